"""Intervals of weighted poses: shares that can be counted, and laws in tables; recalibrations and bins."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES, JOINTS
from posefit.motion.built_in import average_skeleton
from posefit.uncertainty.calibration import LEVELS, Recalibration, reliability
from posefit.uncertainty.intervals import angle_intervals, joint_intervals
from posefit.uncertainty.modes import Posterior
from posefit.uncertainty.shared import DEPTH, STATURE, depth_halves, in_footage, shared_spreads
from tests.cases import each

SKELETON = average_skeleton()
STILL = np.zeros(ANGLES)
TOE = JOINTS.index("ltoes")


def yawed(degrees: list[float], weights: list[float], recalibration: Recalibration | None = None) -> Posterior:
    poses = np.zeros((len(degrees), ANGLES))
    poses[:, 0] = np.radians(degrees)
    return Posterior(poses, np.zeros((len(degrees), 3)), np.array(weights), recalibration=recalibration)


def test_a_ball_holds_its_share_of_the_weight() -> None:
    # of weights 0.5, 0.3, 0.2: half are at the pose itself, 80 of 100 at 10 degrees or less, 95 need the one at 90
    radii = joint_intervals(SKELETON, yawed([0, 10, 90], [0.5, 0.3, 0.2]), STILL)
    still, toe = SKELETON.joints(STILL), SKELETON.joints(yawed([10, 90], [1, 1]).poses)
    chords = np.linalg.norm(toe[:, TOE] - still[TOE], axis=1)
    np.testing.assert_allclose(radii[:, TOE], [0.0, *chords], atol=5e-4)
    np.testing.assert_allclose(radii[:, 0], 0.0, atol=1e-4)  # roots are at one point


def test_a_normal_error_of_an_angle_has_the_quantiles_of_its_law() -> None:
    halves = angle_intervals(yawed([0], [1.0], Recalibration(angle_spreads=np.full(ANGLES, 0.1))), STILL)
    np.testing.assert_allclose(halves, np.outer(0.1 * np.array([0.6745, 1.2816, 1.96]), np.ones(66)), atol=3e-4)


def test_balls_hold_a_drawn_sample() -> None:
    rng = np.random.default_rng(0)
    model = Recalibration(joint_spreads=rng.uniform(0.0, 0.1, len(JOINTS)))
    some = yawed([0, 20, 170], [0.5, 0.3, 0.2], model)
    radii = joint_intervals(SKELETON, some, STILL)
    joints = SKELETON.joints(some.poses)[rng.choice(3, 20_000, p=some.weights)]
    joints += model.joint_spreads[:, None] * rng.normal(size=joints.shape)
    off = np.linalg.norm(joints - SKELETON.joints(STILL), axis=2)
    held = (off <= radii[:, None]).mean(axis=1)
    np.testing.assert_allclose(held[:, 1:], np.tile(np.array(LEVELS)[:, None], 26), atol=0.015)


def test_factors_multiply_the_intervals() -> None:
    twice = Recalibration(joint_factors=np.full((3, 27), 2.0), angle_factors=np.full((3, ANGLES), 3.0))
    plain = yawed([0, 10, 20], [0.5, 0.3, 0.2])
    known = replace(plain, recalibration=twice)
    np.testing.assert_allclose(joint_intervals(SKELETON, known, STILL), 2.0 * joint_intervals(SKELETON, plain, STILL))
    np.testing.assert_allclose(angle_intervals(known, STILL), 3.0 * angle_intervals(plain, STILL))


def test_the_root_is_off_in_the_world_alone() -> None:
    for cameras in (1, 2, 4):
        about, world = shared_spreads(cameras), shared_spreads(cameras, world=True)
        assert about[0] == 0.0
        assert world[0] > 0.0
    np.testing.assert_array_equal(shared_spreads(2), shared_spreads(4))


def test_one_camera_alone_does_not_show_the_depth() -> None:
    camera = Camera.around(np.zeros(3), 1.0, 8.0, (640, 360), 0.6)
    given, guessed, several = (
        depth_halves(in_footage(Recalibration(), *known), camera, np.zeros(3))
        for known in ((1, True), (1, False), (2, False))
    )
    np.testing.assert_allclose(given, DEPTH * 8.0 * np.array([[0.6745], [1.2816], [1.96]]), rtol=1e-4)
    np.testing.assert_allclose(guessed, np.hypot(DEPTH, STATURE) / DEPTH * given)
    np.testing.assert_array_equal(several, 0.0)


def test_angles_are_circular() -> None:
    halves = angle_intervals(yawed([170, -170], [0.5, 0.5]), yawed([180], [1.0]).poses[0])
    np.testing.assert_allclose(np.degrees(halves[:, 0]), 10.0, atol=0.05)
    wide = Recalibration(angle_spreads=np.full(ANGLES, 10.0))
    np.testing.assert_array_equal(angle_intervals(yawed([0], [1.0], wide), STILL)[2], np.pi)


def test_reliability_is_by_bins() -> None:
    bins = reliability(np.array([0.05, 0.15, 0.19, 1.0]), np.array([False, True, False, True]))
    assert bins == [(1, 0.05, 0.0), (2, pytest.approx(0.17), 0.5), (1, 1.0, 1.0)]


@each(
    ("make", "message"),
    [
        (lambda: Recalibration(angle_spreads=np.zeros(27)), r"angle_spreads must have shape \(66,\), got \(27,\)"),
        (lambda: Recalibration(joint_spreads=-np.ones(27)), "joint_spreads must be 0 or more, got -1"),
        (lambda: Recalibration(second_side=1.5), r"second_side must lie in 0 to 1, got 1\.5"),
        (lambda: Recalibration(sharpness=0.0), "sharpness must lie in 1e-09 to 1e"),
    ],
)
def test_wrong_corrections_are_refused(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()
