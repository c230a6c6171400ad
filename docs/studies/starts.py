"""The benefit of a search that starts from a look-up of the silhouette.

    python docs/studies/starts.py look
    python docs/studies/starts.py evaluations
    python docs/studies/starts.py images
    python docs/studies/starts.py tracks

The people are outside the training data. Every image shows a pose of a recorded clip at
any yaw; look-up and prior learn without the person's clips. The camera is 3.5 to 5
metres away. The person is up to 0.8 metres off its axis, and only their height is
known.

`look` counts the modes until one faces in the right direction. `evaluations` records
the best cost of a search in walks, blind and from the start. `images` fits single
images. `tracks` tracks the first frames of walks and turns from all sides; a track
fails if its mean error is above 150 mm.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any
from unittest.mock import patch

import click
import numpy as np

import posefit
from clips import GROUPS, RUNS, SIDES, WALKS, Clip, cell_fields, track_of
from posefit.arrays import Array
from posefit.fitting.metrics import LOST_MM
from posefit.fitting.space import SearchSpace
from posefit.fitting.start import modes_apart, start_in
from posefit.fitting.tracker import Observation, Task
from posefit.geometry.rotation import wrapped
from posefit.motion import recorded
from posefit.motion.built_in import average_skeleton
from posefit.motion.clips import training_clips, training_motions
from posefit.motion.motion import Motion
from posefit.output.picture import ALTERNATIVES, MIN_ALTERNATIVE_WEIGHT
from posefit.progress import QUIET
from posefit.silhouette.mask import Mask
from posefit.sweep.cell import ALL_AROUND, cell_scene
from posefit.sweep.check import cell_of
from posefit.tracking import polish
from posefit.uncertainty.modes import other_modes
from posefit_exemplars.lookup import Lookup
from table import markdown, percent

SIZE = (320, 240)
FOCAL = 260.0
MODES = (1, 2, 3, 8)
MARKS = (40, 200, 2440)  # evaluations
RIGHT_DEGREES = 45.0
WRONG_DEGREES = 60.0
# images of each clip in each study
LOOKED = 4
SEARCHED = 3
FITTED = 2
FRAMES = 20  # frames of a tracked clip


@dataclass(frozen=True)
class Image:
    """A mask and the truth behind it."""

    clip: Clip
    camera: posefit.Camera
    body: posefit.Body
    pose: Array
    mask: Mask

    def errors_mm(self, joints: Array) -> Array:
        """Return the mean distances (n,) of joints (n, 27, 3), roots at one point."""
        truth = self.body.skeleton.joints(self.pose[None])[0]
        away = np.linalg.norm((joints - joints[:, :1]) - (truth - truth[0]), axis=2)
        return np.asarray(1000.0 * away.mean(axis=1))

    def turned_degrees(self, poses: Array) -> Array:
        """Return the errors of the yaws of poses (n, 66) in degrees."""
        return np.asarray(np.degrees(np.abs(wrapped(poses[:, 0] - self.pose[0]))))


def images(group: str, each: int) -> Iterator[Image]:
    """Yield `each` images of each clip of a group."""
    rng = np.random.default_rng(61)
    for clip in GROUPS[group]:
        motion = recorded.clip(clip.name).motion()
        body = posefit.Body.of(motion.skeleton)
        for _ in range(each):
            pose = motion.poses[rng.integers(len(motion))].copy()
            pose[0] = rng.uniform(-np.pi, np.pi)
            away = np.array([rng.uniform(-0.8, 0.8), 0.0, rng.uniform(3.5, 5.0)])
            camera = posefit.Camera(
                *SIZE,
                np.full(2, FOCAL),
                np.array(SIZE) / 2.0,
                np.diag([1.0, -1.0, -1.0]),
                away,
            )
            place = -motion.skeleton.joints(pose[None])[0].mean(axis=0)
            yield Image(
                clip, camera, body, pose, posefit.project(body, camera, pose, place)
            )


def training_of(clip: Clip, only: str = "") -> list[Motion]:
    """Return the motions of all other people, or only of those in a group."""
    names = [
        each.name for each in GROUPS.get(only, ()) if each.subject != clip.subject
    ] or [clip.library]
    return training_motions(training_clips(names), 30.0)


def task_of(image: Image, training: list[Motion]) -> Task:
    """Return the task of an image. Only the person's height is known."""
    average = posefit.Body.of(average_skeleton())
    share = image.body.stature / average.stature
    return Task(
        average.scaled(share, share),
        [image.camera],
        MARKS[-1],
        None,
        np.zeros(3),
        "aligned",
        training=training,
    )


def printed(heads: Sequence[str], cells: Sequence[Sequence[str]], words: int) -> None:
    click.echo("\n".join(markdown(heads, cells, words)))


@click.group()
def main() -> None:
    """Measure searches that start from a look-up."""


@main.command()
def look() -> None:
    """Print how many modes are needed until one is right, by group."""
    cells = []
    for group in GROUPS:
        right = []
        for image in images(group, LOOKED):
            task = task_of(image, training_of(image.clip))
            posterior = Lookup(task).posterior(
                Observation([posefit.Silhouette.of(image.mask)])
            )
            if posterior is not None:
                modes = modes_apart(task.body.skeleton, posterior)
                turned = image.turned_degrees(
                    np.array([mode.poses[0] for _, mode in modes])
                )
                right.append([turned[:count].min() <= RIGHT_DEGREES for count in MODES])
        cells.append(
            [
                group,
                str(len(right)),
                *(percent(share, 0) for share in np.mean(right, axis=0)),
            ]
        )
    printed(
        ["faces within 45 degrees, %", "images", *(f"of {count}" for count in MODES)],
        cells,
        1,
    )


