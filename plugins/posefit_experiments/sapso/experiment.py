"""The experiments of the SAPSO paper's section 5: tracks of three motions, first frames, and what anybody reaches."""

import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from multiprocessing import get_context
from typing import Any, NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.fitting.prior import Prior
from posefit.footage.scene import Scene, synthetic
from posefit.geometry.rotation import wrapped
from posefit.registry import registry
from posefit.tracking.evaluation import nearest
from posefit.tracking.front import track
from posefit.tracking.method import ITERATIONS
from posefit.tracking.synthetic import SIZE
from posefit_experiments.sapso.motions import Case
from posefit_experiments.sapso.numbers import FRAMES

WORKERS = 2
Progress = Callable[[Iterator[Any], int], Iterator[Any]]


class Method(NamedTuple):
    """What is compared: an optimiser in a space."""

    label: str
    optimiser: str
    prior: str
    prior_settings: dict[str, Any]


_FULL = ("full", {"limits": "training"})  # constraint 1 on all angles; the files' joint limits alone are far wider
METHODS = {
    "particle@full": Method("PF", "particle", *_FULL),
    "sapso@full": Method("SAPSO", "sapso", *_FULL),
    "sapso@pca": Method("PCA + SAPSO", "sapso", "pca", {}),
    "pso@pca": Method("PCA + PSO", "pso", "pca", {}),
    "particle@pca": Method("PCA + PF", "particle", "pca", {}),
}
PAPER = ("particle@full", "sapso@full", "sapso@pca")
COMPARED = {"walk": tuple(METHODS), "turn": ("sapso@pca",), "run": tuple(METHODS)}
BASELINES = {
    "mean_pose": "mean training pose",
    "persistence": "first true pose, held",
    "nearest": "best training pose",
}


