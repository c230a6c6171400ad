"""What `posefit sweep` does."""

import json
import os
import shlex
import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from posefit.sweep.cell import Cell, run_cell, settings_text
from posefit.sweep.drive import Tally, drive_cells, progress_of
from posefit.sweep.driver import Driver
from posefit.sweep.engines.engine import Engine
from posefit.sweep.engines.limits import Limits
from posefit.sweep.ledger import INDEX, Ledger
from posefit.sweep.plan import Plan

DONE, QUARANTINED, STOPPED = 0, 1, 130  # exit statuses

Say = Callable[[str], None]


def run_plan(
    plan: str,
    out: str,
    *,
    workers: int | None,
    scheduler: str | None,
    dask_local: int | None,
    limits: Limits,
    say: Say,
) -> tuple[Tally, int]:
    """Return how the sweep of a plan to a folder ended, and the exit status that says so."""
    cells = Plan.read(plan).cells
    start = engine(workers, scheduler, dask_local, limits)
    with closing(start()) as running:  # without an engine there is no folder either
        tally = swept(cells, out, running, say)
    return tally, STOPPED if tally.stopped else QUARANTINED if tally.quarantined else DONE


def swept(cells: Sequence[Cell], out: str | Path, running: Engine, say: Say) -> Tally:
    """Return how cells ended that an engine ran into the ledger in a folder, with a bar on stderr."""
    with Driver(out, say) as driver:
        already = sum(driver.state(cell.key) is not None for cell in cells)
        if already:
            say(f"{already} of {len(cells)} cells are done already")
        if already < len(cells):
            return _driven(cells, driver, running, already, say)
        tally = Tally(len(cells))
        tally.done = sum(cell.key in driver.ledger for cell in cells)
        tally.quarantined = len(cells) - tally.done
        return tally


def preview(
    plan: str, out: str | None, *, workers: int | None, scheduler: str | None, dask_local: int | None, limits: Limits
) -> dict[str, Any]:
    """Return the cells of a plan, which of them are done already, and about how long the others take."""
    from posefit.sweep.estimate import estimated_seconds

    cells = Plan.read(plan).cells
    ledger = Ledger(out) if out is not None and (Path(out) / INDEX).exists() else None
    left = [cell for cell in cells if ledger is None or cell.key not in ledger]
    if not left:
        return {"cells": [_shown(cell, True) for cell in cells], "seconds": 0.0, "workers": 0}
    with closing(engine(workers, scheduler, dask_local, limits)()) as running:
        count = running.window()
        taken = estimated_seconds(left, running, count)
    waiting = {cell.key for cell in left}
    return {"cells": [_shown(cell, cell.key not in waiting) for cell in cells], "seconds": taken, "workers": count}


def engine(workers: int | None, scheduler: str | None, dask_local: int | None, limits: Limits) -> Callable[[], Engine]:
    """Return what starts the engine that was asked for. Raises ValueError where more than one was."""
    given = [
        name for name, value in (("workers", workers), ("scheduler", scheduler), ("dask-local", dask_local)) if value
    ]
    if len(given) > 1:
        raise ValueError(f"--{given[0]} must not be given with --{given[1]}: cells run in one place")
    for name, value in (("workers", workers), ("dask-local", dask_local)):
        if value is not None and value < 1:
            raise ValueError(f"--{name} must be at least 1, got {value}")

    def start() -> Engine:
        if scheduler is not None or dask_local is not None:
            from posefit.sweep.engines.cluster import Cluster

            return Cluster(scheduler, dask_local, limits, run_cell)
        from posefit.sweep.engines.processes import Processes

        return Processes(workers or cores(), limits, run_cell)

    return start


def tally_text(tally: Tally, out: str) -> str:
    """Return how a sweep ended, and the command that shows what it found."""
    line = f"{tally.done} of {tally.cells} cells done, {tally.ran} of them now, written to {out}"
    if tally.quarantined:
        line += f"; {tally.quarantined} quarantined: the reasons are in {Path(out) / 'quarantine'}"
    if tally.stopped:
        line += "; stopped: the same command goes on from there"
    elif tally.done:
        page = shlex.quote(f"{out.rstrip(os.sep)}.html")
        line += f"\nwhat was found: posefit report {shlex.quote(out)} --out {page}"
    return line


def preview_lines(found: dict[str, Any]) -> list[str]:
    """Return the lines that show a preview."""
    lines = []
    for cell in found["cells"]:
        more = [*settings_text(cell["settings"]), *(f"{kind} {share:g}" for kind, share in cell["corruption"].items())]
        views = ", ".join(f"{view:g}" for view in cell["view_degrees"])
        lines.append(
            f"{cell['key'][:8]}  {cell['method']} on {cell['motion']}, view {views}, instance {cell['instance']}, "
            f"seed {cell['seed']}{''.join(f', {one}' for one in more)}{'  done' if cell['done'] else ''}"
        )
    left = sum(not cell["done"] for cell in found["cells"])
    takes = f": about {duration_text(found['seconds'])} on {found['workers']} workers" if left else ""
    return [*lines, f"{len(lines)} cells, {left} of them to run{takes}"]


def duration_text(seconds: float) -> str:
    """Return a time as people say it."""
    for name, size in (("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.1f} {name}"
    return f"{seconds:.0f} seconds"


def _driven(cells: Sequence[Cell], driver: Driver, running: Engine, already: int, say: Say) -> Tally:
    from tqdm import tqdm

    bar = tqdm(total=len(cells), initial=already, unit="cell", file=sys.stderr, dynamic_ncols=True)

    def beside(message: str) -> None:
        bar.clear()
        say(message)

    with bar:
        return drive_cells(cells, driver, running, beside, progress_of(bar))


def _shown(cell: Any, done: bool) -> dict[str, Any]:
    return {"key": cell.key, "done": done, **json.loads(json.dumps(cell.spec))}


def cores() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
