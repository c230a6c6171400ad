"""The tables of a ledger's file, and how files of older formats become current ones."""

import sqlite3
from pathlib import Path

from posefit.errors import InputError
from posefit.reading import counted

FILE = "ledger.sqlite"
SUFFIX = ".sqlite"
WAL = "-wal"  # suffix of the log that SQLite keeps while a file is written
MIN_FILE_BYTES = 512  # SQLite's smallest page, and so its smallest file
COLUMNS = {"key", "kind", "spec", "status", "faults", "losses", "row"}
# The columns of the view: the column and path of each value, and its type. Expressions
# in a view have no declared type, and a program that reads the type, such as DuckDB,
# would take numbers for bytes: 10 would be less than 9. So the view begins with an
# empty table, whose types SQLite uses for the view.
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
# the versions of the finished cells, with their numbers
VERSIONS = """
    SELECT json_extract(spec, '$.version'), count(*) FROM cells
    WHERE status = 'done' AND json_valid(spec) GROUP BY 1
"""


def format_of(file: Path, database: sqlite3.Connection) -> int:
    """Return the format of a ledger, or 0 if it is still empty.

    Raises InputError if it is not a ledger.
    """
    tables = dict(database.execute("SELECT name, type FROM sqlite_master").fetchall())
    if not tables:
        # SQLite treats a file that is too short as empty
        if 0 < (size := file.stat().st_size) < MIN_FILE_BYTES:
            raise sqlite3.DatabaseError(
                f"a file of {counted(size, 'byte')}, too short to be one"
            )
        return 0
    columns = {row[1] for row in database.execute("PRAGMA table_info(cells)")}
    if tables.get("cells") != "table" or not columns >= COLUMNS:
        raise InputError(
            f"{file}: expected a ledger that posefit sweep wrote, "
            "got another SQLite file"
        )
    (form,) = database.execute("PRAGMA user_version").fetchone()
    if not 1 <= form <= FORMAT:
        raise InputError(
            f"{file}: expected a ledger of format 1 to {FORMAT}, got {form}: "
            "a newer posefit may read it"
        )
    return int(form)
