"""The problem that optimisers minimise, and trackers that go from frame to frame.

| looking for | file |
|---|---|
| the function that an optimiser minimises, which counts; the loop that minimises it. SAPSO (5) | problem.py |
| the box [-1, 1]^d that every optimiser searches, and where a search starts in it | box.py |
| proposals as poses: root angles, translation, a prior's coordinates | space.py |
| where a search starts when poses are guessed for its frame | start.py |
| what a prior is: poses as fewer numbers, and which of them are feasible; the tilt of the root with them | prior.py |
| the cost of proposals for one observation, where a body is placed, and smaller pictures | cost.py |
| what an optimiser is, and the base of adapters of other libraries | optimiser.py |
| what a tracker is; the search a frame around a prediction. SAPSO section 4 | tracker.py |
| weights of costs, how many samples they are worth | weights.py |
| errors against a truth. SAPSO (8)-(10) | metrics.py |
| how likely a detector's landmarks are | landmarks.py |
| checks of what optimisers and priors return | validation.py |
| the loop that drives a tracker, and the audit of its frames | driving.py |
| the build of one person, fitted with the poses | shape.py |
| what many bodies cost in many frames, in one compiled call | bodies.py, body_kernels.py |
| one frame fitted to the contours of its masks | contours.py, contour_kernels.py |
| CMA-ES | cma.py |
| aligning and decoding, compiled | kernels.py |
| checks of settings; arrays of other libraries | check.py, dlpack.py |
"""
