"""Arrays that are computed once per machine, and stored next to compiled functions.

A file's name is a digest of everything that its arrays are computed from, so files are
never stale. A file is written under a random name and then renamed, so that other
processes never read half a file. If a file is damaged or cannot be read, its arrays are
computed again; if it cannot be written, each process computes them for itself.
"""

import hashlib
import os
import secrets
import zipfile
import zlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

# files of a kind, about ten megabytes each: the least recently used are removed
MAX_FILES = 24
# the exceptions that a damaged archive raises
_DAMAGED = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error)

Arrays = Mapping[str, NDArray[Any]]


def cache_folder() -> Path:
    """Return the cache: NUMBA_CACHE_DIR, or posefit's folder in the user's cache."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return Path(chosen)
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "posefit"


def stored(kind: str, key: bytes, make: Callable[[], Arrays]) -> Arrays:
    """Return the arrays of a key, read from the cache, or made and written to it.

    Args:
        kind: The name of the folder in the cache.
        key: The data that the arrays are made from, or a digest of it.
        make: Returns the arrays by name; always the same ones for the same key.

    Returns:
        The arrays by name.
    """
    name = hashlib.sha256(key).hexdigest()[:32]
    try:
        path = cache_folder() / kind / f"{name}.npz"
        arrays = _read(path)
    except RuntimeError:  # no home directory, and so no cache
        arrays = make()
    except _DAMAGED:
        arrays = make()
        with suppress(OSError):
            _write(path, arrays)
    return arrays


def _read(path: Path) -> Arrays:
    """Return the arrays of a file; reading an archive compares its checksums."""
    # NumPy would leave a damaged archive open if it opened it itself
    with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    if not arrays:
        raise ValueError(f"{path} is empty")
    # mark the file as recently used
    with suppress(OSError):
        os.utime(path)
    return arrays


def _write(path: Path, arrays: Arrays) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}-{secrets.token_hex(4)}.npz")
    try:
        with temporary.open("xb") as file:
            named: dict[str, Any] = dict(arrays)
            np.savez(file, **named)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
    files = sorted(path.parent.iterdir(), key=os.path.getmtime)
    for old in files[:-MAX_FILES]:
        old.unlink(missing_ok=True)
