"""The experiments of the SAPSO paper's section 5: tracks of three motions, first frames, and what anybody reaches.

The tables need errors of single angles and of single frames, and the figures poses; the motions begin after a clip's
first frame, and one is bent on purpose. A cell's row holds none of it, so all of them are jobs; see
`posefit_reproduce.grid`.
"""

from collections.abc import Callable, Mapping
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.tracking.evaluation import nearest
from posefit.tracking.front import track
from posefit_reproduce.grid import Progress, check_seeds, each
from posefit_reproduce.sapso.design import COMPARED, DRIVEN, METHODS, WORKERS, Scale
from posefit_reproduce.sapso.motions import PaperMotion, paper_scene
from posefit_reproduce.sapso.results import PaperResults, PaperTrack, TrackKey


class ViewKey(NamedTuple):
    """Names what is seen of a motion."""

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
    found = each(jobs, workers, progress)
    return PaperResults(
        dict(motions),
        scale,
        seeds,
        {key: one for key, one in found.items() if isinstance(key, TrackKey) and isinstance(one, PaperTrack)},
        {key: one for key, one in found.items() if isinstance(key, ViewKey) and isinstance(one, dict)},
        {key: one for key, one in found.items() if isinstance(key, StartKey) and isinstance(one, np.ndarray)},
    )


def follow_paper(motion: PaperMotion, key: TrackKey, scale: Scale) -> PaperTrack:
    """Follow a motion with a method; the first pose is searched, the root's translation is known."""
    method = METHODS[key.method]
    found = track(
        paper_scene(motion, key.view),
        train=motion.training,
        method=f"{method.optimiser}@{method.prior}",
        settings={**{f"{method.prior}.{name}": value for name, value in method.prior_settings.items()}, **DRIVEN},
        iterations=scale.iterations,
        seed=key.seed,
    )
    said = found.summary
    return PaperTrack(
        found.motion.poses,
        said["seconds_per_frame"],
        said["evaluations"] / said["frames"],
        said["swap_rate"],
        said["lost_rate"],
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
    return np.array([one.found[0].history for one in tracks])
