"""A page that holds everything it needs, markup, style, scripts and data, and asks nobody for anything."""

import json
from importlib.resources import files
from typing import Any

import numpy as np

from posefit.report import colours

SCRIPTS = ("base", "tables", "charts", "certainty", "ranks", "body", "gallery", "author", "main")  # in this order
PART = "<!--part-->"  # where style, data and scripts go
MARK = "<!doctype html>\n<!-- a report of posefit -->\n"  # how every report begins
_UNSAFE = {ord(sign): f"\\u{ord(sign):04x}" for sign in "<>&\u2028\u2029"}


def document(data: dict[str, Any]) -> str:
    """Return the page that shows the data of a report."""
    before, middle, after, end = _read("report.html").split(PART)
    style = f"<style>\n{colours.style()}{_read('report.css')}</style>"
    held = f'<script type="application/json" id="data">{embedded(data)}</script>'
    return "".join(
        [
            MARK,
            before,
            style,
            middle,
            held,
            after,
            f"<script>\n{script()}</script>",
            end,
        ]
    )


def script() -> str:
    """Return the page's script: all of `SCRIPTS` as one, so that no name of theirs reaches beyond it."""
    return '"use strict";\n(() => {\n' + "\n".join(_read(f"{name}.js") for name in SCRIPTS) + "})();\n"


def _read(name: str) -> str:
    return (files("posefit.report") / "page" / name).read_text(encoding="utf-8")


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
