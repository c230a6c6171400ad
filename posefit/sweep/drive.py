"""Drives a sweep: has an engine run the cells of a ledger that are planned, and writes what becomes of them.

Three attempts that fail by the cell's own fault put it into quarantine. One that was ended from outside is no fault of
the cell: it is tried again after all others, and only fifty of these put it into quarantine.
"""

import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

from posefit.errors import InputError
from posefit.sweep.engine import POLL_SECONDS, Engine, Outcome
from posefit.sweep.ledger import Writer


@dataclass
class Tally:
    """How a sweep stands."""

    cells: int
    done: int = 0  # cells with a row
    ran: int = 0  # of these, cells that this driver ran
    failed: int = 0  # attempts of this driver that failed
    quarantined: int = 0
    stopped: bool = False  # by the user


def drive(
    ledger: Writer,
    engine: Engine,
    say: Callable[[str], None],
    watch: Callable[[Tally], None] = lambda _: None,
) -> Tally:
    """Return how a sweep ended: with all planned cells done or quarantined, or stopped. `watch` is called at changes.

    Raises InputError where the ledger cannot be written to or the engine is gone; rows that were finished are safe.
    """
    counts = ledger.counts()
    tally = Tally(counts.total(), counts["done"], quarantined=counts["quarantined"])
    watch(tally)
    # the place of each cell that runs, by its key
    waiting = deque(ledger.planned())
    running = dict[str, int]()
    try:
        with _stopping(say) as stop_requests:
            while len(stop_requests) < 2 and (
                running or (waiting and not stop_requests)
            ):
                while waiting and not stop_requests and len(running) < engine.window():
                    place = waiting.popleft()
                    cell = ledger.cell(place)
                    running[cell.key] = place
                    engine.submit(cell)
                if not (outcomes := engine.wait(POLL_SECONDS)):
                    continue
                # a row counts once it is on the disk
                written = replace(tally)
                with ledger.transaction():
                    for outcome in outcomes:
                        place = running.pop(outcome.job.key)
                        if not _record(ledger, written, outcome):
                            waiting.append(place)
                tally = written
                watch(tally)
            tally.stopped = bool(waiting or running)
    except InputError as error:
        safe = f"{tally.done} of {tally.cells} cells are done and safe: the same command goes on from there"
        raise InputError(f"{error}; {safe}") from error
    finally:
        engine.close()
    return tally


def _record(ledger: Writer, tally: Tally, outcome: Outcome) -> bool:
    """Write what became of a cell, count it, and return whether the cell has ended; else it is to be tried again."""
    key = outcome.job.key
    if outcome.result is not None:
        tally.ran += 1
        tally.done += ledger.finish(key, outcome.result)
        return True
    if outcome.reason is None:
        return False
    tally.failed += 1
    quarantined = ledger.fail(key, outcome.reason, outcome.is_own_fault)
    tally.quarantined += quarantined
    return quarantined


@contextmanager
def _stopping(say: Callable[[str], None]) -> Iterator[list[int]]:
    """Yield requests to stop, which come by Ctrl-C, twice for at once, or by SIGTERM; in the main thread alone."""
    stop_requests: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield stop_requests
        return

    def stop(number: int, _: object) -> None:
        stop_requests.extend([number] * (2 if number == signal.SIGTERM else 1))
        if len(stop_requests) == 1:
            say("finishing the cells that run; Ctrl-C once more stops at once")

    before = {
        number: signal.signal(number, stop)
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield stop_requests
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
