"""Lines of text files, with errors that name file and line."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from posefit.errors import InputError
from posefit.reading import SHOWN, cut

# no angle or length of a person comes near; beyond it arithmetic would overflow
LARGEST = 1e6
BOM = b"\xef\xbb\xbf"  # which some editors write first


class Line(NamedTuple):
    """One line of a file, as words; that after the last one has none."""

    path: Path
    number: int
    words: Sequence[str]

    @property
    def key(self) -> str:
        """The first word in small letters, "" after the last line."""
        return self.words[0].lower() if self.words else ""

    def mistake(self, expected: str, got: str | None = None) -> InputError:
        """Return the error of this line; what came is all of it where it is not stated."""
        if got is None:
            got = quoted_words(self.words) if self.words else "the end of the file"
        return InputError(
            f"{self.path}:{self.number}: expected {cut(expected, 2 * SHOWN)}, got {cut(got)}"
        )

    def numbers(self, count: int) -> list[float]:
        """Return the numbers after the first word. Raises InputError where they are not so many small ones."""
        first = quoted_words(self.words[:1])
        words = self.words[1:]
        if len(words) != count:
            raise self.mistake(f"{count} values for {first}", f"{len(words)}")
        try:
            values = [float(word) for word in words]
        except ValueError:
            raise self.mistake(f"numbers for {first}", quoted_words(words)) from None
        if not sum(map(abs, values)) < LARGEST:  # this way round it is true of NaN, too
            raise self.mistake(
                f"finite numbers below {LARGEST:g} for {first}", quoted_words(words)
            )
        return values


def lines_of(path: Path, longest: int) -> Iterator[Line]:
    """Yield the lines of a file that have words, and the one after the last: no file is without a line.

    Raises InputError for a line of more than `longest` bytes.
    """
    number = 0
    with path.open("rb") as file:
        for number, raw in enumerate(iter(partial(file.readline, longest + 1), b""), 1):
            if len(raw) > longest:
                raise Line(path, number, ()).mistake(
                    f"a line of at most {longest} bytes", "a longer one"
                )
            if words := raw.removeprefix(BOM).decode("utf-8", errors="replace").split():
                yield Line(path, number, words)
    yield Line(path, max(number, 1), ())


def quoted_words(words: Sequence[str]) -> str:
    """Return words of a file as a message quotes them."""
    return repr(cut(" ".join(words)))
