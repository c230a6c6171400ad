"""What a search gains that begins where a silhouette points, on people whom nothing was learned from.

    python docs/studies/starts.py look
    python docs/studies/starts.py evaluations
    python docs/studies/starts.py images

Every image shows a pose of a recorded clip at any yaw; the person's clips are left out of what the look-up and the
prior learn from. A camera stands 3.5 to 5 metres away; the person is up to 0.8 metres off its axis, and only their
height is known. `look` counts how many modes it takes until one faces as the person does, and how far the pose of the
best is off. `evaluations` follows the best cost of a search, blind and from the start. `images` fits single images.
Intervals are bootstraps of the mean over clips, 95 %.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import click
import numpy as np

import posefit
from clips import GROUPS, WALKS, Clip
from posefit.arrays import Array
from posefit.fitting.space import SearchSpace
from posefit.fitting.start import modes_apart, start_in
from posefit.fitting.tracker import Observation, Task
from posefit.geometry.rotation import wrapped
from posefit.motion import recorded
from posefit.motion.built_in import average_skeleton
from posefit.motion.clips import training_clips, training_motions
from posefit.motion.motion import Motion
from posefit.progress import QUIET
from posefit.silhouette.corruption import corrupted
from posefit_exemplars.lookup import Lookup

SIZE, FOCAL = (320, 240), 260.0
DAMAGE = {"holes": 0.3, "blobs": 0.3, "jitter": 0.3}
MODES = (1, 2, 3, 8)
MARKS = (40, 80, 200, 400, 800, 2440)  # evaluations
RIGHT_DEGREES, WRONG_DEGREES, LOST_MM = 45.0, 60.0, 150.0
METHODS = ("sapso@pca", "cma@loose", "exemplars")


@dataclass(frozen=True)
class Image:
    """A mask and what it shows."""

    clip: Clip
    camera: posefit.Camera
    body: posefit.Body
    pose: Array
    mask: Array

    def error_mm(self, joints: Array) -> float:
        """Return the mean distance of joints (27, 3), roots at one point."""
        truth = self.body.skeleton.joints(self.pose[None])[0]
        return float(1000.0 * np.linalg.norm((joints - joints[0]) - (truth - truth[0]), axis=1).mean())

    def turned_degrees(self, yaw: float) -> float:
        """Return how far a yaw is off."""
        return float(np.degrees(np.abs(wrapped(np.array([yaw - self.pose[0]]))[0])))


def images(groups: tuple[str, ...], each: int, damaged: bool = False) -> Iterator[Image]:
    """Yield so many images of each clip of some groups."""
    rng = np.random.default_rng(61)
    for clip in (clip for group in groups for clip in GROUPS[group]):
        motion = recorded.clip(clip.name).motion()
        body = posefit.Body.of(motion.skeleton)
        for _ in range(each):
            pose = motion.poses[rng.integers(len(motion))].copy()
            pose[0] = rng.uniform(-np.pi, np.pi)
            away = np.array([rng.uniform(-0.8, 0.8), 0.0, rng.uniform(3.5, 5.0)])
            camera = posefit.Camera(*SIZE, np.full(2, FOCAL), np.array(SIZE) / 2.0, np.diag([1.0, -1.0, -1.0]), away)
            place = -motion.skeleton.joints(pose[None])[0].mean(axis=0)
            mask = posefit.project(body, camera, pose, place)
            yield Image(clip, camera, body, pose, corrupted(mask, DAMAGE, rng) if damaged else mask)


def training_of(clip: Clip, only: str = "") -> list[Motion]:
    """Return the motions of all other people, or those of one group."""
    names = [each.name for each in GROUPS.get(only, ()) if each.subject != clip.subject] or [clip.library]
    return training_motions(training_clips(names), 30.0)


def task_of(image: Image, training: list[Motion]) -> Task:
    """Return the task of an image: the average body of the person's height, and no more."""
    average = posefit.Body.of(average_skeleton())
    share = image.body.stature / average.stature
    return Task(
        average.scaled(share, share), [image.camera], MARKS[-1], None, np.zeros(3), "aligned", training=training
    )


def interval(values: list[float], clips: list[str]) -> str:
    """Return a mean and its interval."""
    rng, array, names = np.random.default_rng(0), np.array(values), np.unique(clips)
    means = [array[np.isin(clips, [name])].mean() for name in names]
    drawn = np.array(means)[rng.integers(0, len(means), (2000, len(means)))].mean(axis=1)
    low, high = np.quantile(drawn, [0.025, 0.975])
    return f"{array.mean():.3g} ({low:.3g} to {high:.3g})"


@click.group()
def main() -> None:
    """Measure starts."""


