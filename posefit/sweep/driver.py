"""A driver: one process that works on a ledger, beside any number of others; and its loop, `drive_cells`.

A driver runs a cell only under a lease, a file that only one driver can create. Its leases hold as long as it lives,
which its locked log shows; a dead driver's cells are tried again by others, as the next attempt. After creating a lease
a driver checks whether the row has come meanwhile: a row is written before the lease on it is given up.

`ATTEMPTS` attempts that fail by the cell's own fault put it into quarantine. One that was ended from outside, by the
death of its driver for example, is no fault of the cell: it is tried again without limit as long as other cells get
done. Only `LOSSES` of them, with no row between the first and the last, put it into quarantine.
"""

import json
import os
import re
import signal
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import Enum
from itertools import count
from pathlib import Path
from typing import Any, Self

from posefit.errors import InputError
from posefit.files import create_once, replaced_file
from posefit.reading import parsed_json
from posefit.sweep.cell import Cell, CellResult
from posefit.sweep.engines.engine import Engine, Outcome
from posefit.sweep.ledger import LEASES, QUARANTINE, ROWS, Ledger, create
from posefit.sweep.log import SUFFIX, Writer, is_locked, on_one_machine
from posefit.sweep.plan import Plan

ATTEMPTS = 3  # that fail by a cell's own fault
LOSSES = 50  # attempts that end by no fault of the cell, while no other cell gets done
LEFTOVER_SECONDS = 60.0  # after which a lease without a name was left behind
SYNC_SECONDS = 1.0  # between two times that rows are brought to the disk
POLL_SECONDS = 0.2  # between two checks for a wish to stop
RECHECK_SECONDS = 0.5  # between two checks of cells that other drivers run

_LEASE = {"driver": str, "process": int, "host": str, "rows": int}  # the fields of a lease
_FAILED_LEASE = {**_LEASE, "failed": str, "own": bool}
_DRIVER = re.compile("[0-9]{8}T[0-9]{6}-[0-9a-f]{8}")

Say = Callable[[str], None]
Cells = Plan | Sequence[Cell]


class State(Enum):
    """Why a cell cannot be leased."""

    DONE = "done"
    QUARANTINED = "quarantined"
    ELSEWHERE = "elsewhere"  # another driver runs it


@dataclass(frozen=True)
class Lease:
    """The right to run a cell."""

    cell: Cell
    attempt: int


