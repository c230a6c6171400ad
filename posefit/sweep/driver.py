"""A driver: one process that works on a ledger, beside any number of others.

Nobody runs a cell without a claim on it, a file that only one driver can create. A driver's claims hold as long as it
lives, which its locked log shows; what a dead one had claimed is tried again by others, as the next attempt. After
creating a claim a driver looks whether the row has come meanwhile: it was written before the claim on it was given up.
"""

import json
import os
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Self

from posefit.files import appear, replaced_file
from posefit.sweep.cell import Cell, CellResult
from posefit.sweep.ledger import CLAIMS, QUARANTINE, ROWS, Ledger, create
from posefit.sweep.log import Writer, alive

ATTEMPTS = 3
LEFT = 60.0  # seconds after which a file that never got its name was left behind
SYNC = 1.0  # seconds between two times that rows are brought to the disk


class State(Enum):
    """Why a cell cannot be claimed."""

    DONE = "done"
    QUARANTINED = "quarantined"
    ELSEWHERE = "elsewhere"  # another driver runs it


@dataclass(frozen=True)
class Claim:
    """The right to run a cell."""

    cell: Cell
    attempt: int


class Driver:
    """Opens a ledger for writing, and creates it where there is none. A context; it closes its log at the end.

    Raises ValueError where the folder cannot be a ledger of this version, or cannot be written to.
    """

    def __init__(self, path: str | Path, say: Callable[[str], None] | None = None) -> None:
        create(Path(path))
        self.ledger = Ledger(path, say)
        self._claims = self.ledger.path / CLAIMS
        self._dead: set[str] = set()

    def __enter__(self) -> Self:
        try:
            self._log = Writer(self.ledger.path / ROWS)
        except OSError as error:
            raise ValueError(
                f"{self.ledger.path}: expected a folder that can be written to, got {error.strerror}"
            ) from None
        self._tidy()
        return self

    def __exit__(self, *_: object) -> None:
        self._log.close()

    def state(self, key: str) -> State | None:
        """Return whether a cell is done or in quarantine; else None."""
        if key in self.ledger:
            return State.DONE
        return State.QUARANTINED if self.ledger.in_quarantine(key) else None

    def claim(self, cell: Cell) -> Claim | State:
        """Return the right to run a cell, or why there is none."""
        reasons = []
        for attempt in range(1, ATTEMPTS + 1):
            path = self._path(cell.key, attempt)
            if not path.exists() and appear(path, self._me):
                self.ledger.refresh()
                if state := self.state(cell.key):
                    self._clear(cell.key, attempt)
                    return state
                return Claim(cell, attempt)
            try:
                held = json.loads(path.read_text(encoding="utf-8"))
            except FileNotFoundError:  # it was finished or released just now
                self.ledger.refresh()
                return self.state(cell.key) or State.ELSEWHERE
            if "failed" not in held and self._lives(held["driver"]):
                return State.ELSEWHERE
            reasons.append(held.get("failed") or f"its driver, process {held['process']} of {held['host']}, died")
        self.ledger.refresh()
        if state := self.state(cell.key):
            return state
        content = {"key": cell.key, "spec": cell.spec, "status": "quarantined", "reasons": reasons}
        if appear(self.ledger.path / QUARANTINE / f"{cell.key}.json", content):
            self._clear(cell.key)
        return State.QUARANTINED

    def finish(self, claim: Claim, result: CellResult) -> None:
        """Write the row of a claimed cell. Raises OSError where there is no room."""
        self._log.append(claim.cell.key, result.row, result.joints)
        self.ledger.refresh()
        self._clear(claim.cell.key)

    def fail(self, claim: Claim, reason: str) -> None:
        """Note why an attempt failed."""
        mine = json.dumps(self._me).removesuffix("}").encode()  # how the claim begins, and goes on beginning
        with replaced_file(self._path(claim.cell.key, claim.attempt), mine) as building:
            building.write_text(json.dumps({**self._me, "failed": reason}), encoding="utf-8")

    def release(self, claim: Claim) -> None:
        """Give a claim up as if it had never been."""
        self._path(claim.cell.key, claim.attempt).unlink(missing_ok=True)

    def sync(self) -> None:
        """Bring rows to the disk, once a second."""
        self._log.sync(SYNC)

    @property
    def _me(self) -> dict[str, Any]:
        return {"driver": self._log.name, "process": os.getpid(), "host": socket.gethostname()}

    def _path(self, key: str, attempt: int) -> Path:
        return self._claims / f"{key}.{attempt}"

    def _clear(self, key: str, last: int = ATTEMPTS) -> None:
        for attempt in range(1, last + 1):
            self._path(key, attempt).unlink(missing_ok=True)

    def _tidy(self) -> None:
        """Remove what drivers left behind that died between what they wrote and giving up their claim on it."""
        for entry in os.scandir(self._claims):
            if entry.name.startswith("."):
                with suppress(FileNotFoundError):  # it got its name just now
                    if time.time() - entry.stat().st_mtime > LEFT:
                        os.unlink(entry)
            elif self.state(entry.name.partition(".")[0]):
                Path(entry).unlink(missing_ok=True)

    def _lives(self, name: str) -> bool:
        if name == self._log.name:
            return True
        if name not in self._dead and not alive(self.ledger.path / ROWS, name):
            self._dead.add(name)
        return name not in self._dead
