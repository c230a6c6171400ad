"""The ledger: one SQLite file in which every cell has a row, whatever happens to the process that writes it.

    with Ledger("results") as ledger:  # the .sqlite files of a folder, also while they grow
        rows = list(ledger.rows())

Cells are in the table `cells`: key, kind ("track" or "search"), spec (JSON: what was run), status ("planned", "done" or
"quarantined"), faults (JSON: the reasons of failed attempts), losses (how often it was killed from outside) and row
(JSON: the figures). The view `runs` has what queries ask for most as columns.

One driver writes a file: it holds a lock on a second one beside it, FILE.driver, which names its process. The operating
system drops that lock when the process ends in any way.
"""

import json
import os
import socket
import sqlite3
import stat
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping
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
WAL = "-wal"  # of SQLite's log beside a file that is written
DRIVER = ".driver"
DRIVEN_BY = "process "  # how the content of a lock file begins
NO_LINK = getattr(os, "O_NOFOLLOW", 0)  # not on every operating system
ATTEMPTS = 3  # that fail by a cell's own fault
LOSSES = 50  # attempts that something outside ended
# to wait for another program that locks a file: where it is opened, and in the middle of a sweep
OPEN_SECONDS = 5.0
BUSY_SECONDS = 60.0
MAX_VALUE_BYTES = 200_000_000  # of a value in a file
MIN_FILE_BYTES = 512  # a page of SQLite, at least
PAGE_BYTES = 8192
COLUMNS = {"key", "kind", "spec", "status", "faults", "losses", "row"}
NAMES = ("key", "spec", "status")  # that a row has beside its figures
# What queries ask for most: where each stands, and its type. A view's expressions have no declared type, and a program
# that asks for one, such as DuckDB, would take numbers for bytes: 10 would be less than 9. So the view begins with an
# empty table, whose types SQLite takes for the view's.
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
# What brings a file to a format, its user_version, from the one before. A row has been the same since the first. Until
# format 2 a column `arrays` held the joints of each frame, which nothing read: an older file keeps its own.
MIGRATIONS = {
    1: """
    CREATE TABLE cells (
        key TEXT PRIMARY KEY, kind TEXT NOT NULL, spec TEXT NOT NULL, status TEXT NOT NULL DEFAULT 'planned',
        faults TEXT NOT NULL DEFAULT '[]', losses INTEGER NOT NULL DEFAULT 0, row TEXT);
    CREATE INDEX by_status ON cells (status);
    """,
    # the columns of the view have types
    2: f"""
    DROP VIEW IF EXISTS runs;
    CREATE TABLE run_types (key TEXT, kind TEXT, status TEXT, faults TEXT, {_TYPES});
    CREATE VIEW runs AS SELECT * FROM run_types
        UNION ALL SELECT key, kind, status, faults, {_VALUES} FROM cells;
    """,
    # a new file has no column `arrays`
    3: "",
}
FORMAT = max(MIGRATIONS)


