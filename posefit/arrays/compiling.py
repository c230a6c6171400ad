"""Functions compiled by numba, and its cache of them: in a folder that is named after what is compiled, and with what.

numba's own cache looks at the one file that a function stands in. What is compiled holds copies of every function that
it calls, and of every constant, wherever these stand: so the folder's name has digests of the sources of posefit and of
the function's own package. Each signature of a function has an index of its own there, so that processes that compile
at the same time lose nothing of each other's; and what cannot be read or written is not in the cache, and no error.
"""

import hashlib
import os
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from posefit.version import source_digest

if "NUMBA_CPU_NAME" in os.environ:
    # A processor that is named has its own instructions and none besides. numba, not yet imported, takes the name for
    # their order only: x86-64-v3 would still have AVX-512 where this machine has it.
    os.environ.setdefault("NUMBA_CPU_FEATURES", "")


def compiled(function: Callable[..., Any], inline: str) -> Any:
    """Return a function compiled by numba, whose calls are inlined "always" or "never"."""
    import numba

    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract", "nsz"}, "inline": inline}
    # these functions are not called from C; wrappers for it would take a twelfth of the time to compile
    options["no_cfunc_wrapper"] = True
    dispatcher: Any = numba.njit(**options)(function)
    if dispatcher is not function:  # NUMBA_DISABLE_JIT: nothing is compiled
        dispatcher._cache = cache_kind()(function)
    return dispatcher


def cache_folder(module: str) -> Path:
    """Return where functions of a module are cached: below NUMBA_CACHE_DIR where it is set, else the user's caches."""
    import numba
    from numba.misc.appdirs import user_cache_dir

    parent = os.environ.get("NUMBA_CACHE_DIR") or user_cache_dir(appname="posefit", appauthor=False)  # type: ignore[no-untyped-call]
    return Path(parent) / f"numba-{numba.__version__}-{source_digest('posefit')}-{source_digest(module)}"


@cache
def cache_kind() -> Any:
    """Return numba's cache of a function, changed where this module's first lines say so."""
    from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, _CacheLocator

    class Locator(_CacheLocator):
        """Says where a function is cached: in a folder whose name says of which sources it is."""

        def __init__(self, function: Any) -> None:
            self._folder, self._line = cache_folder(function.__module__), function.__code__.co_firstlineno

        def get_cache_path(self) -> str:
            return str(self._folder)

        def get_source_stamp(self) -> str:
            return ""

        def get_disambiguator(self) -> str:
            return str(self._line)

        @classmethod
        def from_function(cls, py_func: Any, py_file: Any) -> Any:  # noqa: ARG003 - numba calls it
            return cls(py_func)

    class Results(CompileResultCacheImpl):
        _locator_classes = [Locator]  # type: ignore[list-item]  # noqa: RUF012 - as numba has it

    class Cache(FunctionCache):
        _impl_class = Results

        def _open(self, key: Any) -> None:
            digest = hashlib.sha256(repr(key).encode()).hexdigest()[:12]
            base = f"{self._impl.filename_base}-{digest}"
            self._cache_file = IndexDataCacheFile(self._cache_path, base, source_stamp="")  # type: ignore[no-untyped-call]

        def _load_overload(self, sig: Any, target_context: Any) -> Any:
            try:
                self._open(self._index_key(sig, target_context.codegen()))  # type: ignore[no-untyped-call]
                return super()._load_overload(sig, target_context)  # type: ignore[no-untyped-call]
            except Exception:  # a damaged file may raise anything: it is compiled again, and written over
                with suppress(Exception):
                    self._cache_file.flush()  # type: ignore[no-untyped-call]
                return None

        def _save_overload(self, sig: Any, data: Any) -> None:
            with suppress(Exception):  # there is no place to write
                self._open(self._index_key(sig, data.codegen))  # type: ignore[no-untyped-call]
                super()._save_overload(sig, data)  # type: ignore[no-untyped-call]

    return Cache
