"""The ledger: an SQLite file with a row for every cell of a sweep.

    with Ledger("results") as ledger:  # the .sqlite files of a folder
        rows = list(ledger.rows())

A ledger can be read while a sweep writes to it (writer.py). A row that was written is
safe, whatever happens to the process that wrote it. The table `cells` has these
columns:

- key
- kind: "track" or "search"
- spec (JSON): the fields of the cell
- status: "planned", "done" or "quarantined"
- faults (JSON): the reasons of failed attempts
- losses: how often the cell was killed from outside
- row (JSON): the figures

The view `runs` has columns for the values that queries use most (schema.py).
"""

import json
import os
import sqlite3
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from posefit.errors import InputError
from posefit.reading import cut, quoted
from posefit.sweep.cell import cell_from
from posefit.sweep.engine import text_of
from posefit.sweep.errors import unusable
from posefit.sweep.schema import SUFFIX, VERSIONS, WAL, format_of
from posefit.version import posefit_build

if TYPE_CHECKING:
    import pandas as pd

OPEN_SECONDS = 5.0  # the longest wait for a program that locks a file
MAX_VALUE_BYTES = 200_000_000  # the largest value that is read


class Ledger:
    """Reads ledgers, also while drivers write to them.

    It shows the rows as they were when it was opened. It is a context manager that
    closes its files at the end. If several files have the same cell, the first finished
    one counts.

    Args:
        paths: Ledger files, or folders of them.

    Raises:
        InputError: There is no ledger, it is damaged, or it cannot be read here.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> import posefit
        >>> few = {"seeds": 1, "frames": 2, "evaluations": 40}
        >>> with TemporaryDirectory() as folder:
        ...     out = f"{folder}/results"
        ...     result = posefit.compare(["random@pca"], out=out, **few)
        ...     with posefit.Ledger(out) as ledger:
        ...         print(len(list(ledger.rows())))
        1
    """

    def __init__(self, *paths: str | Path) -> None:
        self.path = Path(paths[0])
        # each file once, even if it is named twice
        names: dict[Path, None] = {}
        for path in paths:
            names.update(dict.fromkeys(_names(Path(path))))
        self._files: dict[Path, sqlite3.Connection] = {}
        with ExitStack() as opened:
            opened.callback(self.close)
            for name in names:
                self._files[name] = _reader(name)
            opened.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        return sum(1 for _ in self._cells("key", "done"))

    def done(self) -> set[str]:
        """Return the keys of the finished cells."""
        return {key for key, _ in self._cells("key", "done")}

    @property
    def changed(self) -> float:
        """The time of the latest change to any of its files, in seconds since 1970."""
        logs = [Path(f"{file}{WAL}") for file in self._files]
        # a reader makes a log as well, which stays empty
        written = [log for log in logs if log.exists() and log.stat().st_size]
        return max(path.stat().st_mtime for path in (*self._files, *written))

    @property
    def version(self) -> str:
        """The versions of posefit that ran the cells, with digests of their sources.

        Without finished rows, the installed version.
        """
        builds = set()
        for file in self._files:
            for version, _ in self._query(file, VERSIONS):
                # the versions of plugins follow after commas
                builds.add(str(version).partition(", ")[0])
        if not builds:
            builds.add(posefit_build())
        return ", ".join(sorted(build.removeprefix("posefit ") for build in builds))

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield every finished row in the order of the plans.

        `posefit.sweep.cell.run_cell` describes a row.
        """
        return self._rows("done")

    def quarantined(self) -> list[dict[str, Any]]:
        """Return the key, spec, status and failures of each cell in quarantine."""
        return list(self._rows("quarantined"))

    def all_rows(self) -> Iterator[dict[str, Any]]:
        """Yield every finished row, and then the cells in quarantine."""
        yield from self.rows()
        yield from self.quarantined()

    def frame(self) -> "pd.DataFrame":
        """Return the pandas table of all cells. See `posefit.sweep.table`."""
        from posefit.sweep.table import dataframe

        return dataframe(self.all_rows())

    def close(self) -> None:
        """Close its files."""
        for database in self._files.values():
            database.close()

    def damaged_row(self, key: str, error: Exception) -> InputError:
        """Return the error of a row that was changed since posefit wrote it."""
        name = quoted(key[:8])[1:-1]
        return InputError(
            f"{self.path}: the row of cell {name} must be written by posefit: "
            f"{cut(text_of(error))}; use a backup, or delete the row"
        )

    def _rows(self, status: str) -> Iterator[dict[str, Any]]:
        for key, texts in self._cells("key, spec, faults, row", status):
            try:
                yield _parsed_row(key, status, *texts)
            except (ValueError, TypeError, KeyError, RecursionError) as error:
                raise self.damaged_row(str(key), error) from None

    def _cells(self, columns: str, status: str) -> Iterator[tuple[Any, list[Any]]]:
        """Yield the key and other columns of each cell that has this status.

        A cell counts once, and as finished if it is finished in any of the files.
        """
        # keys are unique within a file, so one file needs no set of up to a million
        several = len(self._files) > 1
        counted = set[str]()
        if several and status != "done":
            counted = self.done()
        query = f"SELECT {columns} FROM cells WHERE status = ? ORDER BY rowid"
        for file in self._files:
            for key, *values in self._query(file, query, status):
                if key not in counted:
                    yield key, values
                if several:
                    counted.add(key)

    def _query(self, file: Path, query: str, *values: Any) -> Iterator[Any]:
        """Yield the rows of a query. Raises InputError if the file cannot be read."""
        try:
            yield from self._files[file].execute(query, values)
        except (sqlite3.Error, UnicodeDecodeError) as error:
            raise unusable(file, error) from None


def _parsed_row(
    key: str, status: str, spec: str, faults: str, row: str | None
) -> dict[str, Any]:
    """Return a row as a mapping. Raises an error if it is not a row of this format."""
    parsed = {"key": str(key), "spec": json.loads(spec), "status": status}
    cell_from(parsed["spec"])  # raises if a field is unknown or missing
    if status == "done":
        return {**parsed, **json.loads(row or "")}
    return {**parsed, "reasons": list(map(str, json.loads(faults)))}


def _names(path: Path) -> list[Path]:
    """Return the path if it is a file, or all ledgers in a folder."""
    if path.is_file():
        return [path]
    ledgers = sorted(path.glob(f"*{SUFFIX}"))
    if not ledgers:
        found = "a folder without one" if path.is_dir() else "none"
        raise InputError(
            f"{path}: expected a ledger, a folder or .sqlite file that posefit sweep "
            f"wrote, got {found}"
        )
    return ledgers


def _reader(file: Path) -> sqlite3.Connection:
    """Return a connection that reads a file."""
    # To read, SQLite creates files in the same folder. It can remove them only if the
    # connection may write.
    writable = os.access(file.parent, os.W_OK) and os.access(file, os.W_OK)
    if writable:
        mode = "rw"
    elif Path(f"{file}{WAL}").exists():
        mode = "ro"
    else:
        mode = "ro&immutable=1"
    address = f"{file.absolute().as_uri()}?mode={mode}"
    with ExitStack() as opened:
        try:
            database = opened.enter_context(
                closing(
                    sqlite3.connect(
                        address, uri=True, timeout=OPEN_SECONDS, isolation_level=None
                    )
                )
            )
            database.execute("PRAGMA query_only = ON")
            # all queries see the rows of one moment, whatever a driver adds meanwhile
            database.execute("BEGIN")
            database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_VALUE_BYTES)
            if not format_of(file, database):
                raise InputError(
                    f"{file}: expected a ledger that posefit sweep wrote, "
                    "got an empty file"
                )
        except (sqlite3.Error, UnicodeDecodeError) as error:
            raise unusable(file, error) from None
        opened.pop_all()
    return database
