"""Masks and videos become a `Scene`: the person, the cameras and what they observed.

    from posefit.footage.source import scene_of

    scene = scene_of(["walk"], view_degrees=[0.0, 90.0])     # two cameras see a built-in motion
    print(scene.count, scene.observations[0].silhouettes[1].mask.shape)

What happens to a mask, an arrow a file:

| from | to | file |
|---|---|---|
| what a user names | of which kind it is, and its scene by the arrows below | source.py |
| a picture | the values by which it marks a person | images.py |
| images, an .npz or .npy file: their values | a `views.View`, a bit a pixel | readers.py |
| masks from elsewhere | those of one person, upright and without holes | cleaning.py |
| a video file, or pictures one a frame | frames at even times | video.py |
| frames | a `View` of the person in them; the files of `posefit extract` | segmentation.py, extract.py |
| masks of segmented frames | a verdict whether they can be a person's | quality.py |
| a stream | a `View` of each frame | live.py |
| views and calibrations | the `Scene`, straightened, in metres, +y up | cameras.py |
| a known motion | the `Scene` of its rendered masks, on a GPU, or corrupted on purpose | scene.py |

A new kind of source is a reader and a line of `source.KINDS`. What is decoded becomes bits at once, and a `View` is
never changed. What a source does not state is guessed in one of these places, and is in `Scene.guesses`. From a mask to
its cost it goes on through `silhouette/mask.py`, `fitting/tracker.py`, `fitting/cost.py`, `silhouette/cost.py` and
`silhouette/kernels.py`.
"""
