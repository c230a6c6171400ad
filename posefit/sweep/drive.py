"""The loop of a sweep: lease cells, have an engine run them, write their rows."""

import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import Any

from posefit.sweep.cell import Cell
from posefit.sweep.driver import Driver, Lease, State
from posefit.sweep.engines.engine import Engine, Outcome
from posefit.sweep.plan import Plan

PATIENCE = 0.2  # seconds between two looks at whether somebody wants to stop
NEAR = 1000  # cells, among which those of different methods are looked for at the beginning
ELSEWHERE = 0.5  # seconds between two looks at cells that other drivers run

Say = Callable[[str], None]
Cells = Plan | Sequence[Cell]


@dataclass
class Tally:
    """How a sweep stands."""

    cells: int
    done: int = 0  # rows there are, whoever wrote them
    ran: int = 0  # of these, rows that this driver wrote
    failed: int = 0  # attempts of this driver that failed
    quarantined: int = 0
    stopped: bool = False  # somebody asked for it


class _Stop:
    """Counts how often somebody asked to stop: once to finish what runs, twice to stop at once."""

    def __init__(self, say: Say) -> None:
        self.wishes, self._say = 0, say

    @contextmanager
    def heard(self) -> Iterator[None]:
        """Listen to Ctrl-C and to SIGTERM, which asks twice, in the main thread; elsewhere nobody asks."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        signal.signal(signal.SIGINT, lambda *_: self._asked(1))
        signal.signal(signal.SIGTERM, lambda *_: self._asked(2))
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _asked(self, times: int) -> None:
        self.wishes += times
        if self.wishes == 1:
            self._say("finishing the cells that run; Ctrl-C once more stops at once")


def drive_cells(
    cells: Cells,
    driver: Driver,
    engine: Engine,
    say: Say,
    watch: Callable[[Tally], None],
) -> Tally:
    """Return how a sweep ended: with all cells done or quarantined, or stopped. `watch` is told of every change.

    A cell that fails is tried again after all others, until it is quarantined. Cells that other drivers run are
    waited for. Raises ValueError where the ledger cannot be written to or the engine is gone; rows that were finished
    are safe.
    """
    stop = _Stop(say)
    sweep = _Sweep(cells, driver, engine, stop, say, watch)
    with stop.heard():
        try:
            sweep.run()
        except OSError as error:
            raise ValueError(
                f"{driver.ledger.path}: expected room to write to, got {error.strerror or error}; {sweep.safe}"
            ) from error
        except ValueError as error:
            raise ValueError(f"{error}; {sweep.safe}") from error
        finally:
            sweep.leave()
    return sweep.tally


class _Sweep:
    """One driver's way through the cells of a plan."""

    def __init__(
        self,
        cells: Cells,
        driver: Driver,
        engine: Engine,
        stop: _Stop,
        say: Say,
        watch: Callable[[Tally], None],
    ) -> None:
        self._driver, self._engine, self._stop, self._say, self._watch = driver, engine, stop, say, watch
        self.tally = Tally(len(cells))
        # of each cell whether it needs no work: a plan of a million cells is gone through, not held
        settled, lost = bytearray(), driver.ledger.quarantined_keys()
        for key in keys_of(cells):
            state = State.DONE if key in driver.ledger else State.QUARANTINED if key in lost else None
            settled.append(self._count(state))
        self._left = settled.count(False)  # cells that were not met yet
        self._coming = interleaved((cell for cell, done in zip(cells, settled, strict=True) if not done), engine.window)
        self._again: deque[Cell] = deque()  # cells that failed, or that others ran
        self._elsewhere: list[Cell] = []
        self._running: dict[str, Lease] = {}

    @property
    def safe(self) -> str:
        """What to say where a sweep ends too early."""
        return f"{self.tally.done} of {self.tally.cells} cells are done and safe: the same command goes on from there"

    def run(self) -> None:
        """Go on until nothing is left, or somebody stops it."""
        self._watch(self.tally)
        looked, told = time.monotonic(), False
        while True:
            if not self._stop.wishes:
                self._fill()
            self._driver.sync()
            if self._stop.wishes > 1 or not (self._running or self._pending()):
                break
            if not self._running:
                if self._elsewhere and not told:
                    self._say(f"waiting for {len(self._elsewhere)} cells that other drivers run")
                    told = True
                time.sleep(PATIENCE)
            for outcome in self._engine.wait(PATIENCE):
                self._take(outcome)
            if self._elsewhere and time.monotonic() - looked > ELSEWHERE:
                self._driver.ledger.refresh()
                self._again.extend(self._elsewhere)
                self._elsewhere.clear()
                looked = time.monotonic()
        self.tally.stopped = bool(self._running or self._waiting or self._elsewhere)
        self._watch(self.tally)

    def leave(self) -> None:
        """Stop what runs, and let others have it."""
        self._engine.close()
        for lease in self._running.values():
            self._driver.release(lease)
        self._running.clear()

    @property
    def _waiting(self) -> int:
        """How many cells nobody runs, as far as is known."""
        return self._left + len(self._again)

    def _next(self) -> Cell:
        """Return a cell that waits: one that was not tried yet, while there is any."""
        if not self._left:
            return self._again.popleft()
        self._left -= 1
        return next(self._coming)

    def _pending(self) -> bool:
        return not self._stop.wishes and bool(self._waiting or self._elsewhere)

    def _fill(self) -> None:
        """Start as many cells as the engine takes."""
        while self._waiting and len(self._running) < self._engine.window():
            cell = self._next()
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
        """Take note of a cell that needs no more work, and return whether it is one."""
        self.tally.done += state is State.DONE
        self.tally.quarantined += state is State.QUARANTINED
        return state in (State.DONE, State.QUARANTINED)


def interleaved(cells: Iterator[Cell], count: Callable[[], int]) -> Iterator[Cell]:
    """Yield cells in their order, but for the first `count()`, which are of different methods where there are any near.

    Workers that begin at the same time would otherwise need the same compiled functions, and wait for each other.
    """
    wanted = count()
    first: dict[str, Cell] = {}
    passed: list[Cell] = []
    for cell in islice(cells, NEAR):
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


def progress_of(bar: Any, say: Say) -> Callable[[Tally], None]:
    """Return what tells a progress bar of tqdm how a sweep stands, and first what was done already."""
    begun: list[bool] = []

    def watch(tally: Tally) -> None:
        settled = tally.done + tally.quarantined
        if not begun:
            begun.append(True)
            bar.n = bar.initial = settled
            if settled:
                say(f"{settled} of {tally.cells} cells are done already")
        if tally.failed or tally.quarantined:
            bar.set_postfix(failures=tally.failed, quarantined=tally.quarantined, refresh=False)
        bar.update(settled - bar.n)

    return watch
