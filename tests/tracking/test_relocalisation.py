"""A person who leaves the picture and comes back the other way is not tracked backwards."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import posefit
from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion import built_in
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit.tracking.restarts import relocalised
from tests.cases import each

WALKS, GAP = 30, 12  # frames
AFTER = slice(WALKS + GAP, None)
MOTION = built_in.motion("walk", frames=WALKS)
MIDDLE = MOTION.translations.mean(axis=0) * [1.0, 0.0, 1.0]
SIDE = Camera.around(MIDDLE + [0.0, MOTION.translations[0, 1], 0.0], np.pi / 2.0, 5.0, (160, 120))


@cache
def footage(comes: str) -> tuple[Array, Array]:
    """Return masks and true yaws of a walk, a gap, and the same walk again: `on`, or `back` the other way."""
    body, poses, places = Body.of(MOTION.skeleton), MOTION.poses, MOTION.translations
    turned, there = poses.copy(), places.copy()
    if comes == "back":
        turned[:, 0] += np.pi
        there = 2.0 * MIDDLE + places * [-1.0, 1.0, -1.0]
    walks = [(poses, places), (turned, there)]
    first, second = (np.array([project(body, SIDE, *pose) for pose in zip(*walk, strict=True)]) for walk in walks)
    yaws = np.concatenate([poses[:, 0], np.full(GAP, np.nan), turned[:, 0]])
    return np.concatenate([first, np.zeros((GAP, *first.shape[1:]), dtype=bool), second]), yaws


def tracked(folder: Path, comes: str, **options: Any) -> tuple[posefit.Track, Array]:
    """Return a track of the footage, and in which frames it faces as the walker does."""
    masks, yaws = footage(comes)
    np.savez(folder / "masks.npz", masks=masks)
    stature = Body.of(MOTION.skeleton).stature
    defaults = {"camera": SIDE, "method": "@loose", "body_frames": 0, "evaluations": 840, "height": stature}
    track = posefit.track(folder / "masks.npz", **{**defaults, **options})
    return track, np.cos(track.motion.poses[:, 0] - yaws) > 0.0


@each("optimiser", ["sapso", "annealed"])
def test_a_relocalised_frame_has_the_effort_of_all_restarts(tmp_path: Path, optimiser: str) -> None:
    track, right = tracked(tmp_path, "back", method=optimiser)
    assert right[:WALKS].all()
    assert right[AFTER].mean() > 0.95
    assert track.summary["relocalised"] == [WALKS + GAP]
    assert track.summary["backwards_share"] == 0.0
    evaluations = [frame.evaluations for frame in track.frames]
    # one to eight modes and the track as it was, ten frames each, and the frame itself
    assert 20 * 840 < evaluations.pop(WALKS + GAP) <= 91 * 840
    assert max(evaluations) <= 840


def test_without_relocalisation_the_person_is_tracked_backwards_with_a_warning(tmp_path: Path) -> None:
    track, right = tracked(tmp_path, "back", settings={"tracker.relocalise_gap": 0})
    assert not right[AFTER].any()
    assert track.summary["relocalised"] == []
    assert track.summary["backwards_share"] > 0.1
    (warning,) = [warning for warning in track.summary["warnings"] if "backwards" in warning]
    assert warning.startswith("the person seems to walk backwards in 14 of 72 frames")


TASK = Task(Body.of(MOTION.skeleton), [SIDE], 10, 0.0, MIDDLE, fps=10.0)
VISIBLE = Observation([Silhouette.of(footage("on")[0][0])])
GONE = Observation([Silhouette.of(footage("on")[0][WALKS])], usable=False)


class PlannedCosts:
    """Follows at planned costs: of the track as it is, and of a restart."""

    def __init__(self, costs: Sequence[float], restart: float) -> None:
        self._costs, self._restart = iter(costs), restart
        self.tasks: list[Task] = []

    def __call__(self, task: Task, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        self.tasks.append(task)
        for observation in observations:
            trial = task.yaw is None or task.fps != TASK.fps
            cost = (self._restart if task.yaw is None else 10.0) if trial else next(self._costs)
            pose, evaluations = np.full(66, rng.random()), int(observation.usable)
            yield Frame(pose, MIDDLE, cost, np.zeros((1, 3), np.int64), evaluations)


def restarts_of(follow: PlannedCosts, observations: Sequence[Observation], task: Task = TASK) -> list[tuple[int, bool]]:
    """Return in which frames a tracker made restarts, and whether one of them was better."""
    frames = list(relocalised(task, follow, observations, np.random.default_rng(0), 5))
    assert len(frames) == len(observations)
    return [(k, frame.details["relocalised"]) for k, frame in enumerate(frames) if frame.details]


@each(("before", "gap", "expected"), [(3, 4, []), (3, 5, [(8, True)]), (3, 9, [(12, True)]), (0, 9, [])])
def test_a_gap_is_of_five_frames_after_one_that_shows_the_person(
    before: int, gap: int, expected: list[tuple[int, bool]]
) -> None:
    assert restarts_of(PlannedCosts([1.0] * 30, 5.0), [VISIBLE] * before + [GONE] * gap + [VISIBLE] * 10) == expected


def test_restarts_that_are_not_better_change_nothing() -> None:
    clip = [VISIBLE] * 3 + [GONE] * 5 + [VISIBLE] * 10
    follow = PlannedCosts([1.0] * 30, 20.0)
    assert restarts_of(follow, clip) == [(8, False)]
    assert len(follow.tasks) == 1 + 8 + 1  # the track itself is not begun again
    plain = list(PlannedCosts([1.0] * 30, 20.0)(TASK, clip, np.random.default_rng(0)))
    again = relocalised(TASK, PlannedCosts([1.0] * 30, 20.0), clip, np.random.default_rng(0), 5)
    np.testing.assert_array_equal([frame.pose for frame in again], [frame.pose for frame in plain])


TYPICAL, HIGH, LOWER = [2.0] * 10, [3.1] * 5, [2.9] * 5


@each(
    ("costs", "expected"),
    [
        ([*TYPICAL, *HIGH, *TYPICAL], [(15, True)]),
        ([*TYPICAL, *HIGH[:4], *TYPICAL], []),
        ([*TYPICAL, *LOWER, *TYPICAL], []),
        ([*TYPICAL[:9], *HIGH, *TYPICAL], []),  # one second has to show what is typical
        ([*TYPICAL, *HIGH, *HIGH, *HIGH, *HIGH], [(15, True)]),  # which is then typical
    ],
)
def test_costs_that_stay_high_for_half_a_second_lead_to_restarts(
    costs: list[float], expected: list[tuple[int, bool]]
) -> None:
    assert restarts_of(PlannedCosts(costs, 5.0), [VISIBLE] * len(costs)) == expected


@each(("earlier", "expected"), [(8, [(0, True)]), (7, [])])
def test_a_resumed_track_remembers_its_gap(earlier: int, expected: list[tuple[int, bool]]) -> None:
    clip = ([VISIBLE] * 3 + [GONE] * 5)[:earlier]
    before = tuple(PlannedCosts([1.0] * 9, 5.0)(TASK, clip, np.random.default_rng(0)))
    assert restarts_of(PlannedCosts([1.0] * 9, 5.0), [VISIBLE] * 4, replace(TASK, before=before)) == expected
