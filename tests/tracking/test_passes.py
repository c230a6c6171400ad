"""A track that is tracked again along its path: what the second pass knows, which one is kept, and their effort."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from posefit.fitting.tracker import Frame, Observation, Task
from posefit.footage.scene import synthetic
from posefit.motion import built_in
from posefit.silhouette.cost import pose_costs
from posefit.tracking.options import TrackOptions
from posefit.tracking.pipeline import track_scene
from posefit.tracking.result import Track
from tests.cases import each

WALK = built_in.motion("walk", frames=60).frames(5, 11)


class Walker:
    """Looks ahead, and estimates the true walk: in each pass so many radians off."""

    lag = 3
    off: ClassVar[dict[str, float]] = {}
    calls: ClassVar[list[tuple[Task, list[Observation]]]] = []

    def __init__(self, task: Task) -> None:
        self.task = task

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield frames of the walk."""
        given: list[Observation] = []
        Walker.calls.append((self.task, given))
        for k, observation in enumerate(observations):
            given.append(observation)
            pose, place = WALK.poses[k].copy(), WALK.translations[k]
            pose[9:30] += Walker.off.get(self.task.translation, 0.0)
            view = self.task.body, self.task.cameras, observation.silhouettes
            costs, counts = pose_costs(*view, pose[None], place[None], 0.5)
            yield Frame(pose, place, float(costs[0]), counts[:, 0], 7, 0.5, np.empty(0), cpu_seconds=0.25)


def tracked(passes: int = 2, **off: float) -> Track:
    """Return the track of six frames of a walk whose truth is unknown."""
    scene = synthetic(WALK, (60.0,), (160, 120), (), (None, None))
    observations = [replace(observation, translation=None) for observation in scene.observations]
    Walker.off, Walker.calls = off, []
    options = TrackOptions(method=Walker, evaluations=300, body_frames=0, passes=passes)
    return track_scene(replace(scene, truth=None, observations=observations), [WALK], options)


@each("passes", [2, 3])
def test_later_passes_know_the_path(passes: int) -> None:
    track = tracked(passes)
    calls = [(task, given) for task, given in Walker.calls if len(given) == len(WALK)]
    assert [task.translation for task, _ in calls] == ["aligned", *["known"] * (passes - 1)]
    path = np.array([observation.translation for observation in calls[1][1]])
    np.testing.assert_allclose(path, WALK.translations, atol=0.03)  # it is the smooth path,
    assert not np.array_equal(path, WALK.translations)  # and not the tracker's
    assert track.summary["passes"] == passes
    assert [frame.evaluations for frame in track.estimates] == [7 * passes] * len(WALK)  # of all
    assert track.measures.seconds_per_frame == pytest.approx(0.5 * passes)


@each(("off", "kept"), [({"known": 1.0}, 1), ({"aligned": 0.5}, 2), ({}, 2)])
def test_a_pass_that_costs_much_more_is_not_kept(off: dict[str, float], kept: int) -> None:
    first, both = tracked(1, **off), tracked(2, **off)
    assert both.summary["kept_pass"] == kept
    if kept == 1:
        assert both.measures.cost == pytest.approx(first.measures.cost)
    elif off:
        assert both.measures.cost < first.measures.cost
