"""Turn masks and videos into a `Scene`: the person, cameras and observations.

    from posefit.footage.options import SourceOptions
    from posefit.footage.source import scene_of

    # two cameras see a built-in motion
    scene = scene_of(["walk"], SourceOptions(view_degrees=[0.0, 90.0]))
    print(scene.count, scene.observations[0].silhouettes[1].mask.shape)

Each row is one step, in one file:

| from | to | file |
|---|---|---|
| what a user names | its kind, and its scene by the steps below | source.py |
| a picture | the values by which it marks a person | images.py |
| images, an .npz or .npy file | a `views.View`: one bit per pixel | readers.py |
| masks from other tools | one person's masks, not inverted, no holes | cleaning.py |
| a video file, or one picture per frame | frames at even times | video.py |
| frames | a `View` of the person in them | segmentation.py |
| a `View` | the files of `posefit extract` | extract.py |
| blobs of successive frames | people, and which one is followed | people.py |
| masks of segmented frames | a verdict: can they be a person? | quality.py |
| a stream | a `View` of each frame | live.py |
| views and calibrations | the `Scene`, straightened, in metres, +y up | cameras.py |
| a known motion | the `Scene` of its rasterised masks | scene.py |
| a `Scene` | the same on a device, such as a GPU | device.py |

To add a kind of source, write a reader and add a line to `source.KINDS`. Decoded masks
are stored as bits at once, and a `View` never changes. What a source does not state is
guessed in one of these files and listed in `Scene.guesses`. The next steps from a mask
to its cost are `silhouette/mask.py`, `fitting/tracker.py`, `fitting/cost.py`,
`silhouette/cost.py` and `silhouette/kernels.py`.
"""
