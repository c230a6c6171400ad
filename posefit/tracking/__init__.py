"""A scene is tracked: by a method, from a first pose that has to be searched, into files and figures.

    import posefit
    track = posefit.track("walk", view_degrees=90, seed=1)
    print(track.measures.mpjpe_mm, track.motion.poses.shape)

| looking for | file |
|---|---|
| `posefit.track` and `posefit.fit`, every option a keyword | front.py |
| every option with its check and help | options.py |
| the steps of tracking, in their order | pipeline.py, and the files that it names |
| names become an optimiser, a prior or a tracker, with settings checked and a budget | method.py |
| what a trajectory costs, and which of two is kept | trajectory.py |
| errors and baselines of a track; what every figure is called, its unit and meaning | evaluation.py, measures.py |
| the folder that appears whole, and goes on where it ended; whether two tracks are the same | outputs.py, identity.py |
| pictures, the page | picture.py, drawing.py, page/ |
| the printed table, and the signs of trust | table.py, trust.py |
"""
