"""The ledger: one SQLite file in which every cell has a row, whatever happens to the process that writes it.

    ledger = Ledger("results")            # every .sqlite file of a folder, or files and folders, while they grow, too

Cells are in the table `cells`: key, kind ("track" or "search"), spec (JSON: what was run), status ("planned", "done" or
"quarantined"), faults (JSON: the reasons of failed attempts), losses (times that something outside ended it), row
(JSON: the figures) and arrays (an .npz). The view `runs` has what queries ask for most as columns.

One driver writes a file: it holds a lock on a second one beside it, FILE.driver, which names its process. The operating
system drops that lock when the process ends in any way.
"""

import io
import json
import os
import socket
import sqlite3
import zipfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from posefit.errors import InputError
from posefit.files import lock
from posefit.reading import counted, cut, quoted
from posefit.sweep.cell import Cell, CellResult, cell_from
from posefit.sweep.check import checked_row
from posefit.version import posefit_build

if TYPE_CHECKING:
    import pandas as pd

    from posefit.arrays import Array

FILE = "ledger.sqlite"
SUFFIX = ".sqlite"
DRIVER = ".driver"
FORMAT = 1  # the file's user_version
ATTEMPTS = 3  # that fail by a cell's own fault
LOSSES = 50  # attempts that something outside ended
BUSY_SECONDS = 60.0  # to wait for a reader that is in the way
MAX_JOINTS_BYTES = 100_000_000  # of a cell, unpacked
MAX_VALUE_BYTES = 200_000_000  # of a value in a file
MIN_FILE_BYTES = 512  # a page of SQLite, at least
COLUMNS = {"key", "kind", "spec", "status", "faults", "losses", "row", "arrays"}
NAMES = ("key", "spec", "status")  # that a row has beside its figures
SCHEMA = f"""
PRAGMA journal_mode = WAL;
BEGIN;
CREATE TABLE IF NOT EXISTS cells (
    key TEXT PRIMARY KEY, kind TEXT NOT NULL, spec TEXT NOT NULL, status TEXT NOT NULL DEFAULT 'planned',
    faults TEXT NOT NULL DEFAULT '[]', losses INTEGER NOT NULL DEFAULT 0, row TEXT, arrays BLOB);
CREATE INDEX IF NOT EXISTS by_status ON cells (status);
CREATE VIEW IF NOT EXISTS runs AS SELECT key, kind, status, faults,
    json_extract(spec, '$.method') AS method, json_extract(spec, '$.name') AS name,
    json_extract(spec, '$.settings') AS settings, json_extract(spec, '$.motion') AS motion,
    json_extract(spec, '$.function') AS function, json_extract(spec, '$.dimension') AS dimension,
    json_extract(spec, '$.instance') AS instance, json_extract(spec, '$.seed') AS seed,
    json_extract(row, '$.error_degrees.mean') AS error_degrees, json_extract(row, '$.mpjpe_mm') AS mpjpe_mm,
    json_extract(row, '$.cost') AS cost, json_extract(row, '$.seconds') AS seconds FROM cells;
PRAGMA user_version = {FORMAT};
COMMIT;
"""


