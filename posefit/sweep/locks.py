"""Proof of life: a driver holds a lock (`flock`) on its log, which the operating system drops when it ends in any way.

On a disk that machines share such a lock is worth something only where every machine sees it. Linux passes locks on NFS
to the server, unless the disk is mounted with `nolock` or `local_lock`; then they hold on one machine alone, and the
leases of another one say nothing.
"""

import os
import re
from pathlib import Path

from posefit.errors import InputError

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
