"""Compares the arguments of two tracks by their content, not by their objects.

A track can only be resumed with the same arguments.
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from posefit.errors import InputError
from posefit.geometry.calibration.read import file_and_name
from posefit.reading import cut

# one argument of a track: "text" is its wording in messages, and "digest" is the
# SHA-256 of its content
Digest = dict[str, str]


def digest_of(value: Any, files: bool = False) -> Digest:
    """Return the digest of a value.

    With `files`, a string that names a file or folder counts as the content of that
    file or folder. FILE:NAME, a camera of a calibration, names a file, too.
    """
    content = json.dumps(_plain(value, files), sort_keys=True, separators=(",", ":"))
    return {
        "text": cut(repr(value)),
        "digest": hashlib.sha256(content.encode()).hexdigest(),
    }


def difference(before: Mapping[str, Digest], now: Mapping[str, Digest]) -> str | None:
    """Return a sentence about the first argument that differs, or None if all agree."""
    for name in sorted(before.keys() | now.keys()):
        earlier = before.get(name, {})
        later = now.get(name, {})
        if earlier.get("digest") == later.get("digest"):
            continue
        expected = earlier.get("text")
        found = later.get("text")
        if expected == found:
            return (
                f"{name} must be {expected}, as before, to resume, "
                "got other content under that name"
            )
        return f"{name} must be {expected}, as before, to resume, got {found}"
    return None


def _plain(value: Any, files: bool) -> Any:
    """Return the content of a value as JSON can hold it.

    Values with equal content give equal results, even if they are different objects.
    """
    same = partial(_plain, files=files)
    if value is None or isinstance(value, bool | int | float):
        return value
    if isinstance(value, str | Path):
        return ["text", str(value), _content(_file(value)) if files else None]
    if isinstance(value, np.ndarray | np.generic):
        array = np.ascontiguousarray(value)
        digest = hashlib.sha256(array.tobytes()).hexdigest()
        return ["array", str(array.dtype), list(array.shape), digest]
    if isinstance(value, Mapping):
        pairs = [[str(name), same(item)] for name, item in value.items()]
        return ["mapping", sorted(pairs)]
    if isinstance(value, set | frozenset):
        value = sorted(value)
    if isinstance(value, Sequence):
        return ["sequence", [same(item) for item in value]]
    kind = f"{type(value).__module__}.{type(value).__qualname__}"
    if isinstance(value, partial):
        return [kind, same(value.func), same(value.args), same(value.keywords)]
    if isinstance(value, type | Callable):  # type: ignore[arg-type]
        module = getattr(value, "__module__", "")
        return ["named", module, getattr(value, "__qualname__", kind)]
    if is_dataclass(value):
        names = [field.name for field in fields(value)]
        return [kind, [[name, same(getattr(value, name))] for name in names]]
    attributes = getattr(value, "__dict__", None)
    return [kind, same(attributes) if attributes is not None else repr(value)]


def _file(value: str | Path) -> Path:
    """Return the path that a string names."""
    path = Path(value)
    return path if path.exists() else file_and_name(path)[0]


def _content(path: Path) -> Any:
    """Return the SHA-256 of a file, or the names and SHA-256 of a folder's files.

    Returns None if nothing exists at the path.
    """
    try:
        if path.is_dir():
            files = [entry for entry in sorted(path.iterdir()) if entry.is_file()]
            return [[file.name, _content(file)] for file in files]
        if not path.is_file():
            return None
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(
            f"{path}: expected a file that can be read, got {error.strerror}"
        ) from None
