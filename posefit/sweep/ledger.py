"""The ledger: an SQLite file with a row for every cell of a sweep.

    with Ledger("results") as ledger:  # the .sqlite files of a folder
        rows = list(ledger.rows())

A ledger can be read while a sweep writes to it. A row that was written is safe,
whatever happens to the process that wrote it. The table `cells` has these columns:

- key
- kind: "track" or "search"
- spec (JSON): the fields of the cell
- status: "planned", "done" or "quarantined"
- faults (JSON): the reasons of failed attempts
- losses: how often the cell was killed from outside
- row (JSON): the figures

The view `runs` has columns for the values that queries use most.

Only one driver writes to a file. It locks a second file, FILE.driver, which names its
process. The operating system releases that lock when the process ends in any way.
"""

import json
import os
import shlex
import socket
import sqlite3
import stat
from array import array
from bisect import bisect_left
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from posefit.errors import InputError
from posefit.files import lock, made_folders, remove_empty
from posefit.reading import counted, cut, quoted
from posefit.sweep.cell import Cell, cell_from
from posefit.sweep.engine import text_of
from posefit.version import posefit_build

if TYPE_CHECKING:
    import pandas as pd

FILE = "ledger.sqlite"
SUFFIX = ".sqlite"
WAL = "-wal"  # suffix of the log that SQLite keeps while a file is written
DRIVER = ".driver"  # suffix of the lock file
DRIVEN_BY = "process "  # how the content of a lock file begins
NO_LINK = getattr(os, "O_NOFOLLOW", 0)  # missing on some operating systems
# A cell goes into quarantine after this many attempts that failed by its own fault, or
# this many that were killed from outside.
ATTEMPTS = 3
LOSSES = 50
# The longest wait for a program that locks a file: on opening it, and during a sweep.
OPEN_SECONDS = 5.0
BUSY_SECONDS = 60.0
MAX_VALUE_BYTES = 200_000_000  # of one value that is read
MIN_FILE_BYTES = 512  # SQLite's smallest page, and so its smallest file
PAGE_BYTES = 8192  # of a new file; a page then holds about three rows
COLUMNS = {"key", "kind", "spec", "status", "faults", "losses", "row"}
NAMES = ("key", "spec", "status")  # the parts of a row that are not figures
# The columns of the view: the column and path of each value, and its type. Expressions
# in a view have no declared type, and a program that asks for it, such as DuckDB, would
# take numbers for bytes: 10 would be less than 9. So the view begins with an empty
# table, whose types SQLite uses for the view.
VIEWED = {
    "method": ("spec", "$.method", "TEXT"),
    "name": ("spec", "$.name", "TEXT"),
    "settings": ("spec", "$.settings", "TEXT"),
    "motion": ("spec", "$.motion", "TEXT"),
    "function": ("spec", "$.function", "INTEGER"),
    "dimension": ("spec", "$.dimension", "INTEGER"),
    "instance": ("spec", "$.instance", "INTEGER"),
    "seed": ("spec", "$.seed", "INTEGER"),
    "error_degrees": ("row", "$.error_degrees.mean", "REAL"),
    "mpjpe_mm": ("row", "$.mpjpe_mm", "REAL"),
    "cost": ("row", "$.cost", "REAL"),
    "seconds": ("row", "$.seconds", "REAL"),
}
_TYPES = ", ".join(f"{name} {kind}" for name, (_, _, kind) in VIEWED.items())
_VALUES = ", ".join(
    f"CAST(json_extract({column}, '{path}') AS {kind})"
    for column, path, kind in VIEWED.values()
)
# The statements that bring a file from the previous format to this one. SQLite's
# user_version is the format. Rows are the same in all formats. Until format 2 a column
# `arrays` held the joints of each frame, which nothing read; older files still have it.
MIGRATIONS = {
    1: """
    CREATE TABLE cells (
        key TEXT PRIMARY KEY, kind TEXT NOT NULL, spec TEXT NOT NULL,
        status TEXT NOT NULL DEFAULT 'planned',
        faults TEXT NOT NULL DEFAULT '[]', losses INTEGER NOT NULL DEFAULT 0, row TEXT);
    CREATE INDEX by_status ON cells (status);
    """,
    # gives the columns of the view types
    2: f"""
    DROP VIEW IF EXISTS runs;
    CREATE TABLE run_types (key TEXT, kind TEXT, status TEXT, faults TEXT, {_TYPES});
    CREATE VIEW runs AS SELECT * FROM run_types
        UNION ALL SELECT key, kind, status, faults, {_VALUES} FROM cells;
    """,
    # changes nothing in an older file; only new files lack the column `arrays`
    3: "",
}
FORMAT = max(MIGRATIONS)


