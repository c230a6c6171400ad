"""Where numba keeps what it compiled: a folder for each state of a module, so that nothing there is stale.

numba's own cache looks at the one file that a function stands in, and what is compiled holds copies of functions and
constants of others. So the folder's name is a digest of all of these and of numba's version. It is in NUMBA_CACHE_DIR
where that is set, else in the user's cache.
"""

import hashlib
import logging
import multiprocessing
import os
import pickle
import shutil
import sys
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.core import event
from numba.core.caching import FunctionCache, IndexDataCacheFile

from posefit.arrays.stored import cache_folder

config: Any = numba.config
MAX_FOLDERS = 256  # of a user's cache: those of older sources are removed


class _Announcement(event.Listener):  # type: ignore[misc]
    """Logs once that a function of posefit's is compiled, but not in a process that another one started."""

    announced = False

    def on_start(self, event: Any) -> None:
        """Log a warning, which is printed on stderr unless logging is configured otherwise."""
        if self.announced or multiprocessing.parent_process() is not None:
            return
        if event.data["dispatcher"].py_func.__module__.startswith("posefit"):
            self.announced = True
            message = "compiling the kernels, once on this machine; this takes ten seconds or more ..."
            logging.getLogger("posefit").warning(message)

    def on_end(self, event: Any) -> None:
        """Say nothing."""


event.register("numba:compile", _Announcement())  # type: ignore[no-untyped-call]


class CheckedFile(IndexDataCacheFile):
    """A file of numba's cache that begins with a digest of the rest: what is damaged is never run."""

    def _save_data(self, name: str, data: Any) -> None:
        dumped = self._dump(data)  # type: ignore[no-untyped-call]
        with self._open_for_write(self._data_path(name)) as file:  # type: ignore[no-untyped-call]
            file.write(hashlib.sha256(dumped).digest() + dumped)

    def _load_data(self, name: str) -> Any:
        content = Path(self._data_path(name)).read_bytes()  # type: ignore[no-untyped-call]
        digest = content[:32]
        dumped = content[32:]
        if hashlib.sha256(dumped).digest() != digest:
            raise ValueError(f"{name} is damaged")
        return pickle.loads(dumped)


class TolerantCache(FunctionCache):
    """numba's cache, for which a file that is damaged, or cannot be read or written, is a miss.

    Each signature has an index of its own: of one index two processes may write, one loses what the other compiled.
    """

    def open_index(self, sig: Any) -> None:
        """Use the index of a signature."""
        base = f"{self._impl.filename_base}-{hashlib.sha256(str(sig).encode()).hexdigest()[:12]}"
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = CheckedFile(self.cache_path, base, stamp)  # type: ignore[no-untyped-call]

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what was compiled for a signature; None where it is not there."""
        self.open_index(sig)
        try:
            return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except Exception:  # whatever a damaged file raises
            with suppress(OSError):
                self.flush()  # type: ignore[no-untyped-call]
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write what was compiled for a signature, if there is room."""
        self.open_index(sig)
        with suppress(OSError):
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]


@lru_cache
def state_of(module: str) -> str:
    """Return a module's name and a digest of its state, on which all depends that its functions compile or compute.

    That is the module's source, the constants that it imports, and the same of the modules whose functions it imports.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    modules = [module]
    own = ("posefit", module.partition(".")[0])
    for name in modules:
        loaded = sys.modules[name]
        digest.update(Path(str(loaded.__file__)).read_bytes())
        for key, value in sorted(vars(loaded).items()):
            if isinstance(value, np.ndarray):
                digest.update(key.encode() + value.tobytes())
            elif isinstance(
                value, int | float | str | tuple | np.generic
            ) and not key.startswith("__"):
                digest.update(f"{key} {value!r}".encode())
            elif (
                (owner := getattr(value, "__module__", None))
                and owner.startswith(own)
                and owner not in modules
            ):
                modules.append(owner)
    return f"{module}-{digest.hexdigest()[:16]}"


def cached(dispatcher: Any) -> Any:
    """Return a function of numba's, which finds in its folder what any process compiled before."""
    before = config.CACHE_DIR
    try:
        name = state_of(dispatcher.py_func.__module__)
        base = Path(before) if before else cache_folder()
        if not (base / name).is_dir():
            (base / name).mkdir(parents=True)
            for old in (
                sorted(base.iterdir(), key=os.path.getmtime)[:-MAX_FOLDERS]
                if not before
                else ()
            ):
                shutil.rmtree(old, ignore_errors=True)
        config.CACHE_DIR = str(base / name)
        cache = TolerantCache(dispatcher.py_func)  # type: ignore[no-untyped-call]
        # else numba chose a place where stale files may be
        if Path(cache.cache_path).is_relative_to(base):
            dispatcher._cache = cache
    except (OSError, RuntimeError):
        pass  # no home, no room, or no file of the function: every process compiles
    finally:
        config.CACHE_DIR = before
    return dispatcher
