"""Segmenters for a still background: `mixture`, `median` and `mean`; and `masks`.

`mixture`, `median` and `mean` compare each frame with the background and have no model
of people. A person who is always in the picture becomes part of a background that is
learned from the video. `mean` avoids this with a picture of the empty scene.

>>> import numpy as np
>>> from posefit_background.segmenters import given_masks
>>> person, shadow = given_masks(None).segment(np.full((2, 2, 3), 255, dtype=np.uint8))
>>> bool(person.all()), bool(shadow.any())
(True, False)
"""

from posefit import hookimpl
from posefit.hooks import RegisterSegmenter


@hookimpl
def posefit_register_segmenters(register: RegisterSegmenter) -> None:
    """Register `mixture`, `median`, `mean` and `masks`."""
    from posefit_background.segmenters import (
        given_masks,
        given_mean,
        learned_median,
        learned_mixture,
    )

    register("mixture", learned_mixture)
    register("median", learned_median)
    register("mean", given_mean)
    register("masks", given_masks, still_background=False)
