"""Does a block of text show what the block of code before it prints? Words and counts exactly, figures within a half."""

import re
from collections.abc import Iterator

from tests.docs.pages import Block

_NUMBER = re.compile(r"(?<![\w.])-?\d[\d,]*(?:\.\d+)?(?:e-?\d+)?")
_TIME = re.compile(r"\s*(ms|us|s|seconds?|poses a second)\b")
TOLERANCE = 0.5  # relative: on another processor a search finds another minimum
# below which a number without a unit, of a line without fractions, is a count
COUNTS = 100
_UNIT = re.compile(r"\s*(mm|cm|m|%|degrees|deg)(?!\w)")


def differences(block: Block, output: str) -> Iterator[str]:
    """Yield each line of `block` that `output` does not hold after the lines before it; `...` stands for anything."""
    lines = [_plain(line) for line in output.splitlines()]
    at = 0
    for line in map(_plain, block.text.splitlines()):
        if line in ("", "...") or line.startswith("$ "):
            continue
        place = next((i for i in range(at, len(lines)) if same(line, lines[i])), None)
        if place is None:
            near = [
                other for other in lines[at:] if other.split()[:1] == line.split()[:1]
            ]
            yield f"{block}: {line!r} is not printed" + (
                f", but {near[0]!r}" if near else ""
            )
        else:
            at = place + 1


def same(shown: str, line: str) -> bool:
    """Return whether two lines have the same words and close numbers; times may be any."""
    if shown.endswith("..."):
        shown = shown.removesuffix("...").rstrip()
        line = " ".join(line.split()[: len(shown.split())])  # as many words
    if _NUMBER.sub("#", shown) != _NUMBER.sub("#", line):
        return False
    numbers = zip(_NUMBER.finditer(shown), _NUMBER.finditer(line), strict=True)
    pairs = [(a, b) for a, b in numbers if not _TIME.match(shown[a.end() :])]
    whole = not any("." in number[0] for pair in pairs for number in pair)

    def is_count(a: re.Match[str]) -> bool:
        return whole and _value(a[0]) < COUNTS and not _UNIT.match(shown[a.end() :])

    return all(a[0] == b[0] if is_count(a) else _close(a[0], b[0]) for a, b in pairs)


def _value(number: str) -> float:
    return float(number.replace(",", ""))


def _plain(line: str) -> str:
    return " ".join(re.sub(r"\x1b\[[0-9;]*m", "", line).split())


def _close(a: str, b: str) -> bool:
    decimals = max(len(number.partition(".")[2]) for number in (a, b))
    x = _value(a)
    y = _value(b)
    return abs(x - y) <= max(
        TOLERANCE * max(abs(x), abs(y)), 2 * 10**-decimals if decimals else 0
    )
