"""Arrays that are made once on a machine, and kept in the cache where the compiled functions are.

A file's name is a digest of all that its arrays are made from, so nothing there is stale. A file is written under a
random name and then renamed, so that processes beside each other read whole files only. A file that is damaged, or that
cannot be read, is made again; if it cannot be written, each process makes its arrays for itself.
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

# files of a kind, which are about ten megabytes each: the ones not used for longest are
# removed
MAX_FILES = 24
# whatever a damaged archive raises
_DAMAGED = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error)

Arrays = Mapping[str, NDArray[Any]]


def cache_folder() -> Path:
    """Return the folder of what is made once on a machine: NUMBA_CACHE_DIR, or posefit's in the user's cache."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return Path(chosen)
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "posefit"


def stored(kind: str, key: bytes, make: Callable[[], Arrays]) -> Arrays:
    """Return the arrays of a key, read from the cache, or made and written there.

    Args:
        kind: the folder of such arrays in the cache.
        key: what the arrays are made from, or a digest of it.
        make: returns the arrays by their names; the same ones for the same key.

    Returns:
        The arrays by their names.

    """
    name = hashlib.sha256(key).hexdigest()[:32]
    try:
        path = cache_folder() / kind / f"{name}.npz"
        arrays = _read(path)
    except RuntimeError:  # there is no home, and so no cache
        arrays = make()
    except _DAMAGED:
        arrays = make()
        with suppress(OSError):
            _write(path, arrays)
    return arrays


def _read(path: Path) -> Arrays:
    """Return the arrays of a file. An archive has a checksum of each array, which is compared as it is read."""
    # NumPy leaves a damaged archive open that it has opened itself
    with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    if not arrays:
        raise ValueError(f"{path} is empty")
    # it is in use: it stays longer than others
    with suppress(OSError):
        os.utime(path)
    return arrays


def _write(path: Path, arrays: Arrays) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.stem}-{secrets.token_hex(4)}.npz")
    try:
        with beside.open("xb") as file:
            named: dict[str, Any] = dict(arrays)
            np.savez(file, **named)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
    files = sorted(path.parent.iterdir(), key=os.path.getmtime)
    for old in files[:-MAX_FILES]:
        old.unlink(missing_ok=True)
