"""A track that is followed again where it went: what the second pass knows, which one is kept, and what it took."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest
from click.testing import CliRunner

import posefit
from posefit.cli import main
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.footage.scene import Scene, synthetic
from posefit.motion import built_in
from posefit.tracking.options import TrackOptions
from posefit.tracking.pipeline import track_scene
from posefit.tracking.summary import Track

WALK = built_in.motion("walk", frames=60).frames(5, 11)


def footage() -> Scene:
    """Return six frames of a walk whose truth nobody knows."""
    scene = synthetic(WALK, (60.0,), (160, 120), (), (None, None))
    return replace(scene, truth=None, observations=[replace(one, translation=None) for one in scene.observations])


class Walker:
    """Looks ahead, and finds the true walk: in each pass so many radians off."""

    lag = 3
    off: ClassVar[dict[str, float]] = {}
    told: ClassVar[list[tuple[Task, list[Observation]]]] = []

    def __init__(self, task: Task) -> None:
        self.task = task

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield frames of the walk."""
        seen: list[Observation] = []
        Walker.told.append((self.task, seen))
        for k, one in enumerate(observations):
            seen.append(one)
            pose = WALK.poses[k].copy()
            pose[9:30] += Walker.off.get(self.task.translation, 0.0)
            (silhouette,), camera = one.silhouettes, self.task.cameras[0]
            counts = posefit_areas(self.task, camera, silhouette, pose, WALK.translations[k])
            yield Frame(pose, WALK.translations[k], *counts, 7, 0.5, np.empty(0), cpu_seconds=0.25)


def posefit_areas(task: Task, camera: Any, silhouette: Any, pose: np.ndarray, place: np.ndarray) -> tuple[Any, Any]:
    """Return the cost of a pose and its areas."""
    from posefit.silhouette.cost import areas, mismatch

    counts = areas(task.body, camera, silhouette, pose[None], place[None])
    return float(mismatch(counts)[0]), counts


def followed(passes: int = 2, **off: float) -> Track:
    Walker.off, Walker.told = off, []
    return track_scene(
        footage(),
        [WALK],
        TrackOptions(method=Walker, evaluations=300, body_frames=0, passes=passes),
    )


def test_the_second_time_the_way_is_known() -> None:
    found = followed()
    tasks = [task for task, seen in Walker.told if len(seen) == len(WALK)]
    assert [task.translation for task in tasks] == ["aligned", "known"]
    second = Walker.told[-1][1]
    told = np.array([one.translation for one in second])
    np.testing.assert_allclose(told, WALK.translations, atol=0.03)  # it is the steady way,
    assert not np.array_equal(told, WALK.translations)  # and not what was found
    assert (found.summary["passes"], found.summary["kept_pass"]) == (2, 2)
    assert [frame.evaluations for frame in found.estimates] == [14] * len(WALK)  # of both
    assert found.measures.seconds_per_frame == pytest.approx(1.0)


def test_a_pass_that_costs_much_more_is_not_kept_but_counted() -> None:
    alone = followed(passes=1)
    found = followed(known=1.0)
    assert found.summary["kept_pass"] == 1
    assert found.measures.cost == pytest.approx(alone.measures.cost)
    assert [frame.evaluations for frame in found.estimates] == [14] * len(WALK)


def test_of_passes_the_better_one_is_kept() -> None:
    alone = followed(passes=1, aligned=0.5)
    found = followed(aligned=0.5)
    assert found.summary["kept_pass"] == 2
    assert found.measures.cost < alone.measures.cost


def test_a_track_is_followed_once_where_nobody_asks_for_more() -> None:
    found = posefit.track("walk", frames=(0, 3), translation="aligned", evaluations=300, smooth=True)
    assert (found.summary["passes"], found.summary["kept_pass"]) == (1, 1)


def test_more_passes_are_followed_where_they_are_asked_for() -> None:
    found = followed(passes=3)
    assert [task.translation for task, seen in Walker.told if len(seen) == len(WALK)] == ["aligned", "known", "known"]
    assert [frame.evaluations for frame in found.estimates] == [21] * len(WALK)


def test_passes_that_make_no_sense_are_refused() -> None:
    for settings, said in [
        ({"passes": 0}, "passes must be at least 1, got 0"),
        ({"passes": 2}, "passes must be 1 where a track is not smooth, got 2"),
    ]:
        with pytest.raises(ValueError, match=said):
            posefit.track("walk", frames=(0, 2), **settings)


def test_a_command_that_asks_for_passes_of_what_is_not_steady_says_so_in_a_line() -> None:
    result = CliRunner().invoke(main, ["track", "walk", "--frames", "0:2", "--passes", "2"])
    assert result.exit_code == 2
    assert result.output.strip().splitlines()[-1].endswith("passes must be 1 where a track is not smooth, got 2")
