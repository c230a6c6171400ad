"""A document that holds everything it needs, markup, style, scripts and data, and asks nobody for anything."""

import json
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np

PART = "<!--part-->"  # in the markup: where style, data and scripts go
SHARED = ("base", "body", "play")  # scripts of pages with bodies, in this order; of others the first is enough
_UNSAFE = {ord(sign): f"\\u{ord(sign):04x}" for sign in "<>&\u2028\u2029"}


def part(package: str, name: str) -> str:
    """Return a file of a package as text."""
    return (files(package) / name).read_text(encoding="utf-8")


def assembled(mark: str, markup: str, style: str, data: Any, script: str) -> str:
    """Return a document: its first line, its markup with the three parts in it. `style` comes after the shared one."""
    before, middle, after, end = markup.split(PART)
    held = f'<script type="application/json" id="data">{embedded(data)}</script>'
    look = f"<style>\n{part(__package__, 'base.css')}{style}</style>"
    return "".join([mark, before, look, middle, held, after, f"<script>\n{script}</script>", end])


def as_one(shared: Sequence[str], *others: tuple[str, Sequence[str]]) -> str:
    """Return scripts as one, so that no name of theirs reaches beyond it: those shared, then of each other package."""
    rooms = [(__package__, shared), *others]
    parts = [part(package, f"{name}.js") for package, names in rooms for name in names]
    return '"use strict";\n(() => {\n' + "\n".join(parts) + "})();\n"


def embedded(value: Any) -> str:
    """Return JSON that may stand in a script element, whatever texts it holds; nan and infinities are null."""
    return json.dumps(plain(value), allow_nan=False, separators=(",", ":")).translate(_UNSAFE)


def plain(value: Any) -> Any:
    """Return what JSON can hold: arrays as lists, floats of five digits, nan and infinities as None."""
    if isinstance(value, dict):
        return {str(name): plain(one) for name, one in value.items()}
    if isinstance(value, np.ndarray):
        return value.tolist() if value.dtype.kind == "i" else plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.5g}") if np.isfinite(value) else None
    return value


def colour_style(light: dict[str, str], dark: dict[str, str]) -> str:
    """Return named colours as variables of a page's style, for light and for dark screens."""
    bright, dim = ("".join(f" --{name}: {colour};" for name, colour in one.items()) for one in (light, dark))
    return f":root {{{bright} }}\n@media (prefers-color-scheme: dark) {{ :root {{{dim} }} }}\n"
