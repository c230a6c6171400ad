"""A tracker's frames: when they come, what they cost, and what happens where nothing is seen."""

import itertools
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posefit.motion import built_in
from posefit.registry import registry
from posefit_exemplars.factory import MIN_EVALUATIONS, exemplars
from tests.cases import cases
from tests.exemplars.conftest import EMPTY, Walk, walk_of


def test_a_pose_is_told_so_many_frames_later(walker: Walk) -> None:
    for lag in cases([0, 2, 15, 40]):
        taken = 0

        def stream() -> Iterator[Any]:
            nonlocal taken
            for observation in walker.seen:
                taken += 1
                yield observation

        tracker = exemplars(walker.told(evaluations=MIN_EVALUATIONS), lag=lag)
        assert tracker.lag == lag
        late = [taken - given for given, _ in enumerate(tracker.track(stream(), np.random.default_rng(0)), 1)]
        count = len(walker.seen)
        assert late == [min(lag, count - given) for given in range(1, count + 1)]


def test_nothing_seen_for_a_while_is_bridged_by_the_motion(walker: Walk) -> None:
    for translation, far in cases([("known", 90.0), ("aligned", 130.0)]):
        seen = [replace(one, usable=not 8 <= k < 14) for k, one in enumerate(walker.seen)]
        if translation == "aligned":
            seen = [replace(one, translation=None) for one in seen]
        empty = [one if one.usable else replace(one, silhouettes=EMPTY) for one in seen]
        tracker = exemplars(walker.told(translation=translation, evaluations=2440))
        frames, same = (list(tracker.track(what, np.random.default_rng(0))) for what in (seen, empty))
        assert [k for k, frame in enumerate(frames) if frame.evaluations == 1] == list(range(8, 14))
        assert walker.off(frames)[8:].max() < far  # and he is found again
        np.testing.assert_array_equal([frame.pose for frame in same], [frame.pose for frame in frames])


def test_an_empty_silhouette_that_should_say_something_ends_nothing(walker: Walk) -> None:
    seen = [replace(one, silhouettes=EMPTY) if 8 <= k < 14 else one for k, one in enumerate(walker.seen)]
    frames = list(exemplars(walker.task).track(seen, np.random.default_rng(0)))
    assert walker.off(frames).max() < 120.0


def test_somebody_who_is_not_there_at_first_is_followed_from_when_he_is(walker: Walk) -> None:
    for translation, usable in cases(itertools.product(["known", "aligned"], [False, True])):
        seen = [replace(one, silhouettes=EMPTY, usable=usable) if k < 3 else one for k, one in enumerate(walker.seen)]
        if translation == "aligned":
            seen = [replace(one, translation=None) for one in seen]
        frames = list(exemplars(walker.told(translation=translation), lag=3).track(seen, np.random.default_rng(0)))
        assert all(np.isfinite(frame.pose).all() for frame in frames)
        assert walker.off(frames)[10:].max() < 150.0


def test_nobody_at_all_is_a_track_nevertheless(walker: Walk) -> None:
    for translation in ("known", "aligned"):
        seen = [replace(one, silhouettes=EMPTY, usable=False) for one in walker.seen[:4]]
        frames = list(exemplars(walker.told(translation=translation)).track(seen, np.random.default_rng(0)))
        assert len(frames) == 4
        assert all(np.isfinite([*frame.pose, *frame.translation, frame.cost]).all() for frame in frames)


def test_a_root_that_is_suddenly_a_thousand_kilometres_away_ends_nothing(walker: Walk) -> None:
    gone = replace(walker.seen[1], usable=False, translation=np.array([1e6, 0.0, 0.0]), silhouettes=EMPTY)
    frames = list(exemplars(walker.task, lag=1).track([walker.seen[0], gone], np.random.default_rng(0)))
    np.testing.assert_array_equal(frames[1].translation, gone.translation)


def test_the_budget_holds_and_small_pictures_count_by_their_pixels() -> None:
    for size, first, budget in cases(
        itertools.product([(160, 120), (60, 45)], ["searched", "given"], [MIN_EVALUATIONS, 1000, 2440])
    ):
        motion = built_in.motion("walk-a", frames=3)
        walk = walk_of(motion, size=size)
        given = {"first_pose": motion.poses[0, 3:]} if first == "given" else {}
        frames = list(exemplars(walk.told(evaluations=budget, **given)).track(walk.seen, np.random.default_rng(0)))
        used = [frame.evaluations for frame in frames]
        assert max(used) <= budget
        assert max(used) > 0.5 * budget


def test_the_budget_holds_for_the_twins_of_several_cameras() -> None:
    for views in cases([(0.0, 90.0), (0.0, 45.0, 90.0, 135.0)]):
        walk = walk_of(built_in.motion("walk-a", frames=2), views)
        for refiner in ("none", "pso", "cma"):
            tracker = exemplars(walk.told(evaluations=MIN_EVALUATIONS), refiner=refiner, lag=0)
            frames = list(tracker.track(walk.seen, np.random.default_rng(0)))
            assert max(frame.evaluations for frame in frames) <= MIN_EVALUATIONS


def test_any_optimiser_of_the_registry_searches_within_the_budget(walker: Walk) -> None:
    for name in cases(["none", "pso", "sapso", "annealed", "particle", "scipy"]):
        if name != "none":
            assert registry().optimiser(name)
        for budget in (MIN_EVALUATIONS, 1000):
            tracker = exemplars(walker.told(evaluations=budget), refiner=name, lag=1)
            frames = list(tracker.track(walker.seen[:2], np.random.default_rng(0)))
            assert max(frame.evaluations for frame in frames) <= budget
            assert walker.off(frames).max() < 300.0


def test_too_small_a_budget_is_refused(walker: Walk) -> None:
    exemplars(walker.told(evaluations=300))
    with pytest.raises(ValueError, match="evaluations must be at least 300 for exemplars, got 299"):
        exemplars(walker.told(evaluations=299))


def test_an_optimiser_that_is_not_there_is_refused_in_one_line(walker: Walk) -> None:
    with pytest.raises(ValueError, match="'nobody'") as refused:
        exemplars(walker.task, refiner="nobody")
    assert len(str(refused.value).splitlines()) == 1


def test_settings_mean_thirtieths_of_a_second_at_any_rate(walker: Walk) -> None:
    at_30, at_120 = (exemplars(walker.told(fps=fps)) for fps in (30.0, 120.0))
    # four frames' costs together are worth what one was, and four random steps lead as far as one did
    assert at_120.temperature == 4.0 * at_30.temperature
    assert 2.0 * at_120.steps.spread == at_30.steps.spread
    assert 2.0 * at_120.steps.turning == at_30.steps.turning
    assert 4.0 * at_120.steps.pace == at_30.steps.pace
    assert at_120.steps.jump == at_30.steps.jump
    assert at_30.exemplars is at_120.exemplars  # nothing is learned twice
