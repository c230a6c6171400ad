"""The boxes of the suite, learned again."""

import numpy as np

from make_boxes import learned_from, upright_poses
from posefit.suites.boxes import STEP, TRAINING_PEOPLE, learned_without


def test_the_file_of_boxes_is_what_the_library_says_today() -> None:
    """Where another LAPACK decomposes, rounding may differ, and a component may point the other way.

    The sign is that of its largest number; those of a left and a right limb are equally large but for rounding.
    """
    learned, stored = (
        learned_from(upright_poses(tuple(person for person in TRAINING_PEOPLE if person != "17"))),
        learned_without("17"),
    )
    assert np.abs(STEP * learned["mean"] - stored.mean).max() <= STEP
    components = STEP * learned["components"]
    components *= np.sign((components * stored.components).sum(axis=1))[:, None]
    assert np.abs(components - stored.components).max() <= 10 * STEP
    assert np.array_equal(learned["order"], stored.order)
