"""Tracks a scene: searches a first pose, follows it, and writes files.

    import posefit
    track = posefit.track("walk", view_degrees=90, seed=1)
    print(track.measures.mpjpe_mm, track.motion.poses.shape)

| looking for | file |
|---|---|
| `posefit.track` and `posefit.fit`, every option a keyword | front.py |
| every option with its check and help | options.py |
| the defaults of options that are not given | defaults.py |
| the steps of tracking, in order | pipeline.py, and the files that it names |
| an optimiser, a prior or a tracker from its name, settings and budget | method.py |
| the cost of a trajectory, and the choice between two | trajectory.py |
| errors or signs of trust, at the end | evaluate.py, and `posefit.evaluation` |
| the result | result.py |
| where a track begins, and when it begins again | restarts.py |
| a body that turns faster than a person can | spins.py |
| live tracking, frame by frame | live.py |

A track passes these on, in this order:

| value | what it has |
|---|---|
| `Scene` | the person's body, the cameras, and an `Observation` of each frame |
| `Task` | what a tracker may use: the scene's body and cameras, and the first pose |
| `Hypothesis` | one initial guess, with a `Frame` for each observation |
| `Tracked` | the frames of the cheapest hypothesis, with the effort of all |
| `Smoothed` | the frames after smoothing, and the scene that they fit |
| `Track` | the result |
"""