@main.command()
def evaluations() -> None:
    """Print the mean best cost after some evaluations, blind and from the start.

    All yaws are searched.
    """
    costs: dict[str, list[Array]] = {}
    priors: dict[str, Any] = {}
    for seed, image in enumerate(images(WALKS, SEARCHED)):
        task = task_of(image, training_of(image.clip, WALKS))
        if image.clip.subject not in priors:
            priors[image.clip.subject] = posefit.prior("pca")().fit(
                task.angles, task.body.skeleton
            )
        reach = np.radians([180.0, 15.0, 15.0])
        space = SearchSpace(
            priors[image.clip.subject], np.zeros(3), reach, np.zeros(3), "aligned"
        )
        observation = Observation([posefit.Silhouette.of(image.mask)])
        posterior = Lookup(task).posterior(observation)
        spaces = {"blind": space, "from the start": space}
        if posterior is not None:
            cost = posefit.SilhouetteCost(
                task.body, task.cameras, observation.silhouettes, space
            )
            start = start_in(cost, modes_apart(task.body.skeleton, posterior))
            spaces["from the start"] = replace(space, start=start)
        for optimiser, (kind, searched) in product(("sapso", "cma"), spaces.items()):
            cost = posefit.SilhouetteCost(
                task.body, task.cameras, observation.silhouettes, searched
            )
            problem = posefit.Problem(cost, searched, MARKS[-1])
            made = posefit.optimiser(optimiser)(searched, np.random.default_rng(seed))
            posefit.minimise(problem, made, budget_known=True)
            used, best_costs = problem.trace
            rows = np.searchsorted(used, MARKS, "right") - 1
            costs.setdefault(f"{optimiser}, {kind}", []).append(best_costs[rows])
    cells = [
        [name, *(f"{cost:.1f}" for cost in np.mean(rows, axis=0))]
        for name, rows in costs.items()
    ]
    printed(
        ["walks, mean cost after evaluations", *(f"{mark:,}" for mark in MARKS)],
        cells,
        1,
    )


# what is fitted, the method, and the groups from which a prior learns, without the
# person
IMAGES = (
    (WALKS, "sapso@pca", ()),
    (WALKS, "exemplars", ()),
    (RUNS, "sapso@pca", ()),
    (RUNS, "sapso@pca", (WALKS, RUNS)),
    (RUNS, "exemplars", ()),
)


@main.command("images")
def single_images() -> None:
    """Print the errors of single images, and of the best of the alternatives shown."""
    cells = []
    for group, method, learned in IMAGES:
        off = []
        turned = []
        for image in images(group, FITTED):
            others = [
                clip.name
                for name in learned
                for clip in GROUPS[name]
                if clip.subject != image.clip.subject
            ]
            if "@" not in method:
                others = [image.clip.library]
            # what is looked up by default, without the person
            library = training_of(image.clip)
            with patch.object(polish, "_library", lambda _fps, known=library: known):
                fit = posefit.fit(
                    image.mask,
                    method=method,
                    camera=image.camera,
                    height=image.body.stature,
                    progress=QUIET,
                    train=others,
                )
            skeleton = fit.track.motion.skeleton
            shown = other_modes(
                skeleton, fit.frame.modes, fit.pose, MIN_ALTERNATIVE_WEIGHT
            )[:ALTERNATIVES]
            poses = np.array([fit.pose, *(mode.pose for mode in shown)])
            errors = image.errors_mm(skeleton.joints(poses))
            angles = image.turned_degrees(poses)
            off.append((errors[0], errors.min()))
            turned.append((angles[0], angles.min()))
        figures = [f"{mean:.0f}" for mean in np.mean(off, axis=0)]
        for values, limit in ((off, LOST_MM), (turned, WRONG_DEGREES)):
            figures += [
                percent(share, 0) for share in (np.array(values) > limit).mean(axis=0)
            ]
        cells.append(
            [group, method, " and ".join(learned) or "default", str(len(off)), *figures]
        )
    heads = [
        f"{head}{best}"
        for head in ("mm", "beyond 150 mm, %", "facing wrong, %")
        for best in ("", "; best")
    ]
    printed(["images of", "method", "learns from", "images", *heads], cells, 3)


@main.command()
def tracks() -> None:
    """Print how many tracks of walks and turns fail, with yaw and place unknown."""
    errors = []
    for clip, view in product((*GROUPS[WALKS], *GROUPS["turns"]), SIDES):
        cell = cell_of(
            cell_fields(
                clip, view, FRAMES, translation="aligned", yaw_off_degrees=ALL_AROUND
            )
        )
        errors.append(float(track_of(cell, cell_scene(cell)).table["mpjpe_mm"].mean()))
    click.echo(
        f"{sum(error > LOST_MM for error in errors)} of {len(errors)} tracks go wrong"
    )


if __name__ == "__main__":
    main()
