"""What `posefit sweep` does."""

import json
import os
import shlex
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import fields
from itertools import islice
from pathlib import Path
from typing import Any

from posefit.errors import InputError
from posefit.reading import counted, cut
from posefit.sweep.cell import json_of, run_cell
from posefit.sweep.driver import Cells, Driver, Tally, drive_cells, keys_of
from posefit.sweep.engines.engine import Engine, Limits, Run
from posefit.sweep.ledger import INDEX, Ledger
from posefit.sweep.plan import Plan

VALUES = 12  # of a field, that a preview lists
WARNINGS = 5  # of a preview

Say = Callable[[str], None]


def swept(
    cells: Cells, out: str | Path, running: Engine, say: Say, *, retry_quarantined: bool = False, keep_old: bool = False
) -> Tally:
    """Return how cells ended that an engine ran into the ledger in a folder, with a bar on stderr.

    With `keep_old` a cell does not run that has a row of another version of posefit or of a plugin.
    """
    from tqdm import tqdm

    with Driver(out, say) as driver:
        if retry_quarantined:
            quarantined = driver.ledger.quarantined_keys()
            count = sum(driver.release_quarantined(key) for key in keys_of(cells) if key in quarantined)
            say(f"{count} {'cell is' if count == 1 else 'cells are'} out of quarantine, to be tried again")
        for version, count in (outdated := driver.ledger.outdated()).items():
            kept = "are kept" if keep_old else "do not count here; --keep-old keeps them"
            say(f"{count} of the {len(driver.ledger)} rows in {out} are of another version, {cut(version)}, and {kept}")
        if keep_old and outdated:
            old = {_unversioned(row["spec"]) for row in driver.ledger.rows() if row["spec"]["version"] in outdated}
            cells = [cell for cell in cells if cell.key in driver.ledger or _unversioned(cell.spec) not in old]
        bar = tqdm(total=len(cells), unit="cell", file=sys.stderr, dynamic_ncols=True, delay=1e-9)
        started = False

        def watch(tally: Tally) -> None:
            nonlocal started
            settled = tally.done + tally.quarantined
            if not started:
                started, bar.n, bar.initial = True, settled, settled
                if settled:
                    say(f"{settled} of {tally.cells} cells are done already")
            if tally.failed or tally.quarantined:
                bar.set_postfix(failures=tally.failed, quarantined=tally.quarantined, refresh=False)
            bar.update(settled - bar.n)

        def say_beside_bar(message: str) -> None:
            bar.clear()
            say(message)

        with bar:
            return drive_cells(cells, driver, running, say_beside_bar, watch)


def _unversioned(spec: Mapping[str, Any]) -> str:
    return json_of({name: value for name, value in spec.items() if name != "version"})


def preview(plan: str, out: str | None, start: Callable[[], Engine], as_json: bool) -> Iterator[str]:
    """Yield the lines of a preview: how many cells of a plan have which values, and about how long all take.

    Or those of one JSON object with each cell, and whether it is done. A million cells are never in memory together.
    """
    from posefit.sweep.estimate import Estimate, KindTotal, Workload, estimate_of

    cells = Plan.read(plan)
    ledger = Ledger(out) if out is not None and (Path(out) / INDEX).exists() else None
    left: Workload = {}
    workers = count = 0
    counts: dict[str, Counter[str]] = {}
    if as_json:
        yield '{"cells": ['
    for k, cell in enumerate(cells):
        done = ledger is not None and cell.key in ledger
        if not done:
            left.setdefault(cell.kind, KindTotal(cell)).add(cell)
            count += 1
        if as_json:
            line = json.dumps({"key": cell.key, "done": done, **cell.spec})
            yield line if k == len(cells) - 1 else f"{line},"
        else:
            for one in fields(cell):
                value = getattr(cell, one.name)
                text = value if isinstance(value, str) else json_of(value)
                counts.setdefault(one.name, Counter())[text] += 1
    estimate = Estimate(0.0, {})
    if left:
        with closing(start()) as running:
            workers = running.window()
            estimate = estimate_of(left, running, workers)
    if as_json:
        untried = json.dumps(estimate.untried)
        yield f'], "seconds": {estimate.seconds!r}, "workers": {workers}, "untried": {untried}}}'
        return
    for name, values in counts.items():
        if name in ("method", "motion") or (len(values) > 1 and name not in ("version", "files")):
            shown = [f"{number:,} x {cut(value)}" for value, number in islice(values.items(), VALUES)]
            more = [f"and {len(values) - VALUES:,} other values"] * (len(values) > VALUES)
            yield f"{name:16}  {', '.join(shown + more)}"
    for cell_text, reason in islice(estimate.untried.items(), WARNINGS):
        yield f"warning: {cell_text}: {reason}; cells of its kind count for no time here, and would be quarantined"
    if len(estimate.untried) > WARNINGS:
        yield f"warning: the same holds of {counted(len(estimate.untried) - WARNINGS, 'other kind')}; --json has each"
    evaluations = sum(total.evaluations for total in left.values())
    takes = f", {evaluations:,} evaluations: about {duration_text(estimate.seconds)} on {counted(workers, 'worker')}"
    yield f"{len(cells):,} cells, {count:,} of them to run{takes if left else ''}"


def engine(
    limits: Limits,
    run: Run = run_cell,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    dask_local: int | None = None,
    dask_dashboard: bool = False,
) -> Callable[[], Engine]:
    """Return a function that starts the engine asked for: processes of this machine, or Dask workers.

    Raises ValueError where more than one is asked for.
    """
    places = {"workers": workers, "scheduler": scheduler, "dask-local": dask_local}
    chosen = [name for name, value in places.items() if value]
    if len(chosen) > 1:
        raise InputError(f"--{chosen[0]} must not be given with --{chosen[1]}: cells run in one place")
    for name, value in (("workers", workers), ("dask-local", dask_local)):
        if value is not None and value < 1:
            raise InputError(f"--{name} must be at least 1, got {value}")
    if dask_dashboard and dask_local is None:
        raise InputError("--dask-dashboard must be given with --dask-local, whose workers it shows, got it without")

    def start() -> Engine:
        from posefit.silhouette.cost import compile_kernels

        compile_kernels()
        if scheduler is not None or dask_local is not None:
            from posefit.sweep.engines.cluster import Cluster

            return Cluster(scheduler, dask_local, limits, run, dashboard=dask_dashboard)
        from posefit.sweep.engines.processes import Processes

        return Processes(workers or cores(), limits, run)

    return start


def tally_text(tally: Tally, out: str) -> str:
    """Return how a sweep ended, and the command that shows its results."""
    line = f"{tally.done} of {tally.cells} cells done, {tally.ran} of them now, written to {out}"
    if tally.quarantined:
        line += f"; {tally.quarantined} quarantined: the reasons are in {Path(out) / 'quarantine'}"
    if tally.stopped:
        line += "; stopped: the same command goes on from there"
    elif tally.done:
        line += f"\nresults: posefit report {shlex.quote(out)} --out {shlex.quote(f'{out.rstrip(os.sep)}.html')}"
    return line


def duration_text(seconds: float) -> str:
    """Return a time in words, such as `2.5 minutes`."""
    for name, size in (("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.1f} {name}"
    whole = round(seconds)
    return f"{whole} second{'' if whole == 1 else 's'}"


def cores() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