class Ledger:
    """Reads ledgers, also while drivers write to them. Raises InputError where there is none, or a damaged one."""

    def __init__(self, *paths: str | Path) -> None:
        self.path = Path(paths[0])
        self.files = list(
            dict.fromkeys(file for path in paths for file in _files(Path(path)))
        )
        self._open = [(file, _reader(file)) for file in self.files]
        # of cells in several files the first finished one counts, or the first
        self._places: dict[str, tuple[int, bool]] = {}
        for k in range(len(self._open)):
            for key, status in self._query(
                k, "SELECT key, status FROM cells WHERE status != 'planned'"
            ):
                if key not in self._places or (
                    status == "done" and not self._places[key][1]
                ):
                    self._places[key] = k, status == "done"

    def __len__(self) -> int:
        return sum(done for _, done in self._places.values())

    def __contains__(self, key: str) -> bool:
        return self._places.get(key, (0, False))[1]

    @property
    def changed(self) -> float:
        """When its latest file was written, in seconds since 1970."""
        return max(
            path.stat().st_mtime
            for file in self.files
            for path in file.parent.glob(f"{file.name}*")
        )

    @property
    def version(self) -> str:
        """The versions of posefit whose results these are, with digests of its source; that of today without rows."""
        query = "SELECT DISTINCT json_extract(spec, '$.version') FROM cells WHERE status = 'done'"
        versions = [
            str(version)
            for k in range(len(self._open))
            for (version,) in self._query(k, query)
        ]
        builds = {version.partition(", ")[0] for version in versions} or {
            posefit_build()
        }
        return ", ".join(sorted(build.removeprefix("posefit ") for build in builds))

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield every finished row, as `posefit.sweep.cell.run_cell` describes it, in the order of the plans."""
        return self._rows("done")

    def quarantined(self) -> list[dict[str, Any]]:
        """Return the cells in quarantine: key, spec, status, and the reason of each attempt."""
        return list(self._rows("quarantined"))

    def all_rows(self) -> Iterator[dict[str, Any]]:
        """Yield every finished row, and then the cells in quarantine."""
        yield from self.rows()
        yield from self.quarantined()

    def joints(self, key: str) -> dict[str, "Array"]:
        """Return the joints (T, 27, 3) of a cell's frames in metres, as `estimate` and `truth`, float32."""
        import numpy as np

        k, _ = self._places[key]
        try:
            ((data,),) = self._query(k, "SELECT arrays FROM cells WHERE key = ?", key)
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                if (
                    sum(member.file_size for member in archive.infolist())
                    > MAX_JOINTS_BYTES
                ):
                    raise ValueError("more than a cell has")
            with np.load(io.BytesIO(data), allow_pickle=False) as stored:
                return {name: stored[name] for name in ("estimate", "truth")}
        except Exception:  # whatever a hostile archive raises
            raise InputError(
                f"{self._open[k][0]}: the joints of cell {key[:8]} must be whole, got damaged ones"
            ) from None

    def frame(self) -> "pd.DataFrame":
        """Return a table of all cells, finished or quarantined; see `posefit.sweep.table`."""
        from posefit.sweep.table import dataframe

        return dataframe(self.all_rows())

    def close(self) -> None:
        """Close its files."""
        for _, database in self._open:
            database.close()

    def _rows(self, status: str) -> Iterator[dict[str, Any]]:
        for k in range(len(self._open)):
            for values in self._query(
                k, f"{SELECT} WHERE status = ? ORDER BY rowid", status
            ):
                if self._places.get(values[0]) == (k, status == "done"):
                    yield self._checked(k, *values)

    def _checked(
        self, k: int, key: Any, spec: Any, status: Any, faults: Any, row: Any
    ) -> dict[str, Any]:
        try:
            return checked_row(str(key), spec, status, faults, row)
        except ValueError as error:
            name = quoted(str(key)[:8])[1:-1]
            fix = f"sqlite3 {FILE} \"UPDATE cells SET status = 'planned' WHERE key LIKE '{name}%'\""
            raise InputError(
                f"{self._open[k][0]}: the row of cell {name} must be one that posefit wrote: {cut(str(error))}; "
                f"to run it again: {fix}"
            ) from None

    def _query(self, k: int, query: str, *values: Any) -> Iterator[Any]:
        file, database = self._open[k]
        try:
            yield from database.execute(query, values)
        except (sqlite3.Error, UnicodeDecodeError) as error:
            raise _damaged(file, error) from None


SELECT = "SELECT key, spec, status, faults, row FROM cells"


