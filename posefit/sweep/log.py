"""Append-only files of finished rows. Each driver writes to one of its own, so no two ever write to the same.

A line is a row with its key and a checksum; `.joints` beside it holds the rows' arrays, one after the other. A line
that was cut off when its driver died has no end, and counts for nothing.

A driver holds a lock (`flock`) on its log, which the operating system drops when it ends in any way. On a disk that
machines share such a lock is worth something only where every machine sees it. Linux passes locks on NFS to the server,
unless the disk is mounted with `nolock` or `local_lock`; then they hold on one machine alone.
"""

import errno
import json
import os
import re
import secrets
import time
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from posefit.errors import InputError

SUFFIX, JOINTS = ".jsonl", ".joints"
_LINE = re.compile(rb'\{"key": "([0-9a-f]{64})", "crc": "([0-9a-f]{8})", "row": (\{.*\})\}\n', re.DOTALL)

MOUNTS = Path("/proc/self/mountinfo")
# of kinds of file systems, the options with which their locks stay on one machine; "" for always
LOCAL = {
    "nfs": ("nolock", "local_lock=flock", "local_lock=all"),
    "nfs4": ("nolock", "local_lock=flock", "local_lock=all"),
    "lustre": ("localflock",),
    "cifs": ("nobrl",),
    "smb3": ("nobrl",),
    "fuse.sshfs": ("",),
}


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
        self._synced = time.monotonic()
        self._paths = folder / f"{self.name}{SUFFIX}", folder / f"{self.name}{JOINTS}"
        # opened for this process alone: no worker inherits the lock
        self._rows, self._joints = (os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644) for path in self._paths)
        try:
            locked(self._rows, self._paths[0])
        except ValueError:
            self.close()
            raise

    def append(self, key: str, row: Mapping[str, Any], joints: bytes) -> None:
        """Add a row with its arrays. Raises OSError where there is no room, and leaves the log as it was."""
        place = [os.fstat(self._joints).st_size, len(joints), zlib.crc32(joints)]
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
    """Return the arrays of a row: bytes of the file beside its log, none where that was cut off."""
    try:
        with path.open("rb") as file:
            if start + length > os.fstat(file.fileno()).st_size:
                return b""
            file.seek(start)
            return file.read(length)
    except (FileNotFoundError, IsADirectoryError):
        return b""


def locked(file: int, path: Path) -> None:
    """Lock an open file of one's own for as long as it is open. Raises ValueError where its disk keeps no locks.

    Others only ever look whether it is locked, which takes a lock for a moment: that moment is waited for.
    """
    import fcntl  # which Windows does not have: it can read ledgers

    try:
        fcntl.flock(file, fcntl.LOCK_EX)
    except OSError as error:
        raise _useless(path, error.strerror or str(error)) from None
    if not is_locked(path):
        raise _useless(path, "one that forgets them")


def is_locked(path: Path) -> bool:
    """Return whether a file is locked: whether the driver that writes a log lives."""
    import fcntl

    try:
        file = os.open(path, os.O_RDONLY)
    except FileNotFoundError:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(file)
    return False


def on_one_machine(path: Path, mounts: Path = MOUNTS) -> str | None:
    """Return why locks in a folder hold on this machine alone; None where others see them, or where it is unknown."""
    try:
        lines = mounts.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:  # an operating system that does not say
        return None
    reason, longest = None, -1
    for line in lines:
        before, _, after = line.partition(" - ")
        words, (kind, _, options) = before.split(), [*after.split(), "", "", ""][:3]
        place = Path(re.sub(r"\\([0-7]{3})", lambda octal: chr(int(octal[1], 8)), words[4]))
        if path.resolve().is_relative_to(place) and len(place.parts) >= longest:  # a later mount covers an earlier one
            given = {"", *words[5].split(","), *options.split(",")}
            reason = next((f"{kind} {option}".strip() for option in LOCAL.get(kind, ()) if option in given), None)
            longest = len(place.parts)
    return reason


def _useless(path: Path, what: str) -> InputError:
    return InputError(
        f"{path.parent.parent}: expected a disk that keeps locks (flock), got {what}; without them it is unknown "
        "which sweep lives"
    )
