"""Where the fit of contours puts the knee of people whose flesh is behind their bones.

    python docs/studies/knees.py --rows knees.jsonl
    python docs/studies/knees.py --library

The build and all poses are fitted to clean masks of walks, from the true poses, so that
nothing but the shape of the legs misleads. The legs are the tracker's cones about the
bones, or have the girths and the flesh behind the bones that are published
(docs/studies/flesh.py); half of these wear trousers. Errors of lengths are in percent.

With `--library`, how much each person of the library bends the knees: the angle between
the lines hip to knee and knee to ankle, from the joints alone, whatever the axes of the
skeleton are.
"""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import click
import numpy as np
from scipy.special import ndtri

from bodies import SEGMENTS, Shot, cameras_of, person
from composites_scene import PLACES
from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.fitting.shape import NAMES, SPREAD, Shape
from posefit.footage.options import SourceOptions
from posefit.footage.source import scene_of
from posefit.geometry.skeleton import JOINTS
from posefit.measuring.gait import gait_of
from posefit.measuring.segments import SIDES
from posefit.motion import recorded
from posefit.motion.motion import Motion
from posefit.tracking.smoothing.contours import fit_contours
from posefit.tracking.smoothing.path import Visibility
from posefit_reproduce.jobs import each
from table import WORKERS, earlier, kept, markdown

BODIES = 10
# numbers of the acts of bodies with even and odd numbers
NUMBERS = {"aslant": (0, 2, 1), "through": (3, 6, 5, 2, 1, 0, 4)}
FITS = 2  # fits after each other, as a track has
LEVEL = 0.8
# A person stands if their joints are slower than this, and their ankles level.
STILL = 0.15  # metres a second
LEVEL_ANKLES = 0.05  # metres
TALL = 0.03  # metres that the pelvis may be below its highest places
STRIDE = (0.6, 1.7)  # seconds
WALKING = (0.7, 1.8)  # metres a second
# shares of a stride: loading ends, swing begins, stance ends
SHARES = (0.25, 0.5, 0.6)
# Flexion in degrees of adults who stand, and in a walk at the strike, when the leg is
# loaded, at its least in stance and at its most in swing: Perry and Burnfield, Gait
# Analysis, Normal and Pathological Function, 2nd edition, 2010.
PUBLISHED = "0 to 5 | 5 | 15 to 20 | 3 to 5 | 60"
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


def flexions(joints: Array) -> Array:
    """Return how much both knees (T, 2) of joints (T, 27, 3) are bent, in degrees."""
    bent = []
    for letter in "lr":
        hip, knee, ankle = (
            joints[:, JOINTS.index(letter + end)]
            for end in ("hipjoint", "femur", "tibia")
        )
        thigh = knee - hip
        shank = ankle - knee
        cosines = (thigh * shank).sum(axis=1) / np.linalg.norm(thigh, axis=1)
        cosines /= np.linalg.norm(shank, axis=1)
        bent.append(np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0))))
    return np.column_stack(bent)


def standing_still(motion: Motion) -> Array:
    """Return the frames (T,) in which a person stands, as tall as in their tallest."""
    joints = motion.joints
    if len(joints) < 3:
        return np.zeros(len(joints), dtype=bool)
    ankles = [JOINTS.index("ltibia"), JOINTS.index("rtibia")]
    slow = [0, *ankles, JOINTS.index("lfemur"), JOINTS.index("rfemur")]
    speed = motion.fps * np.linalg.norm(np.gradient(joints, axis=0), axis=2)
    level = np.abs(np.diff(joints[:, ankles, 1], axis=1))[:, 0] < LEVEL_ANKLES
    height = joints[:, 0, 1] - joints[:, ankles, 1].min(axis=1)
    tall = height > np.quantile(height, 0.9) - TALL
    return np.asarray((speed[:, slow].max(axis=1) < STILL) & level & tall)


def strides_of(motion: Motion) -> Iterator[list[float]]:
    """Yield flexion at strike, in loading, least in stance and most in swing."""
    if len(motion) < motion.fps:
        return
    bent = flexions(motion.joints)
    places = motion.joints[:, 0, ::2]
    for side, foot in enumerate(SIDES):
        strikes = [
            round(motion.fps * step.strike_seconds)
            for step in gait_of(motion).steps
            if step.foot == foot
        ]
        for start, stop in pairwise(strikes):
            seconds = (stop - start) / motion.fps
            metres = np.linalg.norm(np.diff(places[start:stop], axis=0), axis=1).sum()
            if (
                not STRIDE[0] <= seconds <= STRIDE[1]
                or not WALKING[0] <= metres / seconds <= WALKING[1]
            ):
                continue
            curve = bent[start : stop + 1, side]
            third, middle, most = (int(share * (stop - start)) for share in SHARES)
            loaded = curve[:third].max()
            least = curve[third:most].min()
            yield [curve[0], loaded, least, curve[middle:].max()]


def library_lines() -> Iterator[str]:
    """Yield how much each person of the library bends the knees."""
    heads = ["person", "frames that stand", "knees: median (least tenth)", "strides"]
    heads += ["strike", "loaded", "least in stance", "most in swing"]
    cells = []
    for subject in recorded.subjects():
        still = []
        strides = list[list[float]]()
        for clip in recorded.clips([subject]):
            motion = clip.motion()
            still.append(flexions(motion.joints)[standing_still(motion)].mean(axis=1))
            strides += strides_of(motion)
        bent = np.concatenate(still)
        stands = "-"
        if len(bent):
            stands = f"{np.median(bent):.0f} ({np.quantile(bent, 0.1):.0f})"
        walks = ["-"] * 4
        if strides:
            walks = [f"{x:.0f}" for x in np.median(strides, axis=0)]
        cells.append([subject, str(len(bent)), stands, str(len(strides)), *walks])
    stands, *walks = PUBLISHED.split(" | ")
    cells.append(["published", "", stands, "", *walks])
    yield from markdown(heads, cells, 1)


@click.command(cls=Command, help=__doc__)
@click.option("--rows", default="knees.jsonl", help="File that keeps the rows.")
@click.option("--views", default="1,2,4", help="Numbers of cameras.")
@click.option("--library", is_flag=True, help="Print the library's knees instead.")
@WORKERS
def main(rows: str, views: str, library: bool, workers: int | None) -> None:
    if library:
        for line in library_lines():
            click.echo(line)
        return
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