class Ledger:
    """Reads ledgers, also while drivers write to them.

    It is a context manager that closes its files at the end. If several files have the
    same cell, the first finished one counts.

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
        files: dict[Path, None] = {}
        for path in paths:
            files.update(dict.fromkeys(_files(Path(path))))
        self.files = list(files)
        self._open: list[tuple[Path, sqlite3.Connection]] = []
        # The cells that are done or quarantined now, by file and status: their rowids,
        # rising. Keys of a million cells would take much memory.
        self._counted: dict[tuple[int, str], array[int]] = {}
        with ExitStack() as opened:
            opened.callback(self.close)
            for file in self.files:
                self._open.append((file, _reader(file)))
            self._count()
            opened.pop_all()

    def _count(self) -> None:
        """Note the cells that count.

        If several files have a cell, the first finished one counts, else the first.
        """
        several = len(self._open) > 1
        seen = set[str]()
        for status in ("done", "quarantined"):
            for k in range(len(self._open)):
                counted = self._counted[k, status] = array("q")
                for rowid, key in self._query(k, f"SELECT rowid, key {OF}", status):
                    if several and key in seen:
                        continue
                    if several:
                        seen.add(key)
                    counted.append(rowid)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        return sum(len(self._counted[k, "done"]) for k in range(len(self._open)))

    def done(self) -> set[str]:
        """Return the keys of the finished cells."""
        done = set[str]()
        for k in range(len(self._open)):
            for _, key in self._chosen(k, "key", "done"):
                done.add(key)
        return done

    @property
    def changed(self) -> float:
        """The time of the latest change to any of its files, in seconds since 1970."""
        logs = [Path(f"{file}{WAL}") for file in self.files]
        # a reader makes a log as well, which stays empty
        written = [log for log in logs if log.exists() and log.stat().st_size]
        return max(path.stat().st_mtime for path in (*self.files, *written))

    @property
    def version(self) -> str:
        """The versions of posefit that ran the cells, with digests of their sources.

        Without finished rows, the installed version.
        """
        builds = set()
        for k in range(len(self._open)):
            for version, _ in self._query(k, VERSIONS):
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
        for _, database in self._open:
            database.close()

    def damaged_row(self, key: str, error: Exception) -> InputError:
        """Return the error of a row that was changed since posefit wrote it.

        Its message has a command that plans the cell again.
        """
        name = quoted(key[:8])[1:-1]
        file = self.files[0]
        query = "SELECT rowid, status FROM cells WHERE key = ?"
        for k, (path, _) in enumerate(self._open):
            for rowid, status in self._query(k, query, key):
                if _is_in(rowid, self._counted.get((k, status), [])):
                    file = path
        statement = f"UPDATE cells SET status = 'planned' WHERE key LIKE '{name}%'"
        return InputError(
            f"{file}: the row of cell {name} must be written by posefit: "
            f"{cut(text_of(error))}; "
            f'to run it again: sqlite3 {shlex.quote(str(file))} "{statement}"'
        )

    def _rows(self, status: str) -> Iterator[dict[str, Any]]:
        for k in range(len(self._open)):
            columns = "key, spec, faults, row"
            for _, key, *texts in self._chosen(k, columns, status):
                try:
                    yield _parsed_row(key, status, *texts)
                except (ValueError, TypeError, KeyError, RecursionError) as error:
                    raise self.damaged_row(str(key), error) from None

    def _chosen(self, k: int, columns: str, status: str) -> Iterator[Any]:
        """Yield the rowid and columns of the cells of a file that count."""
        counted = self._counted[k, status]
        for row in self._query(k, f"SELECT rowid, {columns} {OF}", status):
            # a driver may have finished others since the ledger was opened
            if _is_in(row[0], counted):
                yield row

    def _query(self, k: int, query: str, *values: Any) -> Iterator[Any]:
        file, database = self._open[k]
        try:
            yield from database.execute(query, values)
        except (sqlite3.Error, UnicodeDecodeError) as error:
            raise _unusable(file, error) from None


OF = "FROM cells WHERE status = ? ORDER BY rowid"  # the end of most queries
# the versions of the finished cells, with their numbers
VERSIONS = """
    SELECT json_extract(spec, '$.version'), count(*) FROM cells
    WHERE status = 'done' AND json_valid(spec) GROUP BY 1
