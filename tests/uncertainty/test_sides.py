"""When left and right are unknown: by poses and their mirror images."""

import numpy as np
import pytest

from posefit.geometry.symmetry import mirrored_poses
from posefit.motion.built_in import average_skeleton, motion
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import Posterior
from posefit.uncertainty.sides import nearer_mirrored, second_side, unknown_sides

SKELETON = average_skeleton()
STRIDE = motion("walk-a", frames=30).poses


def halves(k: int, weights: list[float], recalibration: Recalibration | None = None) -> Posterior:
    poses = np.array([STRIDE[k], mirrored_poses(SKELETON, STRIDE[k : k + 1])[0]])
    return Posterior(poses, np.zeros((2, 3)), np.array(weights), recalibration=recalibration)


def test_a_pose_is_nearer_to_itself_and_its_mirror_image_is_not() -> None:
    strides = STRIDE[::7]  # in none of which one leg passes the other: there a pose is nearly its own mirror image
    joints = SKELETON.joints(strides)
    traded = SKELETON.joints(mirrored_poses(SKELETON, strides))
    assert not nearer_mirrored(joints, joints).any()
    assert nearer_mirrored(traded, joints).all()


def test_the_second_side_is_the_weight_of_the_other_half_of_the_stride() -> None:
    for k in range(0, 30, 7):
        assert second_side(SKELETON, halves(k, [0.7, 0.3]), STRIDE[k]) == pytest.approx(0.3)


def test_sides_are_unknown_from_a_threshold_on() -> None:
    assert unknown_sides(SKELETON, halves(0, [0.8, 0.2]), STRIDE[0])
    assert not unknown_sides(SKELETON, halves(0, [0.81, 0.19]), STRIDE[0])
    assert unknown_sides(SKELETON, halves(0, [0.81, 0.19], Recalibration(second_side=0.1)), STRIDE[0])
    assert not unknown_sides(SKELETON, halves(0, [1.0, 0.0]), STRIDE[0])