class Ledger:
    """Reads ledgers, also while drivers write to them. A context, which closes its files at the end.

    Raises InputError if there is no ledger, if it is damaged, or if it cannot be read here.
    """

    def __init__(self, *paths: str | Path) -> None:
        self.path = Path(paths[0])
        self.files = list(
            dict.fromkeys(file for path in paths for file in _files(Path(path)))
        )
        self._open: list[tuple[Path, sqlite3.Connection]] = []
        # the file of each cell that ended, and whether it is done
        self._places: dict[str, tuple[int, bool]] = {}
        with ExitStack() as opened:
            opened.callback(self.close)
            for file in self.files:
                self._open.append((file, _reader(file)))
            for k in range(len(self._open)):
                self._place(k)
            opened.pop_all()

    def _place(self, k: int) -> None:
        """Note the cells of a file: of a cell in several files the first finished one counts, or the first."""
        query = "SELECT key, status FROM cells WHERE status != 'planned'"
        for key, status in self._query(k, query):
            done = status == "done"
            if key not in self._places or (done and not self._places[key][1]):
                self._places[key] = k, done

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        return sum(done for _, done in self._places.values())

    def __contains__(self, key: str) -> bool:
        return self._places.get(key, (0, False))[1]

    def done(self) -> set[str]:
        """Return the keys of the finished cells."""
        return {key for key, (_, done) in self._places.items() if done}

    @property
    def changed(self) -> float:
        """When its latest file was written, in seconds since 1970."""
        parts = [Path(f"{file}{suffix}") for file in self.files for suffix in ("", WAL)]
        return max(path.stat().st_mtime for path in parts if path.exists())

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

    def frame(self) -> "pd.DataFrame":
        """Return a table of all cells, finished or quarantined; see `posefit.sweep.table`."""
        from posefit.sweep.table import dataframe

        return dataframe(self.all_rows())

    def close(self) -> None:
        """Close its files."""
        for _, database in self._open:
            database.close()

    def damaged_row(self, key: str, error: Exception) -> InputError:
        """Return the error of a row that posefit did not write as it is, and what to do about it."""
        name = quoted(key[:8])[1:-1]
        file = self._open[self._places[key][0]][0]
        fix = f"sqlite3 {FILE} \"UPDATE cells SET status = 'planned' WHERE key LIKE '{name}%'\""
        return InputError(
            f"{file}: the row of cell {name} must be one that posefit wrote: {cut(text_of(error))}; "
            f"to run it again: {fix}"
        )

    def _rows(self, status: str) -> Iterator[dict[str, Any]]:
        query = f"{SELECT} WHERE status = ? ORDER BY rowid"
        for k in range(len(self._open)):
            for key, *texts in self._query(k, query, status):
                if self._places.get(key) != (k, status == "done"):
                    continue
                try:
                    yield _parsed_row(key, status, *texts)
                except (ValueError, TypeError, KeyError, RecursionError) as error:
                    raise self.damaged_row(str(key), error) from None

    def _query(self, k: int, query: str, *values: Any) -> Iterator[Any]:
        file, database = self._open[k]
        try:
            yield from database.execute(query, values)
        except (sqlite3.Error, UnicodeDecodeError) as error:
            raise _unreadable(file, error) from None


SELECT = "SELECT key, spec, faults, row FROM cells"


def _parsed_row(
    key: str, status: str, spec: str, faults: str, row: str | None
) -> dict[str, Any]:
    """Return a row as a mapping. Raises an error that says what no row of this format has."""
    parsed = {"key": str(key), "spec": json.loads(spec), "status": status}
    cell_from(parsed["spec"])  # knows each field
    if status == "done":
        return {**parsed, **json.loads(row or "")}
    return {**parsed, "reasons": list(map(str, json.loads(faults)))}


