"""Tracks of people outside the library, in recorded clips.

    python docs/studies/people.py --ledger people
    python docs/studies/people.py --recovery

The clips are walks, runs, jumps, turns, dances and everyday activities. The first yaw
is known to 25 degrees, the translation is known, the body is exact and the silhouettes
are clean. In the last table, of some walks, none of this holds. `--recovery` measures
something else: whether a track recovers after the person was out of sight for a while.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import click
import numpy as np

from clips import (
    ASIDE,
    CHANGES,
    GROUPS,
    PAIRS,
    SIDES,
    WALKS,
    Clip,
    Views,
    cell_fields,
    track_of,
)
from posefit.cli.output import Command
from posefit.fitting.metrics import LOST_MM
from posefit.fitting.space import Translation
from posefit.fitting.tracker import Observation
from posefit.footage.scene import Scene, rendered, synthetic
from posefit.motion.motion import Motion
from posefit.silhouette.mask import Silhouette
from posefit.sweep.cell import TrackCell, cell_scene
from posefit.sweep.check import cell_of
from posefit.sweep.plan import Plan
from posefit_reproduce.jobs import each
from table import LEDGER, WORKERS, bar, field_text, grouped, markdown, percent, rows

CHANGED = 3  # walks that are also tracked in worse conditions, from 45 and 90 degrees
SEEDED = 2  # clips of a group that are tracked with more seeds, from 45 and 90 degrees
# the further seeds: a few random draws decide which hypothesis is chosen
SEEDS = (1, 2)

# a line's name in a table, and a cell's fields
Cells = Iterator[tuple[str, dict[str, Any]]]


def by_group(groups: Mapping[str, Sequence[Clip]]) -> Cells:
    """Yield the cells of all clips by one camera and by two."""
    for group, clips in groups.items():
        for clip, view in product(
            clips, (*SIDES[:3], *(PAIRS if clips is GROUPS[WALKS] else PAIRS[1:]))
        ):
            again = groups is GROUPS and clip in clips[:SEEDED] and view in SIDES[1:3]
            for seed in (0, *SEEDS) if again else (0,):
                yield group, cell_fields(clip, view, clip.frames, seed=seed)


def by_condition() -> Cells:
    """Yield the cells of a few walks, in usual and in worse conditions."""
    for name, change in (("as above", {}), ("all worse", CHANGES["all of these"])):
        for clip, view in product(GROUPS[WALKS][:CHANGED], SIDES[1:3]):
            yield name, cell_fields(clip, view, clip.frames, seed=0, **change)


def people_lines(aside: bool, workers: int | None, ledger: str | None) -> Iterator[str]:
    """Yield the tables: by number of cameras, by view, and in worse conditions."""
    cells = (
        list(by_group(ASIDE if aside else GROUPS)),
        [] if aside else list(by_condition()),
    )
    # a plan contains each cell once
    different = {repr(fields): fields for some in cells for _, fields in some}
    results = dict(
        zip(
            different,
            rows(Plan.of({"cells": [*different.values()]}), workers, ledger),
            strict=True,
        )
    )
    groups, conditions = (
        [{**results[repr(fields)], "line": line} for line, fields in some]
        for some in cells
    )
    yield from grouped(
        groups,
        lambda row: [row["line"], str(len(row["spec"]["view_degrees"]))],
        ["group", "cameras"],
    )
    yield ""
    yield from grouped(
        groups,
        lambda row: [row["line"], field_text(row, "view_degrees")],
        ["group", "view"],
    )
    if conditions:
        yield ""
        yield from grouped(conditions, lambda row: [row["line"]], ["walks"])


# frames after the person's return within which the track must be right again
WITHIN = 10
STAYS = 10  # further frames, all of which must be right
# frames out of the picture before the person comes back the other way
AWAY = 20
WALKERS = 5  # number of walks
BEFORE = 60  # frames in view before the absence, and after it
GAPS = {"10 frames of nothing": 10, "30 frames of nothing": 30}
RETURN = "back the other way"
KINDS = (*GAPS, RETURN)
TRANSLATIONS: tuple[Translation, ...] = ("known", "aligned")


def hidden(
    observations: Sequence[Observation], start: int, stop: int
) -> list[Observation]:
    """Return observations with some empty ones, which do not give the place either."""
    empty = [
        Silhouette.of(np.zeros_like(silhouette.mask))
        for silhouette in observations[start].silhouettes
    ]
    nothing = Observation(empty, None, usable=False)
    return [
        nothing if start <= k < stop else observation
        for k, observation in enumerate(observations)
    ]


def trial(
    cell: TrackCell, views: Views, kind: str, translation: Translation
) -> tuple[bool, bool]:
    """Return whether a track recovers after an absence, and whether it faces right.

    A track has recovered if no frame is lost from ten frames after the absence on.
    """
    scene = cell_scene(cell)
    scene, back = (
        returned(scene, views) if kind == RETURN else with_gap(scene, GAPS[kind])
    )
    track = track_of(cell, scene, translation=translation)
    assert track.truth is not None
    later = slice(back + WITHIN, back + WITHIN + STAYS)
    facing = np.cos(track.motion.poses[later, 0] - track.truth.poses[later, 0]) > 0.0
    return bool((track.table["mpjpe_mm"][later] <= LOST_MM).all()), bool(
        facing.mean() > 0.5
    )


def with_gap(scene: Scene, frames: int) -> tuple[Scene, int]:
    """Return the scene with a gap in its middle, and the first frame after the gap."""
    gone = (scene.count - frames) // 2
    back = gone + frames
    return replace(scene, observations=hidden(scene.observations, gone, back)), back


def returned(scene: Scene, views: Views) -> tuple[Scene, int]:
    """Return the scene with the person's return, and their first visible frame then.

    They leave at its end and come back the same way, turned round, from the same place.
    """
    truth = scene.truth
    assert truth is not None
    turned = np.array(truth.poses)
    turned[:, 0] += np.pi
    first = truth.translations[0]
    last = truth.translations[-1]
    across = (first + last) * [1.0, 0.0, 1.0] - truth.translations * [1.0, 0.0, 1.0]
    places = across + truth.translations * [0.0, 1.0, 0.0]
    poses = np.concatenate([truth.poses, np.tile(truth.poses[-1], (AWAY, 1)), turned])
    translations = np.concatenate(
        [truth.translations, np.tile(last, (AWAY, 1)), places]
    )
    motion = Motion(truth.name, truth.skeleton, poses, translations, truth.fps)
    size = scene.cameras[0].width, scene.cameras[0].height
    whole = synthetic(motion, views, size, [], (None, None))
    observations = rendered(motion, whole.body, whole.cameras)
    gone = len(truth)
    back = len(truth) + AWAY
    return replace(
        whole, yaw=scene.yaw, observations=hidden(observations, gone, back)
    ), back


def recovery_lines(workers: int | None) -> Iterator[str]:
    """Yield the shares of trials in which a track recovered and faced right.

    There is a row for each kind of absence and of translation.
    """
    # all cells are made, and so checked, before any of them runs
    jobs = {}
    for clip, view, kind, translation in product(
        GROUPS[WALKS][:WALKERS], SIDES[1:3], KINDS, TRANSLATIONS
    ):
        cell = cell_of(
            cell_fields(clip, view, BEFORE if kind == RETURN else clip.frames)
        )
        jobs[clip.name, view, kind, translation] = partial(
            trial, cell, view, kind, translation
        )
    trials = each(jobs, workers, bar)
    table = []
    for case in product(KINDS, TRANSLATIONS):
        some = np.array([result for key, result in trials.items() if key[2:] == case])
        table.append(
            [*case, str(len(some)), *(percent(share, 0) for share in some.mean(axis=0))]
        )
    yield from markdown(
        ["out of sight", "translation", "trials", "right again %", "facing right %"],
        table,
        2,
    )


@click.command(cls=Command, help=__doc__)
@click.option("--recovery", is_flag=True, help="Measure gaps and returns instead.")
@click.option("--aside", is_flag=True, help="Use clips on which nothing was tuned.")
@LEDGER
@WORKERS
def main(recovery: bool, aside: bool, ledger: str | None, workers: int | None) -> None:
    for line in (
        recovery_lines(workers) if recovery else people_lines(aside, workers, ledger)
    ):
        click.echo(line)


if __name__ == "__main__":
    main()
