"""A sweep under sabotage: `python -m tests.sweep.chaos --engine processes|dask --cells 300 --events 60 --seed 1`.

Cells take half a second. While they run, events come at random moments: a process that runs a cell is killed, or a
Dask worker, the driver, or the driver with its whole group; one is stopped and goes on; a log is cut off as power
failure may, a byte of it is flipped, a line of it comes twice; a lease is deleted, or a byte of it is flipped; a
second driver joins. Whenever the driver has ended, it is started again, by the
same command. At the end every cell must have one row, with the figures of an undisturbed run, and none may be in
quarantine. Prints one JSON object of what happened; its exit status is 1 where something was lost.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from posefit.sweep.ledger import Ledger
from tests.sweep.fake import SLOW, STARTS, cells, result, starts

ROOT = Path(__file__).parents[2]
DASK = "kill a Dask worker"
EVENTS = (
    "kill a worker", DASK, "kill the driver", "kill the group", "stop and go on", "cut a log off",
    "flip a byte", "repeat a line", "delete a lease", "flip a byte of a lease", "start a second driver",
)  # fmt: skip
STOPPED = 1.0  # seconds that a process is stopped
PAUSE = 0.05, 0.3  # seconds between two events, at least and at most
PATIENCE = 60.0  # seconds for a driver to begin cells, or to end
STARTED = 200  # times that a driver is started, at most


@dataclass
class Chaos:
    """A sabotaged sweep: its folder, what is to happen to it, and what happened."""

    folder: Path
    engine: str
    count: int
    events: int
    seed: int
    happened: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)
        self._ledger, self._starts = self.folder / "ledger", self.folder / "starts"
        self._driver: subprocess.Popen[bytes] | None = None
        self._others: list[subprocess.Popen[bytes]] = []  # drivers beside it

    def run(self) -> dict[str, object]:
        """Return what happened, and what became of the cells."""
        began, drivers, status = time.monotonic(), 0, -1
        try:
            while drivers < STARTED and (status != 0 or self._missing()):
                self._start()
                drivers += 1
                while self._driver is not None and self._driver.poll() is None:
                    if sum(self.happened.values()) < self.events:
                        self._event()
                    time.sleep(self._random.uniform(*PAUSE))
                assert self._driver is not None
                status = self._driver.wait()
        finally:
            self._end()
        ledger = Ledger(self._ledger)
        rows = list(ledger.rows())
        keys = Counter(row["key"] for row in rows)
        wanted = {cell.key: _figures(result(cell).row) for cell in cells(self.count, SLOW)}
        return {
            "engine": self.engine,
            "cells": self.count,
            "events": dict(sorted(self.happened.items())),
            "drivers": drivers,
            "starts": len(starts(self._starts)),
            "lost": len(wanted.keys() - keys.keys()),
            "doubled": sum(number > 1 for number in keys.values()) + len(keys.keys() - wanted.keys()),
            "changed": sum(_figures(row) != wanted.get(row["key"]) for row in rows),
            "quarantined": len(ledger.quarantined()),
            "leases left": len(list((self._ledger / "leases").iterdir())),
            "files of rows": len(list((self._ledger / "rows").iterdir())),
            "seconds": round(time.monotonic() - began, 1),
        }

    def _start(self) -> None:
        before = len(starts(self._starts))
        self._driver = self._begun()
        until = time.monotonic() + PATIENCE
        while self._driver.poll() is None and len(starts(self._starts)) == before and time.monotonic() < until:
            time.sleep(0.1)

    def _begun(self) -> subprocess.Popen[bytes]:
        words = [sys.executable, "-m", "tests.sweep.fake", str(self._ledger), self.engine, str(self.count), "slow"]
        environment = {**os.environ, STARTS: str(self._starts), "PYTHONPATH": str(ROOT)}
        with (self.folder / "output.txt").open("ab") as output:
            return subprocess.Popen(
                words, cwd=ROOT, env=environment, start_new_session=True, stdout=output, stderr=subprocess.STDOUT
            )

    def _end(self) -> None:
        for driver in (self._driver, *self._others):
            if driver is not None and driver.poll() is None:
                os.killpg(driver.pid, signal.SIGKILL)
                driver.wait()

    def _missing(self) -> bool:
        """Return whether rows that the last driver counted were damaged since."""
        return len(Ledger(self._ledger)) < self.count

    def _event(self) -> None:
        assert self._driver is not None
        events = [event for event in EVENTS if self.engine == "dask" or event != DASK]
        event, driver = self._random.choice(events), self._driver.pid
        with suppress(ProcessLookupError, FileNotFoundError):
            if event == "kill a worker":
                done = self._signalled(self._running(), signal.SIGKILL, signal.SIGTERM)
            elif event == DASK:
                done = self._signalled(_parents(self._running()), signal.SIGKILL)
            elif event == "kill the driver":
                done = self._signalled([driver], signal.SIGKILL)
            elif event == "kill the group":
                os.killpg(driver, signal.SIGKILL)
                done = True
            elif event == "stop and go on":
                done = self._signalled([driver, *self._running()], signal.SIGSTOP)
            elif event == "delete a lease":
                done = self._harmed("leases/*", lambda path: path.unlink())
            elif event == "flip a byte of a lease":
                done = self._harmed("leases/*", self._flip)
            elif event == "repeat a line":
                done = self._harmed("rows/*.jsonl", self._repeat)
            elif event == "start a second driver":
                self._others.append(self._begun())
                done = True
            elif event == "cut a log off":
                done = self._harmed("rows/*", lambda path: os.truncate(path, self._place(path)))
            else:
                done = self._harmed("rows/*", self._flip)
            self.happened[event] += done

    def _signalled(self, processes: list[int], *signals: signal.Signals) -> bool:
        """Send one of some signals to one of some processes; who is stopped goes on soon."""
        if not processes:
            return False
        process, number = self._random.choice(processes), self._random.choice(signals)
        os.kill(process, number)
        if number == signal.SIGSTOP:
            time.sleep(STOPPED)
            os.kill(process, signal.SIGCONT)
        return True

    def _running(self) -> list[int]:
        """Return the processes of this driver that began a cell and live."""
        assert self._driver is not None
        known = dict.fromkeys(process for _, process in starts(self._starts)[-8:])
        return [process for process in known if self._driver.pid in _ancestors(process)]

    def _harmed(self, pattern: str, harm: Callable[[Path], object]) -> bool:
        paths = [path for path in sorted(self._ledger.glob(pattern)) if not path.name.startswith(".")]
        paths = [path for path in paths if path.stat().st_size]
        if not paths:
            return False
        harm(self._random.choice(paths))
        return True

    def _place(self, path: Path) -> int:
        """Return a place near the end of a file: a power failure takes what was written last."""
        size = path.stat().st_size
        return self._random.randrange(max(0, size - 4000), size)

    def _repeat(self, path: Path) -> None:
        """Write a whole line of a log once more, to another log."""
        whole = [line for line in path.read_bytes().splitlines(keepends=True) if line.endswith(b"\n")]
        if whole:
            with (path.parent / "repeated.jsonl").open("ab") as file:
                file.write(self._random.choice(whole))

    def _flip(self, path: Path) -> None:
        file = os.open(path, os.O_RDWR)
        try:
            place = self._place(path)
            byte = os.pread(file, 1, place)
            os.pwrite(file, bytes([byte[0] ^ 1 << self._random.randrange(8)]), place)
        finally:
            os.close(file)


def _figures(row: Mapping[str, object]) -> dict[str, object]:
    """Return what an undisturbed run of a cell gives, to the bit."""
    return {name: row[name] for name in ("spec", "cost", "error_degrees", "joint_errors_mm", "trace")}


def _parent(process: int) -> int:
    """Return the parent of a process that lives, else 0."""
    try:
        state, parent = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[:2]
    except (FileNotFoundError, ProcessLookupError):
        return 0
    return 0 if state == "Z" else int(parent)


def _parents(processes: list[int]) -> list[int]:
    return [parent for parent in map(_parent, processes) if parent > 1]


def _ancestors(process: int) -> list[int]:
    ancestors = []
    while (process := _parent(process)) > 1:
        ancestors.append(process)
    return ancestors


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", choices=("processes", "dask"), default="processes")
    for name, default in (("cells", 300), ("events", 60), ("seed", 1)):
        parser.add_argument(f"--{name}", type=int, default=default)
    asked = parser.parse_args()
    with TemporaryDirectory() as folder:
        outcome = Chaos(Path(folder), asked.engine, asked.cells, asked.events, asked.seed).run()
        output = (Path(folder) / "output.txt").read_text(errors="replace")
    print(json.dumps(outcome, indent=1))
    if any(outcome[name] for name in ("lost", "doubled", "changed", "quarantined")):
        print(output[-4000:], file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