class Driver:
    """Opens a ledger for writing, and creates it where there is none. A context; it closes its log at the end.

    Raises ValueError where the folder cannot be a ledger, or cannot be written to.
    """

    def __init__(self, path: str | Path, say: Callable[[str], None] | None = None) -> None:
        create(Path(path))
        self.ledger = Ledger(path, say)
        self._leases = self.ledger.path / LEASES
        self._dead: set[str] = set()

    def __enter__(self) -> Self:
        try:
            self._log = Writer(self.ledger.path / ROWS)
        except OSError as error:
            raise InputError(
                f"{self.ledger.path}: expected a folder that can be written to, got {error.strerror}"
            ) from None
        self._tidy()
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._log.close()
        except OSError as error:  # only a disk that takes rows and then loses them
            raise InputError(
                f"{self.ledger.path}: expected its latest rows to reach the disk, got {error.strerror}; the same "
                "command runs again what is missing"
            ) from None

    def state(self, key: str) -> State | None:
        """Return whether a cell is done or in quarantine; else None."""
        if key in self.ledger:
            return State.DONE
        return State.QUARANTINED if self.ledger.in_quarantine(key) else None

    def lease(self, cell: Cell) -> Lease | State:
        """Return the right to run a cell, or why there is none."""
        faults: list[str] = []
        losses: list[str] = []
        for attempt in count(1):
            if len(faults) == ATTEMPTS or len(losses) == LOSSES:
                break
            path = self._path(cell.key, attempt)
            if not path.exists() and self._taken(path):
                self.ledger.refresh()
                if state := self.state(cell.key):
                    self._clear(cell.key, attempt)
                    return state
                return Lease(cell, attempt)
            held = read_lease(path)
            if held is None:  # it was finished or released just now
                self.ledger.refresh()
                return self.state(cell.key) or State.ELSEWHERE
            if "failed" not in held and self._lives(held):
                return State.ELSEWHERE
            if held.get("own"):
                faults.append(held["failed"])
            elif held.get("rows") == len(self.ledger):  # others have got nowhere since
                losses.append(held.get("failed") or f"its driver, process {held['process']} of {held['host']}, died")
        rows = len(self.ledger)
        self.ledger.refresh()
        if state := self.state(cell.key):
            return state
        if len(self.ledger) != rows:  # others have got somewhere, after all
            return self.lease(cell)
        reasons = faults if len(faults) == ATTEMPTS else [
            f"something outside ended it {LOSSES} times while no other cell got done", *losses[-ATTEMPTS:]
        ]  # fmt: skip
        content = {"key": cell.key, "spec": cell.spec, "status": "quarantined", "reasons": reasons}
        if create_once(self.ledger.path / QUARANTINE / f"{cell.key}.json", content):
            self._clear(cell.key)
        return State.QUARANTINED

    def finish(self, lease: Lease, result: CellResult) -> None:
        """Write the row of a leased cell. Raises OSError where there is no room."""
        if not self._mine(lease):  # it was removed, and another driver may have been quicker
            self.ledger.refresh()
        if lease.cell.key not in self.ledger:
            self._log.append(lease.cell.key, result.row, result.joints)
            self.ledger.refresh()
        self._clear(lease.cell.key)

    def fail(self, lease: Lease, reason: str, own: bool = True) -> None:
        """Note why an attempt failed, and whether that was the cell's own fault."""
        if not self._mine(lease):  # it was removed: it is as if it had been released
            return
        path = self._path(lease.cell.key, lease.attempt)
        with replaced_file(path, self._mark) as building:
            content = {**self._me, "rows": len(self.ledger), "failed": reason, "own": own}
            building.write_text(json.dumps(content), encoding="utf-8")

    def release_quarantined(self, key: str) -> bool:
        """Let a cell out of quarantine, and return whether it was there."""
        if not self.ledger.in_quarantine(key):
            return False
        self._clear(key)  # first, so that it does not come back at once
        (self.ledger.path / QUARANTINE / f"{key}.json").unlink(missing_ok=True)
        return True

    def release(self, lease: Lease) -> None:
        """Give a lease up as if it had never been."""
        if self._mine(lease):
            self._path(lease.cell.key, lease.attempt).unlink(missing_ok=True)

    def sync(self) -> None:
        """Bring rows to the disk, once a second."""
        self._log.sync(SYNC_SECONDS)

    @property
    def _me(self) -> dict[str, Any]:
        return {"driver": self._log.name, "process": os.getpid(), "host": socket.gethostname()}

    def _path(self, key: str, attempt: int) -> Path:
        return self._leases / f"{key}.{attempt}"

    @property
    def _mark(self) -> bytes:
        """How a lease of this driver begins, and goes on beginning."""
        return json.dumps(self._me).removesuffix("}").encode()

    def _taken(self, path: Path) -> bool:
        try:
            return create_once(path, {**self._me, "rows": len(self.ledger)})
        except FileNotFoundError:  # another driver, whose clock is ahead, took what was being written for left behind
            return create_once(path, {**self._me, "rows": len(self.ledger)})

    def _mine(self, lease: Lease) -> bool:
        try:
            return self._path(lease.cell.key, lease.attempt).read_bytes().startswith(self._mark)
        except FileNotFoundError:
            return False

    def _clear(self, key: str, last: int = ATTEMPTS) -> None:
        for attempt in count(1):
            try:
                self._path(key, attempt).unlink()
            except (FileNotFoundError, IsADirectoryError):
                if attempt >= last:
                    return

    def _tidy(self) -> None:
        """Remove what drivers left behind that died between what they wrote and giving up their lease on it."""
        for entry in os.scandir(self._leases):
            if entry.name.startswith("."):
                with suppress(FileNotFoundError):  # it got its name just now
                    if self._log.began - entry.stat().st_mtime > LEFTOVER_SECONDS:
                        os.unlink(entry)
            elif self.state(entry.name.partition(".")[0]) and not entry.is_dir():
                Path(entry).unlink(missing_ok=True)

    def _lives(self, held: dict[str, Any]) -> bool:
        name = held["driver"]
        if name == self._log.name:
            return True
        if name in self._dead:
            return False
        if held["host"] != socket.gethostname() and (local := on_one_machine(self.ledger.path)):
            raise InputError(
                f"{self.ledger.path}: expected a disk whose locks other machines see, got {local}, and {held['host']} "
                "has begun cells: mount it with locks; or let one machine work on it, and remove from leases/ what "
                "another one left there"
            )
        if not is_locked(self.ledger.path / ROWS / f"{name}{SUFFIX}"):
            self._dead.add(name)
        return name not in self._dead