@dataclass(frozen=True)
class Scale:
    """How much of the paper's experiments is run."""

    frames: int = FRAMES
    views: tuple[float, ...] = (0.0, 45.0, 90.0)
    iterations: int = ITERATIONS
    swarms: tuple[int, ...] = (20, 40, 60, 100)  # N of figure 6

    @property
    def shown(self) -> float:
        """The view of table 1 and of figure 5, the middle one."""
        return self.views[len(self.views) // 2]


QUICK = Scale(frames=30, views=(45.0,))


class Cell(NamedTuple):
    """A track."""

    case: str
    method: str
    view: float
    seed: int


@dataclass(frozen=True, eq=False)
class Run:
    """What a track found."""

    poses: Array = field(repr=False)  # (T, 66)
    seconds: float  # a frame
    evaluations: float  # a frame
    swapped: float  # share of frames
    lost: float


@dataclass(frozen=True, eq=False)
class Results:
    """Everything that was found, from which tables and figures are made."""

    cases: dict[str, Case]
    scale: Scale
    seeds: int
    runs: dict[Cell, Run] = field(repr=False)
    baselines: dict[tuple[str, float], dict[str, Array]] = field(repr=False)  # poses (T, 66) of each baseline
    histories: dict[tuple[str, float, int], Array] = field(repr=False)  # (swarms, iterations + 1) lowest cost

    def of(self, case: str, method: str) -> list[Run]:
        """Return the runs of a method, view by view and seed by seed."""
        return [self.runs[Cell(case, method, view, seed)] for view, seed in self._pairs]

    @property
    def _pairs(self) -> list[tuple[float, int]]:
        return list(product(self.scale.views, range(self.seeds)))

    def poses(self, case: str, name: str) -> Array:
        """Return what a method or a baseline makes of a motion, (views, seeds, T, 66)."""
        found = [
            self.baselines[case, view][name] if name in BASELINES else self.runs[Cell(case, name, view, seed)].poses
            for view, seed in self._pairs
        ]
        return np.array(found).reshape(len(self.scale.views), self.seeds, *found[0].shape)

    def errors(self, case: str, name: str) -> Array:
        """Return the errors (8) in degrees of a method or a baseline, (views, seeds, T)."""
        poses, truth = self.poses(case, name), self.cases[case].test.poses
        return np.array([[metrics.pose_error_degrees(truth, one) for one in view] for view in poses])

    def angle_errors(self, case: str, name: str) -> Array:
        """Return the mean absolute error (66,) of each angle in degrees, over views, seeds and frames."""
        away = wrapped(self.poses(case, name) - self.cases[case].test.poses)
        return np.asarray(np.degrees(np.abs(away)).mean(axis=(0, 1, 2)))


def reproduce(made: dict[str, Case], seeds: int, scale: Scale, progress: Progress | None = None) -> Results:
    """Return what the experiments give on the motions of `cases`, from two processes.

    Raises ValueError where `seeds` is no positive number.
    """
    if seeds < 1:
        raise ValueError(f"seeds must be at least 1, got {seeds}")
    tracks = [
        Cell(case, method, view, seed)
        for case, view, seed in product(made, scale.views, range(seeds))
        for method in COMPARED[case]
    ]
    seen = list(product(made, scale.views))
    starts = list(product(("walk", "run"), scale.views, range(seeds)))
    jobs: list[Callable[[], Any]] = [
        *(partial(follow, made[one.case], one, scale) for one in tracks),
        *(partial(baselines, made[case], view) for case, view in seen),
        *(partial(converge, made[case], scale, view, seed) for case, view, seed in starts),
    ]
    # Ctrl-C reaches every process; here it ends the whole, and the workers go quietly after their last run
    pool = ProcessPoolExecutor(WORKERS, get_context("spawn"), signal.signal, (signal.SIGINT, signal.SIG_IGN))
    try:
        coming = pool.map(_call, jobs)
        found = list(progress(coming, len(jobs)) if progress else coming)
    finally:
        pool.shutdown(cancel_futures=True)
    first, second = len(tracks), len(tracks) + len(seen)
    return Results(
        made,
        scale,
        seeds,
        dict(zip(tracks, found[:first], strict=True)),
        dict(zip(seen, found[first:second], strict=True)),
        dict(zip(starts, found[second:], strict=True)),
    )


def _call(job: Callable[[], Any]) -> Any:
    return job()


def scene_of(case: Case, view: float, frames: tuple[int | None, int | None] = (None, None)) -> Scene:
    """Return a motion as a camera sees it."""
    return synthetic(case.test, [view], SIZE, [], frames)


def follow(case: Case, cell: Cell, scale: Scale) -> Run:
    """Follow a motion with a method; the first pose is searched, the root's translation is known."""
    method = METHODS[cell.method]
    found = track(
        scene_of(case, cell.view),
        train=case.training,
        optimiser=method.optimiser,
        prior=method.prior,
        prior_settings=method.prior_settings,
        iterations=scale.iterations,
        seed=cell.seed,
    )
    said = found.summary
    return Run(
        found.motion.poses,
        said["seconds_per_frame"],
        said["evaluations"] / said["frames"],
        said["swap_rate"],
        said["lost_rate"],
    )


def baselines(case: Case, view: float) -> dict[str, Array]:
    """Return the poses (T, 66) of each baseline, all with the true root and translation, which no method has."""
    truth, angles, scene = case.test.poses, case.angles, scene_of(case, view)
    mean = np.column_stack([truth[:, :3], np.tile(angles.mean(axis=0), (len(truth), 1))])
    held = np.tile(truth[0], (len(truth), 1))
    best = np.array([nearest(scene, angles, k, seen) for k, seen in enumerate(scene.observations)])
    return {"mean_pose": mean, "persistence": held, "nearest": best}


def converge(case: Case, scale: Scale, view: float, seed: int) -> Array:
    """Return the lowest cost after each iteration (swarms, iterations + 1) in the first frame, for each N."""
    scene = scene_of(case, view, (0, 1))
    histories = [
        track(scene, train=case.training, particles=count, iterations=scale.iterations, seed=seed).found[0].history
        for count in scale.swarms
    ]
    return np.array(histories)


def compact(case: Case) -> Any:
    """Return the compact space of a motion: a fitted `pca`."""
    prior: Prior = registry().prior("pca")()
    return prior.fit(case.angles)


@dataclass(frozen=True, eq=False)
class Swarm:
    """A swarm in the first frame, from iteration to iteration."""

    scene: Scene
    poses: Sequence[Array] = field(repr=False)  # of each iteration (n, 66)
    translations: Sequence[Array] = field(repr=False)  # of each iteration (n, 3)
    best: Sequence[int]  # of each iteration, the proposal of lowest cost
    history: Array = field(repr=False)  # (iterations + 1,) lowest cost so far


def swarm(case: Case, scale: Scale, particles: int, seed: int = 0) -> Swarm:
    """Return the proposals of SAPSO in the first frame."""
    scene = scene_of(case, scale.shown, (0, 1))
    spaces: list[Any] = []
    asked: list[Array] = []
    best: list[int] = []
    make = registry().optimiser("sapso")

    class Watched:
        def __init__(self, space: Any, rng: np.random.Generator, *, particles: int, iterations: int) -> None:
            self._optimiser = make(space, rng, particles=particles, iterations=iterations)
            asked.clear()  # so that the last search stays alone; the one before it only compiles
            best.clear()
            spaces.append(space)

        def ask(self) -> Array:
            proposals = self._optimiser.ask()
            if len(proposals):
                asked.append(proposals)
            return proposals

        def tell(self, proposals: Array, costs: Array) -> None:
            best.append(int(np.argmin(costs)))
            self._optimiser.tell(proposals, costs)

    found = track(
        scene,
        optimiser=Watched,
        optimiser_settings={"particles": particles},
        train=case.training,
        particles=particles,
        iterations=scale.iterations,
        seed=seed,
    )
    decoded = [spaces[-1].decode(proposals) for proposals in asked]
    return Swarm(scene, [one[0] for one in decoded], [one[1] for one in decoded], best, found.found[0].history)
