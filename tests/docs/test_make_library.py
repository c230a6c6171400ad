"""The script that packs the library of recorded motions stores as few poses as it may."""

import numpy as np

from make_library import LONGEST_GAP, TOLERANCE, kept_frames
from posefit.motion.built_in import average_skeleton


def test_a_body_at_rest_leaves_few_frames_and_one_that_moves_all() -> None:
    average = average_skeleton()
    rest = np.zeros((50, 66))
    assert kept_frames(average, rest, np.zeros((50, 3))).tolist() == [*range(0, 49, LONGEST_GAP), 49]
    # the root is thrown to and fro by twice the tolerance: every frame is a corner
    thrown = np.zeros((50, 3))
    thrown[::2, 1] = 4.0 * TOLERANCE
    assert kept_frames(average, rest, thrown).tolist() == list(range(50))
    # at an even pace, everything lies on a line
    assert len(kept_frames(average, rest, np.linspace(0.0, 5.0, 50)[:, None] * [1.0, 0.0, 0.0])) == 8
