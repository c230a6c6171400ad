"""Drives a sweep: has an engine run the planned cells, and writes their outcomes.

A cell goes into quarantine after three attempts that failed by its own fault. An
attempt that was killed from outside is not the cell's fault: the cell is tried again
after all others, and goes into quarantine only after fifty such attempts.

Waiting for the disk takes longer than a short cell, so the outcomes of cells that end
soon after each other are written together.
"""

import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

from posefit.errors import InputError
from posefit.sweep.engine import POLL_SECONDS, Engine, Outcome
from posefit.sweep.versions import foreign_plugins
from posefit.sweep.writer import Writer

WRITE_SECONDS = 0.2  # the least time between two writes while cells run


@dataclass
class Tally:
    """The state of a sweep, in numbers of cells."""

    cells: int
    done: int = 0  # cells with a row
    ran: int = 0  # done by this driver
    failed: int = 0  # attempts of this driver that failed
    quarantined: int = 0
    stopped: bool = False  # whether the user stopped the sweep


def drive(
    ledger: Writer,
    engine: Engine,
    say: Callable[[str], None],
    watch: Callable[[Tally], None] = lambda _: None,
) -> Tally:
    """Run the planned cells of a ledger until all are done or quarantined, or it stops.

    Args:
        ledger: The ledger whose cells run.
        engine: Runs the cells. It is closed at the end.
        say: Called with each message for the user.
        watch: Called with the tally at the beginning and after each change.

    Returns:
        The state at the end.

    Raises:
        InputError: The ledger cannot be written to, or the engine is gone. Finished
            rows are safe.
    """
    counts = ledger.counts()
    tally = Tally(counts.total(), counts["done"], quarantined=counts["quarantined"])
    watch(tally)
    waiting = deque(ledger.planned())
    running = dict[str, int]()  # row in the ledger by the cell's key
    ended: list[tuple[int, Outcome]] = []  # not written yet, with their rows
    written = time.monotonic()
    try:
        with _stopping(say) as stop_requests:
            while len(stop_requests) < 2 and (
                running or ended or (waiting and not stop_requests)
            ):
                window = engine.window()
                while waiting and not stop_requests and len(running) < window:
                    rowid = waiting.popleft()
                    cell = ledger.cell(rowid)
                    running[cell.key] = rowid
                    engine.submit(cell, foreign_plugins(cell.version))
                is_due = time.monotonic() - written >= WRITE_SECONDS
                if ended and (is_due or not running):
                    waiting += _write(ledger, tally, ended)
                    watch(tally)
                    written = time.monotonic()
                else:
                    for outcome in engine.wait(POLL_SECONDS):
                        ended.append((running.pop(outcome.job.key), outcome))
        waiting += _write(ledger, tally, ended)
    except InputError as error:
        # if the engine failed, outcomes may remain; if the ledger did, `ended` is empty
        _write(ledger, tally, ended)
        safe = (
            f"{tally.done} of {tally.cells} cells are done and safe: "
            "run the same command again to continue"
        )
        raise InputError(f"{error}; {safe}") from error
    finally:
        engine.close()
    tally.stopped = bool(waiting or running)
    watch(tally)
    return tally


def _write(ledger: Writer, tally: Tally, ended: list[tuple[int, Outcome]]) -> list[int]:
    """Write, count and remove outcomes. Returns the rows of cells to try again."""
    if not ended:
        return []
    batch = ended.copy()
    # so that nothing is written twice, nor tried again if the ledger cannot be written
    ended.clear()
    again = []
    # a row counts once it is on the disk, so count in a copy until then
    written = replace(tally)
    with ledger.transaction():
        for rowid, outcome in batch:
            if not _record(ledger, written, outcome):
                again.append(rowid)
    vars(tally).update(vars(written))
    return again


def _record(ledger: Writer, tally: Tally, outcome: Outcome) -> bool:
    """Write and count the outcome of one attempt.

    Returns whether the cell is done or quarantined. If not, it must be tried again.
    """
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
    """Yield a list that grows with each request to stop.

    One entry means: finish the running cells. Two mean: stop at once. Ctrl-C adds one,
    SIGTERM two. Python handles signals only in the main thread; in others the list
    remains empty.
    """
    stop_requests: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield stop_requests
        return

    def stop(number: int, _: object) -> None:
        stop_requests.extend([number] * (2 if number == signal.SIGTERM else 1))
        if len(stop_requests) == 1:
            say("finishing the running cells; press Ctrl-C again to stop at once")

    before = {
        number: signal.signal(number, stop)
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield stop_requests
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
