"""Clips to learn from, and a walk to follow that is none of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.footage.scene import synthetic
from posefit.geometry.body import Body
from posefit.motion import built_in
from posefit.motion.built_in import average_skeleton
from posefit.motion.motion import Motion
from posefit.silhouette.mask import Silhouette
from posefit_exemplars.exemplars import Exemplars

BUDGET = 1000
EMPTY = [Silhouette.of(np.zeros((120, 160), dtype=bool))]


@dataclass(frozen=True)
class Walk:
    """What a tracker is told, what it sees, and what is true."""

    task: Task
    seen: Sequence[Observation]
    motion: Motion

    def told(self, **known: object) -> Task:
        """Return the task, told something else."""
        return replace(self.task, **known)  # type: ignore[arg-type]

    def off(self, frames: Sequence[Frame], first: int = 0) -> Array:
        """Return the mean distance of joints in each frame (T,), in millimetres."""
        skeleton = self.motion.skeleton
        true = skeleton.joints(self.motion.poses, self.motion.translations)[first : first + len(frames)]
        poses, places = (np.array([getattr(frame, name) for frame in frames]) for name in ("pose", "translation"))
        return np.asarray(1000.0 * np.linalg.norm(skeleton.joints(poses, places) - true, axis=-1).mean(axis=1))


def walk_of(motion: Motion, views: Sequence[float] = (45.0,), size: tuple[int, int] = (160, 120)) -> Walk:
    """Return a walk as cameras see it, to be followed by what other built-in motions teach."""
    scene = synthetic(motion, list(views), size, [], (None, None))
    training = [built_in.motion(name, frames=60) for name in ("walk-b", "walk-c", "run-b")]
    task = Task(
        Body.of(motion.skeleton),
        scene.cameras,
        BUDGET,
        float(motion.poses[0, 0]),
        motion.translations[0],
        fps=motion.fps,
        training=training,
    )
    return Walk(task, list(scene.observations), motion)


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """Have matrices multiplied by one thread, as a track has them: on a busy machine more are ten times as slow."""
    with threadpool_limits(1):
        yield


@pytest.fixture(scope="session")
def walker() -> Walk:
    return walk_of(built_in.motion("walk-a", frames=24))


@pytest.fixture(scope="session")
def small() -> Exemplars:
    """Return the states of two short walks."""
    return Exemplars.of([built_in.motion(name, frames=20) for name in ("walk-a", "walk-b")], average_skeleton())


@pytest.fixture(scope="session")
def two() -> Exemplars:
    """Return the states of a walk and a run."""
    return Exemplars.of([built_in.motion("walk-a", frames=40), built_in.motion("run-a", frames=25)], average_skeleton())
