"""What happens before the first frame: compiling, restarts, and the person's build."""

import os
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.fitting.start import posterior_of
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.footage.scene import Scene
from posefit.motion import built_in
from posefit.progress import Progress
from posefit.silhouette.drawn import PoseCount
from posefit.silhouette.mask import Silhouette
from posefit.tracking.initialise import fitted_build, task_of
from posefit.tracking.options import TrackOptions
from posefit.tracking.restarts import best_restart, first_shown_whole
from posefit.uncertainty.modes import Posterior
from posefit_exemplars.lookup import Lookup
from tests.cases import each
from tests.testing import planted
from tests.tracking.scenes import frame_of, masks_of, rows_of, walk

COMPILING = "compiling kernels for their first use on this machine; this takes ten seconds or more ..."


@each("method", [{}, {"method": "annealed"}, {"method": "vsmm"}])
def test_a_search_is_made_once(method: dict[str, Any]) -> None:
    drawn = PoseCount()
    with drawn.counting():
        used = posefit.fit("walk", size=(120, 90), **method).summary["evaluations"]
    assert used == drawn.poses


@pytest.mark.slow
def test_compiling_is_announced_only_when_something_is_compiled(
    tmp_path: Path,
) -> None:
    words = [
        sys.executable,
        "-m",
        "posefit",
        "fit",
        "walk",
        "--size",
        "60x45",
        "--evaluations",
        "80",
    ]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    logs = [
        subprocess.run(words, env=environment, capture_output=True, text=True).stderr
        for _ in range(2)
    ]
    assert [log.count(COMPILING) for log in logs] == [1, 0]


def test_a_tracker_that_needs_its_whole_budget_gets_it() -> None:
    class Demanding(planted.Holds):
        def __init__(self, task: Any) -> None:
            if task.evaluations < 2000:
                raise ValueError(
                    f"evaluations must be at least 2000, got {task.evaluations}"
                )
            super().__init__(task)

    assert (
        posefit.track("walk", method=Demanding, frames=(0, 2), size=(120, 90)).summary[
            "frames"
        ]
        == 2
    )
    with pytest.raises(ValueError, match="evaluations must be at least 2000, got 400"):
        posefit.track(
            "walk", method=Demanding, frames=(0, 2), size=(120, 90), evaluations=400
        )


