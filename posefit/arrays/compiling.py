"""Compiled functions, once a machine: numba's cache, made safe against changes elsewhere and against processes.

numba's own cache looks at the one file that a function stands in. What is compiled holds copies of every function that
it calls, and of every constant, wherever these stand: so the cache of a function is empty, too, once a file has
changed that its module imports, directly or not.

numba's own cache also lets several processes compile at the same time, and loses a signature where two of them write
its index. So each function has a lock beside its cache, a file that is locked (`flock`) while the function is searched,
compiled and written: who comes later finds it there. The operating system drops a lock when its process ends in any
way. Locks cannot wait for each other in a circle: a process takes them one within the other only where one function
calls another, and no two functions call each other. Where there is no lock to be had, on a disk without them or one
that cannot be written to, every process compiles.
"""

import ast
import gc
import hashlib
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.util import resolve_name
from pathlib import Path
from typing import Any

STARTED = time.time()  # before the modules were loaded that are compiled
# whose versions are numba's affair
_FOREIGN = sys.stdlib_module_names | {"cv2", "llvmlite", "numba", "numpy", "scipy"}

_held: set[Path] = set()  # of this process, which only the thread that holds numba's own lock may look at


def compiled_once(dispatcher: Any) -> Any:
    """Return a function of numba's, cached where there is a folder for it, that one process at a time compiles."""
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.types import unliteral

    function, alone = dispatcher.py_func, dispatcher.compile

    @cache
    def lock() -> Path | None:
        folder = cached(dispatcher)
        return None if folder is None else folder / f"{function.__module__}.{function.__qualname__}.lock"

    def compile_in_turn(signature: Any) -> Any:
        if isinstance(signature, tuple):  # a number written out in a call would be a type of its own
            signature = tuple(unliteral(argument) for argument in signature)  # type: ignore[no-untyped-call]
        # a thread of this process that waits for another process must not hold what a second thread needs to go on
        with global_compiler_lock, uncollected(), in_turn(lock()):
            return _compiled(alone, signature)

    dispatcher.compile = compile_in_turn
    return dispatcher


def _compiled(alone: Callable[[Any], Any], signature: Any) -> Any:
    try:
        return alone(signature)
    except OSError:  # it is compiled, and could not be written
        return alone(signature)


def cached(dispatcher: Any) -> Path | None:
    """Return the folder of a dispatcher's cache, which is used from now on; None where there is none.

    To be called when the function is compiled or searched: earlier, its module may not have imported everything yet.
    """
    from numba.core.caching import FunctionCache, IndexDataCacheFile

    with suppress(RuntimeError):
        own: Any = FunctionCache(dispatcher.py_func)  # type: ignore[no-untyped-call]
        stamp = own._impl.locator.get_source_stamp(), made_of(dispatcher.py_func.__module__)
        own._cache_file = IndexDataCacheFile(own.cache_path, own._impl.filename_base, stamp)  # type: ignore[no-untyped-call]
        dispatcher._cache = own
        return Path(own.cache_path)
    return None


@cache
def made_of(module: str) -> str:
    """Return a digest of the source files of a module and of all that it imports as it is loaded, directly or not.

    Raises RuntimeError where one of them has changed since: what runs in this process is not what stands there.
    """
    digest, waiting, visited = hashlib.sha256(), [module], {module}
    while waiting:
        text, imported = _source(waiting.pop())
        digest.update(text)
        new = [name for name in imported if name not in visited and name.partition(".")[0] not in _FOREIGN]
        visited.update(new)
        waiting += new
    return digest.hexdigest()


@cache
def _source(module: str) -> tuple[bytes, list[str]]:
    """Return the text of a module's file, and the names of what it imports; nothing where there is no such file."""
    file = getattr(sys.modules.get(module), "__file__", None) or ""
    if not file.endswith(".py"):
        return b"", []
    if STARTED < Path(file).stat().st_mtime <= time.time():
        raise RuntimeError(f"{file} has changed")
    text, names = Path(file).read_bytes(), []
    package = module if Path(file).stem == "__init__" else module.rpartition(".")[0]
    for line in ast.parse(text).body:  # what stands within `if` or a function need not be loaded in every process
        if isinstance(line, ast.Import):
            names += [one.name for one in line.names]
        elif isinstance(line, ast.ImportFrom):
            start = resolve_name("." * line.level + (line.module or ""), package)
            names += [start, *(f"{start}.{one.name}" for one in line.names)]
    return text, names


@contextmanager
def uncollected() -> Iterator[None]:
    """Have Python look for no garbage in the body: numba has so many objects that a fifth of compiling goes into it."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


@contextmanager
def in_turn(path: Path | None) -> Iterator[None]:
    """Hold the lock of a path in the body; where there is none to be had, go on without it."""
    if path is None or path in _held:  # a function that calls itself
        yield
        return
    try:
        import fcntl

        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except (ImportError, OSError):
        yield
        return
    _held.add(path)
    try:
        with suppress(OSError):  # a disk without locks
            fcntl.flock(file, fcntl.LOCK_EX)
        yield
    finally:
        _held.discard(path)
        with suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_UN)  # a process that was forked meanwhile may hold it open
        os.close(file)
