"""The body's radii by hand, and what it refuses."""

import numpy as np
import pytest

from posefit.geometry.body import Body
from posefit.geometry.skeleton import BONES, JOINTS
from posefit.motion.built_in import average_skeleton


def test_radii_are_shares_of_the_bones_length() -> None:
    skeleton = average_skeleton()
    radii = Body.of(skeleton).radii
    assert radii.shape == (26, 2)
    for name in ("lfemur", "rfemur"):
        bone = BONES.index(name)
        np.testing.assert_allclose(radii[bone], skeleton.lengths[bone] * np.array([0.205, 0.130]))
    head = BONES.index("head")
    np.testing.assert_allclose(radii[head], skeleton.lengths[head] * np.array([0.88, 0.86]))


def test_a_joint_is_as_wide_as_the_widest_bone_that_meets_there() -> None:
    radii = np.zeros((26, 2))
    radii[BONES.index("lhipjoint")] = 0.1, 0.2
    radii[BONES.index("rhipjoint")] = 0.3, 0.0
    radii[BONES.index("lfemur")] = 0.15, 0.05
    radii[BONES.index("head")] = 0.0, 0.4
    joint_radii = Body(average_skeleton(), radii).joint_radii()
    by_hand = {"root": 0.3, "lhipjoint": 0.2, "lfemur": 0.05, "head": 0.4}
    np.testing.assert_allclose(joint_radii, [by_hand.get(name, 0.0) for name in JOINTS])


def test_radii_are_checked() -> None:
    skeleton = average_skeleton()
    with pytest.raises(ValueError, match=r"radii must have shape \(26, 2\), got \(2, 26\)"):
        Body(skeleton, np.zeros((2, 26)))
    for bad, message in ((-0.1, "radii must not be negative, got -0.1"), (np.nan, "radii must be finite")):
        radii = np.ones((26, 2))
        radii[3, 1] = bad
        with pytest.raises(ValueError, match=message):
            Body(skeleton, radii)