def read_lease(path: Path) -> dict[str, Any] | None:
    """Return what a lease says: its `driver`, `process` and `host`, or why it `failed`; None where there is none.

    A damaged one has failed, and holds nothing.
    """
    try:
        held: dict[str, Any] = parsed_json(path.read_bytes()) if path.is_file() or not path.exists() else {}
        types = {name: type(value) for name, value in held.items()}
        if types in (_LEASE, _FAILED_LEASE) and _DRIVER.fullmatch(held["driver"]):
            return held
    except FileNotFoundError:
        return None
    except (OSError, ValueError, AttributeError):
        pass
    return {"failed": "its lease was damaged"}


@dataclass
class Tally:
    """How a sweep stands."""

    cells: int
    done: int = 0  # cells with a row, whichever driver wrote it
    ran: int = 0  # of these, cells that this driver ran
    failed: int = 0  # attempts of this driver that failed
    quarantined: int = 0
    stopped: bool = False  # by the user


def drive_cells(
    cells: Cells, driver: Driver, engine: Engine, say: Say, watch: Callable[[Tally], None] = lambda _: None
) -> Tally:
    """Return how a sweep ended: with all cells done or quarantined, or stopped. `watch` is called at every change.

    A cell that fails is tried again after all others, until it is quarantined. Cells that other drivers run are
    waited for. Raises ValueError where the ledger cannot be written to or the engine is gone; rows that were finished
    are safe.
    """
    sweep = _Sweep(cells, driver, engine, say, watch)
    try:
        with sweep.stopping():
            sweep.run()
    except OSError as error:
        reason = f"{driver.ledger.path}: expected room to write to, got {error.strerror or error}"
        raise InputError(f"{reason}; {sweep.safe}") from error
    except ValueError as error:
        raise InputError(f"{error}; {sweep.safe}") from error
    finally:
        sweep.leave()
    return sweep.tally


