"""Grids of runs, in processes of the sweep engine: plans of cells, and jobs that are no cells.

A cell is told by names and numbers, its row holds figures, and a ledger keeps it: `rows` runs a plan of them, and the
same plan into the same ledger goes on where it was. What a cell cannot say (poses to draw, motions made for the
occasion, a build to be found) is a job: a function without arguments whose result comes back as it is, by `each`. Jobs
whose results are rows can have a file, to which `kept` writes each as it comes; `earlier` reads it when they go on.
"""

import json
from collections import deque
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import closing, nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from posefit.reading import parsed_json, read_text
from posefit.sweep.cell import run_cell
from posefit.sweep.command import cores, swept
from posefit.sweep.engines.engine import Limits, Run
from posefit.sweep.engines.processes import Processes
from posefit.sweep.ledger import Ledger
from posefit.sweep.plan import Plan

PATIENCE = 0.2  # seconds between two looks at whether somebody wants to stop
LARGEST_ROWS = 50_000_000  # bytes of a file of rows

Row = dict[str, Any]
Progress = Callable[[Iterator[Any], int], Iterator[Any]]
Say = Callable[[str], None]
K = TypeVar("K", bound=Hashable)
T = TypeVar("T")


def rows(plan: Plan, workers: int | None, ledger: str | None, say: Say) -> list[dict[str, Any]]:
    """Return the rows of a plan's cells, in its order, from so many processes; by default one a core.

    They are written to a folder `ledger`, where one is named, and read from it where they are there already. Raises
    ValueError where a cell failed three times, and KeyboardInterrupt where somebody stopped it.
    """
    _check(workers)
    with nullcontext(ledger) if ledger else TemporaryDirectory() as folder:
        run: Run = run_cell
        with closing(Processes(workers or cores(), Limits(), run)) as engine:
            tally = swept(plan, folder, engine, say)
        if tally.stopped:
            again = f": the same command goes on from {ledger}" if ledger else ""
            say(f"stopped after {tally.done} of {tally.cells} runs{again}")
            raise KeyboardInterrupt
        found = Ledger(folder)
        failed = {one["key"]: one["reasons"][-1] for one in found.quarantined()}
        for cell in plan:
            if cell.key in failed:
                raise ValueError(f"{cell}: {failed[cell.key]}")
        return [found.row(cell.key) for cell in plan]


def each(jobs: Mapping[K, Callable[[], T]], workers: int | None, progress: Progress | None = None) -> dict[K, T]:
    """Return what every job gives, under its key, from so many processes; by default one a core.

    Jobs and results travel between processes. Raises ValueError where a job fails, and ends the others.
    """
    _check(workers)
    engine: Processes[tuple[K, Callable[[], T]], T] = Processes(min(workers or cores(), len(jobs)), Limits(), _called)
    with closing(engine):
        ended = _ended(jobs, engine)
        found = dict(progress(ended, len(jobs)) if progress else ended)
    return {key: found[key] for key in jobs}


def _ended(jobs: Mapping[K, Callable[[], T]], engine: Processes[tuple[K, Callable[[], T]], T]) -> Iterator[tuple[K, T]]:
    """Yield the keys and results of jobs as they end."""
    waiting, running = deque(jobs.items()), 0
    while waiting or running:
        while waiting and running < engine.window():
            engine.submit(waiting.popleft())
            running += 1
        for one in engine.wait(PATIENCE):
            running -= 1
            key = one.cell[0]
            if one.result is None:
                raise ValueError(f"{key}: {one.reason}")
            yield key, one.result


def _called(job: tuple[K, Callable[[], T]]) -> T:
    return job[1]()


def earlier(path: str | None, names: Sequence[str], key: Callable[[Row], K]) -> dict[K, Row]:
    """Return the rows of a file, each under its key; the file is made where there is none.

    Raises ValueError where it cannot be written to, or a line is no row: where one of the names is missing, or `key`
    raises ValueError or TypeError.
    """
    if path is None:
        return {}
    try:
        Path(path).touch()
    except OSError as error:
        raise ValueError(f"{path}: expected a file for rows, got {error.strerror}") from None
    found = {}
    for number, line in enumerate(read_text(path, LARGEST_ROWS).splitlines(), 1):
        try:
            row = {**parsed_json(line)}
            if not row.keys() >= set(names):
                raise ValueError("names")
            found[key(row)] = row
        except (ValueError, TypeError):
            wanted = ", ".join(names)
            raise ValueError(f"{path}: line {number} must be a row with {wanted}, got another text") from None
    return found


def kept(
    path: str | None, progress: Progress | None, ended: Iterator[tuple[K, Row]], count: int
) -> Iterator[tuple[K, Row]]:
    """Yield rows under their keys as they come, each written to a file at once where one is named."""
    for key, row in progress(ended, count) if progress else ended:
        if path is not None:
            with Path(path).open("a", encoding="utf-8") as file:
                file.write(f"{json.dumps(row)}\n")
        yield key, row


def _check(workers: int | None) -> None:
    if workers is not None and workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}")


def check_seeds(seeds: int) -> None:
    """Return nothing. Raises ValueError where it is no number of seeds."""
    if seeds < 1:
        raise ValueError(f"seeds must be at least 1, got {seeds}")
