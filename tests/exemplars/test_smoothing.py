"""The filter over what was found: nothing comes late, and nothing is lost."""

import gc
import weakref
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from posefit_exemplars.smoothing import Estimate, smoothed, smoothed_pose
from tests.cases import cases


class Blind:
    """A look that costs nothing."""

    root: np.ndarray | None = None
    usable = True

    def measured(self, pose: np.ndarray, place: np.ndarray) -> tuple[float, np.ndarray]:
        return float(place[0]), np.zeros((1, 3), dtype=np.int64)


def found(k: float, look: Any = None) -> Estimate:
    """Return a steady movement at frame k."""
    pose = np.full(66, 0.05 * k)
    return Estimate(pose, np.array([0.1 * k, 1.0, -k]), look or Blind(), 10.4, 0.5 + k, 0.25 + k)


def test_a_steady_movement_stays_where_it_is_and_every_frame_comes_in_its_order() -> None:
    for ahead in cases([0, 1, 3, 6]):
        told = list(smoothed((found(k) for k in range(15)), 2.0, ahead))
        assert len(told) == 15
        for k, frame in enumerate(told):
            np.testing.assert_allclose(frame.pose, 0.05 * k, atol=1e-12)
            np.testing.assert_allclose(frame.translation, [0.1 * k, 1.0, -k], atol=1e-12)
            assert (frame.seconds, frame.cpu_seconds) == (0.5 + k, 0.25 + k)
            assert frame.evaluations == 12  # 10.4, of which a part is one, and the one that is told
            assert frame.cost == pytest.approx(0.1 * k)  # of what is told, not of what was found


def test_a_turn_past_the_half_circle_goes_on_steadily() -> None:
    turns = np.radians(np.arange(170.0, 200.0, 5.0))
    poses = np.zeros((len(turns), 66))
    poses[:, 0] = (turns + np.pi) % (2.0 * np.pi) - np.pi
    pose, _ = smoothed_pose(poses, np.zeros((len(turns), 3)), 3, 1.5)
    assert np.cos(pose[0] - turns[3]) == pytest.approx(1.0)


def test_the_weights_are_those_of_a_bell() -> None:
    poses = np.zeros((5, 66))
    poses[2] = 1.0
    share = np.exp(-0.5 * (np.arange(-2, 3) / 1.5) ** 2)
    places = np.eye(5, 3)
    pose, place = smoothed_pose(poses, places, 2, 1.5)
    assert pose[0] == pytest.approx(share[2] / share.sum())
    np.testing.assert_allclose(place, share[:3] / share.sum())
    # at an end there is as little to one side as to the other
    np.testing.assert_array_equal(smoothed_pose(poses, places, 0, 1.5)[0], poses[0])
    np.testing.assert_array_equal(smoothed_pose(poses, places, 2, 0.0)[0], poses[2])


def test_a_frame_is_told_so_many_later_and_no_more() -> None:
    for ahead in cases([0, 1, 4]):
        taken = 0

        def stream() -> Iterator[Estimate]:
            nonlocal taken
            for k in range(10):
                taken = k + 1
                yield found(k)

        late = [taken - given for given, _ in enumerate(smoothed(stream(), 2.0, ahead), 1)]
        assert late == [ahead] * (10 - ahead) + list(range(ahead - 1, -1, -1))


def test_with_nothing_ahead_everything_stays_as_it_is() -> None:
    rng = np.random.default_rng(0)
    rough = [Estimate(rng.normal(size=66), rng.normal(size=3), Blind(), 1.0, 0.0, 0.0) for _ in range(6)]  # type: ignore[arg-type]
    for spread, ahead in ((2.0, 0), (0.0, 3)):
        for one, frame in zip(rough, smoothed(rough, spread, ahead), strict=True):
            np.testing.assert_array_equal(frame.pose, one.pose)
            np.testing.assert_array_equal(frame.translation, one.place)


def test_a_root_that_is_known_is_where_it_is_known_to_be() -> None:
    known = SimpleNamespace(root=np.zeros(3), usable=True, measured=Blind().measured)
    rng = np.random.default_rng(0)
    rough = [Estimate(np.zeros(66), rng.normal(size=3), known, 1.0, 0.0, 0.0) for _ in range(6)]  # type: ignore[arg-type]
    for one, frame in zip(rough, smoothed(rough, 2.0, 2), strict=True):
        np.testing.assert_array_equal(frame.translation, one.place)


def test_memory_stays_flat() -> None:
    alive: list[weakref.ref[Estimate]] = []
    most = 0

    def stream() -> Iterator[Estimate]:
        for k in range(200):
            one = found(k)
            alive.append(weakref.ref(one))
            yield one

    for _ in smoothed(stream(), 2.0, 6):
        gc.collect(0)
        most = max(most, sum(one() is not None for one in alive))
    assert most <= 2 * 6 + 3  # as many on either side, the one that is told, and the one that comes
