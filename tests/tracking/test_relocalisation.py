"""Whoever leaves the picture and comes back the other way is not followed backwards."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion import built_in
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit.tracking.restarts import RelocalisingTracker
from tests.cases import each

WALKS, GAP = 30, 12  # frames
AFTER = slice(WALKS + GAP, None)
MOTION = built_in.motion("walk", frames=WALKS)
MIDDLE = MOTION.translations.mean(axis=0) * [1.0, 0.0, 1.0]
SIDE = Camera.around(MIDDLE + [0.0, MOTION.translations[0, 1], 0.0], np.pi / 2.0, 5.0, (160, 120))


@cache
def film(comes: str) -> tuple[Array, Array]:
    """Masks and true yaws of a walk past a camera, a gap, and the same walk again: `on`, or `back` the other way."""
    body, poses, places = Body.of(MOTION.skeleton), MOTION.poses, MOTION.translations
    turned, there = poses.copy(), places.copy()
    if comes == "back":
        turned[:, 0] += np.pi
        there = 2.0 * MIDDLE + places * [-1.0, 1.0, -1.0]
    each = [(poses, places), (turned, there)]
    first, second = (np.array([project(body, SIDE, *one) for one in zip(*walk, strict=True)]) for walk in each)
    yaws = np.concatenate([poses[:, 0], np.full(GAP, np.nan), turned[:, 0]])
    return np.concatenate([first, np.zeros((GAP, *first.shape[1:]), dtype=bool), second]), yaws


def followed(folder: Path, comes: str, **given: Any) -> tuple[posefit.Track, Array]:
    """Return a track of a film, and in which frames it faces as the walker does."""
    masks, yaws = film(comes)
    np.savez(folder / "masks.npz", masks=masks)
    usual = {"camera": SIDE, "method": "@loose", "body_frames": 0, "iterations": 20}
    stature = Body.of(MOTION.skeleton).stature
    track = posefit.track(folder / "masks.npz", height=stature, **{**usual, **given})
    return track, np.cos(track.motion.poses[:, 0] - yaws) > 0.0


@pytest.mark.slow
@each("optimiser", ["sapso", "annealed"])
def test_who_comes_back_faces_where_he_goes_in_nine_of_ten_seeds(tmp_path: Path, optimiser: str) -> None:
    # which way he is followed is decided before the track is steadied
    tracks = [followed(tmp_path, "back", method=optimiser, seed=seed, smooth=False) for seed in range(10)]
    right = [faces[AFTER].mean() for _, faces in tracks]
    assert np.mean(np.array(right) > 0.95) >= 0.9, right


@each("optimiser", ["sapso", "annealed"])
def test_who_comes_back_is_told_with_what_it_took(tmp_path: Path, optimiser: str) -> None:
    track, right = followed(tmp_path, "back", method=optimiser)
    assert right[:WALKS].all()
    assert right[AFTER].mean() > 0.95
    assert track.summary["relocalised"] == [WALKS + GAP]
    assert track.summary["backwards_share"] == 0.0
    spent = [frame.evaluations for frame in track.estimates]
    # eight starts and the track as it was, ten frames each, and the frame itself
    assert 80 * 840 < spent[WALKS + GAP] <= 91 * 840
    assert max(spent[: WALKS + GAP] + spent[WALKS + GAP + 1 :]) <= 840


def test_with_0_he_is_followed_backwards_which_is_told(tmp_path: Path) -> None:
    track, right = followed(tmp_path, "back", settings={"tracker.relocalise_gap": 0})
    assert not right[AFTER].any()
    assert track.summary["relocalised"] == []
    assert track.summary["backwards_share"] > 0.1
    (said,) = [warning for warning in track.summary["warnings"] if "backwards" in warning]
    assert said.startswith("the person seems to walk backwards in 14 of 72 frames")


def test_who_goes_on_after_a_gap_is_followed_on(tmp_path: Path) -> None:
    track, right = followed(tmp_path, "on", smooth=False)
    assert right[AFTER].all()
    assert all(frame.evaluations == 0 for frame in track.estimates[WALKS : WALKS + GAP])
    np.testing.assert_array_equal(
        [frame.pose for frame in track.estimates[WALKS : WALKS + GAP]], [track.estimates[WALKS - 1].pose] * GAP
    )


def test_where_the_truth_is_known_nobody_looks_around_unless_he_is_asked_to() -> None:
    given: dict[str, Any] = {"frames": (0, 3), "size": (80, 60), "evaluations": 80}
    plain, asked = (posefit.track("walk", settings=one, **given) for one in ({}, {"tracker.relocalise_gap": 5}))
    np.testing.assert_array_equal(plain.motion.poses, asked.motion.poses)
    assert plain.summary["relocalised"] == asked.summary["relocalised"] == []


def test_a_wrong_number_of_frames_is_one_clear_error() -> None:
    for wrong, said in [
        (-1, "relocalise_gap must be 0 or more, got -1"),
        (2.5, r"tracker.relocalise_gap must be int \| none, got 2.5"),
    ]:
        with pytest.raises(ValueError, match=said):
            posefit.track("walk", frames=(0, 1), settings={"tracker.relocalise_gap": wrong})


TASK = Task(Body.of(MOTION.skeleton), [SIDE], 10, 0.0, MIDDLE, fps=10.0)
SEEN = [
    Observation([Silhouette.of(film("on")[0][0])]),
    Observation([Silhouette.of(film("on")[0][WALKS])], usable=False),
]


class Told:
    """Follows at costs that are told: of the track as it is, and of a start that looks around."""

    def __init__(self, costs: Sequence[float], start: float) -> None:
        self._costs, self._start = iter(costs), start
        self.begun: list[Task] = []

    def __call__(self, task: Task, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        self.begun.append(task)
        for one in observations:
            tried = task.yaw is None or task.fps != TASK.fps
            cost = (self._start if task.yaw is None else 10.0) if tried else next(self._costs)
            pose = np.full(66, rng.random())
            yield Frame(pose, MIDDLE, cost, np.zeros((1, 3), np.int64), int(one.usable), 1.0, np.empty(0))


def looked(told: Told, observations: Sequence[Observation], task: Task = TASK) -> list[tuple[int, bool]]:
    """Return in which frames a tracker looked around, and whether it went on with something new."""
    frames = list(RelocalisingTracker(task, told).track(observations, np.random.default_rng(0)))
    assert len(frames) == len(observations)
    return [(k, frame.details["relocalised"]) for k, frame in enumerate(frames) if frame.details]


@each(("gap", "found"), [(4, []), (5, [(8, True)]), (9, [(12, True)])])
def test_a_gap_of_five_frames_is_one(gap: int, found: list[tuple[int, bool]]) -> None:
    seen, gone = SEEN
    assert looked(Told([1.0] * 30, 5.0), [seen] * 3 + [gone] * gap + [seen] * 10) == found


def test_frames_before_the_first_that_shows_him_are_no_gap() -> None:
    seen, gone = SEEN
    assert looked(Told([1.0] * 30, 5.0), [gone] * 9 + [seen] * 10) == []


def test_what_is_not_better_changes_nothing() -> None:
    seen, gone = SEEN
    clip = [seen] * 3 + [gone] * 5 + [seen] * 10
    told = Told([1.0] * 30, 20.0)
    assert looked(told, clip) == [(8, False)]
    assert len(told.begun) == 1 + 8 + 1  # the track itself is not begun anew
    plain = list(Told([1.0] * 30, 20.0)(TASK, clip, np.random.default_rng(0)))
    again = list(RelocalisingTracker(TASK, Told([1.0] * 30, 20.0)).track(clip, np.random.default_rng(0)))
    np.testing.assert_array_equal([one.pose for one in again], [one.pose for one in plain])


def test_it_looks_around_where_costs_stay_high_for_half_a_second() -> None:
    usual, high, rather = [2.0] * 10, [3.1] * 5, [2.9] * 5
    for costs, found in (
        ([*usual, *high, *usual], [(15, True)]),
        ([*usual, *high[:4], *usual], []),
        ([*usual, *rather, *usual], []),
        ([*usual[:9], *high, *usual], []),  # one second has to show what is usual
        ([*usual, *high, *high, *high, *high], [(15, True)]),  # which is then what is usual
    ):
        assert looked(Told(costs, 5.0), [SEEN[0]] * len(costs)) == found


def test_a_track_that_goes_on_remembers_its_gap() -> None:
    seen, gone = SEEN
    earlier = list(Told([1.0] * 9, 5.0)(TASK, [seen] * 3 + [gone] * 5, np.random.default_rng(0)))
    assert looked(Told([1.0] * 9, 5.0), [seen] * 4, replace(TASK, before=tuple(earlier))) == [(0, True)]
    assert looked(Told([1.0] * 9, 5.0), [seen] * 4, replace(TASK, before=tuple(earlier[:7]))) == []
