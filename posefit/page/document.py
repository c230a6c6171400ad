"""A document that contains everything it needs: markup, style, scripts and data.

It makes no network request.
"""

import json
from collections.abc import Iterator, Sequence
from importlib.resources import files
from typing import Any

import numpy as np

PART = "<!--part-->"  # replaced in the markup by style, data and script
PIECE = 10_000  # numbers of an array that are converted together
SHARED = ("base", "chart")  # scripts of every page, in this order
_UNSAFE = {ord(sign): f"\\u{ord(sign):04x}" for sign in "<>&\u2028\u2029"}


def part(package: str, name: str) -> str:
    """Return a file of a package as text."""
    return (files(package) / name).read_text(encoding="utf-8")


def assembled(
    mark: str, markup: str, style: str, data: Any, script: str
) -> Iterator[str]:
    """Yield the parts of a document with style, data and script in its markup.

    Args:
        mark: The document's first line.
        markup: The body, with a `PART` for the data and one for the script.
        style: Rules after the shared ones.
        data: The value of `D` in the scripts.
        script: The script, by `one_script`.
    """
    head = part(__package__, "head.html")
    before, middle, after, end = f"{head}{markup}".split(PART)
    style_element = f"<style>\n{part(__package__, 'base.css')}{style}</style>"
    yield from (mark, before, style_element, middle)
    yield '<script type="application/json" id="data">'
    for text in _json(data):
        yield text.translate(_UNSAFE)
    yield "</script>"
    yield from (after, f"<script>\n{script}</script>", end)


def one_script(package: str, names: Sequence[str]) -> str:
    """Return the shared scripts and a package's scripts as one script.

    Its names are not global.
    """
    parts = [part(__package__, f"{name}.js") for name in SHARED]
    parts += [part(package, f"{name}.js") for name in names]
    return '"use strict";\n(() => {\n' + "\n".join(parts) + "})();\n"


def embedded(value: Any) -> str:
    """Return JSON that is safe in a script element, with any texts.

    Nan and infinities are null.
    """
    return "".join(_json(value)).translate(_UNSAFE)


def _json(value: Any) -> Iterator[str]:
    """Yield the parts of a value's JSON.

    Dictionaries and long arrays are converted a part at a time, because all numbers of
    a page as Python objects, or as one text, take much memory.
    """
    if isinstance(value, dict):
        begin = "{"
        for name, inner in value.items():
            yield f"{begin}{json.dumps(str(name))}:"
            yield from _json(inner)
            begin = ","
        yield "}" if value else "{}"
    elif isinstance(value, np.ndarray) and value.ndim == 1 and len(value) > PIECE:
        begin = "["
        for first in range(0, len(value), PIECE):
            (piece,) = _json(value[first : first + PIECE])
            yield f"{begin}{piece[1:-1]}"
            begin = ","
        yield "]"
    else:
        yield json.dumps(plain(value), allow_nan=False, separators=(",", ":"))


def plain(value: Any) -> Any:
    """Return a value that JSON can hold.

    Arrays become lists, floats are rounded to five digits, and nan and infinities
    become None.
    """
    if isinstance(value, dict):
        return {str(name): plain(inner) for name, inner in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        if not np.isfinite(value):
            return None
        rounded = float(f"{value:.5g}")
        # rounding the largest floats gives infinity
        return rounded if np.isfinite(rounded) else float(value)
    return value


def _variables(colours: dict[str, str]) -> str:
    return "".join(f" --{name}: {colour};" for name, colour in colours.items())


def colour_style(light: dict[str, str], dark: dict[str, str]) -> str:
    """Return named colours as variables of a page's style, for light and dark."""
    bright = _variables(light)
    dim = _variables(dark)
    in_the_dark = "@media (prefers-color-scheme: dark)"
    return f":root {{{bright} }}\n{in_the_dark} {{ :root {{{dim} }} }}\n"
