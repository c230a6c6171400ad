"""Compilation by numba, saved for later processes; announced and timed.

Compiled functions are saved by numba (`cache=True`), in a folder for each module. numba
itself only checks the file that a function is in, but compiled code contains copies of
functions and constants of other modules. So the folder's name has a digest of all their
sources and of numba's version: a change of any of them is another folder. `folders`
keeps damaged files and other processes from doing harm.

Two listeners follow numba's events, which it documents for applications. While a
function is compiled for the first time, they do this:

    numba    | compiles callees, function |  saves  | releases its lock
    event    compile             compile        compiler_lock
             starts              ends           ends
    posefit  announces,          stops time,    lists the files,
             starts time         locks folder   unlocks folder
"""

import hashlib
import logging
import multiprocessing
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from types import ModuleType
from typing import Any

import numba
import numpy as np
from numba.core import event  # numba's documented interface for applications

from posefit.arrays import folders

config: Any = numba.config
# by module: the folder where its compiled functions are saved; None if they cannot be
_folders: dict[str, Path | None] = {}
# numba reads the folder from its configuration, which all threads share
_configuring = threading.Lock()


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
        """Start the time of an outermost compilation, and announce the first one.

        The warning goes to stderr unless logging is configured.
        """
        depth = getattr(self._thread, "depth", 0)
        if not depth:
            self._thread.began = perf_counter()
        self._thread.depth = depth + 1
        if self.announced or multiprocessing.parent_process() is not None:
            return
        if event.data["dispatcher"].py_func.__module__.startswith("posefit"):
            self.announced = True
            logging.getLogger("posefit").warning(
                "compiling kernels for their first use on this machine; "
                "this takes ten seconds or more ..."
            )

    def on_end(self, event: Any) -> None:  # noqa: ARG002
        """Add the time, unless this function was compiled for another one."""
        self._thread.depth -= 1
        if not self._thread.depth:
            self.seconds += perf_counter() - self._thread.began


class _Saving(event.Listener):  # type: ignore[misc]
    """Locks a function's folder while numba saves the function, and lists its files."""

    def __init__(self) -> None:
        self._thread = threading.local()

    def on_start(self, event: Any) -> None:
        """Do nothing: only the end of a compilation matters."""

    def on_end(self, event: Any) -> None:
        """Lock a function's folder once it is compiled; unlock it once it is saved."""
        if event.kind == "numba:compile":
            self._begin(event.data["dispatcher"].py_func.__module__)
        else:
            self._end()

    def _begin(self, module: str) -> None:
        folder = _folders.get(module)
        if folder is not None:
            self._thread.saving = ExitStack()
            self._thread.saving.enter_context(folders.saving(folder))

    def _end(self) -> None:
        # the compiler's lock is also released after steps that save nothing
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

    That is the module's source, the constants that it imports, and the same for
    every module that it imports, or imports a function from. It reads the names that
    modules have at that moment: what is imported inside a function is not included, and
    what a module imports must stand before its first compiled function.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    modules = [module]
    own = ("posefit", module.partition(".")[0])
    # the list grows while it is read: a module adds the modules that it imports from
    for name in modules:
        loaded = sys.modules[name]
        digest.update(Path(str(loaded.__file__)).read_bytes())
        for key, value in sorted(vars(loaded).items()):
            if isinstance(value, np.ndarray):
                digest.update(key.encode() + value.tobytes())
                continue
            constant = isinstance(value, int | float | str | tuple | np.generic)
            if constant and not key.startswith("__"):
                digest.update(f"{key} {value!r}".encode())
                continue
            owner = _owner_of(value)
            if owner and owner.startswith(own) and owner not in modules:
                modules.append(owner)
    return f"{module}-{digest.hexdigest()[:16]}"


def _owner_of(value: Any) -> str | None:
    """Return the name of the module that a value is, or is from; None if unknown."""
    if isinstance(value, ModuleType):
        # a package's contents depend on what was imported before
        return None if hasattr(value, "__path__") else value.__name__
    return getattr(value, "__module__", None)


def compiled(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Return a function compiled by numba with these options.

    It is saved for later processes if that is possible.
    """
    if config.DISABLE_JIT:
        return function
    module = function.__module__
    if module not in _folders:
        _folders[module] = _folder_of(module)
    folder = _folders[module]
    if folder is None:
        return numba.njit(**options)(function)
    with _configuring:
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


def _folder_of(module: str) -> Path | None:
    """Return the folder of a module's functions; None if nothing can be saved."""
    try:
        name = state_of(module)
    except OSError:  # the module is not from a file
        return None
    return folders.usable_folder(name)
