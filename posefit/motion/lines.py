"""Lines of text files, with errors that name file and line."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from posefit.errors import InputError
from posefit.reading import SHOWN, cut

# far above any angle or length of a person; beyond it arithmetic would overflow
LARGEST = 1e6
BOM = b"\xef\xbb\xbf"  # some editors write it at the start


class Line(NamedTuple):
    """One line of a file, as words. The line after the last one has no words."""

    path: Path
    number: int
    words: Sequence[str]

    @property
    def key(self) -> str:
        """The first word in lower case, "" after the last line."""
        if self.words:
            return self.words[0].lower()
        return ""

    def mistake(self, expected: str, got: str | None = None) -> InputError:
        """Return the error of this line.

        Args:
            expected: What should be there.
            got: The actual text, by default the whole line.
        """
        if got is None:
            if self.words:
                got = quoted_words(self.words)
            else:
                got = "the end of the file"
        return InputError(
            f"{self.path}:{self.number}: expected {cut(expected, 2 * SHOWN)}, "
            f"got {cut(got)}"
        )

    def numbers(self, count: int) -> list[float]:
        """Return the `count` numbers after the first word.

        Raises:
            InputError: There are more or fewer, or one is not a number, or too large.
        """
        first = quoted_words(self.words[:1])
        words = self.words[1:]
        if len(words) != count:
            raise self.mistake(f"{count} values for {first}", f"{len(words)}")
        try:
            values = [float(word) for word in words]
        except ValueError:
            raise self.mistake(f"numbers for {first}", quoted_words(words)) from None
        # this comparison also fails for NaN
        if not sum(map(abs, values)) < LARGEST:
            raise self.mistake(
                f"finite numbers below {LARGEST:g} for {first}", quoted_words(words)
            )
        return values


def lines_of(path: Path, longest: int) -> Iterator[Line]:
    """Yield the lines of a file that have words, and an empty one at the end.

    Raises:
        InputError: A line has more than `longest` bytes.
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
    # an empty line, so that a missing part of the file has a line number in its message
    yield Line(path, max(number, 1), ())


def quoted_words(words: Sequence[str]) -> str:
    """Return words of a file in the form that messages quote."""
    return repr(cut(" ".join(words)))