"""


def _is_in(rowid: int, rising: Sequence[int]) -> bool:
    """Return whether a rowid is among others, which rise."""
    place = bisect_left(rising, rowid)
    return place < len(rising) and rising[place] == rowid


def _parsed_row(
    key: str, status: str, spec: str, faults: str, row: str | None
) -> dict[str, Any]:
    """Return a row as a mapping. Raises an error if it is not a row of this format."""
    parsed = {"key": str(key), "spec": json.loads(spec), "status": status}
    cell_from(parsed["spec"])  # raises if a field is unknown or missing
    if status == "done":
        return {**parsed, **json.loads(row or "")}
    return {**parsed, "reasons": list(map(str, json.loads(faults)))}


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
                opened.enter_context(_locked(self.path))
                if not self.path.exists():
                    opened.push(partial(_undo_files, self.path))
                database = sqlite3.connect(
                    self.path, timeout=OPEN_SECONDS, isolation_level=None
                )
                self._db = opened.enter_context(closing(database))
                self._prepare()
            except (OSError, sqlite3.Error) as error:
                raise _unusable(self.path, error, writes=True) from None
            self._opened = opened.pop_all()

    def _prepare(self) -> None:
        """Check the file, migrate it to the current format, and make writes durable."""
        form = _check_format(self.path, self._db)
        if form:
            (whole,) = self._db.execute("PRAGMA quick_check(1)").fetchone()
            if whole != "ok":
                raise sqlite3.DatabaseError(whole)
        # This must come before the first table. A row takes more than half of a page of
        # SQLite's usual size, so such a page would hold only one row.
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
            raise _unusable(self.path, error, writes=True) from None

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
            [cell.key, cell.kind, json.dumps(cell.spec)],
        )

    def planned(self) -> list[int]:
        """Return the places of the plan's cells to run, with failed ones at the end."""
        # `faults` is a JSON list, and "[]" has two characters
        query = (
            "SELECT cells.rowid FROM planned JOIN cells USING (key) "
            "WHERE status = 'planned' "
            "ORDER BY length(faults) > 2 OR losses > 0, cells.rowid"
        )
        return [place for (place,) in self._db.execute(query)]

    def counts(self) -> Counter[str]:
        """Return how many of the plan's cells are planned, done and quarantined."""
        query = (
            "SELECT status, count(*) FROM planned JOIN cells USING (key) "
            "GROUP BY status"
        )
        counts = Counter(dict(self._db.execute(query).fetchall()))
        counts["done"] += self._elsewhere
        return +counts

    def cell(self, place: int) -> Cell:
        """Return the cell at a place, as `planned` returns them."""
        query = "SELECT spec FROM cells WHERE rowid = ?"
        (spec,) = self._db.execute(query, [place]).fetchone()
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
        """Let the plan's cells out of quarantine, and return how many."""
        query = (
            "UPDATE cells SET status = 'planned', faults = '[]', losses = 0 "
            "WHERE status = 'quarantined' AND key IN (SELECT key FROM planned)"
        )
        return self._db.execute(query).rowcount

    def versions(self) -> dict[str, int]:
        """Return the number of finished cells by their version."""
        return dict(self._db.execute(VERSIONS).fetchall())


def _files(path: Path) -> list[Path]:
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
                closing(sqlite3.connect(address, uri=True, timeout=OPEN_SECONDS))
            )
            database.execute("PRAGMA query_only = ON")
            database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_VALUE_BYTES)
            if not _check_format(file, database):
                raise InputError(
                    f"{file}: expected a ledger that posefit sweep wrote, "
                    "got an empty file"
                )
        except (sqlite3.Error, UnicodeDecodeError) as error:
            raise _unusable(file, error) from None
        opened.pop_all()
    return database