class Writer:
    """Opens one file of a ledger for writing, as its one driver, and creates it where there is none. A context.

    Raises InputError if another process drives it, if it is damaged, or if it cannot be written to. Then nothing is
    left of a ledger that was not there before.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._elsewhere = 0  # cells of the plan that another file has done
        _check_place(self.path)
        with ExitStack() as opened:
            try:
                made = made_folders(self.path.parent)
                opened.push(partial(_undo_folders, made))
                # the lock is the last to be released
                opened.enter_context(_locked(self.path))
                if not self.path.exists():
                    opened.push(partial(_undo_files, self.path))
                self._db = opened.enter_context(
                    closing(
                        sqlite3.connect(
                            self.path, timeout=OPEN_SECONDS, isolation_level=None
                        )
                    )
                )
                self._prepare()
            except (OSError, sqlite3.Error) as error:
                raise _unwritable(self.path, error) from None
            self._opened = opened.pop_all()

    def _prepare(self) -> None:
        """Check the file, bring its tables to today's form, and have each write reach the disk."""
        form = _check_format(self.path, self._db)
        if form:
            (whole,) = self._db.execute("PRAGMA quick_check(1)").fetchone()
            if whole != "ok":
                raise sqlite3.DatabaseError(whole)
        # Before the first table: a row takes more than half of a page of SQLite's usual size, and would have one alone.
        self._db.execute(f"PRAGMA page_size = {PAGE_BYTES}")
        self._db.executescript("PRAGMA journal_mode = WAL")
        for later in range(form + 1, FORMAT + 1):
            self._db.executescript(
                f"BEGIN; {MIGRATIONS[later]} PRAGMA user_version = {later}; COMMIT;"
            )
        # what is written survives the loss of power
        self._db.execute("PRAGMA synchronous = FULL")
        self._db.execute(f"PRAGMA busy_timeout = {1000 * BUSY_SECONDS:.0f}")
        self._db.execute("CREATE TEMP TABLE planned (key TEXT PRIMARY KEY)")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let others drive it."""
        self._opened.close()

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Write all that the body does, or nothing. Raises InputError where there is no room."""
        try:
            self._db.execute("BEGIN IMMEDIATE")
            with self._db:  # which commits, or rolls back
                yield
        except sqlite3.Error as error:
            raise _unwritable(self.path, error) from None

    def plan(
        self, cells: Iterable[Cell], elsewhere: Container[str] = frozenset()
    ) -> None:
        """Add the cells of a plan, which may be there already; `planned` and `counts` are of these.

        Those with a key in `elsewhere` are done in another file: they are counted, and not added.
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
        counts = Counter(dict(self._db.execute(query).fetchall()))
        counts["done"] += self._elsewhere
        return +counts

    def cell(self, place: int) -> Cell:
        """Return the cell in a place."""
        (spec,) = self._db.execute(
            "SELECT spec FROM cells WHERE rowid = ?", [place]
        ).fetchone()
        return cell_from(json.loads(spec))

    def finish(self, key: str, row: Mapping[str, Any]) -> bool:
        """Write a cell's row, and return whether it is the first: if a cell ran twice, the first row counts."""
        figures = {name: value for name, value in row.items() if name not in NAMES}
        text = json.dumps(figures, allow_nan=False)
        query = "UPDATE cells SET status = 'done', row = ? WHERE key = ? AND status != 'done'"
        return self._db.execute(query, [text, key]).rowcount == 1

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
    """Return a ledger's files: itself, or the ledgers in a folder."""
    if path.is_file():
        return [path]
    if not (found := sorted(path.glob(f"*{SUFFIX}"))):
        came = "a folder without one" if path.is_dir() else "none"
        raise InputError(
            f"{path}: expected a ledger, a folder or .sqlite file that posefit sweep wrote, got {came}"
        )
    return found


def _reader(file: Path) -> sqlite3.Connection:
    """Return a connection that reads a file.

    SQLite removes what it puts beside the file, if it may write there.
    """
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
                    f"{file}: expected a ledger that posefit sweep wrote, got an empty file"
                )
        except (sqlite3.Error, UnicodeDecodeError) as error:
            raise _unreadable(file, error) from None
        opened.pop_all()
    return database


def _check_format(file: Path, database: sqlite3.Connection) -> int:
    """Return the format of a ledger, 0 of one that is still empty. Raises InputError if it is something else."""
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
    (form,) = database.execute("PRAGMA user_version").fetchone()
    if tables and not 1 <= form <= FORMAT:
        raise InputError(
            f"{file}: expected a ledger of format 1 to {FORMAT}, got {form}: a newer posefit may read it"
        )
    return int(form) if tables else 0


