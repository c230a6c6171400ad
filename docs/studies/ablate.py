"""What each mechanism and constant of the default tracker is worth.

    python docs/studies/ablate.py --ledger ablated.jsonl
    python docs/studies/ablate.py --constants --ledger ablated.jsonl

A mechanism is switched off; a constant is halved and doubled. Recorded people who are
left out of the library are tracked as in people.py, by one camera and by two, with
several seeds. A line is a change of the tracker: the mean difference of the error from
the tracker as it is, over the same clips and seeds, with its 95 % interval, and the
ratio of CPU times. If a change makes no difference in any column, its mechanism can go.
Finished tracks are kept in a file, where the same command continues.
"""

import importlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import click
import numpy as np

from clips import GROUPS, PAIRS, SIDES, cell_fields, track_of
from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.statistics.means import run_means
from posefit.sweep.cell import cell_scene
from posefit.sweep.check import cell_of
from table import WORKERS, keyed, markdown, measured

PACKAGE = "posefit_exemplars"
MODULES = (
    "beam",
    "calibration",
    "exemplars",
    "frame_costs",
    "hypotheses",
    "kernels",
    "lookup",
    "lost_model",
    "markov",
    "smoothing",
    "tracker",
)
AS_IT_IS = "as it is"
OFF = 1e9  # of a spread or a cost: so large that what depends on it says nothing
TINY = 1e-9  # of a share or a cost
FRAMES = 60  # of a clip, at most
VIEWS = (SIDES[1], PAIRS[1])  # by one camera and by two
FROM_EACH_GROUP = 1  # clips

Change = Mapping[str, Any]  # the constants that differ, by `module.NAME`
# A mechanism is switched off by the constant that gives it its weight.
MECHANISMS: Mapping[str, Change] = {
    AS_IT_IS: {},
    "no reflected hypotheses": {"hypotheses.REFLECTED_SHARE": 0.0},
    "no fresh hypotheses but two": {"hypotheses.FRESH_SHARE": TINY},
    "all hypotheses fresh but one": {"hypotheses.FRESH_SHARE": 0.9},
    "poses of clips pull no hypothesis": {"hypotheses.LIBRARY_TURN": OFF},
    "distance from clips costs nothing": {"hypotheses.LIBRARY_COST": 0.0},
    "no diverse states": {"beam.BEAM_SHARES": 1},
    "no shares of yaws": {"beam.YAW_SHARES": 1},
    "parts continue at their speed alone": {"hypotheses.SPEED_COSTS": {1.0: 0.0}},
    "clips are followed at their speed alone": {
        "beam.CLIP_SPEEDS": (1.0,),
        "beam.RECORDED_SPEED": 0,
    },
    "no limit to the cost of a part's step": {"hypotheses.MAX_PART_COST": OFF},
    "noise raises no limit": {"hypotheses.MAX_JUMP_FACTOR": 1.0},
    "masks are never taken for noisy": {"hypotheses.CLEAN_COST": OFF},
    "no candidates that turn away": {"beam.CANDIDATE_TURN": TINY},
    "roots may be anywhere": {"beam.ROOT_SPREAD": OFF, "beam.DEPTH_SPREAD": OFF},
    "a known root says nothing of clips": {"beam.KNOWN_ROOT_SPREAD": OFF},
    "no search everywhere after the first frame": {"tracker.SEARCHES_PER_SECOND": TINY},
    "fast turns cost nothing": {"beam.FAST_TURN_COST": 0.0},
    "no jumps": {"beam.JUMP_COST": 1e4},
    "near hypotheses are not one": {"hypotheses.SAME_DISTANCE": 1e-4},
    "the beam has all evaluations but a fit": {"tracker.FIT_SHARE": 0.3},
    "the path's costs count as much": {"hypotheses.SHARPNESS": 1.0},
}


class Run(NamedTuple):
    """A track: a change of the tracker, a clip by some cameras, and a seed."""

    change: str
    clip: str
    views: int
    seed: int


def constants() -> dict[str, Change]:
    """Return each numeric constant of the tracker halved, and doubled."""
    changes: dict[str, Change] = {}
    for module in MODULES:
        for name, value in vars(importlib.import_module(f"{PACKAGE}.{module}")).items():
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if not name.isupper() or not is_number or value == 0:
                continue
            place = f"{module}.{name}"
            # one imported from another module is changed with that one
            if any(
                place.endswith(f".{known.split('.')[1]}") for known in _seen(changes)
            ):
                continue
            for factor in (0.5, 2.0):
                changed = (
                    type(value)(round(value * factor))
                    if isinstance(value, int)
                    else value * factor
                )
                if changed != value and changed != 0:
                    changes[f"{place} = {changed:.3g}"] = {place: changed}
    return changes


