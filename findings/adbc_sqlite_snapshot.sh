#!/bin/sh
# adbc-driver-sqlite 1.13.0: a connection keeps the database as it was at its first query, and stops others writing.
#
# Its connections begin a transaction by themselves, and a closed cursor does not end it; those of Python's sqlite3 do
# not begin one to read. Who follows a running sweep with it sees the first count for ever. In a database with a
# rollback journal the writer gets "database is locked", too; with a write-ahead log it writes. Call `commit()` after
# each query, or connect with `autocommit=True`, and both see and write.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet adbc-driver-sqlite==1.13.0 pyarrow==26.0.1
cd "$folder"
cat > write.py <<'PYTHON'
import sqlite3
import sys

database = sqlite3.connect(sys.argv[1], timeout=0.2)
try:
    for statement in sys.argv[2:]:
        database.execute(statement)
    database.commit()
    print("written")
except sqlite3.OperationalError as error:
    print(error)
PYTHON
venv/bin/python - <<'PYTHON'
import subprocess
import sys
from importlib.metadata import version

import adbc_driver_sqlite.dbapi as adbc


def write(*arguments):
    # in another process, because locks do not hold within one
    command = [sys.executable, "write.py", *arguments]
    return subprocess.run(command, capture_output=True, text=True).stdout.strip()


def count(connection):
    with connection.cursor() as cursor:
        cursor.execute("SELECT count(*) FROM cells")
        return cursor.fetchone()[0]


print("adbc-driver-sqlite", version("adbc-driver-sqlite"))
expected = {
    ("delete", False): ([1, 1, 1], "database is locked"),
    ("wal", False): ([1, 1, 2], "written"),
    ("delete", True): ([1, 2, 2], "written"),
    ("wal", True): ([1, 2, 2], "written"),
}
unchanged = True
for (journal, autocommit), wanted in expected.items():
    path = f"{journal}-{autocommit}.db"
    begun = f"PRAGMA journal_mode = {journal}"
    write(path, begun, "CREATE TABLE cells (x)", "INSERT INTO cells VALUES (1)")
    connection = adbc.connect(path, autocommit=autocommit)
    counts = [count(connection)]
    said = write(path, "INSERT INTO cells VALUES (2)")
    counts.append(count(connection))
    if not autocommit:
        connection.commit()
    counts.append(count(connection))
    connection.close()
    print(f"{journal}, autocommit {autocommit}: writer: {said}; counts {counts}")
    unchanged = unchanged and (counts, said) == wanted
raise SystemExit(not unchanged)
PYTHON
