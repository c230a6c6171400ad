"""Metrics by numbers worked by hand, and by law."""

import numpy as np
import pytest

from posefit.fitting import metrics
from posefit.geometry.rotation import Array, rotation_from_joint_angles
from posefit.geometry.skeleton import JOINTS, MIRROR, angle_index
from posefit.motion import library


@pytest.fixture(scope="module")
def joints() -> Array:
    motion = library.built_in("walk", frames=20)
    return motion.skeleton.joints(motion.poses, motion.translations)


def test_only_chosen_dimensions_count() -> None:
    truth, estimate = np.zeros((1, 66)), np.zeros((1, 66))
    estimate[0, 0] = np.radians(10.0)
    chosen = np.zeros(66, dtype=bool)
    chosen[:2] = True
    assert metrics.pose_error_degrees(truth, estimate, chosen)[0] == pytest.approx(5.0)


def test_one_joint_turned_by_22_degrees_is_a_geodesic_of_1() -> None:
    truth, estimate = np.zeros((1, 66)), np.zeros((1, 66))
    estimate[0, angle_index(JOINTS.index("lfemur")) + 1] = np.radians(22.0)
    assert metrics.geodesic_degrees(truth, estimate)[0] == pytest.approx(1.0)


def test_one_joint_27_mm_off_is_an_mpjpe_of_1(joints: Array) -> None:
    moved = joints.copy()
    moved[:, 5, 1] += 0.027
    np.testing.assert_allclose(metrics.mpjpe_mm(joints, moved), 1.0)


def test_mpjpe_ignores_where_the_root_is(joints: Array) -> None:
    np.testing.assert_allclose(metrics.mpjpe_mm(joints, joints + [1.0, 2.0, 3.0]), 0.0, atol=1e-9)


def test_pa_mpjpe_ignores_rotation_scale_and_place_but_no_reflection(joints: Array) -> None:
    rotation = rotation_from_joint_angles(np.array([0.4, -1.2, 2.0]))
    np.testing.assert_allclose(metrics.pa_mpjpe_mm(joints, 1.7 * joints @ rotation.T + 3.0), 0.0, atol=1e-8)
    assert metrics.mpjpe_mm(joints, joints @ rotation.T).min() > 100.0
    assert metrics.pa_mpjpe_mm(joints, joints * [1.0, 1.0, -1.0]).min() > 10.0


def test_pa_mpjpe_is_never_above_the_best_translation_alone(joints: Array) -> None:
    noisy = joints + np.random.default_rng(0).normal(0.0, 0.05, joints.shape)
    centred = [points - points.mean(axis=1, keepdims=True) for points in (joints, noisy)]
    squared = 1e6 * ((centred[0] - centred[1]) ** 2).sum(axis=2).mean(axis=1)
    assert (metrics.pa_mpjpe_mm(joints, noisy) <= np.sqrt(squared)).all()


def test_iou_by_hand() -> None:
    assert metrics.iou(np.array([[10, 20, 30], [0, 0, 0], [1, 0, 0]])).tolist() == [0.5, 1.0, 0.0]


def test_a_mirrored_stride_counts_as_swapped(joints: Array) -> None:
    rooted = joints - joints[:, :1]
    mirrored = (rooted * [-1.0, 1.0, 1.0])[:, list(MIRROR)]  # it goes along +z
    strides = np.abs(rooted[:, JOINTS.index("lfoot"), 2] - rooted[:, JOINTS.index("rfoot"), 2]) > 0.3
    assert strides.sum() >= 5
    assert metrics.swapped(joints, mirrored)[strides].all()
    assert metrics.swap_rate(joints, joints) == 0.0
    assert metrics.swap_rate(joints, joints + np.random.default_rng(0).normal(0.0, 0.003, joints.shape)) == 0.0


def test_lost_is_above_150_mm() -> None:
    assert metrics.lost_rate(np.array([149.0, 150.0, 151.0, 400.0])) == 0.5


def test_skill_by_hand() -> None:
    assert metrics.skill(1.0, 4.0) == 0.75
    assert metrics.skill(4.0, 4.0) == 0.0
    assert metrics.skill(1.0, 0.0) is None


def test_shapes_are_checked() -> None:
    with pytest.raises(ValueError, match=r"truth must have shape \(T, 66\), got \(66,\)"):
        metrics.pose_error_degrees(np.zeros(66), np.zeros(66))
    with pytest.raises(ValueError, match=r"joints must have the truth's shape \(2, 27, 3\), got \(1, 27, 3\)"):
        metrics.mpjpe_mm(np.zeros((2, 27, 3)), np.zeros((1, 27, 3)))
