"""The SAPSO paper's own numbers. Acta Automatica Sinica 38(5), 2012, section 5.

Table 1 gives three angles of four joints. It does not give their order or the axes of
the skeleton, so only the sizes of its errors can be compared with others.
"""

from typing import NamedTuple

import numpy as np

from posefit.arrays import Array


class Tracked(NamedTuple):
    """A cell of table 2."""

    error_degrees: float
    spread_degrees: float  # (10), called the variance in the table's head
    seconds_per_frame: float


TABLE_1_JOINTS = ("LFemur", "RFemur", "LKnee", "RKnee")
# the true and the estimated angles of each motion in degrees, (4 joints, 3)
TABLE_1: dict[str, tuple[Array, Array]] = {
    "walk": (
        np.array(
            [
                [-13.015, 46.717, 10.994],
                [-0.127, 6.481, 23.928],
                [-2.302, 57.572, 7.482],
                [-0.454, 31.281, 4.379],
            ]
        ),
        np.array(
            [
                [-11.397, 48.776, 5.114],
                [-0.632, 2.766, 24.117],
                [-3.180, 60.346, 10.051],
                [0.346, 34.422, 1.443],
            ]
        ),
    ),
    "turn": (
        np.array(
            [
                [-12.624, 45.177, 9.155],
                [-1.243, 2.548, 19.946],
                [-3.693, 64.398, 8.325],
                [-0.165, 31.91, 3.480],
            ]
        ),
        np.array(
            [
                [-9.331, 43.254, 2.798],
                [-0.538, -0.045, 23.227],
                [-2.193, 62.504, 7.542],
                [0.960, 34.945, -1.518],
            ]
        ),
    ),
    "run": (
        np.array(
            [
                [-12.348, 46.922, 11.044],
                [0.591, 4.265, 27.956],
                [-1.221, 48.237, 6.975],
                [-0.513, 30.113, 5.298],
            ]
        ),
        np.array(
            [
                [-11.144, 45.707, 8.435],
                [1.127, 1.374, 27.919],
                [-1.458, 46.142, 7.313],
                [0.254, 32.668, 3.628],
            ]
        ),
    ),
}
# the three methods on each motion, by their names in `methods.METHODS`
TABLE_2: dict[str, dict[str, Tracked]] = {
    "walk": {
        "particle@full": Tracked(4.6713, 2.5157, 5.236),
        "sapso@full": Tracked(4.4369, 1.5181, 4.384),
        "sapso@pca": Tracked(3.5123, 1.6324, 2.541),
    },
    "run": {
        "particle@full": Tracked(4.4669, 2.0289, 4.965),
        "sapso@full": Tracked(4.3949, 0.9821, 3.962),
        "sapso@pca": Tracked(3.8769, 1.3789, 2.365),
    },
}
FRAMES = 100  # in each sequence
TRAINING_FRAMES = {"walk": 386, "turn": 386, "run": 198}
CONVERGED = 30  # iterations, section 5.2 and figure 6
SMALL_DEGREES = 5.0  # most dimensions have smaller errors: section 5.3 and figure 7
TRACK_DEGREES = 4.0  # about the mean error of its tracks: section 5.4
# this many components explain at least this share: section 2.1
ENOUGH_COMPONENTS = 5
EXPLAINED_VARIANCE = 0.95
# figure 5
SHOWN_ITERATIONS = (0, 10, 40, 60)
SHOWN_PARTICLES = 100
SWARMS = (20, 40, 60, 100)  # N of figure 6; the text does not give the paper's own