class _Sweep:
    """One driver's way through the cells of a plan."""

    def __init__(self, cells: Cells, driver: Driver, engine: Engine, say: Say, watch: Callable[[Tally], None]) -> None:
        self._driver, self._engine, self._say, self._watch = driver, engine, say, watch
        self._wishes = 0  # to stop: 1 after the cells that run, 2 at once
        self.tally = Tally(len(cells))
        # of each cell whether it needs no work: the cells of a plan of a million are not held
        settled, quarantined = bytearray(), driver.ledger.quarantined_keys()
        for key in keys_of(cells):
            state = State.DONE if key in driver.ledger else State.QUARANTINED if key in quarantined else None
            settled.append(self._count(state))
        self._new_count = settled.count(False)
        self._new = (cell for cell, done in zip(cells, settled, strict=True) if not done)
        self._again: deque[Cell] = deque()  # cells that failed, or that others ran
        self._elsewhere: list[Cell] = []
        self._running: dict[str, Lease] = {}

    @property
    def safe(self) -> str:
        """The end of a message where a sweep ends too early."""
        return f"{self.tally.done} of {self.tally.cells} cells are done and safe: the same command goes on from there"

    @contextmanager
    def stopping(self) -> Iterator[None]:
        """Stop by Ctrl-C, twice for at once, or by SIGTERM; in the main thread alone."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        signal.signal(signal.SIGINT, lambda *_: self._stop(1))
        signal.signal(signal.SIGTERM, lambda *_: self._stop(2))
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def run(self) -> None:
        """Go on until nothing is left, or the user stops it."""
        self._watch(self.tally)
        checked, announced = time.monotonic(), False
        while True:
            if not self._wishes:
                self._fill()
            self._driver.sync()
            pending = not self._wishes and (self._waiting or self._elsewhere)
            if self._wishes > 1 or not (self._running or pending):
                break
            if not self._running:
                if self._elsewhere and not announced:
                    self._say(f"waiting for {len(self._elsewhere)} cells that other drivers run")
                    announced = True
                time.sleep(POLL_SECONDS)
            for outcome in self._engine.wait(POLL_SECONDS):
                self._take(outcome)
            if self._elsewhere and time.monotonic() - checked > RECHECK_SECONDS:
                self._driver.ledger.refresh()
                self._again.extend(self._elsewhere)
                self._elsewhere.clear()
                checked = time.monotonic()
        self.tally.stopped = bool(self._running or self._waiting or self._elsewhere)
        self._watch(self.tally)

    def leave(self) -> None:
        """Stop what runs, and give its leases up."""
        self._engine.close()
        for lease in self._running.values():
            self._driver.release(lease)
        self._running.clear()

    @property
    def _waiting(self) -> int:
        """How many cells are not run by any driver, as far as is known."""
        return self._new_count + len(self._again)

    def _stop(self, wishes: int) -> None:
        self._wishes += wishes
        if self._wishes == 1:
            self._say("finishing the cells that run; Ctrl-C once more stops at once")

    def _fill(self) -> None:
        """Start as many cells as the engine takes: new ones first."""
        while self._waiting and len(self._running) < self._engine.window():
            if self._new_count:
                self._new_count -= 1
                cell = next(self._new)
            else:
                cell = self._again.popleft()
            lease = self._driver.lease(cell)
            if isinstance(lease, Lease):
                self._running[cell.key] = lease
                self._engine.submit(cell)
            elif lease is State.ELSEWHERE:
                self._elsewhere.append(cell)
            else:
                self._count(lease)
                self._watch(self.tally)

    def _take(self, outcome: Outcome) -> None:
        """Write what became of a cell."""
        lease = self._running[outcome.cell.key]
        if outcome.result is not None:
            self._driver.finish(lease, outcome.result)
            self.tally.ran += 1
            self._count(State.DONE)
        else:
            if outcome.reason is None:
                self._driver.release(lease)
            else:
                self._driver.fail(lease, outcome.reason, outcome.own)
                self.tally.failed += 1
            self._again.append(outcome.cell)
        del self._running[outcome.cell.key]
        self._watch(self.tally)

    def _count(self, state: State | None) -> bool:
        """Return whether a cell needs no more work, and count it."""
        self.tally.done += state is State.DONE
        self.tally.quarantined += state is State.QUARANTINED
        return state in (State.DONE, State.QUARANTINED)


def keys_of(cells: Cells) -> Iterator[str]:
    """Return the keys of cells; a plan gives them without making its cells."""
    return cells.keys() if isinstance(cells, Plan) else (cell.key for cell in cells)