def _check_place(path: Path) -> None:
    folder = path.parent
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: expected a folder for the ledger, got a file")
    if path.is_symlink() and not path.exists():
        raise InputError(f"{path}: expected a ledger, got a link that leads nowhere")
    names = (
        [name for name in sorted(os.listdir(folder)) if not name.startswith(".")]
        if folder.is_dir()
        else []
    )
    if names and not any(name.endswith((SUFFIX, DRIVER)) for name in names):
        raise InputError(
            f"{folder}: expected a new folder or a ledger, got one with {names[0]}"
        )


def _undo_folders(made: Iterable[Path], error: object, *_: object) -> None:
    """Remove new folders that are empty, if there was an error: the exit of a context."""
    if error is not None:
        remove_empty(made)


def _undo_files(path: Path, error: object, *_: object) -> None:
    """Remove a new ledger, if there was an error: the exit of a context."""
    if error is not None:
        for suffix in ("", WAL, "-shm", "-journal"):
            Path(f"{path}{suffix}").unlink(missing_ok=True)


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold the lock that says that this process drives a ledger. If the body fails, a new lock file is removed.

    In a folder that others may write to, its name may be a link's or another file's: nothing is written to those.
    Raises InputError then, and if another process holds the lock.
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
        # a second name is a hard link; no name is that of a driver that removed it just now
        if not stat.S_ISREG(state.st_mode) or state.st_nlink != 1:
            raise _no_lock_file(name)
        driver = os.read(file, 1000).decode(errors="replace")
        if driver and not driver.startswith(DRIVEN_BY):
            raise _no_lock_file(name)
        if not is_locked:
            raise InputError(
                f"{path}: expected a ledger that no other sweep writes to, "
                f"got one that {cut(driver or 'another process')} drives; "
                "--shard I/N writes to a file of its own"
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
        f"{name}: expected the lock file of posefit sweep, got a link or another program's file"
    )


def _is_without_shared_memory(error: Exception) -> bool:
    """Return whether a disk cannot hold the write-ahead log of a ledger, as many network disks cannot."""
    name = getattr(error, "sqlite_errorname", "")
    return "locking protocol" in str(error) or name.startswith("SQLITE_IOERR_SHM")


def _is_damage(error: Exception) -> bool:
    """Return whether an error says that a file is damaged; any other is about where it lies, or who uses it."""
    return isinstance(error, UnicodeDecodeError) or (
        isinstance(error, sqlite3.DatabaseError)
        and not isinstance(error, sqlite3.OperationalError)
    )


def _unreadable(file: Path, error: Exception) -> InputError:
    """Return the error of a ledger that cannot be read."""
    if isinstance(error, sqlite3.ProgrammingError):
        return InputError(f"{file}: expected an open ledger, got a closed one")
    if _is_damage(error):
        return _damaged(file, error)
    reason = cut(str(error))
    if "locked" in reason:
        came = f"one in use ({reason}): try again when no other program locks it"
    elif _is_without_shared_memory(error):
        came = f"one on a disk that SQLite cannot share ({reason}): copy it to a local folder and read that"
    else:
        log = f"{file.name}{WAL}"
        came = f"one that cannot be opened here ({reason}): copy it, with {log} if there is one, to a folder of yours"
    return InputError(f"{file}: expected a ledger that can be read, got {came}")


def _unwritable(path: Path, error: Exception) -> InputError:
    """Return the error of a ledger that cannot be written to."""
    if _is_damage(error):
        return _damaged(path, error)
    reason = cut(str(getattr(error, "strerror", None) or error))
    if "locked" in reason:
        came = f"one in use ({reason}): try again when no other program locks it"
    elif _is_without_shared_memory(error):
        came = f"a disk that SQLite cannot share ({reason}): write to a local folder, and copy it afterwards"
    else:
        came = reason
    return InputError(f"{path}: expected a file that can be written to, got {came}")


def _damaged(file: Path, error: Exception) -> InputError:
    what = f"got {cut(str(error))}: take it from a copy, or save what can be read by sqlite3 {file.name} .recover"
    return InputError(f"{file}: expected a whole SQLite file, {what}")
