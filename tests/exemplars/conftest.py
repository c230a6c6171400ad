"""Clips to learn from, and a walk to follow that is none of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from posefit import Body, Frame, Motion, Observation, Silhouette, Task
from posefit.arrays import Array
from posefit.footage.scene import synthetic
from posefit.motion import built_in
from posefit.motion.built_in import average_skeleton
from posefit_exemplars.exemplars import Exemplars
from posefit_exemplars.tracker import ExemplarTracker

BUDGET = 1000
EMPTY = [Silhouette.of(np.zeros((120, 160), dtype=bool))]


@dataclass(frozen=True)
class Walk:
    """A tracker's task and observations, and the true motion."""

    task: Task
    observations: Sequence[Observation]
    motion: Motion

    def aligned(self) -> "Walk":
        """Return the walk with an unknown root translation."""
        observations = [
            replace(observation, translation=None) for observation in self.observations
        ]
        return replace(
            self,
            task=replace(self.task, translation="aligned"),
            observations=observations,
        )

    def hidden(self, first: int, last: int, *, usable: bool = False) -> "Walk":
        """Return the walk with empty silhouettes from frame `first` to before `last`."""
        observations = list(self.observations)
        for k in range(first, last):
            observations[k] = replace(observations[k], silhouettes=EMPTY, usable=usable)
        return replace(self, observations=observations)

    def track(
        self, first: int = 0, last: int | None = None, *, seed: int = 0, **settings: Any
    ) -> list[Frame]:
        """Return the frames of a track; fields of the task may be among the settings."""
        known = {
            name: settings.pop(name) for name in [*settings] if hasattr(self.task, name)
        }
        tracker = ExemplarTracker(replace(self.task, **known), **settings)
        return list(
            tracker.track(self.observations[first:last], np.random.default_rng(seed))
        )

    def errors_mm(self, frames: Sequence[Frame], first: int = 0) -> Array:
        """Return the mean distance of joints in each frame (T,), in millimetres."""
        skeleton = self.motion.skeleton
        truth = skeleton.joints(self.motion.poses, self.motion.translations)[
            first : first + len(frames)
        ]
        joints = skeleton.joints(
            np.array([frame.pose for frame in frames]),
            [frame.translation for frame in frames],
        )
        return np.asarray(1000.0 * np.linalg.norm(joints - truth, axis=-1).mean(axis=1))


def walk_of(
    motion: Motion, views: Sequence[float] = (45.0,), size: tuple[int, int] = (160, 120)
) -> Walk:
    """Return a walk before cameras, to be followed with other built-in motions as training."""
    scene = synthetic(motion, list(views), size, [], (None, None))
    training = [
        built_in.motion(name, frames=60) for name in ("walk-b", "walk-c", "run-b")
    ]
    yaw = float(motion.poses[0, 0])
    place = motion.translations[0]
    task = Task(
        Body.of(motion.skeleton),
        scene.cameras,
        BUDGET,
        yaw,
        place,
        fps=motion.fps,
        training=training,
    )
    return Walk(task, list(scene.observations), motion)


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """Multiply matrices in one thread, as a track does: on a busy machine more are ten times as slow."""
    with threadpool_limits(1):
        yield


@pytest.fixture(scope="session")
def walker() -> Walk:
    return walk_of(built_in.motion("walk-a", frames=24))


@pytest.fixture(scope="session")
def small() -> Exemplars:
    """Return the states of two short walks."""
    return Exemplars.of(
        [built_in.motion(name, frames=20) for name in ("walk-a", "walk-b")],
        average_skeleton(),
    )


@pytest.fixture(scope="session")
def two() -> Exemplars:
    """Return the states of a walk and a run."""
    return Exemplars.of(
        [built_in.motion("walk-a", frames=40), built_in.motion("run-a", frames=25)],
        average_skeleton(),
    )
