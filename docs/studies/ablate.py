"""What each mechanism and constant of the default tracker is worth.

    python docs/studies/ablate.py --ledger ablated.jsonl
    python docs/studies/ablate.py --constants --ledger ablated.jsonl

A mechanism is switched off; a constant is halved and doubled. Recorded people who are
left out of the library are tracked: by one camera, by two, and by one in bad conditions
(the root and the first yaw are unknown, the body is 5 % off, silhouettes are damaged).
Each track is of another clip and has another seed, and every change has the same
tracks. A line of the table is a change: how much larger the errors are than those of
the tracker as it is, as a geometric mean, with the 95 % interval for other clips and
seeds; and the median ratio of CPU times. A change that makes no difference in any
column shows that its mechanism can go. Finished tracks are kept in a file, where the
same command continues.

To see what another cost model does, track before and after it, and compare:

    ablate.py --only "as it is" --ledger before.jsonl
    ablate.py --only "as it is" --ledger after.jsonl --against before.jsonl
"""

import importlib
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple
from unittest.mock import patch

import click
import numpy as np

from clips import (
    CHANGES,
    EVALUATIONS,
    GROUPS,
    METHOD,
    PAIRS,
    RUNS,
    SIDES,
    WALKS,
    Clip,
    Views,
    cell_fields,
    learn_library,
    track_of,
)
from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.errors import InputError
from posefit.footage.scene import Scene
from posefit.geometry.skeleton import ANGLES
from posefit.settings import settings_of
from posefit.statistics.means import mean_interval
from posefit.sweep.cell import cell_scene
from posefit.sweep.check import cell_of
from posefit.tracking.result import Track
from posefit.version import posefit_build, source_digest
from posefit_exemplars.tracker import ExemplarTracker
from table import WORKERS, Row, earlier, keyed, markdown, measured

PACKAGE = "posefit_exemplars"
MODULES = (
    "beam",
    "cost_model",
    "exemplars",
    "fits",
    "frame_costs",
    "hypotheses",
    "kernels",
    "lookup",
    "markov",
    "proposals",
    "path",
    "smoothing",
    "tracker",
)
CELL = "cell"  # a change of `cell.FIELD` is one of the cell's fields
AS_IT_IS = "as it is"
# Constants that are not halved and doubled, by the reason why not.
FIXED: Mapping[str, Sequence[str]] = {
    "they follow from other constants": (
        "MIN_EVALUATIONS",
        "REACHES",
        "YAWS",
    ),
    "they lay out arrays, and change rounding at most": (
        "ANGLES",
        "FIRST_DIMENSIONS",
        "LANES",
    ),
    "they keep numbers finite": ("MAX_KERNEL_COST",),
    "it counts what a fit evaluates": ("PLACES_COMPARED",),
    "arrays on disk are learned with them": (
        "DIMENSIONS",
        "DISTANCE",
        "GROUPS",
        "PICTURE",
        "POSES",
        "MIN_FRAME_DISTANCE",
        "SAME_TURN",
        "SIDE",
    ),
    "it changes the posterior, not the pose: see posterior.py": ("MODE_DISTANCE",),
    "only other methods use them: see starts.py": (
        "MAX_DISTANCE",
        "TEMPERATURE",
    ),
    "other fits use them, too: see follow.py": ("ROBUST_SCALES", "STEP_EVALUATIONS"),
    "these tracks have no later passes, known yaws or spins": (
        "LIMB_ROUNDS",
        "WRONG_YAW_COST",
    ),
}
OFF = 1e9  # a spread or a cost so large that what depends on it has no effect
TINY = 1e-9  # a share or a cost that is as good as 0
FRAMES = 24  # most frames of a clip


def no_pull(_noise: float) -> Array:
    """Return no weight (69,) for the poses of clips."""
    return np.zeros(3 + ANGLES)


def no_turn(_spread: float) -> Array:
    """Return no turn but none (1,) for candidates."""
    return np.zeros(1)


def no_root_costs(missed: Array, *_: Any) -> Array:
    """Return no costs (..., n) of roots."""
    return np.zeros(missed.shape[:-1])


