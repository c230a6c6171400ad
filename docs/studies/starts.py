"""What a search gains that begins where a silhouette points, on people whom nothing was learned from.

    python docs/studies/starts.py look
    python docs/studies/starts.py evaluations
    python docs/studies/starts.py images
    python docs/studies/starts.py tracks --group walks --group turns

Every image shows a pose of a recorded clip at any yaw; the person's clips are left out of what the look-up and the
prior learn from. A camera stands 3.5 to 5 metres away; the person is up to 0.8 metres off its axis, and only their
height is known. `look` counts how many modes it takes until one faces as the person does, and how far the pose of the
best is off. `evaluations` follows the best cost of a search, blind and from the start. `images` fits single images.
`tracks` follows the first frames of clips from all sides; a track goes wrong whose mean error is above 150 mm.
Intervals are bootstraps of the mean over clips, 95 %.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import click
import numpy as np

import posefit
from clips import EVALUATIONS, GROUPS, SIDES, WALKS, Clip, cell_fields, track_of
from posefit.arrays import Array
from posefit.fitting.space import SearchSpace
from posefit.fitting.start import modes_apart, start_in
from posefit.fitting.tracker import Observation, Task
from posefit.geometry.rotation import wrapped
from posefit.motion import recorded
from posefit.motion.built_in import average_skeleton
from posefit.motion.clips import training_clips, training_motions
from posefit.motion.motion import Motion
from posefit.output.picture import ALTERNATIVES, MIN_WEIGHT
from posefit.progress import QUIET
from posefit.silhouette.corruption import corrupted
from posefit.sweep.cell import ALL_AROUND, cell_scene
from posefit.sweep.check import cell_of
from posefit.uncertainty.calibration import MAIN_LEVEL
from posefit.uncertainty.modes import other_modes
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

    def errors(self, joints: Array) -> Array:
        """Return the distances (27,) of joints (27, 3), metres, roots at one point."""
        truth = self.body.skeleton.joints(self.pose[None])[0]
        return np.asarray(np.linalg.norm((joints - joints[0]) - (truth - truth[0]), axis=1))

    def error_mm(self, joints: Array) -> float:
        """Return the mean distance of joints (27, 3), roots at one point."""
        return float(1000.0 * self.errors(joints).mean())

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
@click.option("--learn", multiple=True, help="Groups of which priors learn others' clips; else the built-in walks.")
@click.option("--group", "groups", multiple=True, default=tuple(GROUPS), type=click.Choice(tuple(GROUPS)))
def single_images(
    each: int,
    methods: tuple[str, ...],
    budget: int | None,
    blind: bool,
    learn: tuple[str, ...],
    groups: tuple[str, ...],
) -> None:
    """Print the errors of single images, by group and method."""
    heads = "mean mm | beyond 150 mm, % | facing wrong, %"
    print(f"| group | method | images | {heads} | with other poses: {heads} | in 80 % intervals | CPU s |")
    for group in groups:
        for method in methods:
            rows, names = [], []
            for image in images((group,), each):
                settings = {"tracker.start": "blind"} if blind and "@" in method else {}
                others = [clip.name for name in learn for clip in GROUPS[name] if clip.subject != image.clip.subject]
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
                    train=others if "@" in method else [image.clip.library],
                )
                skeleton, (radii,) = fit.track.motion.skeleton, fit.track.content.intervals["joint_radii"]
                shown = other_modes(skeleton, fit.frame.modes, fit.pose, MIN_WEIGHT)[:ALTERNATIVES]
                poses = np.array([fit.pose, *(mode.pose for mode in shown)])
                off = np.array([image.error_mm(joints) for joints in skeleton.joints(poses)])
                turned = np.array([image.turned_degrees(pose[0]) for pose in poses])
                rows.append(
                    [
                        *(off[0], 100.0 * (off[0] > LOST_MM), 100.0 * (turned[0] > WRONG_DEGREES)),
                        *(off.min(), 100.0 * (off.min() > LOST_MM), 100.0 * (turned.min() > WRONG_DEGREES)),
                        100.0 * (image.errors(fit.joints) <= radii[MAIN_LEVEL]).mean(),
                        fit.summary["cpu_seconds_per_frame"],
                    ]
                )
                names.append(image.clip.name)
            columns = [interval(list(column), names) for column in zip(*rows, strict=True)]
            print(f"| {group} | {method} | {len(names)} | {' | '.join(columns)} |", flush=True)


@main.command()
@click.option("--group", "groups", multiple=True, default=tuple(GROUPS), type=click.Choice(tuple(GROUPS)))
@click.option("--view", "views", multiple=True, type=float, default=[view for (view,) in SIDES], help="Degrees.")
@click.option("--method", default="exemplars")
@click.option("--evaluations", "budget", default=EVALUATIONS, help="Of a frame.")
@click.option("--frames", default=20, help="Of a clip, at most.")
@click.option("--known", is_flag=True, help="The first yaw is known to 25 degrees, and the translation.")
@click.option("--seeds", default=1)
def tracks(
    groups: tuple[str, ...],
    views: tuple[float, ...],
    method: str,
    budget: int,
    frames: int,
    known: bool,
    seeds: int,
) -> None:
    """Print how far the tracks of each group are off, and how many go wrong."""
    unknown = {} if known else {"translation": "aligned", "yaw_off_degrees": ALL_AROUND}
    print("| group | tracks | mean mm | median mm | lost frames, % | go wrong |")
    for group in groups:
        rows, names = [], []
        for clip, view, seed in product(GROUPS[group], views, range(seeds)):
            cell = cell_of(cell_fields(clip, (view,), frames, method=method, evaluations=budget, seed=seed, **unknown))
            error = track_of(cell, cell_scene(cell)).table["mpjpe_mm"]
            rows.append((error.mean(), 100.0 * (error > LOST_MM).mean()))
            names.append(clip.name)
        errors, lost = map(list, zip(*rows, strict=True))
        wrong = sum(error > LOST_MM for error in errors)
        columns = f"{interval(errors, names)} | {np.median(errors):.3g} | {interval(lost, names)}"
        print(f"| {group} | {len(rows)} | {columns} | {wrong} |", flush=True)


if __name__ == "__main__":
    main()
