"""Whether two tracks are the same: their arguments are compared by content, as cells of a sweep are."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from posefit.errors import InputError
from posefit.reading import cut

# of one argument of a track: its "text" in a message, the SHA-256 of its content as
# "digest"
Digest = dict[str, str]


def digest_of(value: Any, files: bool = False) -> Digest:
    """Return what a value is; with `files`, a text that names a file or folder is what that holds."""
    content = json.dumps(_plain(value, files), sort_keys=True, separators=(",", ":"))
    return {
        "text": cut(repr(value)),
        "digest": hashlib.sha256(content.encode()).hexdigest(),
    }


def difference(before: Mapping[str, Digest], now: Mapping[str, Digest]) -> str | None:
    """Return a sentence about the first argument in which two tracks differ, or None where there is none."""
    for name in sorted(before.keys() | now.keys()):
        earlier = before.get(name, {})
        later = now.get(name, {})
        expected = earlier.get("text")
        came = later.get("text")
        if earlier.get("digest") != later.get("digest"):
            if expected == came:
                return f"{name} must be {expected} as it was, to resume, got one with another content"
            return f"{name} must be {expected}, as before, to resume, got {came}"
    return None


def _plain(value: Any, files: bool) -> Any:
    """Return what a value consists of, as JSON holds it: equal for equal contents, whatever the objects are."""
    same = partial(_plain, files=files)
    if value is None or isinstance(value, bool | int | float):
        return value
    if isinstance(value, str | Path):
        return ["text", str(value), _content(Path(value)) if files else None]
    if isinstance(value, np.ndarray | np.generic):
        array = np.ascontiguousarray(value)
        return [
            "array",
            str(array.dtype),
            list(array.shape),
            hashlib.sha256(array.tobytes()).hexdigest(),
        ]
    if isinstance(value, Mapping):
        return [
            "mapping",
            sorted([str(name), same(item)] for name, item in value.items()),
        ]
    if isinstance(value, Sequence | set | frozenset):
        return [
            "sequence",
            [
                same(item)
                for item in (value if isinstance(value, Sequence) else sorted(value))
            ],
        ]
    kind = f"{type(value).__module__}.{type(value).__qualname__}"
    if isinstance(value, partial):
        return [kind, same(value.func), same(value.args), same(value.keywords)]
    if isinstance(value, type | Callable):  # type: ignore[arg-type]
        return [
            "named",
            getattr(value, "__module__", ""),
            getattr(value, "__qualname__", kind),
        ]
    if is_dataclass(value):
        return [
            kind,
            [[field.name, same(getattr(value, field.name))] for field in fields(value)],
        ]
    attributes = getattr(value, "__dict__", None)
    return [kind, same(attributes) if attributes is not None else repr(value)]


def _content(path: Path) -> Any:
    """Return the SHA-256 of a file, of a folder those of its files, or None where there is nothing."""
    try:
        if path.is_dir():
            return [
                [file.name, _content(file)]
                for file in sorted(path.iterdir())
                if file.is_file()
            ]
        if not path.is_file():
            return None
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(
            f"{path}: expected a file that can be read, got {error.strerror}"
        ) from None
