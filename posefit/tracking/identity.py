"""Whether two tracks are the same: their arguments are compared by content, as cells of a sweep are."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from posefit.errors import InputError

SHOWN = 80  # characters of a value in a message
PIECE = 1 << 20  # bytes of a file that are read at a time


@dataclass(frozen=True)
class ArgumentDigest:
    """One argument of a track: its text in a message, and the SHA-256 of its content."""

    text: str
    digest: str

    @classmethod
    def of(cls, value: Any, files: bool = False) -> "ArgumentDigest":
        """Return what a value is; with `files`, a text that names a file or folder is what that holds."""
        text = repr(value)
        shown = text if len(text) <= SHOWN else f"{text[: SHOWN - 3]}..."
        return cls(shown, _digest(_plain(value, files)))

    def as_json(self) -> dict[str, str]:
        """Return it as JSON holds it."""
        return {"text": self.text, "digest": self.digest}


def difference(before: Mapping[str, Mapping[str, str]], now: Mapping[str, ArgumentDigest]) -> str | None:
    """Return a sentence about the first argument in which two tracks differ, or None where there is none."""
    for name in sorted(before.keys() | now.keys()):
        earlier, later = before.get(name), now.get(name)
        digest = None if later is None else later.digest
        if (None if earlier is None else earlier.get("digest")) == digest:
            continue
        expected, came = (None if earlier is None else earlier.get("text")), (None if later is None else later.text)
        if expected == came:
            return f"{name} must be {expected} as it was, to resume, got one with another content"
        return f"{name} must be {expected}, as before, to resume, got {came}"
    return None


def _digest(plain: Any) -> str:
    text = json.dumps(plain, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(value: Any, files: bool) -> Any:
    """Return what a value consists of, as JSON holds it: equal for equal contents, whatever the objects are."""
    same = partial(_plain, files=files)
    if value is None or isinstance(value, bool | int | float):
        return value
    if isinstance(value, str | Path):
        return ["text", str(value), _content(Path(value)) if files else None]
    if isinstance(value, np.ndarray | np.generic):
        array = np.ascontiguousarray(value)
        return ["array", str(array.dtype), list(array.shape), hashlib.sha256(array.tobytes()).hexdigest()]
    if isinstance(value, Mapping):
        return ["mapping", sorted([str(name), same(one)] for name, one in value.items())]
    if isinstance(value, Sequence | set | frozenset):
        return ["sequence", [same(one) for one in (value if isinstance(value, Sequence) else sorted(value))]]
    kind = f"{type(value).__module__}.{type(value).__qualname__}"
    if isinstance(value, partial):
        return [kind, same(value.func), same(value.args), same(value.keywords)]
    if isinstance(value, type | Callable):  # type: ignore[arg-type]
        return ["named", getattr(value, "__module__", ""), getattr(value, "__qualname__", kind)]
    if is_dataclass(value):
        return [kind, [[one.name, same(getattr(value, one.name))] for one in fields(value)]]
    held = getattr(value, "__dict__", None)
    return [kind, same(held) if held is not None else repr(value)]


def _content(path: Path) -> Any:
    """Return the SHA-256 of a file, of a folder those of its files, or None where there is nothing."""
    try:
        if path.is_dir():
            return [[one.name, _content(one)] for one in sorted(path.iterdir()) if one.is_file()]
        if not path.is_file():
            return None
        digest = hashlib.sha256()
        with path.open("rb") as file:
            while piece := file.read(PIECE):
                digest.update(piece)
        return digest.hexdigest()
    except OSError as error:
        raise InputError(f"{path}: expected a file that can be read, got {error.strerror}") from None