@each(
    ("size", "rows"),
    [((320, 240), 240), ((640, 479), 479), ((640, 480), 240), ((960, 721), 240)],
)
def test_restarts_see_small_pictures_and_the_best_goes_on_in_the_whole_one(
    size: tuple[int, int], rows: int
) -> None:
    scene = walk(5, [90.0], size)
    motion = scene.truth
    task = Task(scene.body, scene.cameras, 100, scene.yaw, scene.anchor)
    views: list[tuple[int, float]] = []

    def follow(
        task: Task, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        for observation in observations:
            views.append((task.cameras[0].height, task.fps))
            assert observation.silhouettes[0].mask.shape[0] == task.cameras[0].height
            view = replace(scene, cameras=task.cameras)
            yield frame_of(view, motion.poses[0], motion.translations[0], observation)

    guess, _ = best_restart(task, scene.observations, follow, 3, 0)
    # frames 0 and 3 of each restart, with their own rate, and the first of the best once more if they were reduced
    assert views == [(rows, 10.0)] * 6 + ([(size[1], 30.0)] if rows != size[1] else [])
    assert guess.fps == 30.0
    (first,) = guess.before
    whole = frame_of(
        scene, motion.poses[0], motion.translations[0], scene.observations[0]
    )
    np.testing.assert_array_equal(first.areas, whole.areas)
    assert guess.cameras is task.cameras


@each(
    ("count", "body_frames", "message"),
    [
        (
            12,
            4,
            "no build is fitted to 4 frames: 4 are too few, at least 5 are needed; the average build is used",
        ),
        (
            3,
            30,
            "no build is fitted to 30 frames: 3 of them show enough of the person, at least 5 are needed",
        ),
        (12, 5, "fitting the person's build to 5 frames"),
    ],
)
def test_too_few_frames_for_a_build_are_reported(
    tmp_path: Path, count: int, body_frames: int, message: str
) -> None:
    scene = walk(count, [90.0], (120, 90))
    np.savez(tmp_path / "a.npz", masks=masks_of(scene))
    log: list[str] = []
    options: dict[str, Any] = {
        "method": "@loose",
        "evaluations": 80,
        "restarts": 1,
        "body_frames": body_frames,
    }
    track = posefit.track(tmp_path / "a.npz", progress=Progress(log.append), **options)
    assert any(line.startswith(message) for line in log)
    assert (track.log.build is None) == message.startswith("no build")


def with_one_camera_late(
    scene: Scene, late: int
) -> tuple[Silhouette, list[Observation]]:
    """Return a mask in which nothing is known, and the observations of a scene: the first `late` have one like it."""
    unknown = Silhouette.of(
        *np.zeros((2, *scene.observations[0].silhouettes[0].mask.shape), dtype=bool)
    )
    shown = [scene.observations[k] for k in range(scene.count)]
    blind = [
        replace(observation, silhouettes=[observation.silhouettes[0], unknown])
        for observation in shown[:late]
    ]
    return unknown, [*blind, *shown[late:]]


def frames_of_builds(
    scene: Scene, observations: list[Observation], *counts: int
) -> list[tuple[list[int], float]]:
    """Return the numbers and the rate of the frames that builds of so many frames are fitted to."""
    task = task_of(
        scene,
        TrackOptions(evaluations=80, translation="known"),
        [built_in.motion("walk")],
    )
    calls: list[tuple[list[int], float]] = []

    def follow(
        task: Task, chosen: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        rows = rows_of(chosen, observations)
        calls.append((rows, task.fps))
        areas = np.zeros((len(scene.cameras), 3), np.int64)
        return iter(
            [Frame(scene.truth.poses[0], scene.anchor, 0.0, areas, 0)] * len(rows)
        )

    for count in counts:
        fitted_build(
            task, replace(scene, observations=observations), follow, count, None, 0
        )
    return [call for k, call in enumerate(calls) if call not in calls[:k]]


def test_a_build_is_fitted_to_every_third_frame_from_the_first_whole_person_on() -> (
    None
):
    scene = walk(40, [0.0, 90.0], (120, 90))
    observations = [scene.observations[k] for k in range(30)]
    thirds, all_of_them = frames_of_builds(scene, observations, 10, 11)
    assert thirds == (list(range(0, 30, 3)), scene.fps / 3)
    assert all_of_them == (list(range(11)), scene.fps)
    unknown, observations = with_one_camera_late(scene, 10)
    # too many for those that come after
    few, many = frames_of_builds(scene, observations, 5, 11)
    assert few[0] == [10, 13, 16, 19, 22]
    assert many[0] == list(range(11))
    assert first_shown_whole(observations) == 10
    by_one = [
        replace(observation, silhouettes=observation.silhouettes[:1])
        for observation in observations
    ]
    assert first_shown_whole(by_one) == 0
    whole = observations[0].silhouettes[0]
    # a part of it at the other edge
    cut = Silhouette.of(np.roll(whole.mask, -int(whole.extent[0]) - 5, axis=1))
    observations = [
        replace(observations[0], silhouettes=[one])
        for one in (unknown, cut, cut, whole)
    ]
    assert first_shown_whole(observations) == 3
    assert (
        first_shown_whole([replace(observations[1], usable=False), observations[2]])
        == 1
    )


@each(("late", "restarts"), [(10, 0), (20, 0), (20, 1)])
def test_a_build_that_begins_late_looks_for_the_pose_again(
    late: int, restarts: int
) -> None:
    scene = walk(50, [0.0, 90.0], (80, 60))
    _, observations = with_one_camera_late(scene, late)
    frame = Frame(
        scene.truth.poses[40], scene.anchor, 0.0, np.zeros((2, 3), np.int64), 0
    )
    first = replace(frame, pose=scene.truth.poses[0])
    task = task_of(
        scene,
        TrackOptions(evaluations=80, translation="known"),
        [built_in.motion("walk")],
    )
    task = replace(task, yaw=0.5, first_pose=first.pose[3:], before=(first,))
    starts: list[tuple[float | None, tuple[Frame, ...]]] = []

    def follow(
        task: Task, chosen: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        starts.append((task.yaw, tuple(task.before)))
        return iter([frame] * len(list(chosen)))

    fitted_build(
        task,
        replace(scene, observations=observations),
        follow,
        5,
        None,
        0,
        restarts=restarts,
    )
    assert scene.fps == 30.0
    begun = (0.5, (first,)) if late < 15 else (None, ())  # half a second
    expected = [begun, (frame.pose[0], (frame,))] if restarts else [begun]

    def poses(before: Sequence[Frame]) -> list[list[float]]:
        return [earlier.pose.tolist() for earlier in before]

    assert [(yaw, poses(before)) for yaw, before in starts] == [
        (yaw, poses(before)) for yaw, before in expected
    ]


def test_the_first_pose_is_looked_up_once(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Observation] = []
    posterior = Lookup.posterior

    def counted(lookup: Lookup, observation: Observation) -> Posterior | None:
        asked.append(observation)
        return posterior(lookup, observation)

    monkeypatch.setattr(Lookup, "posterior", counted)
    masks = masks_of(walk(2, [90.0], (120, 90)))
    posefit.track(
        masks,
        method="random@loose",
        evaluations=120,
        restarts=1,
        body_frames=0,
        smooth=False,
    )
    assert len(asked) == 1


def test_footage_without_a_truth_needs_no_angles_of_the_whole_library(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        Task,
        "angles",
        property(lambda task: pytest.fail("all angles were put together")),
    )
    masks = masks_of(walk(2, [90.0], (120, 90)))
    track = posefit.track(
        masks, method="vsmm", evaluations=80, restarts=1, body_frames=0, smooth=False
    )
    assert track.truth is None


def test_ends_of_searches_of_one_image_are_as_likely_as_they_are_cheap() -> None:
    costs = np.array([3.0, 1.0, 5.0])
    shares = np.exp([-1.0, 0.0, -2.0])  # two of cost are a factor of e
    posterior = posterior_of(np.zeros((3, 66)), np.zeros((3, 3)), costs)
    np.testing.assert_allclose(posterior.weights, shares / shares.sum())
