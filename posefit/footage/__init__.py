"""Motions, masks and videos become a `Scene`: the person, the cameras and what they observed.

    from posefit.footage.source import scene_of

    scene = scene_of(["walk"], view_degrees=[0.0, 90.0])     # two cameras see a built-in motion
    print(scene.count, scene.observations[0].silhouettes[1].mask.shape)

| looking for | file |
|---|---|
| a scene from the name of a motion, masks or a video; what a method learns from | source.py |
| the scene itself; observations of a known motion, on a GPU, or corrupted on purpose | scene.py |
| numbered variations of a motion, as in other benchmarks | instance.py |
| several cameras: calibrations, lens distortion, one frame rate; which way the person faces | cameras.py |
| masks in memory, a bit a pixel | masks.py |
| masks of a folder or an .npz file: which values are the person's; images of any kind | readers.py, images.py |
| inverted masks, holes, one of several people | cleaning.py |
| video, read and written frame by frame | video.py |
| the person in a video; the files of `posefit extract` | segmentation.py, extract.py |
| whether masks can be a person's | quality.py |

Every image and video frame is decoded once, into `masks.PackedMasks`. From a mask to its cost it goes through
`silhouette/mask.py`, `fitting/tracker.py`, `fitting/problem.py`, `silhouette/cost.py` and `silhouette/kernels.py`.
"""
