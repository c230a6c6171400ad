"""The problem that optimisers minimise, and trackers that follow a person.

| looking for | file |
|---|---|
| the problem, which counts evaluations, and its search loop. SAPSO (5) | problem.py |
| the box [-1, 1]^d of every search, and where a search starts in it | box.py |
| proposals as poses: root angles, translation, a prior's coordinates | space.py |
| starts of a search from guessed poses | start.py |
| priors: poses as fewer numbers, their feasibility, the tilt of the root | prior.py |
| the cost of proposals for one observation, and aligning a body with it | cost.py |
| optimisers, and the base of adapters of other libraries | optimiser.py |
| what trackers get and return | tracker.py |
| one search per frame around a prediction. SAPSO section 4 | synthesis.py |
| weights of costs, and their effective number of samples | weights.py |
| errors against a truth. SAPSO (8)-(10) | metrics.py |
| the likelihood of a detector's landmarks | landmarks.py |
| checks of what optimisers and priors return | validation.py |
| the loop that drives a tracker, and the audit of its frames | driving.py |
| the build of one person, fitted with the poses | shape.py |
| costs of many bodies in many frames, in one call | bodies.py, body_kernels.py |
| bodies fitted to the contours of masks | contours.py, contour_kernels.py |
| the same, compiled: one bone, one body | contour_residuals.py, contour_twists.py |
| CMA-ES | cma.py |
| aligning and decoding, compiled | kernels.py |
| checks of settings; arrays of other libraries | check.py, dlpack.py |
"""
