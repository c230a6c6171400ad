"""Writes a ledger: plans cells, and records the outcome of each."""

import json
import os
import sqlite3
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Self

from posefit.errors import InputError
from posefit.files import made_folders, remove_empty
from posefit.sweep.cell import Cell, cell_from
from posefit.sweep.errors import unusable
from posefit.sweep.ledger import OPEN_SECONDS
from posefit.sweep.lock import DRIVER, locked
from posefit.sweep.schema import FORMAT, MIGRATIONS, SUFFIX, VERSIONS, WAL, format_of

# A cell goes into quarantine after this many attempts that failed by its own fault, or
# this many that were killed from outside.
ATTEMPTS = 3
LOSSES = 50
BUSY_SECONDS = 60.0  # the longest wait for a program that locks the file in a sweep
PAGE_BYTES = 8192  # page size of a new file; a page contains about three rows
NAMES = ("key", "spec", "status")  # the parts of a row that are not figures


class Writer:
    """Opens one file of a ledger for writing, or creates it.

    It is a context manager. While it is open, no other process can write to the file.

    Args:
        path: The file.

    Raises:
        InputError: Another process writes to the file, it is damaged, or it cannot be
            written to. New files and folders are then removed again.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._elsewhere = 0  # cells of the plan that are done in another file
        _check_place(self.path)
        with ExitStack() as opened:
            try:
                made = made_folders(self.path.parent)
                opened.push(partial(_undo_folders, made))
                # entered first, the lock is released last
                opened.enter_context(locked(self.path))
                if not self.path.exists():
                    opened.push(partial(_undo_files, self.path))
                database = sqlite3.connect(
                    self.path, timeout=OPEN_SECONDS, isolation_level=None
                )
                self._db = opened.enter_context(closing(database))
                self._prepare()
            except (OSError, sqlite3.Error) as error:
                raise unusable(self.path, error, writes=True) from None
            self._opened = opened.pop_all()

    def _prepare(self) -> None:
        """Check the file, migrate it to the current format, and make writes durable."""
        form = format_of(self.path, self._db)
        if form:
            (whole,) = self._db.execute("PRAGMA quick_check(1)").fetchone()
            if whole != "ok":
                raise sqlite3.DatabaseError(whole)
        # This must come before the first table. A row takes more than half of a page of
        # SQLite's usual size, so such a page would contain only one row.
        self._db.execute(f"PRAGMA page_size = {PAGE_BYTES}")
        self._db.executescript("PRAGMA journal_mode = WAL")
        for later in range(form + 1, FORMAT + 1):
            self._db.executescript(
                f"BEGIN; {MIGRATIONS[later]} PRAGMA user_version = {later}; COMMIT;"
            )
        # so that a committed row survives a power failure
        self._db.execute("PRAGMA synchronous = FULL")
        self._db.execute(f"PRAGMA busy_timeout = {1000 * BUSY_SECONDS:.0f}")
        self._db.execute("CREATE TEMP TABLE planned (key TEXT PRIMARY KEY)")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file and release its lock."""
        self._opened.close()

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Write all changes of the body, or none.

        Raises InputError if they cannot be written, as on a full disk.
        """
        try:
            self._db.execute("BEGIN IMMEDIATE")
            with self._db:  # commits, or rolls back
                yield
        except sqlite3.Error as error:
            raise unusable(self.path, error, writes=True) from None

    def plan(
        self, cells: Iterable[Cell], elsewhere: Container[str] = frozenset()
    ) -> None:
        """Add the cells of a plan that the file does not have yet.

        `planned` and `counts` then refer to the cells of this plan.

        Args:
            cells: The cells of the plan.
            elsewhere: Keys of cells that are done in another file. They are counted as
                done, and not added.
        """
        with self.transaction():
            for cell in cells:
                if cell.key in elsewhere:
                    self._elsewhere += 1
                else:
                    self.add(cell)

    def add(self, cell: Cell) -> None:
        """Add one cell of a plan."""
        self._db.execute("INSERT OR IGNORE INTO planned VALUES (?)", [cell.key])
        self._db.execute(
            "INSERT INTO cells (key, kind, spec) VALUES (?, ?, ?) "
            "ON CONFLICT (key) DO UPDATE "
            "SET spec = excluded.spec WHERE spec != excluded.spec",
            [cell.key, cell.kind, cell.spec_text],
        )

    def planned(self) -> list[int]:
        """Return the row numbers of the plan's cells to run, failed ones at the end."""
        # `faults` is a JSON list, and "[]" has two characters
        query = (
            "SELECT cells.rowid FROM planned JOIN cells USING (key) "
            "WHERE status = 'planned' "
            "ORDER BY length(faults) > 2 OR losses > 0, cells.rowid"
        )
        return [rowid for (rowid,) in self._db.execute(query)]

    def counts(self) -> Counter[str]:
        """Return how many of the plan's cells are planned, done and quarantined."""
        query = (
            "SELECT status, count(*) FROM planned JOIN cells USING (key) "
            "GROUP BY status"
        )
        counts = Counter(dict(self._db.execute(query).fetchall()))
        counts["done"] += self._elsewhere
        return +counts

    def cell(self, rowid: int) -> Cell:
        """Return the cell of a row number, as `planned` returns them."""
        query = "SELECT spec FROM cells WHERE rowid = ?"
        (spec,) = self._db.execute(query, [rowid]).fetchone()
        return cell_from(json.loads(spec))

    def finish(self, key: str, row: Mapping[str, Any]) -> bool:
        """Write a cell's row, and return whether it was written.

        If a cell runs twice, the first row counts.
        """
        figures = {name: value for name, value in row.items() if name not in NAMES}
        text = json.dumps(figures, allow_nan=False)
        query = (
            "UPDATE cells SET status = 'done', row = ? "
            "WHERE key = ? AND status != 'done'"
        )
        return self._db.execute(query, [text, key]).rowcount == 1

    def fail(self, key: str, reason: str, is_own_fault: bool = True) -> bool:
        """Note a failed attempt, and return whether the cell is now in quarantine."""
        faults, losses = self._db.execute(
            "SELECT faults, losses FROM cells WHERE key = ?", [key]
        ).fetchone()
        reasons = json.loads(faults)
        if is_own_fault:
            reasons.append(reason)
        else:
            losses += 1
        quarantined = len(reasons) >= ATTEMPTS or losses >= LOSSES
        if losses >= LOSSES:
            reasons = [f"killed from outside {LOSSES} times", reason]
        status = "quarantined" if quarantined else "planned"
        self._db.execute(
            "UPDATE cells SET status = ?, faults = ?, losses = ? "
            "WHERE key = ? AND status = 'planned'",
            [status, json.dumps(reasons), losses, key],
        )
        return quarantined

    def release_quarantined(self) -> int:
        """Plan the plan's quarantined cells again, and return how many."""
        query = (
            "UPDATE cells SET status = 'planned', faults = '[]', losses = 0 "
            "WHERE status = 'quarantined' AND key IN (SELECT key FROM planned)"
        )
        with self.transaction():
            return self._db.execute(query).rowcount

    def versions(self) -> dict[str, int]:
        """Return the number of finished cells by their version."""
        return dict(self._db.execute(VERSIONS).fetchall())


def _check_place(path: Path) -> None:
    """Raise InputError if a ledger must not be created or continued at this path."""
    folder = path.parent
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: expected a folder for the ledger, got a file")
    if path.is_symlink() and not path.exists():
        raise InputError(f"{path}: expected a ledger, got a broken link")
    if not folder.is_dir():
        return
    names = [name for name in sorted(os.listdir(folder)) if not name.startswith(".")]
    # a folder with other files but no ledger is probably the wrong one
    if names and not any(name.endswith((SUFFIX, DRIVER)) for name in names):
        raise InputError(
            f"{folder}: expected a new folder or a ledger, got one with {names[0]}"
        )


def _undo_folders(made: Iterable[Path], error: object, *_: object) -> None:
    """Remove new folders that are empty if there was an error. An `__exit__`."""
    if error is not None:
        remove_empty(made)


def _undo_files(path: Path, error: object, *_: object) -> None:
    """Remove a new ledger if there was an error. An `__exit__`."""
    if error is not None:
        for suffix in ("", WAL, "-shm", "-journal"):
            Path(f"{path}{suffix}").unlink(missing_ok=True)
