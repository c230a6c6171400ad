"""Where the fit of contours puts the knee of people whose flesh is behind their bones.

    python docs/studies/knees.py --rows knees.jsonl

The build and all poses are fitted to clean masks of walks, from the true poses, so that
nothing but the shape of the legs misleads. The legs are the tracker's cones about the
bones, or have the girths and the flesh behind the bones that are published
(docs/studies/flesh.py); half of these wear trousers. Errors of lengths are in percent.
"""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import click
import numpy as np
from scipy.special import ndtri

from bodies import SEGMENTS, Shot, cameras_of, person
from composites_scene import PLACES
from posefit.cli.output import Command
from posefit.fitting.shape import NAMES, SPREAD, Shape
from posefit.footage.options import SourceOptions
from posefit.footage.source import scene_of
from posefit.tracking.smoothing.contours import fit_contours
from posefit.tracking.smoothing.path import Visibility
from posefit_reproduce.jobs import each
from table import WORKERS, earlier, kept, markdown

BODIES = 10
# numbers of the acts of bodies with even and odd numbers
NUMBERS = {"aslant": (0, 2, 1), "through": (3, 6, 5, 2, 1, 0, 4)}
FITS = 2  # fits after each other, as a track has
LEVEL = 0.8
KINDS = {"cones": False, "published": True}


def shot_of(body: int, views: int, legs: bool) -> Shot:
    """Return a walk of a body: odd ones from the side, even ones aslant."""
    situation = "through" if body % 2 else "aslant"
    numbers = NUMBERS[situation]
    return Shot(situation, numbers[body // 2 % len(numbers)], views, body, legs=legs)


def row_of(body: int, views: int, kind: str) -> dict[str, Any]:
    """Return the relative errors of a body's lengths, and how sure they claim to be."""
    shot = shot_of(body, views, KINDS[kind])
    who = person(shot)
    cameras, _ = cameras_of(shot, np.random.default_rng(body))
    with tempfile.TemporaryDirectory() as folder:
        paths = []
        for number, camera in enumerate(cameras):
            masks = [who.mask(camera, k) for k in range(len(who.motion))]
            paths.append(Path(folder) / f"{number}.npz")
            fps = np.array(who.motion.fps)
            np.savez_compressed(paths[-1], masks=np.array(masks), fps=fps)
        options = SourceOptions(camera=cameras, height=who.body.stature)
        scene = scene_of(paths, options)
    average = scene.body
    motion = replace(who.motion, skeleton=average.skeleton)
    ones = np.ones(len(NAMES))
    shape: Shape | None = Shape(average, ones, SPREAD, np.inf, who.body.stature)
    visibility = Visibility.of(scene)
    for _ in range(FITS):
        scene, motion, shape = fit_contours(scene, motion, visibility, shape)
    assert shape is not None
    lengths = scene.body.skeleton.lengths / who.body.skeleton.lengths
    names = ("thigh", "shank")
    off = {name: float(np.log(lengths[SEGMENTS[name]])) for name in names}
    spreads = {
        name: float(shape.spread[NAMES.index(f"{name}s length")]) for name in names
    }
    return {"body": body, "views": views, "legs": kind, "off": off, "spread": spreads}


def knees_lines(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield mean errors with standard deviations, and how often intervals hold."""
    heads = ["legs", "cameras", "bodies", "thigh %", "shank %", "ratio %"]
    heads += ["thigh, shank, ratio without sign %", f"{100 * LEVEL:.0f} % hold"]
    cells = []
    half = ndtri(0.5 + 0.5 * LEVEL)
    for kind, views in product(KINDS, PLACES):
        some = [row for row in rows if (row["legs"], row["views"]) == (kind, views)]
        if not some:
            continue
        off = np.array([[row["off"][name] for name in row["off"]] for row in some])
        spread = np.array([[*row["spread"].values()] for row in some])
        held = np.abs(off) <= half * spread
        off = 100.0 * np.column_stack([off, off[:, 0] - off[:, 1]])
        means = [f"{x.mean():.1f} ± {x.std(ddof=1):.1f}" for x in off.T]
        sizes = ", ".join(f"{x:.1f}" for x in np.abs(off).mean(axis=0))
        cells.append(
            [kind, str(views), str(len(some)), *means, sizes, f"{held.mean():.0%}"]
        )
    yield from markdown(heads, cells, 2)


@click.command(cls=Command, help=__doc__)
@click.option("--rows", default="knees.jsonl", help="File that keeps the rows.")
@click.option("--views", default="1,2,4", help="Numbers of cameras.")
@WORKERS
def main(rows: str, views: str, workers: int | None) -> None:
    done = earlier(rows, lambda row: (row["legs"], row["views"], row["body"]))
    jobs = {}
    for body, kind, count in product(range(BODIES), KINDS, map(int, views.split(","))):
        if (kind, count, body) not in done:
            jobs[kind, count, body] = partial(row_of, body, count, kind)
    done |= each(jobs, workers, partial(kept, rows)) if jobs else {}
    for line in knees_lines([*done.values()]):
        click.echo(line)


if __name__ == "__main__":
    main()
