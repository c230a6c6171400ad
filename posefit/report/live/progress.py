"""How far a sweep is, read from its ledger while any number of drivers write to it."""

import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import time

from posefit.sweep.driver import read_lease
from posefit.sweep.ledger import LEASES, ROWS, SHORT, Ledger
from posefit.sweep.locks import is_locked
from posefit.sweep.log import SUFFIX


@dataclass(frozen=True)
class Progress:
    """How many cells of the plan that was begun last are where; of all cells, where no plan is known."""

    cells: int | None  # of the plan
    done: int
    quarantined: int
    left: int | None  # neither done nor in quarantine, those that run among them
    running: int  # leased by drivers that live
    failed: int  # attempts at cells that are neither done nor in quarantine, so that they are tried again
    seconds: float | None  # that what is left will take about, at the pace since the plan was begun or gone on with


def progress_so_far(ledger: Ledger, now: float | None = None) -> Progress:
    """Return how far the plan of a ledger is that was begun last; `now` is the time in seconds since 1970."""
    ledger.refresh()
    (running, failed), lost = _attempts(ledger), ledger.quarantined_keys()
    plans = ledger.plans()
    if not plans:
        return Progress(None, len(ledger), len(lost), None, running, failed, None)
    plan = plans[0]
    mine = {plan.keys[k : k + SHORT] for k in range(0, len(plan.keys), SHORT)}
    done, quarantined = (sum(bytes.fromhex(key[: 2 * SHORT]) in mine for key in keys) for keys in (ledger.keys(), lost))
    left, passed = plan.cells - done - quarantined, (time() if now is None else now) - plan.begun
    settled = done + quarantined - plan.settled
    known = running and left and settled > 0 and passed > 0.0
    seconds = left * passed / settled if known else None
    return Progress(plan.cells, done, quarantined, left, running, failed, seconds)


def _attempts(ledger: Ledger) -> tuple[int, int]:
    """Return how many cells living drivers have leased, and how many attempts have failed at cells not settled."""
    lives: dict[str, bool] = {}
    running = failed = 0
    for entry in os.scandir(ledger.path / LEASES):
        if entry.name.startswith("."):
            continue
        with suppress(OSError):  # a disk that does not say
            held = read_lease(Path(entry))
            if held is None:
                continue
            if "failed" in held:
                failed += 1
                continue
            name = held["driver"]
            if name not in lives:
                lives[name] = is_locked(ledger.path / ROWS / f"{name}{SUFFIX}")
            running += lives[name]
    return running, failed
