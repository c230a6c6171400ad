"""Cells that take no work: what a sweep's machinery is tried with. Each start is noted in the file POSEFIT_STARTS names.

`python -m tests.sweep.fake DIR CELLS SECONDS [SCHEDULER]` drives a sweep of such cells and of five bad ones; what a cell
does follows from its `frames`: see `behave`. What drives a sweep is imported where it is used: the processes that run cells do without.
"""

import json
import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from posefit.sweep.cell import Cell, TrackCell
from posefit.sweep.engine import Limits, Outcome

if TYPE_CHECKING:
    from posefit.sweep.drive import Tally
    from posefit.sweep.engine import Engine

ROOT = Path(__file__).parents[2]
STARTS = "POSEFIT_STARTS"
LEFT = "POSEFIT_LEFT"
SLOW_SECONDS = "POSEFIT_SLOW_SECONDS"
SEGFAULT = 1001
ENDLESS = 1002
HOG = 1003
RAISE = 1004
SLOW = 1005
SECOND = 1006
TOGETHER = 1007
LEAVE = 1008
KILLED = 1009
EXIT = 1010
COMPILE = 1011
LEAVE_BEHIND = 1012


def cells(count: int, frames: int = 60) -> list[TrackCell]:
    """Return so many cells that differ by their seed."""
    return [
        TrackCell("random@pca", "walk", ("walk-a",), seed=seed, frames=frames)
        for seed in range(count)
    ]


def behave(cell: TrackCell) -> dict[str, Any]:
    """Return a result that follows from the cell alone, or do harm."""
    if STARTS in os.environ:
        with open(os.environ[STARTS], "ab", buffering=0) as file:
            file.write(f"{cell.key} {os.getpid()}\n".encode())
    match cell.frames:
        case n if n == SEGFAULT:
            os.kill(os.getpid(), signal.SIGSEGV)  # as if its memory were wrong
        case n if n == ENDLESS:
            while True:
                pass
        case n if n == HOG:
            _ = [np.ones(2**24) for _ in range(10_000)]
        case n if n == RAISE:
            raise ZeroDivisionError("one\nby none")
        case n if n == LEAVE:
            os._exit(0)
        case n if n == EXIT:
            sys.exit(0)
        case n if n == KILLED:  # as if from outside
            os.kill(os.getpid(), (signal.SIGKILL, signal.SIGTERM)[cell.seed % 2])
        case n if n == LEAVE_BEHIND:
            leave_behind()
        case n if n == COMPILE:
            compiled()
        case n if n == TOGETHER:
            while len(starts(Path(os.environ[STARTS]))) < 2:
                time.sleep(0.02)
        case n if n == SECOND:
            time.sleep(1.0)
        case n if n == SLOW:
            time.sleep(float(os.environ.get(SLOW_SECONDS, "0.5")))
        case _:
            time.sleep(0.05)
    return result(cell)


def state() -> list[Any]:
    """Return what a cell may find changed by an earlier one."""
    return [
        os.getcwd(),
        os.environ.get("LEFT"),
        "left" in sys.path,
        signal.getsignal(signal.SIGUSR1) is signal.SIG_DFL,
        np.geterr()["divide"],
    ]


def leave_behind() -> None:
    """Note the state of this process and the number of another that sleeps, and change all of it."""
    sleeps = [sys.executable, "-c", "import time; time.sleep(600)"]
    process = subprocess.Popen(sleeps, cwd="/", start_new_session=True)
    # NumPy draws two of them, and keeps the second
    numbers = random.random(), np.random.standard_normal()  # noqa: NPY002
    with open(os.environ[LEFT], "a", encoding="utf-8") as file:
        file.write(json.dumps([process.pid, *state(), numbers]) + "\n")
    os.chdir("/")
    os.environ["LEFT"] = "left"
    sys.path.append("left")
    signal.signal(signal.SIGUSR1, lambda *_: None)
    np.seterr(divide="raise")
    random.seed(1)
    np.random.set_bit_generator(np.random.PCG64(1))


def compiled() -> int:
    """Return how many threads numba may use, asked by a loop that is compiled just now."""
    import numba

    @numba.njit
    def threads() -> int:
        return numba.get_num_threads()

    return int(threads())


