"""Folders for numba's compiled functions, safe from damage and other processes.

    posefit.silhouette.kernels-4e07.../     a module, and a digest of its sources
        lock                                held while a function is saved
        SHA256SUMS                          the digests of the files below
        silhouette_.../                     made by numba
            kernels.count_areas-....nbi     an index of the types of arguments
            kernels.count_areas-....1.nbc   compiled for the first of them

numba trusts its files: a damaged one raises an exception or crashes the process. So the
digests of all files are listed. A process that begins to use a folder removes the files
that differ from the list, and their functions are compiled again.

numba does not lock its files. If two processes saved the same function for other types,
both would take the next free number, and an index could lead to the other's code. So a
folder is locked while a function is saved and listed.
"""

import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from posefit.arrays.stored import cache_folder

MAX_FOLDERS = 256  # in the user's cache: the oldest ones beyond this are removed
# bytes: with less free space nothing is saved, since numba would raise an error in the
# middle of a call
MIN_FREE = 64 << 20
SUMS = "SHA256SUMS"


def usable_folder(name: str) -> Path | None:
    """Return a folder of the cache, without damaged files; None if it cannot be used.

    The cache is NUMBA_CACHE_DIR, or posefit's folder in the user's cache.
    """
    try:
        base = cache_folder()
        folder = base / name
        if not folder.is_dir():
            folder.mkdir(parents=True)
            _remove_oldest(base)
        if shutil.disk_usage(folder).free < MIN_FREE:
            return None
        # a quota, or a limit to the size of files, may forbid what the disk could hold
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"room for a file")
        with _locked(folder):
            _remove_damaged(folder)
    except (OSError, RuntimeError):
        return None  # no free space, not writeable, or no home directory
    return folder


@contextmanager
def saving(folder: Path) -> Iterator[None]:
    """Lock a folder while a function is saved there, and list the folder's files."""
    with _locked(folder):
        yield
        _list_files(folder)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Lock a folder against other processes, if the operating and file systems can."""
    with ExitStack() as stack:
        with suppress(ImportError, OSError):
            import fcntl

            file = stack.enter_context((folder / "lock").open("ab"))
            fcntl.flock(file, fcntl.LOCK_EX)
            # if a child process has the file open too, closing it would not unlock it
            stack.callback(fcntl.flock, file, fcntl.LOCK_UN)
        yield


def _remove_oldest(base: Path) -> None:
    """Remove the oldest folders from the user's cache, not from NUMBA_CACHE_DIR."""
    if os.environ.get("NUMBA_CACHE_DIR"):
        return
    folders = sorted(base.iterdir(), key=os.path.getmtime)
    for old in folders[:-MAX_FOLDERS]:
        shutil.rmtree(old, ignore_errors=True)


def _list_files(folder: Path) -> None:
    """List the SHA-256 of a folder's files in the format of `sha256sum`.

    If the list cannot be written, the next process removes the files.
    """
    with suppress(OSError):
        lines = []
        for path in _files_in(folder):
            lines.append(_line_of(path, folder) + "\n")
        (folder / SUMS).write_text("".join(lines))


def _remove_damaged(folder: Path) -> None:
    """Remove the files of a folder that differ from the list."""
    try:
        listed = set((folder / SUMS).read_text(errors="replace").splitlines())
    except OSError:
        listed = set()
    for path in list(_files_in(folder)):
        try:
            intact = _line_of(path, folder) in listed
        except OSError:
            intact = False
        if not intact:
            path.unlink()


def _files_in(folder: Path) -> Iterator[Path]:
    """Yield numba's indices and compiled functions."""
    yield from folder.rglob("*.nb[ic]")


def _line_of(path: Path, folder: Path) -> str:
    """Return the line of a file in the list."""
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return f"{digest}  {path.relative_to(folder)}"
