"""The segmenter `mediapipe`: finds the person with MediaPipe's pose model.

It needs no still background. C. Lugaresi et al., MediaPipe: a framework for building
perception pipelines, 2019; V. Bazarevsky et al., BlazePose: on-device real-time body
pose tracking, 2020. Version 0.10.14 includes the weights, so nothing is downloaded.
Install it with `pip install 'posefit[mediapipe]'`. The handbook's page "How do I track
a person in a video?" shows how to install it without the parts that posefit does not
need.

Example:
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
