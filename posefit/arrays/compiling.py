"""The cache of compiled functions: one folder per module and state of its sources.

The cache is numba's (`cache=True`). numba itself only checks the file that a function
is in, but compiled code holds copies of functions and constants of other modules. So
the name of the folder has a digest of all their sources and of numba's version. The
folder is in NUMBA_CACHE_DIR if that is set, otherwise in the user's cache.

numba trusts its files: a damaged one raises an exception or crashes the process. So
each folder lists the SHA-256 of its files. A process that starts to use a folder
removes files that differ from the list, and their functions are compiled again. numba
saves one function at a time without a lock, and two processes may write the same file.
So functions are saved and listed under a lock on the folder.
"""

import hashlib
import logging
import multiprocessing
import os
import shutil
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from types import ModuleType
from typing import Any

import numba
import numpy as np
from numba.core import event  # numba's documented interface for applications

from posefit.arrays.stored import cache_folder

config: Any = numba.config
MAX_FOLDERS = 256  # in the user's cache: the oldest ones beyond this are removed
# bytes: with less free space nothing is saved, since numba would raise an error in the
# middle of a call
MIN_FREE = 64 << 20
SUMS = "SHA256SUMS"
# the folder of each module with compiled functions; None if nothing can be saved
_folders: dict[str, Path | None] = {}
_choosing_folder = threading.Lock()


class _Compilation(event.Listener):  # type: ignore[misc]
    """Logs once that posefit's functions are compiled, and times all compilations.

    A process started by another one logs nothing.
    """

    def __init__(self) -> None:
        self.announced = False
        self.seconds = 0.0  # of all compilations so far
        # by thread: when its outermost compilation began, and how many are within it
        self._thread = threading.local()

    def on_start(self, event: Any) -> None:
        """Log a warning, which goes to stderr unless logging is configured."""
        depth = getattr(self._thread, "depth", 0)
        if not depth:
            self._thread.began = perf_counter()
        self._thread.depth = depth + 1
        if self.announced or multiprocessing.parent_process() is not None:
            return
        if event.data["dispatcher"].py_func.__module__.startswith("posefit"):
            self.announced = True
            logging.getLogger("posefit").warning(
                "compiling the kernels, once on this machine; "
                "this takes ten seconds or more ..."
            )

    def on_end(self, event: Any) -> None:  # noqa: ARG002
        """Add the time, unless this function was compiled for another one."""
        self._thread.depth -= 1
        if not self._thread.depth:
            self.seconds += perf_counter() - self._thread.began


class _Saving(event.Listener):  # type: ignore[misc]
    """Locks a function's folder while numba saves the function, and lists its files.

    numba saves a function after it is compiled and before the compiler's lock is
    released.
    """

    def __init__(self) -> None:
        self._thread = threading.local()

    def on_start(self, event: Any) -> None:
        """Do nothing: only the end of a compilation matters."""

    def on_end(self, event: Any) -> None:
        """Lock a function's folder once it is compiled; unlock it once it is saved."""
        if event.kind == "numba:compile":
            self._compiled(event.data["dispatcher"].py_func.__module__)
        else:
            self._saved()

    def _compiled(self, module: str) -> None:
        """Lock the folder of a module, in which numba saves a function next."""
        folder = _folders.get(module)
        if folder is not None:
            saving = ExitStack()
            self._thread.saving = saving
            saving.enter_context(_locked(folder))
            # before the lock is released
            saving.callback(_list_files, folder)

    def _saved(self) -> None:
        """List the files of the folder that this thread has locked, and unlock it."""
        saving = self._thread.__dict__.pop("saving", None)
        if saving is not None:
            saving.close()


_saving = _Saving()
_compilation = _Compilation()
event.register("numba:compile", _compilation)  # type: ignore[no-untyped-call]
event.register("numba:compile", _saving)  # type: ignore[no-untyped-call]
event.register("numba:compiler_lock", _saving)  # type: ignore[no-untyped-call]


