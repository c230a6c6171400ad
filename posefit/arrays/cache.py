"""numba's cache of a compiled function, emptied when anything has changed that the function is made of.

numba itself looks at the one file that a function stands in. What is compiled holds copies of every function that it
calls, and of every constant, wherever these stand: after an update, machine code of two versions would meet.
"""

import hashlib
import inspect
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher


class Cache(FunctionCache):  # type: ignore[misc]
    """numba's cache of a dispatcher's function, in the folder that numba chooses; RuntimeError where there is none."""

    def __init__(self, dispatcher: Any) -> None:
        super().__init__(dispatcher.py_func)  # type: ignore[no-untyped-call]
        stamp = self._impl.locator.get_source_stamp(), made_of(dispatcher)
        self._cache_file = IndexDataCacheFile(self.cache_path, self._impl.filename_base, stamp)  # type: ignore[no-untyped-call]


def cached(dispatcher: Any) -> Path | None:
    """Return the folder of a dispatcher's cache, which is used from now on; None where there is none.

    To be called when the function is compiled or searched: earlier, what it calls may not be defined yet.
    """
    with suppress(RuntimeError):
        dispatcher._cache = Cache(dispatcher)
        return Path(dispatcher._cache.cache_path)
    return None


def made_of(dispatcher: Any) -> str:
    """Return a digest of all that a dispatcher's machine code depends on, as it stands in this process.

    These are the functions that it calls, directly or not, how numba is to compile each, and the values of the
    constants that they name. A plain function among them stands for one that is registered in the same module, by
    `overload`: all functions of that module count. So do the fields of the named tuples that a module knows, which
    come as arguments and are read by their place.
    """
    digest = hashlib.sha256()
    waiting, visited = [dispatcher], {id(dispatcher)}
    while waiting:
        for part in _parts(waiting.pop()):
            digest.update(_described(part).encode() + b"\n")
            called = part[-1] if isinstance(part, tuple) else part
            if isinstance(called, Dispatcher | FunctionType) and id(called) not in visited:
                visited.add(id(called))
                waiting.append(called)
    return digest.hexdigest()


def _parts(called: Any) -> Iterator[Any]:
    """Yield what one function is made of; what it names as a tuple of name and value."""
    function = inspect.unwrap(called)
    known, names = function.__globals__, set(_names(function.__code__))
    yield called, function.__code__, function.__defaults__
    if isinstance(called, Dispatcher):
        yield sorted((name, _described(value)) for name, value in called.targetoptions.items())
    else:
        beside = vars(sys.modules[function.__module__]).values()
        for other in map(inspect.unwrap, filter(callable, beside)):
            if isinstance(other, FunctionType) and other.__module__ == function.__module__:
                yield other.__qualname__, other
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        yield name, _bare(cell.cell_contents)
    for name in sorted(names & known.keys()):
        yield name, _bare(known[name])
        if isinstance(known[name], ModuleType):
            inside = vars(known[name])
            for part in sorted(names & inside.keys()):
                # the functions of other packages are numba's affair
                if isinstance(inside[part], Dispatcher) or not callable(inside[part]):
                    yield name, part, inside[part]
    for name, value in sorted(known.items()):
        if isinstance(value, type) and issubclass(value, tuple) and hasattr(value, "_fields"):
            yield name, value._fields


def _names(code: CodeType) -> Iterator[str]:
    """Yield the names that a function's code looks up, and those of the functions within it."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _bare(value: Any) -> Any:
    """Return the function that another one stands around, as numba's intrinsics do; anything else as it is."""
    return value if isinstance(value, Dispatcher) or not callable(value) else inspect.unwrap(value)


def _described(value: Any) -> str:
    """Return a text of a value that is the same in every process; of what is no plain value, its name."""
    if value is None or isinstance(value, bool | int | float | complex | str | bytes):
        return repr(value)
    if isinstance(value, tuple | list):
        return f"({', '.join(map(_described, value))})"
    if isinstance(value, set | frozenset):
        return f"{{{', '.join(sorted(map(_described, value)))}}}"
    if isinstance(value, np.ndarray | np.generic):
        return f"{value.dtype.str} {value.shape} {value.tobytes().hex()}"
    if isinstance(value, CodeType):
        names = value.co_names, value.co_varnames, value.co_freevars, value.co_cellvars
        return _described((value.co_name, value.co_argcount, value.co_flags, value.co_code, value.co_consts, *names))
    named = value if hasattr(value, "__qualname__") else type(value)
    return f"{named.__module__}.{named.__qualname__}"
