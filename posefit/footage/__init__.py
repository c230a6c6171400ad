"""What cameras saw, or would have seen of a known motion, becomes a `Scene`: all that a tracker needs to know.

    from pathlib import Path
    from posefit.footage.source import Viewing, scene_of

    scene = scene_of(["walk"], Viewing(view_degrees=[0.0, 90.0]), work=Path())     # two cameras see a built-in motion
    print(scene.count, scene.observations[0].silhouettes[1].mask.shape)

| looking for | file |
|---|---|
| what a user names becomes a scene: motions, masks, videos; how it is looked at | source.py |
| what a method learns from: motions, folders of them, people of the library | training.py |
| what a scene is; a known motion rendered; masks whose truth nobody knows | scene.py |
| observations that are spoilt on purpose | spoilt.py |
| several cameras: calibrations, lens distortion, which camera saw what | cameras.py |
| masks read when their turn comes; those of an .npz file; pictures of strangers | masks.py, stacks.py, images.py |
| what the values of masks mean; one person of them, whole | given/ |
| video, read and written frame by frame | video.py |
| the person taken out of a video; the files of `posefit extract` | segmentation.py, extract.py |
| whether what was taken out can be a person | segmenting/ |

A source is read once. From a mask to its cost it goes through `masks.py`, `silhouette/mask.py`, `fitting/tracker.py`,
`fitting/problem.py`, `silhouette/cost.py` and `silhouette/kernels.py`.
"""
