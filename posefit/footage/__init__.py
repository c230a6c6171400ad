"""Turn masks and videos into a `Scene`: the person, cameras and observations.

    from posefit.footage.options import SourceOptions
    from posefit.footage.source import scene_of

    # two cameras see a built-in motion
    scene = scene_of(["walk"], SourceOptions(view_degrees=[0.0, 90.0]))
    print(scene.count, scene.observations[0].silhouettes[1].mask.shape)

Each row is one step, in one file:

| from | to | file |
|---|---|---|
| what a user names | one source per camera | named.py |
| a source | its kind, its files and its reader | kinds.py |
| options of a source | options that are checked for its kind | options.py, uses.py |
| a source and its options | its scene, by the steps below | source.py |
| names of images | the frames that they are | numbering.py |
| a picture | the values by which it marks a person | images.py |
| values of all masks | which of them mark the person | values.py |
| images, an .npz or .npy file | a `views.View`: one bit per pixel | readers.py |
| masks from other tools | one person's masks, not inverted, no holes | cleaning.py |
| a video file, or one picture per frame | frames at the size of masks | video.py |
| times of a file's frames | a rate, and the frame at each even time | rates.py |
| decoded frames | the same again, from a temporary file | kept.py |
| one frame | the people in it | segmenter.py, extraction.py |
| frames in their order | people, their masks and quality | scanner.py |
| blobs of successive frames | people, and which one is followed | people.py |
| people in their frames | an early end if the border always cuts them | edge.py |
| a network's person in each frame | the same person in all frames | identities.py |
| pictures | whether the camera moves | camera_motion.py |
| a network's facings | which way the person faces | facing.py |
| a video | a `View` of the person in it | segmentation.py |
| masks of segmented frames | a verdict: can they be a person? | quality.py |
| masks of several cameras | a verdict: can they be one person? | agreement.py |
| a `View` | the files of `posefit extract` | extract.py |
| pictures | an .mp4 file | writing.py |
| a stream | a `View` of each frame | live.py |
| calibrations and sources | which camera took which source | pairing.py |
| calibrations | the axes and the unit of their world | world.py |
| a `View` and its calibration | the same without distortion | straightening.py |
| views and calibrations | the `Scene`, in metres, +y up | cameras.py |
| views of the same frames | the silhouettes of each frame | observations.py |
| a known motion | the `Scene` of its rasterised masks | scene.py |
| a `Scene` | the same on a device, such as a GPU | device.py |

To add a kind of source, write a reader and add a line to `kinds.KINDS`. The reader of a
file of masks decodes them to an array, and returns `readers.view_of` it:

    def read_stack(path, frames, label, fps):
        arrays = {"masks": decoded(existing(path))}  # (T, height, width)
        return view_of(str(path), arrays, frames, label, fps)

    Kind("masks", _ends_in(".stack"), view=read_stack),

The reader of a film returns a `Video`. If its frames fit in memory, that is short:

    def read_frames(path, fps, width):
        images = decoded(existing(path))  # T images (height, width, 3), blue first
        return Video.of_images(images, path, fps, width)

    Kind("pictures", _ends_in(".frames"), film=read_frames),

Decoded masks are stored as bits at once, and a `View` never changes. What a source does
not state is guessed in one of these files and listed in `Scene.guesses`. The next steps
from a mask to its cost are `silhouette/mask.py`, `fitting/tracker.py`,
`fitting/cost.py`, `silhouette/cost.py` and `silhouette/kernels.py`.
"""
