"""The page of a report as one document. `posefit.page` has the parts of all pages.

| looking for | file |
|---|---|
| the empty sections and their style | report.html, report.css |
| methods: colours, marks, and the legend that shows and hides them | methods.js |
| charts: lines with bands, errors of joints | charts.js |
| the first screen: all methods, problems | first.js |
| the tables, and the command that runs a cell again | tables.js |
| paired tests: one method against all others | compare.js |
| the order in which everything is drawn | main.js |

The constant `D` is the data that `posefit.report.content` returns.

All colours are darker on white and lighter on black, so that each has a contrast of at
least 4.5 to 1 with its background. Marks distinguish methods too.
"""

from collections.abc import Iterator
from typing import Any

from posefit.page.document import assembled, colour_style, one_script, part

MARK = "<!doctype html>\n<!-- a report of posefit -->\n"  # how every report begins
# each script may use the ones before it
SCRIPTS = ("methods", "charts", "first", "tables", "compare", "main")
_LIGHT = ("#00775a", "#a63d80", "#7a5c00", "#6b4cc0", "#111111", "#b0123b", "#3d6b7d")
_DARK = ("#2cc79a", "#e39cc6", "#d9cf6a", "#b9a3ff", "#f2f2f2", "#ff8095", "#8fb8c9")
COLOUR_COUNT = len(_LIGHT)

LIGHT = {f"c{k}": colour for k, colour in enumerate(_LIGHT)}
DARK = {f"c{k}": colour for k, colour in enumerate(_DARK)}


def document(data: dict[str, Any]) -> Iterator[str]:
    """Yield the parts of the page that shows the data of a report."""
    style = colour_style(LIGHT, DARK) + part(__package__, "report.css")
    return assembled(
        MARK,
        part(__package__, "report.html"),
        style,
        data,
        one_script(__package__, SCRIPTS),
    )
