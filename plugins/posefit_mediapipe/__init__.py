"""The segmenter `mediapipe`: the person by MediaPipe's pose model in each frame, moving or not.

C. Lugaresi et al., MediaPipe: a framework for building perception pipelines, 2019; V. Bazarevsky et al., BlazePose:
on-device real-time body pose tracking, 2020. Version 0.10.14 carries the weights, so nothing is downloaded.
`pip install 'posefit[mediapipe]'`; the handbook shows how to install it without what posefit does not need,
"How do I follow a video?".

>>> from posefit.registry import registry
>>> offer = registry().offers["segmenter"]["mediapipe"]
>>> [setting.name for setting in offer.settings]
['confidence', 'threshold']
"""

from posefit import hookimpl
from posefit.hooks import RegisterSegmenter


@hookimpl
def posefit_register_segmenters(register: RegisterSegmenter) -> None:
    """Register `mediapipe`."""
    from posefit_mediapipe.segmenter import MediaPipe

    register(
        "mediapipe",
        MediaPipe,
        still_background=False,
        needs=("mediapipe", "posefit[mediapipe]"),
    )
