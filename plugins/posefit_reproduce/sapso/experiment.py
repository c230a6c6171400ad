"""The experiments of the SAPSO paper's section 5: tracks of three motions, first frames, and baselines.

The tables need errors of single angles and frames, and the figures poses, which a sweep does not keep; so all are jobs.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.geometry.rotation import wrapped
from posefit.tracking.evaluation import nearest
from posefit.tracking.front import track
from posefit.tracking.measures import BASELINES
from posefit_reproduce.jobs import Progress, check_seeds, each
from posefit_reproduce.sapso.design import COMPARED, DRIVEN, METHODS, WORKERS, Scale
from posefit_reproduce.sapso.motions import PaperMotion, paper_scene


class TrackKey(NamedTuple):
    """Names a track."""

    motion: str
    method: str
    view: float
    seed: int


@dataclass(frozen=True, eq=False)
class PaperTrack:
    """A track and its figures."""

    poses: Array = field(repr=False)  # (T, 66)
    seconds: float  # a frame
    evaluations: float  # a frame
    swapped: float  # share of frames
    lost: float


@dataclass(frozen=True, eq=False)
class PaperResults:
    """All results, from which tables and figures are made."""

    motions: dict[str, PaperMotion]
    scale: Scale
    seeds: int
    tracks: dict[TrackKey, PaperTrack] = field(repr=False)
    baselines: dict[tuple[str, float], dict[str, Array]] = field(repr=False)  # poses (T, 66) of each baseline
    histories: dict[tuple[str, float, int], Array] = field(repr=False)  # (swarms, iterations + 1) lowest cost

    def of(self, motion: str, method: str) -> list[PaperTrack]:
        """Return the tracks of a method, view by view and seed by seed."""
        return [self.tracks[TrackKey(motion, method, view, seed)] for view, seed in self._pairs]

    @property
    def _pairs(self) -> list[tuple[float, int]]:
        return list(product(self.scale.views, range(self.seeds)))

    def poses(self, motion: str, name: str) -> Array:
        """Return what a method or a baseline makes of a motion, (views, seeds, T, 66)."""
        results = [
            self.baselines[motion, view][name]
            if name in BASELINES
            else self.tracks[TrackKey(motion, name, view, seed)].poses
            for view, seed in self._pairs
        ]
        return np.array(results).reshape(len(self.scale.views), self.seeds, *results[0].shape)

    def errors(self, motion: str, name: str) -> Array:
        """Return the errors (8) in degrees of a method or a baseline, (views, seeds, T)."""
        poses, truth = self.poses(motion, name), self.motions[motion].test.poses
        return np.array([[metrics.pose_error_degrees(truth, one) for one in view] for view in poses])

    def angle_errors(self, motion: str, name: str) -> Array:
        """Return the mean absolute error (66,) of each angle in degrees, over views, seeds and frames."""
        away = wrapped(self.poses(motion, name) - self.motions[motion].test.poses)
        return np.asarray(np.degrees(np.abs(away)).mean(axis=(0, 1, 2)))


class ViewKey(NamedTuple):
    """Key of a motion seen from a side."""

    motion: str
    view: float


class StartKey(NamedTuple):
    """Names searches of a motion's first frame."""

    motion: str
    view: float
    seed: int


def repeat_paper(
    motions: Mapping[str, PaperMotion],
    seeds: int,
    scale: Scale,
    workers: int = WORKERS,
    progress: Progress | None = None,
) -> PaperResults:
    """Return what the experiments give on the motions of `paper_motions`, from so many processes.

    Raises ValueError where `seeds` is no positive number.
    """
    check_seeds(seeds)
    jobs: dict[TrackKey | ViewKey | StartKey, Callable[[], PaperTrack | dict[str, Array] | Array]] = {}
    for motion, view, seed in product(motions, scale.views, range(seeds)):
        for method in COMPARED[motion]:
            key = TrackKey(motion, method, view, seed)
            jobs[key] = partial(follow_paper, motions[motion], key, scale)
    for motion, view in product(motions, scale.views):
        jobs[ViewKey(motion, view)] = partial(baseline_poses, motions[motion], view)
    for motion, view, seed in product(("walk", "run"), scale.views, range(seeds)):
        jobs[StartKey(motion, view, seed)] = partial(converge, motions[motion], scale, view, seed)
    results = each(jobs, workers, progress)
    return PaperResults(
        dict(motions),
        scale,
        seeds,
        {key: one for key, one in results.items() if isinstance(key, TrackKey) and isinstance(one, PaperTrack)},
        {key: one for key, one in results.items() if isinstance(key, ViewKey) and isinstance(one, dict)},
        {key: one for key, one in results.items() if isinstance(key, StartKey) and isinstance(one, np.ndarray)},
    )


def follow_paper(motion: PaperMotion, key: TrackKey, scale: Scale) -> PaperTrack:
    """Follow a motion with a method; the first pose is searched, the root's translation is known."""
    method = METHODS[key.method]
    results = track(
        paper_scene(motion, key.view),
        train=motion.training,
        method=f"{method.optimiser}@{method.prior}",
        settings={**{f"{method.prior}.{name}": value for name, value in method.prior_settings.items()}, **DRIVEN},
        iterations=scale.iterations,
        seed=key.seed,
    )
    summary = results.summary
    return PaperTrack(
        results.motion.poses,
        summary["seconds_per_frame"],
        summary["evaluations"] / summary["frames"],
        summary["swap_rate"],
        summary["lost_rate"],
    )


def baseline_poses(motion: PaperMotion, view: float) -> dict[str, Array]:
    """Return the poses (T, 66) of each baseline, all with the true root and translation, which no method has."""
    truth, angles, scene = motion.test.poses, motion.angles, paper_scene(motion, view)
    mean = np.column_stack([truth[:, :3], np.tile(angles.mean(axis=0), (len(truth), 1))])
    held = np.tile(truth[0], (len(truth), 1))
    best = np.array([nearest(scene, angles, k, seen) for k, seen in enumerate(scene.observations)])
    return {"mean_pose": mean, "persistence": held, "nearest": best}


def converge(motion: PaperMotion, scale: Scale, view: float, seed: int) -> Array:
    """Return the lowest cost after each iteration (swarms, iterations + 1) in the first frame, for each N."""
    scene = paper_scene(motion, view, (0, 1))
    tracks = [
        track(
            scene,
            train=motion.training,
            population_size=count,
            iterations=scale.iterations,
            settings=DRIVEN,
            seed=seed,
        )
        for count in scale.swarms
    ]
    return np.array([one.estimates[0].history for one in tracks])
