"""The lock of a ledger's file: only one driver writes to it.

A driver locks a second file, FILE.driver, which names its process. The operating system
releases the lock when the process ends in any way.
"""

import os
import socket
import stat
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from posefit.errors import InputError
from posefit.files import lock
from posefit.reading import cut

DRIVER = ".driver"  # suffix of the lock file
DRIVEN_BY = "process "  # how the content of a lock file begins
NO_LINK = getattr(os, "O_NOFOLLOW", 0)  # missing on some operating systems


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold a ledger's lock, so that no other process writes to the ledger.

    If the body fails, a new lock file is removed. In a folder that others may write to,
    its name may belong to a link or another program's file. Nothing is written to
    these.

    Raises InputError in that case, and if another process holds the lock.
    """
    name = f"{path}{DRIVER}"
    strange = InputError(
        f"{name}: expected the lock file of posefit sweep, "
        "got a link or another program's file"
    )
    new = not os.path.lexists(name)
    if os.path.islink(name):
        raise strange
    file = os.open(name, os.O_RDWR | os.O_CREAT | NO_LINK, 0o666)
    with ExitStack() as opened:
        opened.callback(os.close, file)
        is_locked = lock(file)
        state = os.fstat(file)
        driver = ""
        # reading a pipe would not return
        if stat.S_ISREG(state.st_mode):
            driver = os.read(file, 1000).decode(errors="replace")
        is_ours = not driver or driver.startswith(DRIVEN_BY)
        # Two names mean a hard link. None means that its driver has just removed it.
        if not stat.S_ISREG(state.st_mode) or state.st_nlink != 1 or not is_ours:
            raise strange
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
