"""The experiments of the SAPSO paper's section 5: single images, tracks of three motions, first frames, baselines.

The tables need errors of single angles and frames, and the figures poses, which a sweep does not keep; so all are jobs.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import Any, Literal, NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.evaluation.errors import nearest
from posefit.evaluation.measures import BASELINES
from posefit.fitting import metrics
from posefit.fitting.space import SearchSpace
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.cameras import place_of
from posefit.footage.scene import Scene, with_corruption
from posefit.geometry.rotation import wrapped
from posefit.motion.motion import Motion
from posefit.tracking.front import track
from posefit.tracking.initialise import task_of
from posefit.tracking.method import prepare
from posefit.tracking.options import TrackOptions
from posefit.tracking.restarts import RESTARTS
from posefit.uncertainty.modes import nearer_mirrored
from posefit_reproduce.jobs import Progress, check_seeds, each
from posefit_reproduce.sapso.motions import PaperMotion, paper_scene
from posefit_reproduce.sapso.paper import (
    COMPARED,
    DRIVEN,
    LETTER,
    OCCLUDER,
    OURS,
    WORKERS,
    Scale,
    settings_of,
)
from posefit_swarm.sapso import SAPSO

PARTICLES = 40  # N, section 5.2

# a motion tracked; its frames each by itself, and with a part hidden; what needs no search; searches of its first frame
Kind = Literal["tracked", "images", "hidden", "baselines", "first frame"]


class Run(NamedTuple):
    """Names what is run."""

    kind: Kind
    motion: str
    view: float
    seed: int = 0
    method: str = ""


@dataclass(frozen=True, eq=False)
class PaperTrack:
    """Poses of a motion's frames, tracked or each by itself, and their figures."""

    poses: Array = field(repr=False)  # (T, 66)
    seconds: float  # a frame
    evaluations: float  # a frame
    swapped: float  # share of frames
    lost: float


@dataclass(frozen=True, eq=False)
class PaperResults:
    """All results, from which tables and figures are made."""

    motions: Mapping[str, PaperMotion]
    scale: Scale
    seeds: int
    # a `PaperTrack` where poses are estimated, by name the poses (T, 66) of baselines, and of first frames the lowest
    # costs (swarms, iterations + 1)
    runs: Mapping[Run, Any] = field(repr=False)

    def of(self, motion: str, method: str = "", kind: Kind = "tracked") -> list[Any]:
        """Return the results of a method, view by view and seed by seed."""
        return [
            self.runs[Run(kind, motion, view, seed, method)]
            for view, seed in product(self.scale.views, range(self.seeds))
        ]

    def poses(self, motion: str, name: str = OURS, kind: Kind = "tracked") -> Array:
        """Return what a method or a baseline makes of a motion, (views, seeds, T, 66)."""
        if name in BASELINES:
            poses = [self.runs[Run("baselines", motion, view)][name] for view in self.scale.views]
            return np.repeat(np.array(poses)[:, None], self.seeds, axis=1)
        results = np.array([result.poses for result in self.of(motion, name, kind)])
        return results.reshape(len(self.scale.views), self.seeds, *results.shape[1:])

    def errors(self, motion: str, name: str, free: bool = False) -> Array:
        """Return the errors (8) in degrees of a method or a baseline, (views, seeds, T).

        Those of all angles, or of the `free` ones that move. Interpretation S18.
        """
        test = self.motions[motion].test
        chosen = test.skeleton.free if free else None
        poses = self.poses(motion, name)
        return np.array([[metrics.pose_error_degrees(test.poses, one, chosen) for one in view] for view in poses])

    def angle_errors(self, motion: str, name: str = OURS, kind: Kind = "images") -> Array:
        """Return the absolute errors (views, seeds, T, 66) of each angle in degrees. Section 5.3."""
        away = wrapped(self.poses(motion, name, kind) - self.motions[motion].test.poses)
        return np.asarray(np.degrees(np.abs(away)))


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
    jobs: dict[Run, Callable[[], Any]] = {}
    for (name, motion), view in product(motions.items(), scale.views):
        jobs[Run("baselines", name, view)] = partial(baseline_poses, motion, view)
        for seed in range(seeds):
            runs = [Run("tracked", name, view, seed, method) for method in COMPARED[name]]
            jobs |= {run: partial(follow_paper, motion, run, scale) for run in runs}
            images: tuple[Kind, ...] = ("images", "hidden")
            runs = [Run(kind, name, view, seed, method) for kind, method in product(images, (OURS, LETTER))]
            jobs |= {run: partial(estimate_paper, motion, run, scale) for run in runs}
            if name in ("walk", "run"):
                jobs[Run("first frame", name, view, seed)] = partial(converge, motion, scale, view, seed)
    return PaperResults(motions, scale, seeds, each(jobs, workers, progress))