# the constants and functions that differ, by `module.NAME`
Change = Mapping[str, Any]
# A mechanism is switched off by the constant or function that gives it its weight.
MECHANISMS: Mapping[str, Change] = {
    AS_IT_IS: {},
    "no reflected hypotheses": {"proposals.reflected_count": lambda _fresh: 0},
    "no fresh hypotheses but two": {"proposals.fresh_count": lambda _evaluations: 2},
    "poses of clips pull no hypothesis": {"fits.library_precisions": no_pull},
    "distance from clips costs nothing": {"cost_model.LIBRARY_COST": 0.0},
    "no diverse states": {"beam.group_share": lambda _exemplars, count: count},
    "masks are never taken for noisy": {"cost_model.CLEAN_COST": OFF},
    "no candidates that turn away": {"proposals.candidate_turns": no_turn},
    "roots may be anywhere": {"cost_model.root_deviation_costs": no_root_costs},
    "no search everywhere after the first frame": {"path.SEARCHES_PER_SECOND": TINY},
    "parts go on at their speed": {"cost_model.SPEED_COSTS": {1.0: 0.0}},
    "no jumps": {"cost_model.JUMP_COST": 1e4},
    "near hypotheses are not one": {"hypotheses.same_distance": lambda _cameras: 1e-4},
    "the beam has all evaluations but a fit": {"tracker.FIT_SHARE": 0.3},
    "the path's costs count as much": {"cost_model.SHARPNESS": 1.0},
    "no smoothing over time": {f"{CELL}.settings": {f"{METHOD}.smoothing": 0.0}},
    "half as many states": {"proposals.BEAM_STATES": 100},
    "half as many searches everywhere": {"path.SEARCHES_PER_SECOND": 5.0},
    "only the nearest group is searched": {"exemplars.NEAR_GROUPS": 1},
    "half of the evaluations": {f"{CELL}.evaluations": EVALUATIONS // 2},
}


# The groups in the order in which their clips are tracked: most changes show first in
# turns and dances.
ORDER = ("turns", "dances", WALKS, "everyday", "jumps", RUNS)


class Situation(NamedTuple):
    """The conditions of some of the tracks."""

    views: Views
    every: int  # of this many tracks, one has the conditions
    fields: Mapping[str, Any]  # fields of the cell
    frames: int = FRAMES  # most frames of a clip


SITUATIONS: Mapping[str, Situation] = {
    "one camera": Situation(SIDES[1], 1, {}),
    "two cameras": Situation(PAIRS[1], 2, {}),
    "one camera, all worse": Situation(SIDES[1], 2, CHANGES["all of these"]),
    "one picture": Situation(SIDES[1], 1, {}, frames=1),
}


class Run(NamedTuple):
    """A track: a change of the tracker, the conditions, and the number of the track."""

    change: str
    situation: str
    number: int  # the number of the clip, and the seed


def constants() -> dict[str, Change]:
    """Return each numeric constant and setting of the tracker halved, and doubled."""
    fixed = {name for names in FIXED.values() for name in names}
    owners: dict[str, tuple[str, Any]] = {}
    for module in MODULES:
        for name, value in vars(importlib.import_module(f"{PACKAGE}.{module}")).items():
            if not name.isupper() or name in fixed or not scaled(name, value, 2.0):
                continue
            # one imported from another module is changed with that one
            if owners.get(name, (module, value))[1] is not value:
                owners[f"{module}.{name}"] = module, value
            owners.setdefault(name, (module, value))
    changes: dict[str, Change] = {}
    for factor, word in ((0.5, "halved"), (2.0, "doubled")):
        for name, (module, value) in owners.items():
            other = scaled(name, value, factor)
            if other != value:
                place = f"{module}.{name.rpartition('.')[2]}"
                changes[f"{name} {word}"] = {place: other}
        for setting in settings_of(ExemplarTracker):
            other = scaled(setting.name, setting.default, factor)
            settings = {f"{METHOD}.{setting.name}": other}
            changes[f"{setting.name} {word}"] = {f"{CELL}.settings": settings}
    return changes


def scaled(name: str, value: Any, factor: float) -> Any:
    """Return a number, or all numbers of a constant, times a factor; None for others.

    A share that would exceed 1 becomes half of the rest larger.
    """
    if isinstance(value, Mapping):
        members = {key: scaled(name, one, factor) for key, one in value.items()}
        return None if None in members.values() else members
    if isinstance(value, tuple):
        scaled_members = tuple(scaled(name, one, factor) for one in value)
        return None if None in scaled_members else scaled_members
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    if name.endswith("_SHARE") and factor * value >= 1.0:
        return 0.5 * (1.0 + value)
    product = value * factor
    return max(round(product), 1) if isinstance(value, int) else product


@contextmanager
def changed(change: Change) -> Iterator[None]:
    """Give constants of the tracker other values, in every module that uses them."""
    before: list[tuple[Any, str, Any]] = []
    modules = [importlib.import_module(f"{PACKAGE}.{name}") for name in MODULES]
    try:
        for place, value in change.items():
            owner, _, name = place.partition(".")
            if owner == CELL:
                continue
            usual = getattr(importlib.import_module(f"{PACKAGE}.{owner}"), name)
            for module in modules:
                if getattr(module, name, None) is usual:
                    before.append((module, name, usual))
                    setattr(module, name, value)
        yield
    finally:
        for module, name, usual in before:
            setattr(module, name, usual)


def tracked(run: Run, change: Change) -> dict[str, Any]:
    """Return the error of a run's track and its CPU time a frame."""
    situation = SITUATIONS[run.situation]
    clip = clip_of(run.number // situation.every)
    # no track's CPU time contains the learning of its library
    learn_library(clip, situation.views)
    fields = cell_fields(
        clip, situation.views, situation.frames, seed=run.number, **situation.fields
    )
    for place, value in change.items():
        owner, _, name = place.partition(".")
        if owner == CELL:
            fields[name] = value
    cell = cell_of(fields)
    scene = cell_scene(cell)
    # finding the closest training pose would take a third of the time
    closest = patch("posefit.evaluation.errors.nearest", true_pose)
    with changed(change), closest:
        began = time.process_time()
        track = track_of(cell, scene)
        seconds = time.process_time() - began
    return {
        **run._asdict(),
        "build": build(),
        "clip": clip.name,
        "mpjpe_mm": track.measures.mpjpe_mm,
        "root_mm": root_error(track, scene),
        "lost": track.measures.lost_rate,
        "cpu_ms": 1e3 * seconds / cell.frames,
    }


def root_error(track: Track, scene: Scene) -> float:
    """Return the mean distance of the root from the true one, in mm."""
    assert scene.truth is not None
    places = np.array([frame.translation for frame in track.frames])
    distances = np.linalg.norm(places - scene.truth.translations, axis=1)
    return 1e3 * float(distances.mean())


def true_pose(scene: Scene, _training: Array, frame: int, *_: Any) -> Array:
    """Return the true pose (66,) of a frame in place of the closest training pose."""
    assert scene.truth is not None
    pose: Array = scene.truth.poses[frame]
    return pose


def clip_of(number: int) -> Clip:
    """Return a clip: of each group in turn, and of each group another every time."""
    group = GROUPS[ORDER[number % len(ORDER)]]
    return group[number // len(ORDER) % len(group)]


def jobs_of(
    changes: Mapping[str, Change], tracks: int, situations: Sequence[str]
) -> dict[Run, Callable[[], dict[str, Any]]]:
    """Return the jobs that track each run, by run."""
    jobs: dict[Run, Callable[[], dict[str, Any]]] = {}
    for number in range(tracks):
        for name in situations:
            if number % SITUATIONS[name].every:
                continue
            for change in changes:
                run = Run(change, name, number)
                jobs[run] = partial(tracked, run, changes[change])
    return jobs


def finished(path: str | None) -> dict[Run, Row]:
    """Return the tracks in a file, all of which are finished."""
    return earlier(path, keyed(Run))


def build() -> str:
    """Return a name for this state of the sources of posefit and of the tracker."""
    return f"{posefit_build()} {source_digest(PACKAGE)}"


def check_build(path: str) -> None:
    """Raise InputError if a file has tracks of other sources."""
    for row in finished(path).values():
        if row.get("build") != build():
            raise InputError(
                f"{path} has tracks of other sources: name a new file, "
                f"and compare both with --against {path}"
            )


def lines(
    results: Mapping[Run, Row],
    changes: Sequence[str],
    before: Mapping[Run, Row] | None = None,
    figure: str = "mpjpe_mm",
) -> Iterator[str]:
    """Yield a table with a line for each change.

    An unfinished track is left out, as are the tracks that would be compared with it.

    Args:
        results: The tracks of this tracker.
        changes: The names of the changes.
        before: The tracks that each change is compared with, which may be of another
            tracker; by default those of this tracker as it is.
        figure: The error that is compared.
    """
    heads = ["change"]
    for name in SITUATIONS:
        heads += [f"{name}: % more", "95 % interval", "tracks"]
    heads.append("CPU")
    usual = {}
    for run, row in (results if before is None else before).items():
        if run.change == AS_IT_IS:
            usual[run] = row
    table = [_usual_line("before" if before else AS_IT_IS, usual, figure)]
    for change in changes:
        if change == AS_IT_IS and before is None:
            continue
        line = [change]
        cpu = list[float]()
        for name in SITUATIONS:
            logs = list[float]()
            for run, row in results.items():
                other = usual.get(run._replace(change=AS_IT_IS))
                if run.change == change and run.situation == name and other:
                    logs.append(math.log(row[figure] / other[figure]))
                    cpu.append(row["cpu_ms"] / other["cpu_ms"])
            line += [*_more(np.array(logs)), str(len(logs))]
        table.append([*line, f"{np.median(cpu):.2f}" if cpu else "-"])
    yield from markdown(heads, table)


def _usual_line(name: str, usual: Mapping[Run, Row], figure: str) -> list[str]:
    """Return the line of the tracks that others are compared with: mean errors."""
    line = [name]
    for situation in SITUATIONS:
        errors = [
            row[figure] for run, row in usual.items() if run.situation == situation
        ]
        middle = f"{np.exp(np.log(errors).mean()):.1f} mm" if errors else "-"
        line += [middle, "", str(len(errors))]
    return [*line, "1.00"]


def _more(logs: Array) -> list[str]:
    """Return how much larger errors are, in percent, from logarithms of ratios (n,)."""
    count = len(logs)
    if not count:
        return ["-", ""]
    if count == 1:
        return [_percent(float(logs[0])), ""]
    mean = mean_interval(logs, np.zeros(count), np.arange(count))
    return [_percent(mean.value), f"{_percent(mean.low)} to {_percent(mean.high)}"]


def _percent(log: float) -> str:
    return f"{100.0 * np.expm1(log):+.1f}"


@click.command(cls=Command, help=__doc__)
@click.option(
    "--constants", "of_constants", is_flag=True, help="Halve and double constants."
)
@click.option("--tracks", type=click.IntRange(1), default=24, show_default=True)
@click.option(
    "--only", multiple=True, metavar="TEXT", help="Changes whose name contains this."
)
@click.option(
    "--situation",
    "situations",
    type=click.Choice(list(SITUATIONS)),
    multiple=True,
    default=tuple(SITUATIONS),
    help="Conditions of the tracks; by default all.",
)
@click.option(
    "--ledger", metavar="FILE", help="Finished tracks: the same command continues."
)
@click.option(
    "--against",
    metavar="FILE",
    type=click.Path(exists=True, dir_okay=False),
    help="The ledger of another tracker, with which all changes are compared.",
)
@click.option(
    "--figure",
    type=click.Choice(["mpjpe_mm", "root_mm"]),
    default="mpjpe_mm",
    show_default=True,
    help="The error that is compared.",
)
@click.option("--print", "only_print", is_flag=True, help="Run nothing further.")
@WORKERS
def main(
    of_constants: bool,
    tracks: int,
    only: tuple[str, ...],
    situations: tuple[str, ...],
    ledger: str | None,
    against: str | None,
    figure: str,
    only_print: bool,
    workers: int | None,
) -> None:
    chosen = {AS_IT_IS: {}, **constants()} if of_constants else MECHANISMS
    changes = {
        name: change
        for name, change in chosen.items()
        if name == AS_IT_IS or not only or any(text in name for text in only)
    }
    if only_print:
        results = finished(ledger)
    else:
        if ledger:
            check_build(ledger)
        results = measured(
            jobs_of(changes, tracks, situations), ledger, keyed(Run), workers
        )
    before = finished(against) if against else None
    for line in lines(results, list(changes), before, figure):
        click.echo(line)


if __name__ == "__main__":
    main()
