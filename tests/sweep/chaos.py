"""A sweep under sabotage: `python -m tests.sweep.chaos --cells 300 --events 60 --seed 1`.

With `--engine dask` the cells run on two workers of a Dask scheduler, which are killed as well.

Cells take half a second, or `--seconds`, so that there is time for all events; five are bad: they raise, exit, end
their process, want all memory, or never end. While they run, events come at random moments: a process that runs a cell
is killed, or the driver, or the driver with its whole group; one is stopped and goes on; a second driver comes. Whenever
the driver has ended, it is started again, by the same command. All the while copies of the ledger's files are taken, as
a power failure would leave them. At the end every cell must have one row, with the figures of an undisturbed run,
exactly the bad ones must be in quarantine, no second driver may have got to run, and each copy must open. Prints one
JSON object of what happened; its exit status is 1 where something was lost.
"""

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

from posefit.sweep.ledger import Ledger
from tests.sweep.fake import (
    SLOW,
    SLOW_SECONDS,
    STARTS,
    bad,
    cells,
    quarantined_in,
    result,
    rows_in,
    scheduler,
    starts,
)

ROOT = Path(__file__).parents[2]
EVENTS = (
    "kill a worker",
    "kill the driver",
    "kill the group",
    "stop and go on",
    "start a second driver",
)
STOPPED = 1.0  # seconds that a process is stopped
PAUSE = 0.3, 1.5  # seconds between two events, at least and at most
CONNECT_TIMEOUT_SECONDS = 600.0  # for a driver to begin cells, or to end
STARTED = 200  # times that a driver is started, at most
LIMIT = 10.0  # seconds that a cell may take


