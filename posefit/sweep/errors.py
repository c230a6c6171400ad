"""What the errors of SQLite mean for the user of a ledger."""

import shlex
import sqlite3
from pathlib import Path

from posefit.errors import InputError
from posefit.reading import cut
from posefit.sweep.schema import WAL


def unusable(file: Path, error: Exception, *, writes: bool = False) -> InputError:
    """Return the error of a ledger that cannot be read, or written to."""
    if isinstance(error, sqlite3.ProgrammingError):
        return InputError(f"{file}: expected an open ledger, got a closed one")
    if _is_damage(error):
        return InputError(
            f"{file}: expected an intact SQLite file, got {cut(str(error))}: use a "
            "backup, or recover the readable part with "
            f"sqlite3 {shlex.quote(file.name)} .recover"
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
            f"with {file.name}{WAL} if that exists, to a folder of your own"
        )
    wanted = "written to" if writes else "read"
    return InputError(f"{file}: expected a ledger that can be {wanted}, got {found}")


def _is_damage(error: Exception) -> bool:
    """Return whether an error means that a file is damaged.

    An OperationalError is about the file's folder or disk, or about who uses it.
    """
    if isinstance(error, UnicodeDecodeError):
        return True
    is_operational = isinstance(error, sqlite3.OperationalError)
    return isinstance(error, sqlite3.DatabaseError) and not is_operational


def _is_without_shared_memory(error: Exception) -> bool:
    """Return whether a disk cannot hold a ledger's write-ahead log.

    Many network disks cannot.
    """
    name = getattr(error, "sqlite_errorname", "")
    return "locking protocol" in str(error) or name.startswith("SQLITE_IOERR_SHM")
