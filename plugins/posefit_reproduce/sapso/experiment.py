"""The experiments of the SAPSO paper's section 5: all runs.

| kind | runs |
|---|---|
| track | 100 frames, the first yaw known to 45 degrees. Table 2, figure 9 |
| unknown | the same with the first yaw unknown. Interpretation S17 |
| image | single frames from all around, unknown yaw. Section 5.3, table 1, figure 7 |
| hidden | the same with a part of the silhouette hidden. Figure 8 |
| first | searches of the first frame with several swarm sizes. Figure 6 |
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.evaluation.errors import nearest
from posefit.evaluation.measures import BASELINES
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.cameras import place_of
from posefit.footage.scene import Scene, with_corruption
from posefit.motion.motion import Motion
from posefit.tracking.defaults import completed
from posefit.tracking.front import track
from posefit.tracking.initialise import task_of
from posefit.tracking.method import prepare
from posefit.tracking.options import TrackOptions
from posefit.tracking.restarts import RESTARTS
from posefit_reproduce.experiment import Arrays, Run
from posefit_reproduce.sapso.methods import (
    LETTER,
    METHODS,
    OTHERS,
    OURS,
    PAPER,
    PARTS,
    TURNING,
)
from posefit_reproduce.sapso.motions import PaperMotion, paper_motions, paper_scene
from posefit_reproduce.sapso.paper import FRAMES, SWARMS

# section 5.2
PARTICLES = 40
ITERATIONS = 60
# strength of the occluder that hides a part of the silhouette, as in figure 8
OCCLUDER = 0.5
BOTH = (OURS, LETTER)
COMPARED = {
    "walk": (*PAPER, *OTHERS, *PARTS),
    "turn": (*PAPER, *OTHERS, *PARTS, *TURNING),
    "run": (*PAPER, *OTHERS, *PARTS),
}


@dataclass(frozen=True)
class Scale:
    """The size of the experiments.

    Single images use every other seed. On these SAPSO to the letter is eight times as
    slow, and uses only the first seed.
    """

    seeds: int = 10
    frames: int = FRAMES
    # degrees, of tracks and of single images
    views: tuple[float, ...] = (0.0, 45.0, 90.0)
    around: tuple[float, ...] = tuple(45.0 * k for k in range(8))
    iterations: int = ITERATIONS

    @property
    def runs(self) -> Iterator[Run]:
        """All runs, seed by seed, so that an interrupted experiment has whole seeds."""
        if self.seeds < 1:
            raise InputError(f"seeds must be at least 1, got {self.seeds}")
        for seed, motion in product(range(self.seeds), COMPARED):
            for view, method in product(self.views, (*COMPARED[motion], *BASELINES)):
                yield Run("track", motion, method, view, seed)
            if motion != "turn":
                for view, method in product(self.views, BOTH):
                    yield Run("first", motion, method, view, seed)
            if seed % 2:
                continue
            methods = (OURS,) if seed else BOTH
            for view, method in product(self.around, methods):
                yield Run("image", motion, method, view, seed)
            for kind, view, method in product(
                ("hidden", "unknown"), self.views, methods
            ):
                yield Run(kind, motion, method, view, seed)


@lru_cache(maxsize=2)
def loaded(clips: str | Path | None, frames: int) -> Mapping[str, PaperMotion]:
    """Return the motions of `paper_motions`, read once per process."""
    return paper_motions(clips, frames)


def perform(clips: str | Path | None, scale: Scale, run: Run) -> Arrays:
    """Return the arrays of a run.

    A first frame has the history of its costs. Other runs have poses (T, 66), and
    except for baselines CPU seconds and evaluations per frame.
    """
    motion = loaded(clips, scale.frames)[run.subject]
    if run.kind == "first":
        histories = []
        for count in SWARMS:
            histories.append(first_history(motion, scale.iterations, count, run))
        return {"history": np.array(histories)}
    scene = paper_scene(motion, run.view)
    if run.method in BASELINES:
        return {"poses": baseline(motion, scene, run.method)}
    if run.kind in ("track", "unknown"):
        frames = follow(scene, motion, scale, run)
    else:
        observations: Sequence[Observation] = scene.observations
        if run.kind == "hidden":
            observations = with_corruption(
                observations, {"occluder": OCCLUDER}, 0.0, run.seed
            )
        images = dict(enumerate(observations))
        frames = estimate_images(
            scene, images, motion.training, run.method, scale.iterations, run.seed
        )
    return {
        "poses": np.array([frame.pose for frame in frames]),
        "cpu_seconds": np.median([frame.cpu_seconds or 0.0 for frame in frames]),
        "evaluations": np.mean([frame.evaluations for frame in frames]),
    }


def options_of(
    name: str, training: Sequence[Motion], iterations: int
) -> dict[str, Any]:
    """Return the options of a method's tracks, with N (C + 1) evaluations per frame."""
    options = {
        "train": training,
        "evaluations": PARTICLES * (iterations + 1),
        **METHODS[name].options,
    }
    method = options["method"]
    if isinstance(method, tuple) and isinstance(method[1], type):
        learned = method[1]().fit(
            np.concatenate([motion.poses[:, 3:] for motion in training])
        )
        options["method"] = method[0], learned
    return options