class Writer:
    """Opens one file of a ledger for writing, as its one driver, and creates it where there is none. A context.

    Raises InputError where another process drives it, where it is damaged, or where it cannot be written to.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        _check_place(self.path)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._db = sqlite3.connect(
                self.path, timeout=BUSY_SECONDS, isolation_level=None
            )
            self._lock = _locked(self.path)
        except (OSError, sqlite3.Error) as error:
            raise _unwritable(self.path, error) from None
        try:
            whole = (
                _check_format(self.path, self._db)
                and self._db.execute("PRAGMA quick_check(1)").fetchone()[0]
            )
            if whole and whole != "ok":
                raise sqlite3.DatabaseError(whole)
            self._db.executescript(SCHEMA)
            # what is written survives the loss of power
            self._db.execute("PRAGMA synchronous = FULL")
            self._db.execute("CREATE TEMP TABLE planned (key TEXT PRIMARY KEY)")
        except sqlite3.Error as error:
            self.close()
            damaged = not isinstance(error, sqlite3.OperationalError)
            raise (_damaged if damaged else _unwritable)(self.path, error) from None
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let others drive it."""
        self._db.close()
        os.close(self._lock)

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Write all that the body does, or nothing. Raises InputError where there is no room."""
        try:
            self._db.execute("BEGIN IMMEDIATE")
            with self._db:  # which commits, or rolls back
                yield
        except sqlite3.OperationalError as error:
            raise _unwritable(self.path, error) from None

    def plan(self, cells: Iterable[Cell]) -> None:
        """Add the cells of a plan, which may be there already; `planned` and `counts` are of these."""
        with self.transaction():
            for cell in cells:
                self.add(cell)

    def add(self, cell: Cell) -> None:
        """Add one cell of a plan."""
        self._db.execute("INSERT OR IGNORE INTO planned VALUES (?)", [cell.key])
        self._db.execute(
            "INSERT INTO cells (key, kind, spec) VALUES (?, ?, ?) ON CONFLICT (key) DO UPDATE "
            "SET spec = excluded.spec WHERE spec != excluded.spec",
            [cell.key, cell.kind, json.dumps(cell.spec)],
        )

    def planned(self) -> list[int]:
        """Return the places of the plan's cells that are to run, those that failed last."""
        query = "SELECT cells.rowid FROM planned JOIN cells USING (key) WHERE status = 'planned'"
        return [
            place
            for (place,) in self._db.execute(
                f"{query} ORDER BY length(faults) > 2 OR losses > 0, cells.rowid"
            )
        ]

    def counts(self) -> Counter[str]:
        """Return how many of the plan's cells are planned, done and quarantined."""
        query = "SELECT status, count(*) FROM planned JOIN cells USING (key) GROUP BY status"
        return Counter(dict(self._db.execute(query).fetchall()))

    def cell(self, place: int) -> Cell:
        """Return the cell in a place."""
        (spec,) = self._db.execute(
            "SELECT spec FROM cells WHERE rowid = ?", [place]
        ).fetchone()
        return cell_from(json.loads(spec))

    def finish(self, key: str, result: CellResult) -> bool:
        """Write what a cell measured, and return whether it is the first: of what ran twice the first counts."""
        row = json.dumps(
            {name: value for name, value in result.row.items() if name not in NAMES},
            allow_nan=False,
        )
        query = "UPDATE cells SET status = 'done', row = ?, arrays = ? WHERE key = ? AND status != 'done'"
        return self._db.execute(query, [row, result.joints, key]).rowcount == 1

    def fail(self, key: str, reason: str, is_own_fault: bool = True) -> bool:
        """Note a failed attempt, and return whether the cell is in quarantine for it."""
        faults, losses = self._db.execute(
            "SELECT faults, losses FROM cells WHERE key = ?", [key]
        ).fetchone()
        reasons = [*json.loads(faults), reason] if is_own_fault else json.loads(faults)
        losses += not is_own_fault
        quarantined = len(reasons) >= ATTEMPTS or losses >= LOSSES
        if losses >= LOSSES:
            reasons = [f"something outside ended it {LOSSES} times", reason]
        self._db.execute(
            "UPDATE cells SET status = ?, faults = ?, losses = ? WHERE key = ? AND status = 'planned'",
            [
                "quarantined" if quarantined else "planned",
                json.dumps(reasons),
                losses,
                key,
            ],
        )
        return quarantined

    def release_quarantined(self) -> int:
        """Let the plan's cells out of quarantine, and return how many."""
        release = "UPDATE cells SET status = 'planned', faults = '[]', losses = 0 WHERE status = 'quarantined'"
        return self._db.execute(
            f"{release} AND key IN (SELECT key FROM planned)"
        ).rowcount

    def old_specs(self) -> Iterator[Mapping[str, Any]]:
        """Yield the specs of finished cells."""
        return (
            json.loads(spec)
            for (spec,) in self._db.execute(
                "SELECT spec FROM cells WHERE status = 'done'"
            )
        )


