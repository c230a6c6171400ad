"""A scene is tracked: by a method, from a first pose that has to be searched, into files and figures.

    import posefit
    track = posefit.track("walk", view_degrees=90, seed=1)
    print(track.measures.mpjpe_mm, track.motion.poses.shape)

| looking for | file |
|---|---|
| `posefit.track` and `posefit.fit`, every option a keyword | front.py |
| every option with its check and help; the defaults of what is left open | options.py, defaults.py |
| the steps of tracking, in their order | pipeline.py, and the files that it names |
| names become an optimiser, a prior or a tracker, with settings checked and a budget | method.py |
| what a trajectory costs, and which of two is kept | trajectory.py |
| errors or signs of trust, at the end | evaluate.py, and `posefit.evaluation` |
| what comes back | result.py |
| frames as they come | live.py |
"""
