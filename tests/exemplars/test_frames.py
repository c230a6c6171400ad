"""When frames come, what they cost, and what happens where the person is not visible."""

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from posefit.fitting.tracker import Observation
from posefit.motion import built_in
from posefit_exemplars.tracker import MIN_EVALUATIONS, ExemplarTracker
from tests.cases import each
from tests.exemplars.conftest import EMPTY, Walk, walk_of


@each("lag", [0, 2, 15, 40])
def test_a_pose_is_reported_lag_frames_later(walker: Walk, lag: int) -> None:
    taken = 0

    def stream() -> Iterator[Observation]:
        nonlocal taken
        for observation in walker.observations:
            taken += 1
            yield observation

    tracker = ExemplarTracker(replace(walker.task, evaluations=MIN_EVALUATIONS), lag=lag)
    late = [taken - reported for reported, _ in enumerate(tracker.track(stream(), np.random.default_rng(0)), 1)]
    count = len(walker.observations)
    assert late == [min(lag, count - reported) for reported in range(1, count + 1)]


@each(("aligned", "most"), [(False, 90.0), (True, 130.0)])
def test_frames_without_the_person_are_bridged(walker: Walk, aligned: bool, most: float) -> None:
    walk = walker.aligned() if aligned else walker
    unusable = [replace(shown, usable=not 8 <= k < 14) for k, shown in enumerate(walk.observations)]
    frames = replace(walk, observations=unusable).track(evaluations=2440)
    assert [k for k, frame in enumerate(frames) if frame.evaluations == 1] == list(range(8, 14))
    assert walk.errors_mm(frames)[8:].max() < most
    empty = walk.hidden(8, 14).track(evaluations=2440)
    np.testing.assert_array_equal([frame.pose for frame in empty], [frame.pose for frame in frames])


@each(("aligned", "usable"), itertools.product([False, True], [False, True]))
def test_a_person_who_appears_later_is_followed_from_then_on(walker: Walk, aligned: bool, usable: bool) -> None:
    frames = (walker.aligned() if aligned else walker).hidden(0, 3, usable=usable).track(lag=3)
    assert all(np.isfinite(frame.pose).all() for frame in frames)
    assert walker.errors_mm(frames)[10:].max() < 150.0


@each("translation", ["known", "aligned"])
def test_a_track_of_no_person_is_finite(walker: Walk, translation: str) -> None:
    frames = walker.hidden(0, 4).track(0, 4, translation=translation)
    assert len(frames) == 4
    assert all(np.isfinite([*frame.pose, *frame.translation, frame.cost]).all() for frame in frames)


def test_a_root_may_jump_a_thousand_kilometres(walker: Walk) -> None:
    gone = Observation(EMPTY, np.array([1e6, 0.0, 0.0]), usable=False)
    frames = replace(walker, observations=[walker.observations[0], gone]).track(lag=1)
    np.testing.assert_array_equal(frames[1].translation, gone.translation)


@each(
    ("size", "first", "budget"),
    itertools.product([(160, 120), (60, 45)], [False, True], [MIN_EVALUATIONS, 1000, 2440]),
)
def test_the_budget_holds_and_small_pictures_count_by_their_pixels(
    size: tuple[int, int], first: bool, budget: int
) -> None:
    motion = built_in.motion("walk-a", frames=3)
    known = {"first_pose": motion.poses[0, 3:]} if first else {}
    used = [frame.evaluations for frame in walk_of(motion, size=size).track(evaluations=budget, **known)]
    assert 0.5 * budget < max(used) <= budget


@each("views", [(45.0,), (0.0, 45.0, 90.0, 135.0)])
@each("refiner", ["none", "pso", "sapso", "annealed", "particle", "scipy", "cma"])
def test_any_optimiser_refines_within_the_budget(views: tuple[float, ...], refiner: str) -> None:
    walk = walk_of(built_in.motion("walk-a", frames=2), views)
    for budget in (MIN_EVALUATIONS, 1000):
        frames = walk.track(evaluations=budget, refiner=refiner, lag=1)
        assert max(frame.evaluations for frame in frames) <= budget
        assert walk.errors_mm(frames).max() < 300.0


def test_too_small_a_budget_is_refused(walker: Walk) -> None:
    with pytest.raises(ValueError, match="evaluations must be at least 300 for exemplars, got 299"):
        walker.track(evaluations=299)