def _check_format(file: Path, database: sqlite3.Connection) -> int:
    """Return the format of a ledger, or 0 if it is still empty.

    Raises InputError if it is not a ledger.
    """
    tables = dict(database.execute("SELECT name, type FROM sqlite_master").fetchall())
    # SQLite treats a file that is too short as empty
    if not tables and 0 < (size := file.stat().st_size) < MIN_FILE_BYTES:
        raise sqlite3.DatabaseError(
            f"a file of {counted(size, 'byte')}, too short to be one"
        )
    columns = {row[1] for row in database.execute("PRAGMA table_info(cells)")}
    if tables and (tables.get("cells") != "table" or not columns >= COLUMNS):
        raise InputError(
            f"{file}: expected a ledger that posefit sweep wrote, "
            "got another SQLite file"
        )
    (form,) = database.execute("PRAGMA user_version").fetchone()
    if tables and not 1 <= form <= FORMAT:
        raise InputError(
            f"{file}: expected a ledger of format 1 to {FORMAT}, got {form}: "
            "a newer posefit may read it"
        )
    return int(form) if tables else 0


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


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold a ledger's lock, so that no other process writes to the ledger.

    If the body fails, a new lock file is removed. In a folder that others may write to,
    its name may belong to a link or another program's file. Nothing is written to
    these.

    Raises InputError in that case, and if another process holds the lock.
    """
    name = f"{path}{DRIVER}"
    new = not os.path.lexists(name)
    if os.path.islink(name):
        raise _no_lock_file(name)
    file = os.open(name, os.O_RDWR | os.O_CREAT | NO_LINK, 0o666)
    with ExitStack() as opened:
        opened.callback(os.close, file)
        is_locked = lock(file)
        state = os.fstat(file)
        # Two names mean a hard link. None means that its driver has just removed it.
        if not stat.S_ISREG(state.st_mode) or state.st_nlink != 1:
            raise _no_lock_file(name)
        driver = os.read(file, 1000).decode(errors="replace")
        if driver and not driver.startswith(DRIVEN_BY):
            raise _no_lock_file(name)
        if not is_locked:
            raise InputError(
                f"{path}: expected a ledger that no other sweep writes to, "
                f"got one that {cut(driver or 'another process')} writes to; "
                "use --shard I/N to write to a separate file"
            )
        try:
            os.ftruncate(file, 0)
            os.lseek(file, 0, os.SEEK_SET)
            driver = f"{DRIVEN_BY}{os.getpid()} of {socket.gethostname()}"
            os.write(file, driver.encode())
            yield
        except BaseException:
            if new:
                with suppress(OSError):
                    os.unlink(name)
            raise


def _no_lock_file(name: str) -> InputError:
    return InputError(
        f"{name}: expected the lock file of posefit sweep, "
        "got a link or another program's file"
    )


def _is_without_shared_memory(error: Exception) -> bool:
    """Return whether a disk cannot hold a ledger's write-ahead log.

    Many network disks cannot.
    """
    name = getattr(error, "sqlite_errorname", "")
    return "locking protocol" in str(error) or name.startswith("SQLITE_IOERR_SHM")


def _is_damage(error: Exception) -> bool:
    """Return whether an error means that a file is damaged.

    An OperationalError is about the file's folder or disk, or about who uses it.
    """
    if isinstance(error, UnicodeDecodeError):
        return True
    is_operational = isinstance(error, sqlite3.OperationalError)
    return isinstance(error, sqlite3.DatabaseError) and not is_operational


def _unusable(file: Path, error: Exception, *, writes: bool = False) -> InputError:
    """Return the error of a ledger that cannot be read, or written to."""
    if isinstance(error, sqlite3.ProgrammingError):
        return InputError(f"{file}: expected an open ledger, got a closed one")
    if _is_damage(error):
        return InputError(
            f"{file}: expected an intact SQLite file, got {cut(str(error))}: use a "
            "backup, or recover the readable part with "
            f"sqlite3 {file.name} .recover"
        )
    found = cut(str(getattr(error, "strerror", None) or error))
    if "locked" in found:
        found = f"one in use ({found}): try again when no other program locks it"
    elif _is_without_shared_memory(error):
        advice = "copy it to a local folder and read that"
        if writes:
            advice = "write to a local folder, and copy it afterwards"
        found = f"one on a disk that SQLite cannot share ({found}): {advice}"
    elif not writes:
        found = (
            f"one that cannot be opened here ({found}): copy it, "
            f"with {file.name}{WAL} if that exists, to a folder of yours"
        )
    wanted = "written to" if writes else "read"
    return InputError(f"{file}: expected a ledger that can be {wanted}, got {found}")
