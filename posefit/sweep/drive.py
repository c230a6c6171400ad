"""The loop of a sweep: lease cells, have an engine run them, write their rows."""

import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice

from posefit.errors import InputError
from posefit.sweep.cell import Cell
from posefit.sweep.driver import Driver, Lease, State
from posefit.sweep.engines.engine import Engine, Outcome
from posefit.sweep.plan import Plan

POLL_SECONDS = 0.2  # between two checks for a wish to stop
RECHECK_SECONDS = 0.5  # between two checks of cells that other drivers run
LOOKAHEAD = 1000  # cells, among which the first ones are chosen of different methods

Say = Callable[[str], None]
Cells = Plan | Sequence[Cell]


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
        self._new = interleaved((cell for cell, done in zip(cells, settled, strict=True) if not done), engine.window)
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


def interleaved(cells: Iterator[Cell], count: Callable[[], int]) -> Iterator[Cell]:
    """Yield cells in their order, but for the first `count()`, which are of different methods where there are any near.

    Workers that begin at the same time would otherwise compile the same functions, and wait for each other.
    """
    wanted = count()
    first: dict[str, Cell] = {}
    passed: list[Cell] = []
    for cell in islice(cells, LOOKAHEAD):
        if first.setdefault(cell.method, cell) is not cell:
            passed.append(cell)
        if len(first) >= wanted:
            break
    yield from first.values()
    yield from passed
    yield from cells


def keys_of(cells: Cells) -> Iterator[str]:
    """Return the keys of cells; a plan gives them without making its cells."""
    return cells.keys() if isinstance(cells, Plan) else (cell.key for cell in cells)
