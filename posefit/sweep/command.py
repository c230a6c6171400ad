"""The steps of the command `posefit sweep`."""

import os
import shlex
from collections.abc import Callable, Iterable, Mapping
from contextlib import closing
from pathlib import Path

from posefit.errors import InputError
from posefit.progress import bars_shown
from posefit.reading import counted, cut
from posefit.silhouette.sharing import cores
from posefit.sweep.cell import Cell, run_cell
from posefit.sweep.drive import Tally, drive
from posefit.sweep.engine import Engine, Limits
from posefit.sweep.pool import Pool
from posefit.sweep.shard import cells_of, done_in, ledgers_of
from posefit.sweep.versions import other_version
from posefit.sweep.writer import Writer


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

    # compiled and cached now, because each worker would otherwise compile them
    compile_kernels()
    file, *others = ledgers_of(out, shard)
    with closing(engine), Writer(file) as ledger:
        _say_other_versions(ledger, out, say)
        ledger.plan(cells_of(plan, shard), done_in(others))
        if retry_quarantined:
            count = ledger.release_quarantined()
            cells = "cell is" if count == 1 else "cells are"
            say(f"{count} quarantined {cells} tried again")
        counts = ledger.counts()
        _say_ended(counts, say)
        with tqdm(
            total=counts.total(),
            initial=counts["done"] + counts["quarantined"],
            unit="cell",
            dynamic_ncols=True,
            disable=quiet or not bars_shown(),
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


def _say_other_versions(
    ledger: Writer, out: str | Path, say: Callable[[str], None]
) -> None:
    """Say which rows of a ledger do not count, because another version made them."""
    for version, count in ledger.versions().items():
        if any(map(other_version, version.split(", "))):
            rows = counted(count, "row")
            say(f"{out}: {rows} of another version do not count: {cut(version)}")


def _say_ended(counts: Mapping[str, int], say: Callable[[str], None]) -> None:
    """Say how many cells of a plan are done or quarantined before a sweep begins."""
    if counts["done"]:
        total = sum(counts.values())
        say(f"{counts['done']} of {total} cells are done already")
    if counts["quarantined"]:
        say(
            f"{counted(counts['quarantined'], 'cell')} in quarantine: "
            "--retry-quarantined tries again"
        )


def engine_starter(
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
    return [line, f"see the results: posefit report {shlex.quote(out)} --out {page}"]
