"""Reads files from outside safely: they cannot fill the memory or cause a traceback.

`posefit.archive` does so for archives of arrays, `posefit.footage.images` for pictures.
"""

import json
import re
import stat
import tomllib
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from posefit.errors import InputError, printable

# names that other libraries use, with the names in posefit
OTHER_WORDS = {
    "optimizer": ("optimiser", "method"),
    "optimizers": ("optimisers", "methods"),
    "optimisers": ("methods",),
}
SHOWN = 80  # characters of a name or value in a message
MAX_DOTS = 1_000  # most dots in a line of TOML, except in decimal numbers
# greatest sum of the squared numbers of dots over all lines: reading a key of n parts
# takes memory as n squared. A plan that names 300 files on each of 10 lines has 1e6.
MAX_SQUARED_DOTS = 10_000_000
_DECIMAL = re.compile(r"(?<![\w.])[-+]?\d+\.\d+(?:[eE][-+]?\d+)?(?![\w.])")


def quoted(value: object) -> str:
    """Return a value in the form that messages quote, cut if it is long."""
    if isinstance(value, str | bytes | bytearray):
        # the rest would not be shown, however long it is
        value = value[: SHOWN + 1]
    try:
        text = repr(value)
    # a number of more digits than Python writes, or endless nesting
    except (ValueError, RecursionError):
        text = f"one {type(value).__name__} that is too long to write"
    return cut(text)


def cut(text: str, most: int = SHOWN) -> str:
    """Return a text on one line, cut if it is long."""
    text = printable(text[: most + 1])
    if len(text) <= most:
        return text
    return f"{text[: most - 3]}..."


def counted(count: int, word: str) -> str:
    """Return a count with its noun: `1 run`, `2,000 runs`."""
    if count == 1:
        return f"{count:,} {word}"
    return f"{count:,} {word}s"


def suggestion(name: str, known: Iterable[str]) -> str:
    """Return a question for the nearest known name, to end a message about a wrong one.

    It is "" if no name is near.
    """
    names = list(known)
    others = [other for other in OTHER_WORDS.get(name, ()) if other in names]
    near = others or get_close_matches(name[:SHOWN], names, 1)
    if near:
        return f"; did you mean {near[0]!r}?"
    return ""


def existing(path: Path) -> Path:
    """Return a path.

    Raises:
        InputError: It does not exist, or is an empty file.
    """
    if not path.exists():
        if path.suffix:
            raise InputError(f"{path}: no such file")
        raise InputError(f"{path}: no such file or folder")
    if path.is_file() and not path.stat().st_size:
        raise InputError(f"{path}: expected a file with content, got an empty one")
    return path


def check_size(path: Path, most: int) -> None:
    """Raise InputError if a file is too large, or is a folder, a pipe or a device.

    Args:
        path: The file.
        most: Bytes that it may have.
    """
    state = path.stat()
    if not stat.S_ISREG(state.st_mode):
        if stat.S_ISDIR(state.st_mode):
            came = "a folder"
        else:
            came = "a pipe or a device"
        raise InputError(f"{path}: expected a file that can be read, got {came}")
    size = state.st_size
    if size > most:
        factor, unit = (1e6, "MB") if most < 1_000_000_000 else (1e9, "GB")
        raise InputError(
            f"{path}: expected at most {most / factor:g} {unit}, "
            f"got {size / factor:.1f} {unit}"
        )


def read_text(path: str | Path, most: int, what: str = "text") -> str:
    """Return the text of a file, without a byte-order mark.

    Args:
        path: The file.
        most: Bytes that it may have.
        what: Kind of text, for messages.

    Raises:
        InputError: The file is larger, is not UTF-8 or cannot be read.
        FileNotFoundError: There is no such file.
    """
    path = Path(path)
    try:
        check_size(path, most)
        with path.open("rb") as file:
            content = file.read()
        return content.decode("utf-8-sig")
    except FileNotFoundError:
        raise
    except OSError as error:
        raise InputError(
            f"{path}: expected a file that can be read, got {error.strerror or error}"
        ) from None
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: expected {what} in UTF-8, got byte 0x{content[error.start]:02x}"
        ) from None


def parsed_toml(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text.

    Raises:
        InputError: The text is nested so deeply that it must be hostile.
        ValueError: The text is not TOML.
    """
    weight = 0
    for number, line in enumerate(text.splitlines(), 1):
        if line.count(".") > 1:
            dots = _DECIMAL.sub("", line).count(".")
        else:
            dots = 0
        weight += dots * dots
        if dots > MAX_DOTS or weight > MAX_SQUARED_DOTS:
            raise InputError(
                f"expected less deeply nested keys, got {dots} dots in line {number}"
            )
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError(
            "expected less deeply nested values, got too many brackets"
        ) from None


def parsed_json(text: str | bytes) -> Any:
    """Return the value of a JSON text.

    Raises:
        InputError: The text is nested so deeply that it must be hostile.
        ValueError: The text is not JSON.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise InputError(
            "expected less deeply nested values, got too many brackets"
        ) from None
