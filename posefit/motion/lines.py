"""Lines of text files, with errors that name file and line."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from posefit.errors import InputError
from posefit.reading import SHOWN, cut

LARGEST = 1e6  # no angle or length of a person comes near; beyond it arithmetic would overflow


def mistake(path: Path, line: int, expected: str, got: str) -> InputError:
    """Return the error of a file's line; what came is quoted, and cut where it is long."""
    return InputError(f"{path}:{line}: expected {cut(expected, 2 * SHOWN)}, got {cut(got)}")


def lines_of(path: Path, longest: int) -> Iterator[tuple[int, bytes]]:
    """Yield the lines of a file with their numbers from 1. Raises ValueError for one of more than `longest` bytes."""
    with path.open("rb") as file:
        for number, line in enumerate(iter(partial(file.readline, longest + 1), b""), 1):
            if len(line) > longest:
                raise mistake(path, number, f"a line of at most {longest} bytes", "a longer one")
            yield number, line


def shown(*words: bytes | str) -> str:
    """Return words of a file as a message quotes them."""
    texts = (word if isinstance(word, str) else word[: 4 * SHOWN].decode("utf-8", errors="replace") for word in words)
    return repr(cut(" ".join(texts).strip()))


def values_of(path: Path, number: int, words: Sequence[Any], count: int) -> list[float]:
    """Return the numbers of a line after its first word. Raises ValueError where they are not so many small ones."""
    if len(words) != count + 1:
        raise mistake(path, number, f"{count} values for {shown(words[0])}", f"{len(words) - 1}")
    try:
        values = [float(word) for word in words[1:]]
    except ValueError:
        raise mistake(path, number, f"numbers for {shown(words[0])}", shown(*words[1:])) from None
    if not sum(map(abs, values)) < LARGEST:  # this way round it is true of NaN, too
        raise mistake(path, number, f"finite numbers below {LARGEST:g} for {shown(words[0])}", shown(*words[1:]))
    return values
