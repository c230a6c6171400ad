"""The filter of estimates over time: its weights, its delay and its memory."""

from typing import Any

import numpy as np
import pytest

from posefit.arrays import Array
from posefit_exemplars.smoothing import Estimate, smoothed, smoothed_pose
from tests.cases import each


class Look:
    """A frame whose cost is where the pose is, for nothing."""

    usable = True

    def __init__(self, root: Array | None = None) -> None:
        self.root = root

    def measured(self, pose: Array, place: Array) -> tuple[float, Array]:
        return float(place[0]), np.zeros((1, 3), dtype=np.int64)


def estimate(pose: Array, place: Array, look: Any = None) -> Estimate:
    return Estimate(pose, place, look or Look(), 10.4, 0.5, 0.25)


def steady(k: float) -> Estimate:
    """Return frame k of a steady movement."""
    return estimate(np.full(66, 0.05 * k), np.array([0.1 * k, 1.0, -k]))


@each("ahead", [0, 1, 3, 6])
def test_a_steady_movement_stays_in_its_order(ahead: int) -> None:
    frames = list(smoothed((steady(k) for k in range(15)), 2.0, ahead))
    assert len(frames) == 15
    for k, frame in enumerate(frames):
        np.testing.assert_allclose(frame.pose, 0.05 * k, atol=1e-12)
        np.testing.assert_allclose(frame.translation, [0.1 * k, 1.0, -k], atol=1e-12)
        assert frame.seconds >= 0.5
        assert frame.cpu_seconds is not None
        assert frame.evaluations == 12  # 10.4 rounded up, and the reported one
        assert frame.cost == pytest.approx(0.1 * k)  # of the smoothed pose


def test_a_turn_past_the_half_circle_stays_steady() -> None:
    turns = np.radians(np.arange(170.0, 200.0, 5.0))
    poses = np.zeros((len(turns), 66))
    poses[:, 0] = (turns + np.pi) % (2.0 * np.pi) - np.pi
    pose, _ = smoothed_pose(poses, np.zeros((len(turns), 3)), 3, 1.5)
    assert np.cos(pose[0] - turns[3]) == pytest.approx(1.0)


def test_the_weights_are_gaussian() -> None:
    poses, places = np.zeros((5, 66)), np.eye(5, 3)
    poses[2] = 1.0
    share = np.exp(-0.5 * (np.arange(-2, 3) / 1.5) ** 2)
    pose, place = smoothed_pose(poses, places, 2, 1.5)
    assert pose[0] == pytest.approx(share[2] / share.sum())
    np.testing.assert_allclose(place, share[:3] / share.sum())
    # at an end as few frames count on the other side
    np.testing.assert_array_equal(smoothed_pose(poses, places, 0, 1.5)[0], poses[0])
    np.testing.assert_array_equal(smoothed_pose(poses, places, 2, 0.0)[0], poses[2])


def test_estimates_are_unchanged_where_nothing_is_smoothed_and_a_known_root_always() -> None:
    rng = np.random.default_rng(0)
    rough = [estimate(rng.normal(size=66), rng.normal(size=3), Look(np.zeros(3))) for _ in range(6)]
    for spread, ahead in ((2.0, 0), (0.0, 3), (2.0, 2)):
        for before, frame in zip(rough, smoothed(rough, spread, ahead), strict=True):
            np.testing.assert_array_equal(frame.translation, before.place)
            if spread * ahead == 0.0:
                np.testing.assert_array_equal(frame.pose, before.pose)