def follow_paper(motion: PaperMotion, run: Run, scale: Scale) -> PaperTrack:
    """Track a motion; the first pose is searched, from any yaw if it is unknown, and the translation is known."""
    results = track(
        paper_scene(motion, run.view, first_yaw=scale.first_yaw),
        restarts=RESTARTS if scale.first_yaw == "unknown" else None,
        train=motion.training,
        method=run.method,
        settings=settings_of(run.method),
        evaluations=PARTICLES * (scale.iterations + 1),
        seed=run.seed,
    )
    summary = results.summary
    evaluations = summary["evaluations"] / summary["frames"]
    shares = summary["swap_rate"], summary["lost_rate"]
    return PaperTrack(results.motion.poses, summary["seconds_per_frame"], evaluations, *shares)


def estimate_images(
    scene: Scene,
    images: Mapping[int, Observation],
    training: Sequence[Motion],
    name: str,
    iterations: int,
    seed: int,
) -> list[Frame]:
    """Return the pose in each image by itself, whichever way the person faces: a full circle of yaws. Section 5.3.

    `images` are observations of the scene by their frames' numbers; a method is run that `METHODS` names.
    """
    options = TrackOptions(method=name, settings=settings_of(name), evaluations=PARTICLES * (iterations + 1), seed=seed)
    task = replace(task_of(scene, options, training), yaw=None)  # Interpretation S17
    method, frames = prepare(options, task), list[Frame]()
    for k, image in images.items():
        known = image.translation
        anchor = place_of(image.silhouettes, scene.cameras, scene.body.stature) if known is None else np.asarray(known)
        frames += method.follow(replace(task, anchor=anchor), [image], np.random.default_rng([seed, k]))
    return frames


def estimate_paper(motion: PaperMotion, run: Run, scale: Scale) -> PaperTrack:
    """Estimate the pose in each frame by itself; the translation is known. Section 5.3."""
    scene = paper_scene(motion, run.view)
    observations = scene.observations
    if run.kind == "hidden":
        observations = with_corruption(observations, {"occluder": OCCLUDER}, 0.0, run.seed)
    images = dict(enumerate(observations))
    frames = estimate_images(scene, images, motion.training, run.method, scale.iterations, run.seed)
    estimate = replace(motion.test, poses=np.array([frame.pose for frame in frames]))
    truth, joints = motion.test.joints, estimate.joints
    return PaperTrack(
        estimate.poses,
        float(np.mean([frame.seconds for frame in frames])),
        float(np.mean([frame.evaluations for frame in frames])),
        float(nearer_mirrored(truth, joints).mean()),
        float((metrics.mpjpe_mm(truth, joints) > metrics.LOST_MM).mean()),
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
    scene = paper_scene(motion, view, (0, 1), scale.first_yaw)
    return np.array(
        [_first_frame(scene, motion, scale, count, seed, method=OURS).trace[:, 1] for count in scale.swarms]
    )


def _first_frame(scene: Scene, motion: PaperMotion, scale: Scale, particles: int, seed: int, **method: Any) -> Frame:
    """Return what a method makes of a scene of one frame."""
    chosen = method["method"]
    name = OURS.partition("@")[0] if isinstance(chosen, str) else chosen[0].__name__
    settings = {**DRIVEN, f"{name}.population_size": particles}
    how: dict[str, Any] = {"settings": settings, "evaluations": particles * (scale.iterations + 1), "seed": seed}
    return track(scene, train=motion.training, **how, **method).frames[0]


@dataclass(frozen=True, eq=False)
class WatchedSwarm:
    """A swarm in the first frame, from iteration to iteration."""

    scene: Scene
    poses: Sequence[Array] = field(repr=False)  # of each iteration (n, 66)
    translations: Sequence[Array] = field(repr=False)  # of each iteration (n, 3)
    best: Sequence[int]  # of each iteration, the proposal of lowest cost
    history: Array = field(repr=False)  # (iterations + 1,) lowest cost so far


def watched_swarm(motion: PaperMotion, scale: Scale, particles: int, seed: int = 0) -> WatchedSwarm:
    """Return the proposals of SAPSO in the first frame."""
    scene = paper_scene(motion, scale.shown, (0, 1), scale.first_yaw)

    class Watched(SAPSO):
        def __init__(
            self, space: SearchSpace, rng: np.random.Generator, *, population_size: int, iterations: int
        ) -> None:
            super().__init__(space, rng, population_size=population_size, iterations=iterations)
            self.decoded: list[tuple[Array, Array]] = []
            self.cheapest: list[int] = []
            self.searched = space
            searches.append(self)

        def tell(self, proposals: Array, costs: Array) -> None:
            self.decoded.append(self.searched.decode(proposals))
            self.cheapest.append(int(np.argmin(costs)))
            super().tell(proposals, costs)

    searches: list[Watched] = []
    frame = _first_frame(scene, motion, scale, particles, seed, method=(Watched, "pca"))
    search = searches[-1]  # the one before it only compiles
    poses, translations = zip(*search.decoded, strict=True)
    return WatchedSwarm(scene, poses, translations, search.cheapest, frame.trace[:, 1])
