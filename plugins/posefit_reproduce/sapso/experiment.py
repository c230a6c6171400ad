"""The experiments of the SAPSO paper's section 5: single images, tracks of three motions, first frames, baselines.

The tables need errors of single angles and frames, and the figures poses, which a sweep does not keep; so all are jobs.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.cameras import place_of
from posefit.footage.scene import Scene, with_corruption
from posefit.geometry.rotation import wrapped
from posefit.motion.motion import Motion
from posefit.tracking.evaluation import nearest
from posefit.tracking.front import track
from posefit.tracking.initialise import task_of
from posefit.tracking.measures import BASELINES
from posefit.tracking.method import prepare
from posefit.tracking.options import TrackOptions
from posefit.tracking.restarts import RESTARTS
from posefit_reproduce.jobs import Progress, check_seeds, each
from posefit_reproduce.sapso.design import COMPARED, DRIVEN, LETTER, OCCLUDER, OURS, WORKERS, Scale, settings_of
from posefit_reproduce.sapso.motions import PaperMotion, paper_scene


class TrackKey(NamedTuple):
    """Names a track."""

    motion: str
    method: str
    view: float
    seed: int


class ImageKey(NamedTuple):
    """Names the estimates of a motion's frames, each by itself; `hidden` where an occluder covers a part."""

    motion: str
    method: str
    view: float
    seed: int
    hidden: bool = False


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

    motions: dict[str, PaperMotion]
    scale: Scale
    seeds: int
    tracks: dict[TrackKey, PaperTrack] = field(repr=False)
    images: dict[ImageKey, PaperTrack] = field(repr=False)
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

    def free_errors(self, motion: str, name: str) -> Array:
        """Return the errors (8) in degrees over the angles that move alone, (views, seeds, T). Interpretation S18."""
        poses, test = self.poses(motion, name), self.motions[motion].test
        free = test.skeleton.free
        return np.array([[metrics.pose_error_degrees(test.poses, one, free) for one in view] for view in poses])

    def estimated(self, motion: str, name: str = OURS, hidden: bool = False) -> Array:
        """Return the poses of single images, (views, seeds, T, 66); of a baseline as in `poses`. Section 5.3."""
        if name in BASELINES:
            return self.poses(motion, name)
        keys = [ImageKey(motion, name, view, seed, hidden) for view, seed in self._pairs]
        poses = np.array([self.images[key].poses for key in keys])
        return poses.reshape(len(self.scale.views), self.seeds, *poses.shape[1:])

    def angle_errors(self, motion: str, name: str = OURS, hidden: bool = False) -> Array:
        """Return the absolute errors (views, seeds, T, 66) of each angle in degrees, of single images."""
        away = wrapped(self.estimated(motion, name, hidden) - self.motions[motion].test.poses)
        return np.asarray(np.degrees(np.abs(away)))


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
    jobs: dict[TrackKey | ImageKey | ViewKey | StartKey, Callable[[], PaperTrack | dict[str, Array] | Array]] = {}
    for motion, view, seed in product(motions, scale.views, range(seeds)):
        for method in COMPARED[motion]:
            key = TrackKey(motion, method, view, seed)
            jobs[key] = partial(follow_paper, motions[motion], key, scale)
    for motion, name, view, seed, hidden in product(motions, (OURS, LETTER), scale.views, range(seeds), (False, True)):
        image = ImageKey(motion, name, view, seed, hidden)
        jobs[image] = partial(estimate_paper, motions[motion], image, scale)
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
        {key: one for key, one in results.items() if isinstance(key, ImageKey) and isinstance(one, PaperTrack)},
        {key: one for key, one in results.items() if isinstance(key, ViewKey) and isinstance(one, dict)},
        {key: one for key, one in results.items() if isinstance(key, StartKey) and isinstance(one, np.ndarray)},
    )


def follow_paper(motion: PaperMotion, key: TrackKey, scale: Scale) -> PaperTrack:
    """Track a motion; the first pose is searched, from any yaw if it is unknown, and the translation is known."""
    results = track(
        paper_scene(motion, key.view, first_yaw=scale.first_yaw),
        restarts=RESTARTS if scale.first_yaw == "unknown" else None,
        train=motion.training,
        method=key.method,
        settings=settings_of(key.method),
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
    options = TrackOptions(method=name, settings=settings_of(name), iterations=iterations, seed=seed)
    task = replace(task_of(scene, options, training), yaw=None)  # Interpretation S17
    method, frames = prepare(options, task), list[Frame]()
    for k, image in images.items():
        known = image.translation
        anchor = place_of(image.silhouettes, scene.cameras, scene.body.stature) if known is None else np.asarray(known)
        tracker = method.tracker(replace(task, anchor=anchor))
        frames += tracker.track([image], np.random.default_rng([seed, k]))
    return frames


def estimate_paper(motion: PaperMotion, key: ImageKey, scale: Scale) -> PaperTrack:
    """Estimate the pose in each frame by itself; the translation is known. Section 5.3."""
    scene = paper_scene(motion, key.view)
    observations = scene.observations
    if key.hidden:
        observations = with_corruption(observations, {"occluder": OCCLUDER}, 0.0, key.seed)
    images = dict(enumerate(observations))
    frames = estimate_images(scene, images, motion.training, key.method, scale.iterations, key.seed)
    estimate = replace(motion.test, poses=np.array([frame.pose for frame in frames]))
    truth, joints = motion.test.joints, estimate.joints
    return PaperTrack(
        estimate.poses,
        float(np.mean([frame.seconds for frame in frames])),
        float(np.mean([frame.evaluations for frame in frames])),
        float(metrics.swapped(truth, joints).mean()),
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
    tracks = [
        track(
            scene,
            train=motion.training,
            method=OURS,
            population_size=count,
            iterations=scale.iterations,
            settings=DRIVEN,
            seed=seed,
        )
        for count in scale.swarms
    ]
    return np.array([one.estimates[0].history for one in tracks])