def follow(scene: Scene, motion: PaperMotion, scale: Scale, run: Run) -> list[Frame]:
    """Track a motion with known translation. The first pose is searched.

    Its yaw is known to 45 degrees, or unknown.
    """
    options = options_of(run.method, motion.training, scale.iterations)
    if run.kind == "unknown":
        return track(
            replace(scene, yaw=None), restarts=RESTARTS, seed=run.seed, **options
        ).frames
    return track(scene, seed=run.seed, **options).frames


def estimate_images(
    scene: Scene,
    images: Mapping[int, Observation],
    training: Sequence[Motion],
    name: str,
    iterations: int,
    seed: int,
) -> list[Frame]:
    """Return the pose in each image, estimated alone from a full circle of yaws.

    Section 5.3. `images` are observations of the scene by frame number. `name` is a
    name of `METHODS`.
    """
    options = completed(
        TrackOptions(**options_of(name, training, iterations), seed=seed), scene.truth
    )
    task = replace(task_of(scene, options, training), yaw=None)  # Interpretation S17
    method = prepare(options, task)
    frames = list[Frame]()
    for k, image in images.items():
        anchor = image.translation
        if anchor is None:
            anchor = place_of(image.silhouettes, scene.cameras, scene.body.stature)
        frames += method.follow(
            replace(task, anchor=np.asarray(anchor)),
            [image],
            np.random.default_rng([seed, k]),
        )
    return frames


def baseline(motion: PaperMotion, scene: Scene, name: str) -> Array:
    """Return the poses (T, 66) of a baseline.

    It has the true root and translation, which no method has.
    """
    truth = motion.test.poses
    angles = motion.angles
    if name == "persistence":
        return np.tile(truth[0], (len(truth), 1))
    if name == "nearest":
        poses = []
        for k, image in enumerate(scene.observations):
            poses.append(nearest(scene, angles, k, image))
        return np.array(poses)
    return np.column_stack(
        [truth[:, :3], np.tile(angles.mean(axis=0), (len(truth), 1))]
    )


def first_history(
    motion: PaperMotion, iterations: int, particles: int, run: Run
) -> Array:
    """Return the lowest cost so far (iterations + 1,) in the first frame.

    There is a value after each population of a swarm.
    """
    options = options_of(run.method, motion.training, iterations)
    options["settings"] = {
        **options["settings"],
        f"{run.method.partition('@')[0]}.population_size": particles,
    }
    options |= {"evaluations": particles * (iterations + 1), "seed": run.seed}
    # figure 6 shows the first frame alone
    frame = track(paper_scene(motion, run.view, 1), **options).frames[0]
    evaluations, costs = frame.trace.T
    populations = particles * np.arange(1, iterations + 2)
    history: Array = costs[np.searchsorted(evaluations, populations, "right") - 1]
    return history