@main.command()
@click.option("--each", default=4, help="Images of a clip.")
@click.option("--damaged", is_flag=True)
def look(each: int, damaged: bool) -> None:
    """Print how many modes it takes until one is right, by group, and how reliable their weights are."""
    print("| group | images | facing within 45 degrees: 1 | 2 | 3 | 8 modes | mm of the best of 1 | 2 | 3 | 8 | none |")
    weights, firsts = list[float](), list[float]()
    for group in GROUPS:
        right, errors, names, refused = [], [], [], 0
        for image in images((group,), each, damaged):
            task = task_of(image, training_of(image.clip))
            posterior = Lookup(task).posterior(Observation([posefit.Silhouette.of(image.mask)]))
            if posterior is None:
                refused += 1
                continue
            modes = modes_apart(task.body.skeleton, posterior)
            poses = [mode.poses[0] for _, mode in modes]
            turned = np.array([image.turned_degrees(pose[0]) for pose in poses])
            off = np.array([image.error_mm(task.body.skeleton.joints(pose[None])[0]) for pose in poses])
            right.append([100.0 * (turned[:count].min() <= RIGHT_DEGREES) for count in MODES])
            errors.append([off[:count].min() for count in MODES])
            names.append(image.clip.name)
            weights.append(modes[0][0])
            firsts.append(float(turned[0] <= RIGHT_DEGREES))
        columns = [interval(list(column), names) for table in (right, errors) for column in zip(*table, strict=True)]
        print(f"| {group} | {len(names)} | {' | '.join(columns)} | {refused} |", flush=True)
    order = np.argsort(weights)
    for part in np.array_split(order, 4):
        said, was = np.mean(np.array(weights)[part]), np.mean(np.array(firsts)[part])
        print(f"weight of the first mode {said:.2f}: it faces right in {was:.2f} of {len(part)}")


@main.command()
@click.option("--each", default=3, help="Images of a clip.")
def evaluations(each: int) -> None:
    """Print the mean of the best cost after so many evaluations, all yaws searched, blind and from the start."""
    print("| motions | search | " + " | ".join(map(str, MARKS)) + " |")
    for name, groups in (("walks", (WALKS,)), ("all", tuple(GROUPS))):
        costs: dict[str, list[Array]] = {}
        priors: dict[str, Any] = {}
        names = list[str]()
        for seed, image in enumerate(images(groups, each if name == "walks" else 1)):
            training = training_of(image.clip, WALKS if name == "walks" else "")
            task = task_of(image, training)
            if image.clip.subject not in priors:
                priors[image.clip.subject] = posefit.prior("pca")().fit(task.angles, task.body.skeleton)
            reach = np.radians([180.0, 15.0, 15.0])
            space = SearchSpace(priors[image.clip.subject], np.zeros(3), reach, np.zeros(3), "aligned")
            observation = Observation([posefit.Silhouette.of(image.mask)])
            posterior = Lookup(task).posterior(observation)
            spaces = {"blind": space, "from the start": space}
            if posterior is not None:
                problem = posefit.PoseProblem(task.body, task.cameras, observation.silhouettes, space)
                start = start_in(problem, modes_apart(task.body.skeleton, posterior))
                spaces["from the start"] = replace(space, start=start)
            names.append(image.clip.name)
            for optimiser in ("sapso", "cma"):
                for kind, searched in spaces.items():
                    problem = posefit.PoseProblem(task.body, task.cameras, observation.silhouettes, searched)
                    made = posefit.optimiser(optimiser)(searched, np.random.default_rng(seed))
                    best = posefit.minimise(problem.evaluate, made, MARKS[-1], budget_known=True)
                    rows = np.searchsorted(best.trace[:, 0], MARKS, "right") - 1
                    costs.setdefault(f"{optimiser}, {kind}", []).append(best.trace[np.maximum(rows, 0), 1])
        for search, rows_of_costs in costs.items():
            columns = [interval(list(column), names) for column in zip(*rows_of_costs, strict=True)]
            print(f"| {name} | {search} | {' | '.join(columns)} |", flush=True)


@main.command("images")
@click.option("--each", default=2, help="Images of a clip.")
@click.option("--method", "methods", multiple=True, default=METHODS)
@click.option("--budget", type=int)
@click.option("--blind", is_flag=True)
def single_images(each: int, methods: tuple[str, ...], budget: int | None, blind: bool) -> None:
    """Print the errors of single images, by group and method."""
    print("| group | method | images | mean mm | beyond 150 mm, % | facing wrong, % | CPU seconds |")
    for group in GROUPS:
        for method in methods:
            rows, names = [], []
            for image in images((group,), each):
                settings = {"tracker.start": "blind"} if blind and "@" in method else {}
                library = {"train": [image.clip.library]} if "@" not in method else {}
                fit = posefit.fit(
                    image.mask,
                    method=method,
                    camera=image.camera,
                    height=image.body.stature,
                    body_frames=0,
                    smooth=False,
                    evaluations=budget,
                    settings=settings,
                    progress=QUIET,
                    **library,
                )
                off, turned = image.error_mm(fit.joints), image.turned_degrees(fit.pose[0])
                cpu = fit.summary["cpu_seconds_per_frame"]
                rows.append((off, 100.0 * (off > LOST_MM), 100.0 * (turned > WRONG_DEGREES), cpu))
                names.append(image.clip.name)
            columns = [interval(list(column), names) for column in zip(*rows, strict=True)]
            print(f"| {group} | {method} | {len(names)} | {' | '.join(columns)} |", flush=True)


if __name__ == "__main__":
    main()