def compiling_seconds() -> float:
    """Return how long this process has compiled functions so far."""
    return _compilation.seconds


@lru_cache
def state_of(module: str) -> str:
    """Return a module's name with a digest of everything that its functions depend on.

    That is the module's source, the constants that it imports, and the same for the
    modules that it imports, by themselves or a function of theirs.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    modules = [module]
    own = ("posefit", module.partition(".")[0])
    # the list grows while it is read: a module adds those that it imports from
    for name in modules:
        loaded = sys.modules[name]
        digest.update(Path(str(loaded.__file__)).read_bytes())
        for key, value in sorted(vars(loaded).items()):
            constant = isinstance(value, int | float | str | tuple | np.generic)
            owner = getattr(value, "__module__", None)
            # what a package holds depends on what was imported before
            if isinstance(value, ModuleType) and not hasattr(value, "__path__"):
                owner = value.__name__
            if isinstance(value, np.ndarray):
                digest.update(key.encode() + value.tobytes())
            elif constant and not key.startswith("__"):
                digest.update(f"{key} {value!r}".encode())
            elif owner and owner.startswith(own) and owner not in modules:
                modules.append(owner)
    return f"{module}-{digest.hexdigest()[:16]}"


def compiled(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Return a function compiled by numba with these options.

    It is saved for later processes if that is possible.
    """
    if config.DISABLE_JIT:
        return function
    module = function.__module__
    if module not in _folders:
        _folders[module] = _usable_folder(module)
    folder = _folders[module]
    if folder is None:
        return numba.njit(**options)(function)
    with _choosing_folder:
        before = config.CACHE_DIR
        config.CACHE_DIR = str(folder)
        try:
            dispatcher = numba.njit(cache=True, **options)(function)
            # numba may choose another folder, with stale files
            usable = Path(dispatcher.stats.cache_path).is_relative_to(folder)
        except RuntimeError:  # the function is not from a file
            usable = False
        finally:
            config.CACHE_DIR = before
    return dispatcher if usable else numba.njit(**options)(function)


def _usable_folder(module: str) -> Path | None:
    """Return the folder of a module's compiled functions, without damaged files.

    None if nothing can be saved.
    """
    try:
        base = cache_folder()
        folder = base / state_of(module)
        if not folder.is_dir():
            folder.mkdir(parents=True)
            _remove_oldest(base)
        if shutil.disk_usage(folder).free < MIN_FREE:
            return None
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"room for a file")
        with _locked(folder):
            _remove_damaged(folder)
    except (OSError, RuntimeError):
        return None  # no home directory, no free space, or a module without a file
    return folder


def _remove_oldest(base: Path) -> None:
    """Remove the oldest folders from the user's cache, not from NUMBA_CACHE_DIR."""
    if config.CACHE_DIR:
        return
    folders = sorted(base.iterdir(), key=os.path.getmtime)
    for old in folders[:-MAX_FOLDERS]:
        shutil.rmtree(old, ignore_errors=True)


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


def _files_in(folder: Path) -> Iterator[Path]:
    yield from folder.rglob("*.nb[ic]")  # numba's indices and compiled functions


def _sum_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _list_files(folder: Path) -> None:
    """List the SHA-256 of a folder's files in the format of `sha256sum`.

    If the list cannot be written, the next process removes the files.
    """
    with suppress(OSError):
        lines = [
            f"{_sum_of(path)}  {path.relative_to(folder)}\n"
            for path in _files_in(folder)
        ]
        (folder / SUMS).write_text("".join(lines))


def _remove_damaged(folder: Path) -> None:
    """Remove the files of a folder that differ from the list."""
    try:
        listed = set((folder / SUMS).read_text(errors="replace").splitlines())
    except OSError:
        listed = set()
    for path in list(_files_in(folder)):
        try:
            intact = f"{_sum_of(path)}  {path.relative_to(folder)}" in listed
        except OSError:
            intact = False
        if not intact:
            path.unlink()
