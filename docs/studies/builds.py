"""How accurately a person's build is estimated.

    python docs/studies/builds.py

The subjects are synthetic: bones and radii are each up to 10 % off the average, and the
stature is up to 10 % taller or smaller. It prints the errors of stature and limbs in
percent, mean and largest, for one, two and four views: of the fitted build, and of the
average build from which the fit starts. A sweep's cell tracks a person with known
build, so these runs are jobs.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import product
from typing import NamedTuple

import click
import numpy as np

from posefit.cli.output import Command
from posefit.fitting.space import Translation
from posefit.fitting.tracker import Task
from posefit.footage.scene import rendered, synthetic
from posefit.geometry.body import Body, varied
from posefit.geometry.skeleton import BONES
from posefit.motion import built_in
from posefit.tracking.defaults import BODY_FRAMES
from posefit.tracking.initialise import fitted_build
from posefit.tracking.method import prepare
from posefit.tracking.options import EVALUATIONS, TrackOptions
from posefit_reproduce.jobs import each
from table import WORKERS, bar

MOTION = "walk-b"
SIZE = (320, 240)
PERCENT = 10.0
SUBJECTS = 8  # each with a different build


class Setup(NamedTuple):
    """What is known of a person, in addition to the silhouettes."""

    label: str
    views_degrees: tuple[float, ...]
    stature: bool
    translation: Translation


SETUPS = (
    Setup("1 view, stature given", (90.0,), True, "aligned"),
    Setup("1 view, root known", (90.0,), False, "known"),
    Setup("2 views", (0.0, 90.0), False, "aligned"),
    Setup("4 views", (0.0, 45.0, 90.0, 135.0), False, "aligned"),
)
LIMBS = {
    "thigh": ("lfemur",),
    "shank": ("ltibia",),
    "upper arm": ("lhumerus",),
    "forearm and hand": ("lradius", "lwrist", "lhand"),
}
PARTS = ("stature", *LIMBS)


def subject(seed: int) -> Body:
    rng = np.random.default_rng([7, seed])
    body = varied(Body.of(built_in.average_skeleton()), PERCENT, rng)
    scale = rng.uniform(0.9, 1.1)
    return body.scaled(scale, scale)


def builds_lines(workers: int | None) -> Iterator[str]:
    """Yield the errors of stature and limbs in percent, for every setup.

    There is a line for the fitted build, and one for the average.
    """
    keys = list(product(SETUPS, range(SUBJECTS)))
    figures_of = each(
        {(one.label, k): partial(_percent_off, one, k) for one, k in keys}, workers, bar
    )
    for one in SETUPS:
        # (subjects, 2, parts)
        pairs = np.array([figures_of[one.label, k] for k in range(SUBJECTS)])
        for k, label in enumerate(("fitted", "average")):
            parts = zip(
                PARTS, pairs[:, k].mean(axis=0), pairs[:, k].max(axis=0), strict=True
            )
            figures = [
                f"{part} {mean:.1f} (at most {most:.1f})" for part, mean, most in parts
            ]
            yield f"{one.label:22} {label:8} % off: {', '.join(figures)}"


def _percent_off(setup: Setup, seed: int) -> tuple[list[float], list[float]]:
    """Return the errors of a subject's parts in percent, after the fit and before."""
    options = TrackOptions(method="@loose")
    average = Body.of(built_in.average_skeleton())
    true = subject(seed)
    walk = replace(built_in.motion(MOTION), skeleton=true.skeleton)
    scene = synthetic(walk, setup.views_degrees, SIZE, [], (None, None))
    scene = replace(scene, body=true, observations=rendered(walk, true, scene.cameras))
    height = None
    start = average
    if setup.stature:
        height = true.stature
        start = average.scaled(*[height / average.stature] * 2)
    training = [built_in.motion(style) for style in built_in.other_styles(scene.name)]
    task = Task(
        start,
        scene.cameras,
        EVALUATIONS,
        scene.yaw,
        scene.anchor,
        setup.translation,
        training=training,
    )
    shape, _ = fitted_build(
        task, scene, prepare(options, task).follow, BODY_FRAMES, height, seed
    )
    return _off(shape.body, true), _off(start, true)


def _off(body: Body, true: Body) -> list[float]:
    """Return the errors of stature and limbs in percent."""
    limbs = [[BONES.index(bone) for bone in bones] for bones in LIMBS.values()]
    lengths, others = (
        [one.stature, *(one.skeleton.lengths[limb].sum() for limb in limbs)]
        for one in (body, true)
    )
    return [
        100.0 * abs(length / other - 1.0)
        for length, other in zip(lengths, others, strict=True)
    ]


@click.command(cls=Command, help=__doc__)
@WORKERS
def main(workers: int | None) -> None:
    for line in builds_lines(workers):
        click.echo(line)


if __name__ == "__main__":
    main()
