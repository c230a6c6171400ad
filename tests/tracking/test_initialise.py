"""What happens before the first frame: compiling, which is said only where it is done, and costs little."""

import os
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.footage.scene import synthetic
from posefit.motion import built_in
from posefit.silhouette.cost import areas, mismatch
from posefit.silhouette.drawn import PoseCount
from posefit.silhouette.mask import Silhouette
from posefit.tracking.initialise import first_seen_by_most, fitted_build, task_of
from posefit.tracking.options import TrackOptions
from posefit.tracking.restarts import best_restart
from tests.cases import each

COMPILING = "compiling the kernels, once on this machine; this takes ten seconds or more ..."


@each("method", [{}, {"method": "annealed"}, {"method": "vsmm"}])
def test_a_search_is_made_once(method: dict[str, Any]) -> None:
    drawn = PoseCount()
    with drawn.counting():
        used = posefit.fit("walk", size=(120, 90), **method).summary["evaluations"]
    # the warm-up may have 8 x 40 evaluations; the baselines draw every training pose once, and the scene one
    training = sum(len(posefit.motion.built_in.motion(style).poses) for style in ("walk-a", "walk-b", "walk-c"))
    assert used <= drawn.poses - training <= used + 400


@pytest.mark.slow
def test_compiling_is_announced_where_something_is_compiled_and_only_there(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "posefit", "fit", "walk", "--size", "60x45", "--evaluations", "80"]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    said = [subprocess.run(words, env=environment, capture_output=True, text=True).stderr for _ in range(2)]
    assert said[0].count(COMPILING) == 1
    assert said[1].count(COMPILING) == 0
    assert "ready in" in said[1]


def test_a_tracker_that_needs_its_whole_budget_works_all_the_same() -> None:
    from tests.testing import planted

    class Demanding(planted.Holds):
        def __init__(self, task: Any) -> None:
            if task.evaluations < 2000:
                raise ValueError(f"evaluations must be at least 2000, got {task.evaluations}")
            super().__init__(task)

    assert posefit.track("walk", method=Demanding, frames=(0, 2), size=(120, 90)).summary["frames"] == 2
    with pytest.raises(ValueError, match="evaluations must be at least 2000, got 400"):
        posefit.track("walk", method=Demanding, frames=(0, 2), size=(120, 90), evaluations=400)


@each(("size", "rows"), [((320, 240), 240), ((640, 479), 479), ((640, 480), 240), ((960, 721), 240)])
def test_starts_are_compared_in_small_pictures_and_the_best_goes_on_in_the_whole_one(
    size: tuple[int, int], rows: int
) -> None:
    motion = built_in.motion("walk", frames=5)
    scene = synthetic(motion, [90.0], size, [], (None, None))
    task = Task(scene.body, scene.cameras, 100, scene.yaw, scene.anchor)
    looked: list[int] = []
    rates: list[float] = []

    def follow(task: Task, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        for seen in observations:
            looked.append(task.cameras[0].height)
            rates.append(task.fps)
            assert seen.silhouettes[0].mask.shape[0] == task.cameras[0].height
            pose, where = motion.poses[:1], motion.translations[:1]
            counts = areas(task.body, task.cameras[0], seen.silhouettes[0], pose, where)
            yield Frame(pose[0], where[0], float(mismatch(counts)[0]), counts, 1, 0.0, np.empty(0))

    begin = best_restart(task, scene.observations, follow, 3, 0)
    # frames 0 and 3 of each start, and the best one's first once more where they were seen small
    assert looked == [rows] * 6 + ([size[1]] if rows != size[1] else [])
    # a model of motion knows how far apart they are
    assert rates == [10.0] * 6 + [30.0] * (len(looked) - 6)
    assert begin.fps == 30.0
    (first,) = begin.before
    whole = areas(
        scene.body, scene.cameras[0], scene.observations[0].silhouettes[0], motion.poses[:1], motion.translations[:1]
    )
    np.testing.assert_array_equal(first.areas, whole)
    assert begin.cameras is task.cameras


@each(
    ("count", "asked", "said"),
    [
        (12, 4, "no build is fitted to 4 frames: 4 are too few, at least 5 are needed; it is the average"),
        (3, 30, "no build is fitted to 30 frames: 3 of them show enough of the person, at least 5 are needed"),
        (12, 5, "fitting the person's build to 5 frames"),
    ],
)
def test_too_few_frames_for_a_build_are_said(tmp_path: Path, count: int, asked: int, said: str) -> None:
    scene = synthetic(built_in.motion("walk", frames=count), [90.0], (120, 90), [], (None, None))
    np.savez(tmp_path / "a.npz", masks=[scene.observations[k].silhouettes[0].mask for k in range(count)])
    heard: list[str] = []
    track = posefit.track(
        tmp_path / "a.npz", method="@loose", evaluations=80, restarts=1, body_frames=asked, say=heard.append
    )
    assert any(line.startswith(said) for line in heard)
    assert (track.summary["body"] is None) == said.startswith("no build")


def test_a_build_sees_every_third_frame_where_there_are_so_many() -> None:
    scene = synthetic(built_in.motion("walk", frames=30), [90.0], (120, 90), [], (None, None))
    task = task_of(scene, TrackOptions(evaluations=80), [built_in.motion("walk")])
    looked: list[tuple[int, float]] = []

    def follow(mine: Task, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        seen = list(observations)
        looked.append((len(seen), mine.fps))
        pose, place = built_in.motion("walk").poses[0], scene.anchor
        return (Frame(pose, place, 0.0, np.zeros((1, 3), np.int64), 0, 0.0, np.empty(0)) for _ in seen)

    fitted_build(task, scene.observations, follow, 10, None, 0)
    fitted_build(task, scene.observations, follow, 11, None, 0)  # of which there are not so many thirds
    assert set(looked) == {(10, scene.fps / 3), (11, scene.fps)}


def test_a_build_begins_where_most_cameras_see_the_person() -> None:
    scene = synthetic(built_in.motion("walk", frames=40), [0.0, 90.0], (120, 90), [], (None, None))
    task = task_of(scene, TrackOptions(evaluations=80), [built_in.motion("walk")])
    nothing = Silhouette.of(np.zeros((90, 120), dtype=bool), np.zeros((90, 120), dtype=bool))
    seen = [scene.observations[k] for k in range(40)]
    seen[:10] = [replace(one, silhouettes=[one.silhouettes[0], nothing]) for one in seen[:10]]
    looked: list[list[int]] = []

    def follow(mine: Task, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        told = list(observations)
        looked.append([next(k for k, one in enumerate(seen) if one is each) for each in told])
        pose, place = built_in.motion("walk").poses[0], scene.anchor
        return (Frame(pose, place, 0.0, np.zeros((2, 3), np.int64), 0, 0.0, np.empty(0)) for _ in told)

    fitted_build(task, seen, follow, 5, None, 0)
    fitted_build(task, seen, follow, 11, None, 0)  # too many for those that come after
    assert looked[0] == [10, 13, 16, 19, 22]
    assert looked[-1] == list(range(11))
    assert first_seen_by_most(seen) == 10
    assert first_seen_by_most([replace(one, silhouettes=one.silhouettes[:1]) for one in seen]) == 0
