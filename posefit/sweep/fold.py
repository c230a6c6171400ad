"""Folds the logs of drivers that have ended into one that lives: every killed one leaves two files behind.

Whatever happens meanwhile, no row is lost: it is written and brought to the disk in its new place before its old one
goes, and until then the same row twice counts once.
"""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from posefit.sweep.ledger import ROWS, Ledger
from posefit.sweep.log import JOINTS, SUFFIX, UNNAMED, Damage, Writer, decoded, joints_at, lines

LARGE = 2**24  # bytes: a log of so many rows stays as it is, so that no row is copied over and over
LEFT = 60.0  # seconds after which a file that nothing points to was left behind


def fold_logs(ledger: Ledger, log: Writer) -> None:
    """Bring the rows of all logs that nobody writes to any more into one that is open, unless there is but one."""
    folder = ledger.path / ROWS
    for path in [*folder.glob(f"*{JOINTS}"), *folder.glob(f"*{UNNAMED}")]:
        with suppress(FileNotFoundError):
            if not path.with_suffix(SUFFIX).exists() and log.began - path.stat().st_mtime > LEFT:
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

    found, files = [], []
    try:
        for path in sorted(folder.glob(f"*{SUFFIX}")):
            with suppress(BlockingIOError, FileNotFoundError):
                if path.stem == log.name or path.stat().st_size >= LARGE:
                    continue
                file = os.open(path, os.O_RDWR)
                files.append(file)
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.fstat(file).st_nlink:  # nobody else has folded it just now
                    found.append(path)
        yield found
    finally:
        for file in files:
            os.close(file)


def _moved(ledger: Ledger, path: Path, log: Writer) -> bool:
    """Copy the rows of a log to another, and return whether everything in it is kept, damaged lines too."""
    whole = True
    for offset, line in lines(path):
        found = decoded(line)
        if found is None:
            whole &= ledger.set_aside(Damage(path, offset, line))
        elif ledger.place(found[0]) == (path.name, offset):
            row = json.loads(found[1])
            start, length, checksum = row.get("joints", (0, 0, 0))
            log.append(found[0], row, joints_at(path.with_suffix(JOINTS), start, length), checksum)
    return whole


def _sync(folder: Path) -> None:
    """Bring to the disk which files a folder has."""
    file = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(file)
    finally:
        os.close(file)
