"""The steps of the command `posefit sweep`."""

import os
import re
import shlex
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from pathlib import Path

from posefit.errors import InputError
from posefit.progress import bars_shown
from posefit.reading import counted, cut
from posefit.silhouette.sharing import cores
from posefit.sweep.cell import Cell, other_version, run_cell
from posefit.sweep.drive import Tally, drive
from posefit.sweep.engine import Engine, Limits
from posefit.sweep.ledger import Ledger
from posefit.sweep.plan import MAX_CELLS
from posefit.sweep.pool import Pool
from posefit.sweep.schema import FILE
from posefit.sweep.writer import Writer

SHARDS = "ledger-*-of-*.sqlite"  # matches the names that `file_of` returns


def swept(
    plan: Iterable[Cell],
    out: str | Path,
    engine: Engine,
    say: Callable[[str], None],
    *,
    shard: str | None = None,
    retry_quarantined: bool = False,
    quiet: bool = False,
) -> Tally:
    """Run the cells of a plan, or of one shard, with a progress bar on stderr.

    Finished rows of another version of posefit or of a plugin do not count as done.

    Args:
        plan: The cells.
        out: The folder of the ledger.
        engine: Runs the cells. It is closed at the end.
        say: Called with each message for the user.
        shard: The shard as I/N, or None for all cells.
        retry_quarantined: Whether to try cells in quarantine again.
        quiet: Whether to hide the progress bar.

    Returns:
        The state at the end.

    Raises:
        InputError: The ledger cannot be written to, or the engine is gone.
    """
    from tqdm.auto import tqdm

    from posefit.silhouette.cost import compile_kernels

    # else each worker would compile them
    compile_kernels()
    file, *others = ledgers_of(out, shard)
    with closing(engine), Writer(file) as ledger:
        for version, count in ledger.versions().items():
            if any(map(other_version, version.split(", "))):
                say(
                    f"{counted(count, 'row')} in {out} are of another version, "
                    f"{cut(version)}, and do not count here"
                )
        ledger.plan(cells_of(plan, shard), done_in(others))
        if retry_quarantined:
            count = ledger.release_quarantined()
            cells = "cell is" if count == 1 else "cells are"
            say(f"{count} {cells} out of quarantine, to be tried again")
        counts = ledger.counts()
        total = counts.total()
        finished = counts["done"] + counts["quarantined"]
        if finished:
            say(f"{finished} of {total} cells are done already")
        hidden = quiet or not bars_shown()
        with tqdm(
            total=total,
            initial=finished,
            unit="cell",
            dynamic_ncols=True,
            disable=hidden,
        ) as bar:

            def watch(tally: Tally) -> None:
                if tally.failed or tally.quarantined:
                    bar.set_postfix(
                        failures=tally.failed,
                        quarantined=tally.quarantined,
                        refresh=False,
                    )
                bar.update(tally.done + tally.quarantined - bar.n)

            def say_beside_bar(message: str) -> None:
                bar.clear()
                say(message)

            return drive(ledger, engine, say_beside_bar, watch)


def file_of(shard: str | None) -> str:
    """Return the name of a ledger's file: of a shard I/N, or of all cells for None.

    Raises InputError if the shard is not I/N.
    """
    if shard is None:
        return FILE
    match = re.fullmatch(r"([0-9]{1,7})/([0-9]{1,7})", shard)
    if not match or not 1 <= int(match[1]) <= int(match[2]) <= MAX_CELLS:
        raise InputError(f"--shard must be I/N such as 2/8, got {cut(shard)}")
    return f"ledger-{int(match[1])}-of-{int(match[2])}.sqlite"


def cells_of(plan: Iterable[Cell], shard: str | None) -> Iterator[Cell]:
    """Return the cells of a plan, or of one shard I/N.

    A cell's key alone decides its shard. So it does not move to another shard when the
    plan grows.
    """
    if shard is None:
        return iter(plan)
    number, count = map(int, shard.split("/"))
    return (cell for cell in plan if int(cell.key, 16) % count == number - 1)


def ledgers_of(out: str | Path, shard: str | None) -> list[Path]:
    """Return the ledgers whose finished cells a run does not repeat, its own first.

    The others are those of shards, for a run without shards.
    """
    ledgers = [Path(out) / file_of(shard)]
    if shard is None:
        ledgers += sorted(Path(out).glob(SHARDS))
    return ledgers


def done_in(ledgers: Iterable[Path]) -> set[str]:
    """Return the keys of the cells that are done in ledgers, as far as these exist."""
    files = [file for file in ledgers if file.exists() and file.stat().st_size]
    if not files:
        return set()
    with Ledger(*files) as ledger:
        return ledger.done()


def engine(
    limits: Limits,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
) -> Callable[[], Engine]:
    """Return a function that starts an engine.

    Args:
        limits: The longest time and the most memory of a cell.
        workers: Number of processes on this machine, by default one per processor.
        scheduler: The address of a Dask scheduler whose workers run the cells instead.

    Raises:
        ValueError: `workers` is less than 1, or `scheduler` is given as well.
    """
    if workers is not None and scheduler is not None:
        raise InputError(
            "--workers must not be given with --scheduler: cells run in one place"
        )
    if workers is not None and workers < 1:
        raise InputError(f"--workers must be at least 1, got {workers}")

    def start() -> Engine:
        if scheduler is not None:
            from posefit.sweep.cluster import Cluster

            return Cluster(scheduler, limits, run_cell)
        return Pool(workers or cores(), limits, run_cell)

    return start


def tally_lines(tally: Tally, out: str) -> list[str]:
    """Return lines that sum up a sweep, with the command that shows its results."""
    line = (
        f"{tally.done} of {tally.cells} cells done, {tally.ran} of them now, "
        f"written to {out}"
    )
    if tally.quarantined:
        line += f"; {tally.quarantined} quarantined: posefit report names the reasons"
    if tally.stopped:
        return [f"{line}; stopped: run the same command again to continue"]
    if not tally.done:
        return [line]
    page = shlex.quote(f"{out.rstrip(os.sep)}.html")
    return [line, f"results: posefit report {shlex.quote(out)} --out {page}"]
