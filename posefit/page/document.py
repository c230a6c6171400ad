"""A document that holds everything it needs: markup, style, scripts and data. It makes no network request."""

import json
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np

PART = "<!--part-->"  # in the markup: the places of style, data and script
SHARED = ("base", "chart")  # scripts of every page, in this order
_UNSAFE = {ord(sign): f"\\u{ord(sign):04x}" for sign in "<>&\u2028\u2029"}


def part(package: str, name: str) -> str:
    """Return a file of a package as text."""
    return (files(package) / name).read_text(encoding="utf-8")


def assembled(mark: str, markup: str, style: str, data: Any, script: str) -> str:
    """Return a document: its first line `mark`, the shared head, and its markup with style, data and script in it."""
    before, middle, after, end = f"{part(__package__, 'head.html')}{markup}".split(PART)
    json_element = (
        f'<script type="application/json" id="data">{embedded(data)}</script>'
    )
    style_element = f"<style>\n{part(__package__, 'base.css')}{style}</style>"
    return "".join(
        [
            mark,
            before,
            style_element,
            middle,
            json_element,
            after,
            f"<script>\n{script}</script>",
            end,
        ]
    )


def one_script(package: str, names: Sequence[str]) -> str:
    """Return the shared scripts and those of a package as one whose names are not global."""
    parts = [part(__package__, f"{name}.js") for name in SHARED] + [
        part(package, f"{name}.js") for name in names
    ]
    return '"use strict";\n(() => {\n' + "\n".join(parts) + "})();\n"


def embedded(value: Any) -> str:
    """Return JSON that is safe in a script element, whatever texts it holds; nan and infinities are null."""
    return _json(value).translate(_UNSAFE)


def _json(value: Any) -> str:
    """Return JSON, made of one part of a table after the other, as all numbers at once take much memory."""
    if isinstance(value, dict):
        return f"{{{','.join(f'{json.dumps(str(name))}:{_json(inner)}' for name, inner in value.items())}}}"
    return json.dumps(plain(value), allow_nan=False, separators=(",", ":"))


def plain(value: Any) -> Any:
    """Return a value that JSON can hold: arrays as lists, floats of five digits, nan and infinities as None."""
    if isinstance(value, dict):
        return {str(name): plain(inner) for name, inner in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        rounded = float(f"{value:.5g}")
        return (
            None
            if not np.isfinite(value)
            else rounded
            if np.isfinite(rounded)
            else float(value)
        )
    return value


def colour_style(light: dict[str, str], dark: dict[str, str]) -> str:
    """Return named colours as variables of a page's style, for light and for dark screens."""
    bright, dim = (
        "".join(f" --{name}: {colour};" for name, colour in scheme.items())
        for scheme in (light, dark)
    )
    return f":root {{{bright} }}\n@media (prefers-color-scheme: dark) {{ :root {{{dim} }} }}\n"
