"""Metrics by numbers worked by hand, and by law."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.geometry.rotation import rotation_from_joint_angles
from posefit.geometry.skeleton import MIRROR
from posefit.motion import built_in
from posefit.uncertainty.modes import nearer_mirrored

seeds = st.integers(0, 2**32 - 1)
rotations = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(
    lambda angles: rotation_from_joint_angles(np.array(angles))
)


@pytest.fixture(scope="module")
def joints() -> Array:
    motion = built_in.motion("walk", frames=20)
    return motion.skeleton.joints(motion.poses, motion.translations)


def test_iou_skill_and_the_share_of_lost_frames_by_hand() -> None:
    assert metrics.iou(np.array([[10, 20, 30], [0, 0, 0], [1, 0, 0]])).tolist() == [
        0.5,
        1.0,
        0.0,
    ]
    assert [metrics.skill(error, 4.0) for error in (1.0, 4.0)] == [0.75, 0.0]
    assert metrics.skill(1.0, 0.0) is None
    assert metrics.lost_rate(np.array([149.0, 150.0, 151.0, 400.0])) == 0.5


def test_chosen_angles_alone_count() -> None:
    truth = np.zeros((3, 66))
    estimate = np.zeros((3, 66))
    estimate[1, 40] = np.radians(-66.0)
    chosen = np.isin(np.arange(66), (39, 40))
    np.testing.assert_allclose(
        metrics.pose_error_degrees(truth, estimate, chosen), [0.0, 33.0, 0.0]
    )


@given(seeds, st.integers(-3, 3))
def test_the_pose_error_is_a_distance_of_directions(seed: int, turns: int) -> None:
    a, b, c = np.random.default_rng(seed).uniform(-4.0, 4.0, (3, 2, 66))
    error = metrics.pose_error_degrees(a, b)
    assert ((error >= 0.0) & (error <= 180.0)).all()
    np.testing.assert_allclose(metrics.pose_error_degrees(b, a), error)
    np.testing.assert_allclose(
        metrics.pose_error_degrees(a + 2.0 * np.pi * turns, b), error
    )
    np.testing.assert_allclose(metrics.pose_error_degrees(a, a), 0.0)
    assert (
        error
        <= metrics.pose_error_degrees(a, c) + metrics.pose_error_degrees(c, b) + 1e-9
    ).all()


def test_the_geodesic_of_the_root_by_hand() -> None:
    # A quarter turn of yaw and then of pitch is a turn of 120 degrees: 120 / 22.
    truth = np.zeros((1, 66))
    estimate = np.zeros((1, 66))
    estimate[0, :2] = np.pi / 2
    np.testing.assert_allclose(metrics.geodesic_degrees(truth, estimate), 120.0 / 22.0)


def test_two_names_of_one_rotation_are_no_geodesic_error() -> None:
    # x + 180, 180 - y, z + 180 is the same rotation as x, y, z: (8) counts it, the geodesic does not.
    rng = np.random.default_rng(1)
    truth = rng.uniform(-1.0, 1.0, (4, 66))
    estimate = truth.copy()
    estimate[:, 3:] += np.pi
    estimate[:, 4::3] = np.pi - truth[:, 4::3]
    np.testing.assert_allclose(
        metrics.geodesic_degrees(truth, estimate), 0.0, atol=1e-5
    )
    assert metrics.pose_error_degrees(truth, estimate).min() > 90.0


def test_mpjpe_by_hand() -> None:
    truth = np.zeros((2, 27, 3))
    joints = np.zeros((2, 27, 3))
    joints[0, 4] = 0.03, 0.04, 0.0  # 50 mm
    joints[0, 9] = 0.0, 0.0, -0.004  # 4 mm
    joints[1, 0] = 0.001, 0.0, 0.0  # the root alone: all the others are 1 mm off
    np.testing.assert_allclose(
        metrics.mpjpe_mm(truth, joints), [54.0 / 27.0, 26.0 / 27.0]
    )


@given(seeds, st.booleans())
def test_pa_mpjpe_is_that_of_the_best_proper_rotation_and_its_scale(
    seed: int, mirrored: bool
) -> None:
    rng = np.random.default_rng(seed)
    truth = rng.normal(0.0, 0.4, (27, 3))
    turn = rotation_from_joint_angles(rng.uniform(-3.0, 3.0, 3))
    noisy = truth @ turn.T + rng.normal(0.0, 0.05, (27, 3))
    if mirrored:
        noisy[:, 2] *= -1.0
    target = truth - truth.mean(axis=0)
    source = noisy - noisy.mean(axis=0)
    rotation = Rotation.align_vectors(target, source)[0].as_matrix()
    back = source @ rotation.T
    scale = (back * target).sum() / (source**2).sum()
    expected = 1e3 * np.linalg.norm(target - scale * back, axis=1).mean()
    np.testing.assert_allclose(
        metrics.pa_mpjpe_mm(truth[None], noisy[None]), expected, rtol=1e-6
    )


def test_an_estimate_in_one_point_is_at_the_centroid_for_pa_mpjpe() -> None:
    truth = np.zeros((1, 27, 3))
    # the centroid is 10 mm along x: one joint 260 mm from it, 26 joints 10 mm
    truth[0, 0, 0] = 0.27
    np.testing.assert_allclose(
        metrics.pa_mpjpe_mm(truth, np.ones((1, 27, 3))), (260.0 + 26 * 10.0) / 27.0
    )


@given(seeds, rotations)
def test_a_swap_does_not_depend_on_position_or_heading(
    joints: Array, seed: int, rotation: Array
) -> None:
    rng = np.random.default_rng(seed)
    estimate = joints + rng.normal(0.0, 0.05, joints.shape)
    estimate[::2] = estimate[::2, list(MIRROR)]
    swapped = nearer_mirrored(joints, estimate)
    moved = nearer_mirrored(
        joints @ rotation.T + rng.normal(size=3),
        estimate @ rotation.T + rng.normal(size=3),
    )
    np.testing.assert_array_equal(moved, swapped)
