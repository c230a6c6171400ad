"""Append-only files of finished rows. Each driver writes to one of its own, so no two ever write to the same.

A line is a row with its key and a checksum; `.joints` beside it holds the rows' arrays, one after the other. A line
that was cut off when its driver died has no end, and counts for nothing.
"""

import errno
import json
import os
import re
import secrets
import time
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from posefit.sweep.locks import locked

SUFFIX, JOINTS, UNNAMED = ".jsonl", ".joints", ".new"
_LINE = re.compile(rb'\{"key": "([0-9a-f]{64})", "crc": "([0-9a-f]{8})", "row": (\{.*\})\}\n', re.DOTALL)


@dataclass(frozen=True)
class Damage:
    """A line that is not what was written."""

    path: Path
    offset: int
    text: bytes = field(repr=False)

    def __str__(self) -> str:
        named = re.search(rb'"key": "([0-9a-f]{8})', self.text)
        cell = f", the row of cell {named[1].decode()}," if named else ""
        return f"{self.path} at byte {self.offset}{cell} is damaged"


def encoded(key: str, row: Mapping[str, Any]) -> bytes:
    """Return the line of a row."""
    text = json.dumps(row, allow_nan=False).encode()
    return b'{"key": "%s", "crc": "%08x", "row": %s}\n' % (key.encode(), zlib.crc32(key.encode() + text), text)


def decoded(line: bytes) -> tuple[str, bytes] | None:
    """Return the key and the row, as JSON, of a line; None where it is damaged."""
    match = _LINE.fullmatch(line)
    if match is None or int(match[2], 16) != zlib.crc32(match[1] + match[3]):
        return None
    return match[1].decode(), match[3]


class Writer:
    """Writes one log; as long as it is open, its file is locked, which shows that its driver lives."""

    def __init__(self, folder: Path) -> None:
        self.name = f"{time.strftime('%Y%m%dT%H%M%S', time.gmtime())}-{secrets.token_hex(4)}"
        self._paths = folder / f"{self.name}{SUFFIX}", folder / f"{self.name}{JOINTS}"
        # a log gets its name once it is locked: before, another driver would take it for that of a dead one
        unnamed = folder / f"{self.name}{UNNAMED}"
        # opened for this process alone: no worker inherits the lock
        self._rows, self._joints = (
            os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644) for path in (unnamed, self._paths[1])
        )
        try:
            locked(self._rows, unnamed)
            unnamed.rename(self._paths[0])
        except (OSError, ValueError):
            for path, file in zip((unnamed, self._paths[1]), (self._rows, self._joints), strict=True):
                path.unlink(missing_ok=True)
                os.close(file)
            raise
        self._synced = time.monotonic()

    def append(self, key: str, row: Mapping[str, Any], joints: bytes, checksum: int | None = None) -> None:
        """Add a row with its arrays, whose checksum is another one only where they are damaged already.

        Raises OSError where there is no room, and leaves the log as it was.
        """
        place = [os.fstat(self._joints).st_size, len(joints), zlib.crc32(joints) if checksum is None else checksum]
        self._add(self._joints, joints)
        line = encoded(key, {**row, "joints": place})
        end = os.fstat(self._rows).st_size
        # where the log was cut off, the rest of a line ends here and takes no other with it
        cut = end and os.pread(self._rows, 1, end - 1) != b"\n"
        self._add(self._rows, b"\n" + line if cut else line)

    def sync(self, seconds: float) -> None:
        """Bring everything to the disk, if it is so long ago that this was done."""
        if time.monotonic() - self._synced >= seconds:
            for file in (self._joints, self._rows):
                os.fsync(file)
            self._synced = time.monotonic()

    @property
    def began(self) -> float:
        """When the log was made, by the clock of its disk, which need not be that of this machine."""
        return os.fstat(self._rows).st_ctime

    def close(self) -> None:
        """End the log; one without rows goes away."""
        try:
            self.sync(0.0)
            if not os.fstat(self._rows).st_size:
                for path in self._paths:
                    path.unlink(missing_ok=True)
        finally:
            for file in (self._joints, self._rows):
                os.close(file)

    def _add(self, file: int, data: bytes) -> None:
        status = os.fstat(file)
        if not status.st_nlink:
            raise FileNotFoundError(errno.ENOENT, "a log that was removed")
        end, done = status.st_size, 0
        try:
            while done < len(data):
                done += os.pwrite(file, data[done:], end + done)
        except OSError:
            os.ftruncate(file, end)
            raise


def lines(path: Path, start: int = 0) -> Iterator[tuple[int, bytes]]:
    """Yield offset and text of each line of a log, from one that starts at `start`; not one that has no end yet."""
    try:
        if path.stat().st_size == start:
            return
        file = path.open("rb")
    except FileNotFoundError:  # an empty log that went away
        return
    with file:
        file.seek(start)
        for line in file:
            if not line.endswith(b"\n"):
                return
            yield start, line
            start += len(line)


def joints_at(path: Path, start: int, length: int) -> bytes:
    """Return the arrays of a row: bytes of the file beside its log, fewer where that was cut off."""
    try:
        with path.open("rb") as file:
            file.seek(start)
            return file.read(length)
    except FileNotFoundError:
        return b""