def _files(path: Path) -> list[Path]:
    """Return a ledger's files: itself, or those of a folder."""
    if path.is_file():
        return [path]
    if not (found := sorted(path.glob(f"*{SUFFIX}"))):
        came = "a folder without one" if path.is_dir() else "none"
        raise InputError(
            f"{path}: expected a ledger, a folder or .sqlite file that posefit sweep wrote, got {came}"
        )
    return found


def _reader(file: Path) -> sqlite3.Connection:
    """Return what reads a file. Where it can be written, too, SQLite removes what it puts beside it."""
    mode = (
        "rw" if os.access(file.parent, os.W_OK) and os.access(file, os.W_OK) else "ro"
    )
    mode += "&immutable=1" if mode == "ro" and not Path(f"{file}-wal").exists() else ""
    try:
        database = sqlite3.connect(
            f"{file.absolute().as_uri()}?mode={mode}", uri=True, timeout=BUSY_SECONDS
        )
        database.execute("PRAGMA query_only = ON")
        if hasattr(database, "setlimit"):
            database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_VALUE_BYTES)
        if not _check_format(file, database):
            raise InputError(
                f"{file}: expected a ledger that posefit sweep wrote, got an empty file"
            )
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise _damaged(file, error) from None
    return database


def _check_format(file: Path, database: sqlite3.Connection) -> bool:
    """Return whether a file is a ledger, and not yet empty. Raises InputError where it is something else."""
    tables = dict(database.execute("SELECT name, type FROM sqlite_master").fetchall())
    # which SQLite takes for an empty one
    if not tables and 0 < (size := file.stat().st_size) < MIN_FILE_BYTES:
        raise sqlite3.DatabaseError(
            f"a file of {counted(size, 'byte')}, too short to be one"
        )
    columns = {row[1] for row in database.execute("PRAGMA table_info(cells)")}
    if tables and (tables.get("cells") != "table" or not columns >= COLUMNS):
        raise InputError(
            f"{file}: expected a ledger that posefit sweep wrote, got another SQLite file"
        )
    if (
        tables
        and (form := database.execute("PRAGMA user_version").fetchone()[0]) != FORMAT
    ):
        raise InputError(f"{file}: expected a ledger of format {FORMAT}, got {form}")
    return bool(tables)


def _check_place(path: Path) -> None:
    folder = path.parent
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: expected a folder for the ledger, got a file")
    names = (
        [name for name in sorted(os.listdir(folder)) if not name.startswith(".")]
        if folder.is_dir()
        else []
    )
    if names and not any(name.endswith((SUFFIX, DRIVER)) for name in names):
        raise InputError(
            f"{folder}: expected a new folder or a ledger, got one with {names[0]}"
        )


def _locked(path: Path) -> int:
    """Return an open file that says, as long as it is locked, that this process drives another.

    Raises InputError where another process does.
    """
    file = os.open(f"{path}{DRIVER}", os.O_RDWR | os.O_CREAT, 0o666)
    if not lock(file):
        driver = os.read(file, 1000).decode(errors="replace") or "another process"
        os.close(file)
        raise InputError(
            f"{path}: expected a ledger that no other sweep writes to, got one that {cut(driver)} drives; "
            "--shard I/N writes to a file of its own"
        )
    os.ftruncate(file, 0)
    os.write(file, f"process {os.getpid()} of {socket.gethostname()}".encode())
    return file


def _damaged(file: Path, error: Exception) -> InputError:
    what = f"got {cut(str(error))}: take it from a copy, or save what can be read by sqlite3 {file.name} .recover"
    return InputError(f"{file}: expected a whole SQLite file, {what}")


def _unwritable(path: Path, error: Exception) -> InputError:
    reason = getattr(error, "strerror", None) or error
    return InputError(
        f"{path}: expected a file that can be written to, got {cut(str(reason))}"
    )
