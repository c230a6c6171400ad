"""Converts docstrings to reStructuredText: plain text with code in backticks."""

import re
from collections.abc import Iterator

_ARRAY = re.compile(
    r"~?(?:numpy\.)?ndarray\[~?tuple\[~?(?:typing\.)?Any, \.\.\.\], "
    r"~?(?:numpy\.)?dtype\[~?(?:numpy\.)?(\w+)\]\]"
)
_COLUMNS = re.compile(r"\S {2,}\S")


def restructured(lines: list[str]) -> list[str]:
    """Return the lines of a docstring as reStructuredText."""
    out: list[str] = []
    literal = False
    for block in _blocks(lines):
        made = _block(block)
        continues = literal and made[0] == "::"  # an empty line within code
        literal = made[0] == "::"
        out += [*(made[2:] if continues else made), ""]
    return out


def shortened(signature: str) -> str:
    """Return a signature with `Array` for numpy's longer name, without `<factory>`."""
    named = _ARRAY.sub(
        lambda one: "Array" if one[1] == "float64" else f"Array[{one[1]}]", signature
    )
    return named.replace("<factory>", "...")


def _blocks(lines: list[str]) -> Iterator[list[str]]:
    """Yield the runs of lines without an empty line in between."""
    block: list[str] = []
    for line in [*lines, ""]:
        if line.strip():
            block.append(line)
        elif block:
            yield block
            block = []


def _block(block: list[str]) -> list[str]:
    if all(line.startswith("    ") for line in block):
        return ["::", "", *block]
    if all(line.lstrip().startswith("|") for line in block):
        return _table(block)
    if sum(bool(_COLUMNS.search(line.strip())) for line in block) >= 2:
        return ["::", "", *(f"    {line}" for line in block)]
    if (
        len(block) > 1
        and block[0].rstrip().endswith(":")
        and block[1].startswith("    ")
    ):
        # an example is code, although its lines may have colons
        if block[1].lstrip().startswith(">>>"):
            return [*_block(block[:1]), "", "::", "", *block[1:]]
        return [*_block(block[:1]), "", *_entries(block[1:])]
    heading = re.fullmatch(r"#+ (.*)", block[0])
    if heading:
        return [f"**{heading[1]}**", "", *(_block(block[1:]) if block[1:] else [])]
    return _escaped("\n".join(block)).split("\n")


def _entries(lines: list[str]) -> list[str]:
    """Return an indented list such as the settings, with a bullet for each entry."""
    out: list[str] = []
    base = len(lines[0]) - len(lines[0].lstrip())
    for line in lines:
        text = _escaped(line.strip())
        if len(line) - len(line.lstrip()) == base:
            name, colon, rest = text.partition(":")
            out.append(
                f"* **{name}**:{rest}" if colon and "`" not in name else f"* {text}"
            )
        else:
            out.append(f"  {text}")
    return out


def _table(lines: list[str]) -> list[str]:
    """Return a table of Markdown as a list-table."""
    rows = [
        [cell.strip() for cell in line.strip().strip("|").split("|")] for line in lines
    ]
    rows = [
        row for row in rows if not all(re.fullmatch(r":?-+:?", cell) for cell in row)
    ]
    out = [".. list-table::", "   :header-rows: 1", ""]
    for row in rows:
        for k, cell in enumerate(row):
            out.append(f"   {'* -' if k == 0 else '  -'} {_escaped(cell)}")
    return out


def _escaped(text: str) -> str:
    """Return text in which only backticks have a meaning."""
    parts = re.split(r"(`[^`]+`)", text)
    for k, part in enumerate(parts):
        if k % 2:
            following = parts[k + 1][:1]
            parts[k] = f"``{part[1:-1].strip()}``" + (
                "\\ " if following.isalnum() else ""
            )
        else:
            parts[k] = re.sub(r"([*|\\])", r"\\\1", part)
            parts[k] = re.sub(r"(?<=\w)_(?!\w)", r"\\_", parts[k])
    return "".join(parts)