@dataclass
class Chaos:
    """A sabotaged sweep: its folder, what is to happen to it, and what happened."""

    folder: Path
    count: int
    events: int
    seed: int
    seconds: float = 0.5  # that a cell takes
    engine: str = "pool"
    happened: Counter[str] = field(default_factory=Counter)
    refused: int = 0
    # the rows of each copy, -1 where it does not open
    copies: list[int] = field(default_factory=list)
    fewer: int = 0  # copies with fewer rows than there were when they were begun

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)
        self._ledger = self.folder / "results"
        self._starts = self.folder / "starts"
        self._driver: subprocess.Popen[bytes] | None = None
        self._address: list[str] = []

    def run(self) -> dict[str, object]:
        """Return what happened, and what became of the cells."""
        own = {STARTS: str(self._starts), SLOW_SECONDS: str(self.seconds)}
        with patch.dict(os.environ, own), ExitStack() as served:
            if self.engine == "dask":
                self._address = [served.enter_context(scheduler(2))]
            return self._run()

    def _run(self) -> dict[str, object]:
        start = time.monotonic()
        drivers = 0
        status = -1
        try:
            while drivers < STARTED and status not in (0, 1):
                before = len(starts(self._starts))
                self._driver = self._begun()
                drivers += 1
                until = time.monotonic() + CONNECT_TIMEOUT_SECONDS
                while (
                    self._driver.poll() is None
                    and len(starts(self._starts)) == before
                    and time.monotonic() < until
                ):
                    time.sleep(0.1)
                while self._driver.poll() is None:
                    if sum(self.happened.values()) < self.events:
                        self._event()
                    self._copy()
                    time.sleep(self._random.uniform(*PAUSE))
                status = self._driver.wait()
        finally:
            if self._driver is not None and self._driver.poll() is None:
                os.killpg(self._driver.pid, signal.SIGKILL)
                self._driver.wait()
        rows = rows_in(self._ledger)
        keys = Counter(row["key"] for row in rows)
        wanted = {cell.key: _figures(result(cell)) for cell in cells(self.count, SLOW)}
        quarantined = {row["key"] for row in quarantined_in(self._ledger)}
        return {
            "engine": self.engine,
            "seed": self.seed,
            "cells": self.count,
            "events": dict(sorted(self.happened.items())),
            "drivers": drivers,
            "starts": len(starts(self._starts)),
            "lost": len(wanted.keys() - keys.keys()),
            "doubled": sum(number > 1 for number in keys.values())
            + len(keys.keys() - wanted.keys()),
            "changed": sum(_figures(row) != wanted.get(row["key"]) for row in rows),
            "wrong in quarantine": len(
                quarantined ^ {cell.key for cell in bad(self.count)}
            ),
            "second drivers that ran": self.happened["start a second driver"]
            - self.refused,
            "copies": len(self.copies),
            "copies that do not open": self.copies.count(-1),
            "copies with rows missing": self.fewer,
            "seconds": round(time.monotonic() - start, 1),
        }

    def _begun(self) -> subprocess.Popen[bytes]:
        words = [
            sys.executable,
            "-m",
            "tests.sweep.fake",
            str(self._ledger),
            str(self.count),
            str(LIMIT),
            *self._address,
        ]
        how = {"cwd": ROOT, "start_new_session": True}
        with (self.folder / "output.txt").open("ab") as output:
            return subprocess.Popen(
                words, stdout=output, stderr=subprocess.STDOUT, **how
            )

    def _event(self) -> None:
        assert self._driver is not None
        event = self._random.choice(EVENTS)
        driver = self._driver.pid
        with suppress(ProcessLookupError, FileNotFoundError):
            if event == "kill a worker":
                done = self._signalled(self._running(), signal.SIGKILL, signal.SIGTERM)
            elif event == "kill the driver":
                done = self._signalled([driver], signal.SIGKILL)
            elif event == "kill the group":
                os.killpg(driver, signal.SIGKILL)
                done = True
            elif event == "stop and go on":
                done = self._signalled([driver, *self._running()], signal.SIGSTOP)
            else:
                other = self._begun()
                ended = other.wait(timeout=CONNECT_TIMEOUT_SECONDS) in (0, 1, 130)
                # it may run if the first driver has ended meanwhile
                done = self._driver.poll() is None
                output = (self.folder / "output.txt").read_bytes()
                self.refused += done and (not ended or b"that process" in output)
            self.happened[event] += done

    def _copy(self) -> None:
        """Copy the ledger's files while their writer stands still, wherever in its writing it is, and open the copy."""
        files = [
            path
            for path in self._ledger.glob("ledger.sqlite*")
            if path.suffix in (".sqlite", ".sqlite-wal")
        ]
        if self._driver is None or not files:
            return
        folder = self.folder / "copy"
        try:
            with Ledger(self._ledger) as ledger:
                with_rows = len(ledger)
            folder.mkdir()
            with suppress(ProcessLookupError):
                os.kill(self._driver.pid, signal.SIGSTOP)
            for path in files:
                shutil.copyfile(path, folder / path.name)
            with suppress(ProcessLookupError):
                os.kill(self._driver.pid, signal.SIGCONT)
            rows = rows_in(folder)
            self.copies.append(len(rows))
            self.fewer += len(rows) < with_rows
        except (FileNotFoundError, ValueError) as error:
            if isinstance(error, ValueError):
                print(error, file=sys.stderr)
                self.copies.append(-1)
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def _signalled(self, processes: list[int], *signals: signal.Signals) -> bool:
        """Send one of some signals to one of some processes; who is stopped goes on soon."""
        if not processes:
            return False
        process = self._random.choice(processes)
        number = self._random.choice(signals)
        os.kill(process, number)
        if number == signal.SIGSTOP:
            time.sleep(STOPPED)
            os.kill(process, signal.SIGCONT)
        return True

    def _running(self) -> list[int]:
        """Return the processes that began a cell and live, and the Dask workers that they belong to."""
        assert self._driver is not None
        known = dict.fromkeys(process for _, process in starts(self._starts)[-8:])
        parents = {process: _ancestors(process) for process in known}
        if self.engine == "dask":
            running = []
            for process in known:
                # the parent of a process that has ended is 0 here, of an orphan 1
                if parents[process] and parents[process][0] > 1:
                    running += [process, parents[process][0]]
            return running
        return [process for process in known if self._driver.pid in parents[process]]


def _figures(row: Mapping[str, object]) -> dict[str, object]:
    """Return what an undisturbed run of a cell gives, to the bit."""
    return {
        name: row[name]
        for name in ("spec", "cost", "error_degrees", "joint_errors_mm", "trace")
    }


def _ancestors(process: int) -> list[int]:
    """Return the parents of a process that lives, up to the first."""
    ancestors = []
    while process > 1:
        try:
            state, parent = (
                Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[:2]
            )
        except (FileNotFoundError, ProcessLookupError):
            return ancestors
        process = 0 if state == "Z" else int(parent)
        ancestors.append(process)
    return ancestors


LOST = ("lost", "doubled", "changed", "wrong in quarantine", "second drivers that ran",
        "copies that do not open", "copies with rows missing")  # fmt: skip


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, default in (("cells", 300), ("events", 60), ("seed", 1)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--seconds", type=float, default=0.5)
    parser.add_argument("--engine", choices=("pool", "dask"), default="pool")
    asked = parser.parse_args()
    with TemporaryDirectory() as folder:
        outcome = Chaos(
            Path(folder),
            asked.cells,
            asked.events,
            asked.seed,
            asked.seconds,
            asked.engine,
        ).run()
        output = (Path(folder) / "output.txt").read_text(errors="replace")
    print(json.dumps(outcome, indent=1))
    if any(outcome[name] for name in LOST):
        print(output[-4000:], file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
