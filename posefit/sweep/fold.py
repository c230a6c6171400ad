"""Folds the logs of drivers that have ended into one that lives: every killed one leaves two files behind.

Whatever happens meanwhile, no row is lost: it is written and synced in its new place before its old one goes, and until
then the same row twice counts once.
"""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from posefit.sweep.ledger import ROWS, Ledger
from posefit.sweep.log import JOINTS, SUFFIX, UNNAMED, Damage, Writer, decoded, joints_at, lines

MAX_FOLDED_BYTES = 2**24  # a larger log stays as it is, so that no row is copied over and over
LEFTOVER_SECONDS = 60.0  # after which a file that nothing points to was left behind


def fold_logs(ledger: Ledger, log: Writer) -> None:
    """Move the rows of all logs of dead drivers into one that is open, unless there is but one."""
    folder = ledger.path / ROWS
    for path in [*folder.glob(f"*{JOINTS}"), *folder.glob(f"*{UNNAMED}")]:
        with suppress(FileNotFoundError):
            if not path.with_suffix(SUFFIX).exists() and log.began - path.stat().st_mtime > LEFTOVER_SECONDS:
                path.unlink()
    with _dead(folder, log) as logs:
        if len(logs) < 2 and all(path.stat().st_size for path in logs):
            return
        ledger.refresh()  # what they wrote until they ended
        moved = [path for path in logs if _moved(ledger, path, log)]
        log.sync(0.0)
        _sync(folder)
        for path in moved:
            path.unlink()
            path.with_suffix(JOINTS).unlink(missing_ok=True)
    ledger.refresh()


@contextmanager
def _dead(folder: Path, log: Writer) -> Iterator[list[Path]]:
    """Give the logs of dead drivers, locked, so that no other driver folds them."""
    import fcntl

    dead, files = [], []
    try:
        for path in sorted(folder.glob(f"*{SUFFIX}")):
            with suppress(BlockingIOError, FileNotFoundError):
                if path.stem == log.name or path.stat().st_size >= MAX_FOLDED_BYTES:
                    continue
                file = os.open(path, os.O_RDWR)
                files.append(file)
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.fstat(file).st_nlink:  # no other driver has folded it just now
                    dead.append(path)
        yield dead
    finally:
        for file in files:
            os.close(file)


def _moved(ledger: Ledger, path: Path, log: Writer) -> bool:
    """Copy the rows of a log to another, and return whether everything in it is kept, damaged lines too."""
    whole = True
    for offset, line in lines(path):
        if (entry := decoded(line)) is None:
            whole &= ledger.set_aside(Damage(path, offset, line))
        elif ledger.place(entry[0]) == (path.name, offset):
            row = json.loads(entry[1])
            start, length, checksum = row.get("joints", (0, 0, 0))
            log.append(entry[0], row, joints_at(path.with_suffix(JOINTS), start, length), checksum)
    return whole


def _sync(folder: Path) -> None:
    """Bring the list of a folder's files to the disk."""
    file = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(file)
    finally:
        os.close(file)