def result(cell: TrackCell) -> dict[str, Any]:
    """Return a cell's row."""
    numbers = np.random.default_rng(cell.seed).random(3)
    return {
        "key": cell.key,
        "spec": cell.spec,
        "status": "done",
        "cost": float(numbers[0]),
        "error_degrees": {"mean": float(numbers[1]), "max": float(numbers[2])},
        "joint_errors_mm": [float(cell.seed)] * 27,
        "trace": {"evaluations": [40, 80], "cost": [2.0, 1.0]},
        "warnings": [],
        "mode_reliability": [],
        "seconds": time.time(),
    }


def swept(out: Path, chosen: Sequence[Cell], engine: "Engine") -> "Tally":
    """Return how a sweep by an engine ended."""
    from posefit.sweep.drive import drive
    from posefit.sweep.schema import FILE
    from posefit.sweep.writer import Writer

    with Writer(out / FILE) as ledger:
        ledger.plan(chosen)
        return drive(ledger, engine, print)


def rows_in(path: Path) -> list[dict[str, Any]]:
    """Return the finished rows of a ledger."""
    from posefit.sweep.ledger import Ledger

    with Ledger(path) as ledger:
        return list(ledger.rows())


def quarantined_in(path: Path) -> list[dict[str, Any]]:
    """Return the cells of a ledger that are in quarantine."""
    from posefit.sweep.ledger import Ledger

    with Ledger(path) as ledger:
        return ledger.quarantined()


class Instant:
    """An engine that makes up a cell's result at once."""

    def __init__(self) -> None:
        self.ended: list[Outcome] = []

    def window(self) -> int:
        return 1

    def submit(self, cell: TrackCell, tenant: str = "") -> None:
        self.ended.append(Outcome(cell, result(cell)))

    def wait(self, seconds: float) -> list[Outcome]:
        ended = self.ended
        self.ended = []
        return ended

    def close(self) -> None: ...


def filled(folder: Path, count: int = 5, start: int = 0) -> Path:
    """Return a ledger with the rows of so many cells."""
    assert swept(folder, cells(start + count)[start:], Instant()).done == count
    return folder


@contextmanager
def scheduler(workers: int) -> Iterator[str]:
    """Yield the address of a Dask scheduler with so many workers of one thread."""
    address = f"tcp://127.0.0.1:{(place := port())}"
    started = []
    words = [
        [
            "dask_scheduler",
            "--port",
            str(place),
            "--host",
            "127.0.0.1",
            "--no-dashboard",
            "--no-show",
        ]
    ]
    words += [
        [
            "dask_worker",
            address,
            "--nthreads",
            "1",
            "--no-dashboard",
            "--death-timeout",
            "300",
        ]
    ] * workers
    try:
        for name, *more in words:
            command = [sys.executable, "-m", f"distributed.cli.{name}", *more]
            quiet = subprocess.DEVNULL
            started.append(
                subprocess.Popen(
                    command,
                    stdout=quiet,
                    stderr=quiet,
                    cwd=ROOT,
                    start_new_session=True,
                )
            )
        yield address
    finally:
        for process in started:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def starts(path: Path) -> list[tuple[str, int]]:
    """Return key and process of each start that was noted."""
    lines = path.read_text().splitlines() if path.exists() else []
    return [(key, int(process)) for key, process in (line.split() for line in lines)]


def bad(seed: int) -> list[TrackCell]:
    """Return five cells that raise, exit, end their process, want all memory and never end."""
    kinds = (RAISE, LEAVE, SEGFAULT, HOG, ENDLESS)
    return [
        replace(cells(1)[0], seed=seed + k, frames=kind) for k, kind in enumerate(kinds)
    ]


def main() -> int:
    """Drive a sweep as the command line says, and return its exit status."""
    from posefit.sweep.cluster import Cluster
    from posefit.sweep.pool import Pool
    from tests.sweep.fake import behave  # by a name that other processes can import

    where, many, seconds, *address = sys.argv[1:]
    limits = Limits(float(seconds), 1.0)
    chosen = cells(int(many), SLOW)
    engine: Engine
    if address:
        engine = Cluster(address[0], limits, behave, 300.0)
    else:
        engine = Pool(2, limits, behave)
    tally = swept(
        Path(where),
        [*chosen[::2], *bad(len(chosen)), *chosen[1::2]],
        engine,
    )
    return 1 if tally.quarantined else 130 if tally.stopped else 0


if __name__ == "__main__":
    sys.exit(main())
