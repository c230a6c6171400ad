"""Weighted poses: intervals by counting and by laws, recalibrations, modes and exchanged sides at known distances."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES, JOINTS
from posefit.geometry.symmetry import mirrored_poses
from posefit.motion.built_in import average_skeleton, motion
from posefit.uncertainty.calibration import LEVELS, Recalibration, reliability
from posefit.uncertainty.intervals import angle_intervals, joint_intervals
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
from posefit.uncertainty.shared import (
    DEPTH,
    STATURE,
    depth_halves,
    in_footage,
    shared_spreads,
)
from tests.cases import each

SKELETON = average_skeleton()
STILL = np.zeros(ANGLES)
TOE = JOINTS.index("ltoes")


def turned(degrees: float) -> np.ndarray:
    return np.radians(degrees) * np.eye(ANGLES)[0]


def yawed(
    degrees: list[float],
    weights: list[float],
    recalibration: Recalibration | None = None,
    coherent: bool = False,
) -> Posterior:
    """Return a weighted pose of rest for each yaw, each in a place of its own."""
    places = np.arange(3.0 * len(degrees)).reshape(-1, 3)
    return Posterior(
        np.array([*map(turned, degrees)]),
        places,
        np.array(weights),
        coherent,
        recalibration,
    )


def test_a_ball_holds_its_share_of_the_weight() -> None:
    # of weights 0.5, 0.3, 0.2: half are at the pose itself, 80 of 100 at 10 degrees or less, 95 need the one at 90
    radii = joint_intervals(SKELETON, yawed([0, 10, 90], [0.5, 0.3, 0.2]), STILL)
    still = SKELETON.joints(STILL)
    toe = SKELETON.joints(yawed([10, 90], [1, 1]).poses)
    chords = np.linalg.norm(toe[:, TOE] - still[TOE], axis=1)
    np.testing.assert_allclose(radii[:, TOE], [0.0, *chords], atol=5e-4)
    np.testing.assert_allclose(radii[:, 0], 0.0, atol=1e-4)  # roots are at one point


def test_a_normal_error_of_an_angle_has_the_quantiles_of_its_law() -> None:
    halves = angle_intervals(
        yawed([0], [1.0], Recalibration(angle_spreads=np.full(ANGLES, 0.1))), STILL
    )
    np.testing.assert_allclose(
        halves, np.outer(0.1 * np.array([0.6745, 1.2816, 1.96]), np.ones(66)), atol=3e-4
    )


def test_balls_hold_a_drawn_sample() -> None:
    rng = np.random.default_rng(0)
    model = Recalibration(joint_spreads=rng.uniform(0.0, 0.1, len(JOINTS)))
    some = yawed([0, 20, 170], [0.5, 0.3, 0.2], model)
    radii = joint_intervals(SKELETON, some, STILL)
    joints = SKELETON.joints(some.poses)[rng.choice(3, 20_000, p=some.weights)]
    joints += model.joint_spreads[:, None] * rng.normal(size=joints.shape)
    off = np.linalg.norm(joints - SKELETON.joints(STILL), axis=2)
    held = (off <= radii[:, None]).mean(axis=1)
    np.testing.assert_allclose(
        held[:, 1:], np.tile(np.array(LEVELS)[:, None], 26), atol=0.015
    )


def test_factors_multiply_the_intervals() -> None:
    twice = Recalibration(
        joint_factors=np.full((3, 27), 2.0), angle_factors=np.full((3, ANGLES), 3.0)
    )
    plain = yawed([0, 10, 20], [0.5, 0.3, 0.2])
    known = replace(plain, recalibration=twice)
    np.testing.assert_allclose(
        joint_intervals(SKELETON, known, STILL),
        2.0 * joint_intervals(SKELETON, plain, STILL),
    )
    np.testing.assert_allclose(
        angle_intervals(known, STILL), 3.0 * angle_intervals(plain, STILL)
    )


def test_the_root_is_off_in_the_world_alone() -> None:
    # one camera leaves the depth open, see the next test, and that is more than the
    # rest
    for cameras in (2, 3, 4):
        about = shared_spreads(cameras)
        world = shared_spreads(cameras, world=True)
        assert about[0] == 0.0
        assert world[0] > 0.0
    np.testing.assert_array_equal(shared_spreads(3), shared_spreads(4))


def test_one_camera_alone_does_not_show_the_depth() -> None:
    camera = Camera.around(np.zeros(3), 1.0, 8.0, (640, 360), 0.6)
    given, guessed, several = (
        depth_halves(in_footage(Recalibration(), *known), camera, np.zeros(3))
        for known in ((1, True), (1, False), (2, False))
    )
    np.testing.assert_allclose(
        given, DEPTH * 8.0 * np.array([[0.6745], [1.2816], [1.96]]), rtol=1e-4
    )
    np.testing.assert_allclose(guessed, np.hypot(DEPTH, STATURE) / DEPTH * given)
    np.testing.assert_array_equal(several, 0.0)


def test_angles_are_circular() -> None:
    halves = angle_intervals(
        yawed([170, -170], [0.5, 0.5]), yawed([180], [1.0]).poses[0]
    )
    np.testing.assert_allclose(np.degrees(halves[:, 0]), 10.0, atol=0.05)
    wide = Recalibration(angle_spreads=np.full(ANGLES, 10.0))
    np.testing.assert_array_equal(
        angle_intervals(yawed([0], [1.0], wide), STILL)[2], np.pi
    )


def test_reliability_is_by_bins() -> None:
    bins = reliability(
        np.array([0.05, 0.15, 0.19, 1.0]), np.array([False, True, False, True])
    )
    assert bins == [(1, 0.05, 0.0), (2, pytest.approx(0.17), 0.5), (1, 1.0, 1.0)]


@each(
    ("make", "message"),
    [
        (
            lambda: Recalibration(angle_spreads=np.zeros(27)),
            r"angle_spreads must have shape \(66,\), got \(27,\)",
        ),
        (
            lambda: Recalibration(joint_spreads=-np.ones(27)),
            "joint_spreads must be 0 or more, got -1",
        ),
        (
            lambda: Recalibration(second_side=1.5),
            r"second_side must lie in 0 to 1, got 1\.5",
        ),
        (lambda: Recalibration(sharpness=0.0), "sharpness must lie in 1e-09 to 1e"),
    ],
)
def test_wrong_corrections_are_refused(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_a_wrong_posterior_is_refused() -> None:
    nan = np.where(np.arange(ANGLES) == 3, np.nan, 0.0)
    for poses, places, weights, message in (
        (
            [STILL] * 2,
            1,
            [1.0, 1.0],
            r"translations of a posterior must have shape \(2, 3\), got \(1, 3\)",
        ),
        (np.zeros((0, ANGLES)), 0, [], "with a sum above 0, got 0, sum 0"),
        ([STILL] * 2, 2, [-1.0, 2.0], "with a sum above 0, got -1, sum 1"),
        ([nan], 1, [1.0], "poses of a posterior must be finite, got 1 that are not"),
    ):
        with pytest.raises(ValueError, match=message):
            Posterior(np.array(poses), np.zeros((places, 3)), np.array(weights))


def test_similar_poses_are_one_mode_and_a_turned_one_is_another() -> None:
    # at rest the feet, knees and arms are beside the body: turned around they are where the others were
    modes = modes_of(SKELETON, yawed([0, 180, 1, -1, 90], [0.4, 0.6, 0.5, 0.5, 0.0]))
    assert [mode.weight for mode in modes] == pytest.approx([0.7, 0.3])
    # of 0, 1 and -1 degrees the one in the middle is nearest to the others: 0.25 + 0.25 against 0.2 + 0.5
    np.testing.assert_array_equal(modes[0].pose, turned(0))
    np.testing.assert_array_equal(modes[1].pose, turned(180))
    np.testing.assert_array_equal(modes[1].translation, [3.0, 4.0, 5.0])


def test_the_other_mode_is_the_likeliest_but_the_nearest() -> None:
    modes = [
        Mode(weight, turned(degrees), np.zeros(3))
        for weight, degrees in ((0.5, 0), (0.3, 180), (0.2, 90))
    ]
    assert other_mode(SKELETON, modes, turned(5)) is modes[1]
    assert other_mode(SKELETON, modes, turned(170)) is modes[0]
    assert other_mode(SKELETON, modes, turned(95), 0.4) is modes[0]
    assert other_mode(SKELETON, modes, turned(5), 0.3) is None  # above, not at least
    assert other_mode(SKELETON, modes[:1], turned(5)) is None
    assert other_mode(SKELETON, [], turned(5)) is None


def test_the_likeliest_mode_is_right_where_the_truth_is_near_and_no_other_is_nearer() -> (
    None
):
    modes = [
        Mode(weight, turned(degrees), np.zeros(3))
        for weight, degrees in ((0.3, 180), (0.7, 0))
    ]
    away = np.array([3.0, 1.0, -2.0])
    assert likeliest_is_right(SKELETON, modes, SKELETON.joints(turned(5), away))
    assert not likeliest_is_right(SKELETON, modes, SKELETON.joints(turned(178), away))
    # nearest to the likeliest, but not near
    quarter = SKELETON.joints(turned(80), away)
    assert not likeliest_is_right(SKELETON, modes, quarter)
    assert likeliest_is_right(SKELETON, modes, quarter, apart=1.0)


def test_tracks_are_compared_by_the_mean_over_frames() -> None:
    # the second of three tracks is turned around in one frame of four, the third in all
    frames = [
        yawed([0, second, 180], [0.5, 0.3, 0.2], coherent=True)
        for second in (180, 0, 0, 0)
    ]
    off = float(
        np.linalg.norm(
            SKELETON.joints(turned(0)) - SKELETON.joints(turned(180)), axis=1
        ).mean()
    )
    modes = track_modes(SKELETON, frames, apart=0.3 * off)  # a quarter of it is less
    assert [mode.weight for mode in modes] == pytest.approx([0.8, 0.2])
    np.testing.assert_array_equal(modes[1].poses, np.tile(turned(180), (4, 1)))
    assert modes[0].translations.shape == (4, 3)
    assert (
        track_modes(SKELETON, [*frames, yawed([0], [1.0])])
        == track_modes(SKELETON, [None])
        == []
    )


def test_weights_of_modes_are_recalibrated() -> None:
    poses = np.zeros((10, 66))
    poses[8:, 3:] = 0.5
    plain = Posterior(poses, np.zeros((10, 3)), np.ones(10))
    for recalibration, weights in (
        (None, [0.8, 0.2]),
        # the roots of 0.8 and 0.2 are as two to one
        (Recalibration(sharpness=0.5), [2 / 3, 1 / 3]),
        (Recalibration(sharpness=0.5, none=0.4), [0.4, 0.2]),
        (Recalibration(none=1.0), [0.0, 0.0]),
    ):
        modes = modes_of(SKELETON, replace(plain, recalibration=recalibration))
        np.testing.assert_allclose([mode.weight for mode in modes], weights)


STRIDE = motion("walk-a", frames=30).poses


def strides(
    k: int, weights: list[float], recalibration: Recalibration | None = None
) -> Posterior:
    """Return frame k of a stride and its mirror image."""
    poses = np.array([STRIDE[k], mirrored_poses(SKELETON, STRIDE[k : k + 1])[0]])
    return Posterior(
        poses, np.zeros((2, 3)), np.array(weights), recalibration=recalibration
    )


def test_a_stride_is_nearer_to_itself_and_not_to_its_mirror_image() -> None:
    # in none of which one leg passes the other: there a pose is nearly its own mirror
    # image
    frames = STRIDE[::7]
    joints = SKELETON.joints(frames)
    assert not nearer_mirrored(joints, joints).any()
    assert nearer_mirrored(
        SKELETON.joints(mirrored_poses(SKELETON, frames)), joints
    ).all()
    for k in range(0, 30, 7):
        assert second_side(
            SKELETON, strides(k, [0.7, 0.3]), STRIDE[k]
        ) == pytest.approx(0.3)


def test_sides_are_unknown_from_a_threshold_on() -> None:
    for second, threshold, unknown in (
        (0.2, 0.2, True),
        (0.19, 0.2, False),
        (0.19, 0.1, True),
        (0.0, 0.2, False),
    ):
        posterior = strides(
            0, [1.0 - second, second], Recalibration(second_side=threshold)
        )
        assert unknown_sides(SKELETON, posterior, STRIDE[0]) == unknown
    assert unknown_sides(SKELETON, strides(0, [0.8, 0.2]), STRIDE[0])
