"""Modes and exchanged sides of weighted poses, on poses whose distances are known."""

from dataclasses import replace

import numpy as np
import pytest

from posefit.geometry.skeleton import ANGLES
from posefit.geometry.symmetry import mirrored_poses
from posefit.motion.built_in import average_skeleton, motion
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import (
    Mode,
    Posterior,
    likeliest_is_right,
    modes_of,
    nearer_mirrored,
    other_mode,
    second_side,
    track_modes,
    unknown_sides,
)

SKELETON = average_skeleton()
STILL = np.zeros(ANGLES)


def turned(degrees: float) -> np.ndarray:
    pose = STILL.copy()
    pose[0] = np.radians(degrees)
    return pose


def posterior(poses: list[np.ndarray], weights: list[float], coherent: bool = False) -> Posterior:
    places = np.arange(3.0 * len(poses)).reshape(-1, 3)
    return Posterior(np.array(poses), places, np.array(weights), coherent)


def test_a_wrong_posterior_is_refused() -> None:
    nan = np.where(np.arange(ANGLES) == 3, np.nan, 0.0)
    for poses, places, weights, message in (
        ([STILL] * 2, 1, [1.0, 1.0], r"translations of a posterior must have shape \(2, 3\), got \(1, 3\)"),
        (np.zeros((0, ANGLES)), 0, [], "with a sum above 0, got 0, sum 0"),
        ([STILL] * 2, 2, [-1.0, 2.0], "with a sum above 0, got -1, sum 1"),
        ([nan], 1, [1.0], "poses of a posterior must be finite, got 1 that are not"),
    ):
        with pytest.raises(ValueError, match=message):
            Posterior(np.array(poses), np.zeros((places, 3)), np.array(weights))


def test_similar_poses_are_one_mode_and_a_turned_one_is_another() -> None:
    # at rest the feet, knees and arms are beside the body: turned around they are where the others were
    poses = [turned(0), turned(180), turned(1), turned(-1), turned(90)]
    modes = modes_of(SKELETON, posterior(poses, [0.4, 0.6, 0.5, 0.5, 0.0]))
    assert [mode.weight for mode in modes] == pytest.approx([0.7, 0.3])
    # of 0, 1 and -1 degrees the one in the middle is nearest to the others: 0.25 + 0.25 against 0.2 + 0.5
    np.testing.assert_array_equal(modes[0].pose, turned(0))
    np.testing.assert_array_equal(modes[1].pose, turned(180))
    np.testing.assert_array_equal(modes[1].translation, [3.0, 4.0, 5.0])


def test_the_other_mode_is_the_likeliest_but_the_nearest() -> None:
    modes = [Mode(weight, turned(degrees), np.zeros(3)) for weight, degrees in ((0.5, 0), (0.3, 180), (0.2, 90))]
    assert other_mode(SKELETON, modes, turned(5)) is modes[1]
    assert other_mode(SKELETON, modes, turned(170)) is modes[0]
    assert other_mode(SKELETON, modes, turned(95), 0.4) is modes[0]
    assert other_mode(SKELETON, modes, turned(5), 0.3) is None  # above, not at least
    assert other_mode(SKELETON, modes[:1], turned(5)) is None
    assert other_mode(SKELETON, [], turned(5)) is None


def test_the_likeliest_mode_is_right_where_the_truth_is_near_and_no_other_is_nearer() -> None:
    modes = [Mode(weight, turned(degrees), np.zeros(3)) for weight, degrees in ((0.3, 180), (0.7, 0))]
    away = np.array([3.0, 1.0, -2.0])
    assert likeliest_is_right(SKELETON, modes, SKELETON.joints(turned(5), away))
    assert not likeliest_is_right(SKELETON, modes, SKELETON.joints(turned(178), away))
    quarter = SKELETON.joints(turned(80), away)  # nearest to the likeliest, but not near
    assert not likeliest_is_right(SKELETON, modes, quarter)
    assert likeliest_is_right(SKELETON, modes, quarter, apart=1.0)


def test_tracks_are_compared_by_the_mean_over_frames() -> None:
    # the second of three tracks is turned around in one frame of four, the third in all
    frames = [
        posterior([turned(0), turned(180 if k == 0 else 0), turned(180)], [0.5, 0.3, 0.2], coherent=True)
        for k in range(4)
    ]
    off = float(np.linalg.norm(SKELETON.joints(turned(0)) - SKELETON.joints(turned(180)), axis=1).mean())
    modes = track_modes(SKELETON, frames, apart=0.3 * off)  # a quarter of it is less
    assert [mode.weight for mode in modes] == pytest.approx([0.8, 0.2])
    np.testing.assert_array_equal(modes[1].poses, np.tile(turned(180), (4, 1)))
    assert modes[0].translations.shape == (4, 3)
    assert track_modes(SKELETON, [*frames, posterior([STILL], [1.0])]) == track_modes(SKELETON, [None]) == []


def test_weights_of_modes_are_recalibrated() -> None:
    poses = np.zeros((10, 66))
    poses[8:, 3:] = 0.5
    plain = Posterior(poses, np.zeros((10, 3)), np.ones(10))
    for recalibration, weights in (
        (None, [0.8, 0.2]),
        (Recalibration(sharpness=0.5), [2 / 3, 1 / 3]),  # the roots of 0.8 and 0.2 are as two to one
        (Recalibration(sharpness=0.5, none=0.4), [0.4, 0.2]),
        (Recalibration(none=1.0), [0.0, 0.0]),
    ):
        modes = modes_of(SKELETON, replace(plain, recalibration=recalibration))
        np.testing.assert_allclose([mode.weight for mode in modes], weights)


STRIDE = motion("walk-a", frames=30).poses


def strides(k: int, weights: list[float], recalibration: Recalibration | None = None) -> Posterior:
    """Return frame k of a stride and its mirror image."""
    poses = np.array([STRIDE[k], mirrored_poses(SKELETON, STRIDE[k : k + 1])[0]])
    return Posterior(poses, np.zeros((2, 3)), np.array(weights), recalibration=recalibration)


def test_a_stride_is_nearer_to_itself_and_not_to_its_mirror_image() -> None:
    frames = STRIDE[::7]  # in none of which one leg passes the other: there a pose is nearly its own mirror image
    joints = SKELETON.joints(frames)
    assert not nearer_mirrored(joints, joints).any()
    assert nearer_mirrored(SKELETON.joints(mirrored_poses(SKELETON, frames)), joints).all()
    for k in range(0, 30, 7):
        assert second_side(SKELETON, strides(k, [0.7, 0.3]), STRIDE[k]) == pytest.approx(0.3)


def test_sides_are_unknown_from_a_threshold_on() -> None:
    for second, threshold, unknown in ((0.2, 0.2, True), (0.19, 0.2, False), (0.19, 0.1, True), (0.0, 0.2, False)):
        posterior = strides(0, [1.0 - second, second], Recalibration(second_side=threshold))
        assert unknown_sides(SKELETON, posterior, STRIDE[0]) == unknown
    assert unknown_sides(SKELETON, strides(0, [0.8, 0.2]), STRIDE[0])