def _seen(changes: Mapping[str, Change]) -> set[str]:
    return {place for change in changes.values() for place in change}


@contextmanager
def changed(change: Change) -> Iterator[None]:
    """Give constants of the tracker other values, in every module that uses them."""
    before: list[tuple[Any, str, Any]] = []
    modules = [importlib.import_module(f"{PACKAGE}.{name}") for name in MODULES]
    try:
        for place, value in change.items():
            owner, _, name = place.partition(".")
            usual = getattr(importlib.import_module(f"{PACKAGE}.{owner}"), name)
            for module in modules:
                if getattr(module, name, None) is usual:
                    before.append((module, name, usual))
                    setattr(module, name, value)
        yield
    finally:
        for module, name, usual in before:
            setattr(module, name, usual)


def tracked(run: Run, change: Change, fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return the error of a run's track and its CPU time a frame."""
    cell = cell_of({**fields, "seed": run.seed})
    scene = cell_scene(cell)
    with changed(change):
        began = time.process_time()
        track = track_of(cell, scene)
        seconds = time.process_time() - began
    return {
        **run._asdict(),
        "mpjpe_mm": track.measures.mpjpe_mm,
        "lost": track.measures.lost_rate,
        "cpu_ms": 1e3 * seconds / cell.frames,
    }


def jobs_of(
    changes: Mapping[str, Change], seeds: int
) -> dict[Run, Callable[[], dict[str, Any]]]:
    """Return the tracks that are compared, by what they are of."""
    clips = [clip for group in GROUPS.values() for clip in group[:FROM_EACH_GROUP]]
    jobs: dict[Run, Callable[[], dict[str, Any]]] = {}
    for seed, clip, views, change in product(range(seeds), clips, VIEWS, changes):
        run = Run(change, clip.name, len(views), seed)
        fields = cell_fields(clip, views, FRAMES)
        jobs[run] = partial(tracked, run, changes[change], fields)
    return jobs


def lines(
    results: Mapping[Run, Mapping[str, Any]], changes: Sequence[str]
) -> Iterator[str]:
    """Yield a table with a line for each change."""

    def of(change: str, views: int, figure: str) -> Array:
        """Return a figure (clips, seeds)."""
        rows: dict[str, list[float]] = {}
        for run, row in results.items():
            if run.change == change and run.views == views:
                rows.setdefault(run.clip, []).append(row[figure])
        return np.array(list(rows.values()))

    counts = sorted({run.views for run in results})
    heads = ["change"]
    for count in counts:
        camera = "camera" if count == 1 else "cameras"
        heads += [f"mm more, {count} {camera}", "95 % interval"]
    cells = []
    for change in changes:
        row = [change]
        cpu = []
        for views in counts:
            usual = of(AS_IT_IS, views, "mpjpe_mm")
            cpu.append(
                of(change, views, "cpu_ms").sum() / of(AS_IT_IS, views, "cpu_ms").sum()
            )
            if change == AS_IT_IS:
                row += [f"{usual.mean():.1f} in all", ""]
                continue
            more = run_means((of(change, views, "mpjpe_mm") - usual)[None])
            row += [
                f"{more.values[0]:+.1f}",
                f"{more.low[0]:+.1f} to {more.high[0]:+.1f}",
            ]
        cells.append([*row, f"{float(np.mean(cpu)):.2f}"])
    yield from markdown([*heads, "CPU"], cells)


@click.command(cls=Command, help=__doc__)
@click.option(
    "--constants", "of_constants", is_flag=True, help="Halve and double constants."
)
@click.option("--seeds", type=click.IntRange(2), default=10, show_default=True)
@click.option(
    "--only", multiple=True, metavar="TEXT", help="Changes whose name holds this."
)
@click.option(
    "--ledger", metavar="FILE", help="Finished tracks: the same command continues."
)
@WORKERS
def main(
    of_constants: bool,
    seeds: int,
    only: tuple[str, ...],
    ledger: str | None,
    workers: int | None,
) -> None:
    chosen = {AS_IT_IS: {}, **constants()} if of_constants else MECHANISMS
    changes = {
        name: change
        for name, change in chosen.items()
        if name == AS_IT_IS or not only or any(text in name for text in only)
    }
    jobs = jobs_of(changes, seeds)
    results = measured(jobs, ledger, keyed(Run), workers)
    for line in lines(results, list(changes)):
        click.echo(line)


if __name__ == "__main__":
    main()
