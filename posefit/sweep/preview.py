"""The preview of `posefit sweep --dry-run`: a plan's cells and their approximate time.

Each method runs a few frames, in another process. This also finds settings that a
method's factory refuses, which checking a plan cannot find.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import islice
from typing import Any, NamedTuple

from posefit.errors import InputError
from posefit.reading import cut
from posefit.settings import settings_text
from posefit.sweep.cell import Cell, TrackCell, json_of, run_cell
from posefit.sweep.engine import POLL_SECONDS, Limits, Outcome
from posefit.sweep.plan import Plan
from posefit.sweep.pool import Pool
from posefit.sweep.shard import cells_of, done_in, file_of, ledgers_of
from posefit.sweep.versions import foreign_plugins

MAX_VALUES = 12  # the most values of a field that a preview lists
FRAMES = 4  # frames of the short run of a method


class Preview(NamedTuple):
    """The preview of a plan."""

    lines: list[str]
    cells: list[dict[str, Any]]  # key, done and spec of each
    seconds: float  # time of the cells to run, one after the other


def preview(plan: str, out: str | None, shard: str | None, limits: Limits) -> Preview:
    """Return the preview of a plan, or of one shard of it.

    Args:
        plan: The plan's file, as `posefit.sweep.plan.Plan.read` takes it.
        out: The folder of the ledger, or None. Its finished cells will not run again.
        shard: The shard as I/N, or None for all cells.
        limits: The longest time and the most memory of a run.

    Returns:
        The preview.

    Raises:
        ValueError: The plan is wrong, or a method fails in its first frames.
    """
    counts: dict[str, Counter[str]] = {}
    to_run: dict[str, list[Cell]] = {}  # cells by method and settings
    listed = []
    for cell, done in _cells(plan, out, shard):
        listed.append({"key": cell.key, "done": done, **cell.spec})
        for name, value in cell.spec.items():
            text = value if isinstance(value, str) else json_of(value)
            counts.setdefault(name, Counter())[text] += 1
        if not done:
            method = json_of([cell.method, dict(cell.settings)])
            to_run.setdefault(method, []).append(cell)
    cells = [cell for group in to_run.values() for cell in group]
    evaluations = sum(cell.total_evaluations for cell in cells)
    totals = (
        f"{len(listed):,} cells, {len(cells):,} of them to run, "
        f"{evaluations:,} evaluations"
    )
    lines = [*_value_lines(counts), totals]
    with closing(Pool(1, limits, run_cell)) as pool:
        seconds = sum(_seconds_of(group, pool) for group in to_run.values())
    return Preview(lines, listed, seconds)


def time_line(seconds: float, workers: int) -> str:
    """Return a line such as `about 3 hours on 2 workers`.

    `seconds` is the time of all cells, one after the other.
    """
    each = seconds / workers
    where = "one worker" if workers == 1 else f"{workers} workers"
    for unit, length in (("hours", 3600.0), ("minutes", 60.0)):
        if each >= 2 * length:
            return f"about {each / length:.0f} {unit} on {where}"
    return f"about {max(each, 1.0):.0f} s on {where}"


def _cells(
    plan: str, out: str | None, shard: str | None
) -> Iterator[tuple[Cell, bool]]:
    """Yield the cells of a plan or of a shard, each with whether it is done."""
    ledgers = ledgers_of(out, shard) if out is not None else []
    # a wrong shard is reported before the plan is read, which may take seconds
    file_of(shard)
    cells = cells_of(Plan.read(plan), shard)
    done = done_in(ledgers)
    for cell in cells:
        yield cell, cell.key in done


def _value_lines(counts: Mapping[str, Counter[str]]) -> list[str]:
    """Return a line for each field with more than one value, with the cells of each."""
    lines = []
    for name, values in counts.items():
        is_varied = len(values) > 1 and name not in ("version", "files")
        if name not in ("method", "motion") and not is_varied:
            continue
        shown = []
        for value, count in islice(values.items(), MAX_VALUES):
            shown.append(f"{count:,} x {cut(value)}")
        if len(values) > MAX_VALUES:
            shown.append(f"and {len(values) - MAX_VALUES:,} other values")
        lines.append(f"{name:16}  {', '.join(shown)}")
    return lines


def _seconds_of(cells: Sequence[Cell], pool: Pool) -> float:
    """Return about how many seconds one method's cells take.

    The estimate is from a few frames of the first one, or from the whole of it if it is
    a search. Raises InputError if it fails.
    """
    first = cells[0]
    amount = sum(map(_amount, cells))
    if isinstance(first, TrackCell):
        # the cell may have fewer frames
        first = replace(first, frames=min(first.frames, FRAMES))
        # a first run imports and compiles; the second is timed
        _row(first, pool)
    row = _row(first, pool)
    searching = row["seconds"]
    if isinstance(first, TrackCell):
        searching = first.frames * row["seconds_per_frame"]
    learning = row["seconds"] - searching
    return float(learning * len(cells) + searching / _amount(first) * amount)


def _amount(cell: Cell) -> float:
    """Return the evaluations of a cell times its views: its time is proportional."""
    views = len(cell.view_degrees) if isinstance(cell, TrackCell) else 1
    return float(cell.total_evaluations * views)


def _row(cell: Cell, pool: Pool) -> dict[str, Any]:
    """Return the row of a cell. Raises InputError naming its method if it fails."""
    pool.submit(cell, foreign_plugins(cell.version))
    outcomes: list[Outcome] = []
    while not outcomes:
        outcomes = pool.wait(POLL_SECONDS)
    (outcome,) = outcomes
    if outcome.reason is not None:
        settings = ", ".join(settings_text(cell.settings))
        method = f"{cell.method} with {settings}" if settings else cell.method
        where = "first frames" if isinstance(cell, TrackCell) else "first search"
        raise InputError(f"{method} fails in its {where}: {outcome.reason}")
    row: dict[str, Any] = outcome.result
    return row
