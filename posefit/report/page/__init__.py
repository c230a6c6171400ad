"""The page of a report as one document; what it shares with other pages is in `posefit.page`.

| looking for | file |
|---|---|
| the sections, empty, and how they look | report.html, report.css |
| colours and marks of methods, the legend whose buttons show and hide them | methods.js |
| charts: curves over evaluations, errors of joints, calibration | curves.js |
| the first screen: all methods, three tracks of the leader, failures, progress of a running sweep | first.js |
| the tables: leaderboard, all runs, running times, failures; the command that runs a cell again | tables.js |
| ranks, paired tests, published claims, selection, one method against all others | compare.js |
| cards and the window that plays a track | gallery.js |
| the order in which everything is drawn | main.js |

The constant `D` is the data that `posefit.report.content` returns.

Methods have the colours of Okabe and Ito, Color universal design, 2008, which colour-blind readers can distinguish,
without their yellow: darker on white and lighter on black, so that each has a contrast of at least 4.5 to 1 with its
background. Marks distinguish methods too.
"""

from typing import Any

from posefit.page.document import assembled, colour_style, one_script, part
from posefit.tracking.drawing import OTHER, hexadecimal
from posefit.tracking.page import BODY_DARK, BODY_LIGHT

MARK = "<!doctype html>\n<!-- a report of posefit -->\n"  # how every report begins
SCRIPTS = ("methods", "curves", "first", "tables", "compare", "gallery", "main")  # in this order
_LIGHT = ("#0063a6", "#b84500", "#00775a", "#a63d80", "#7a5c00", "#6b4cc0", "#111111")
_DARK = ("#4aa8e0", "#f08a3c", "#2cc79a", "#e39cc6", "#f0b53c", "#b9a3ff", "#f2f2f2")
COLOURS = len(_LIGHT)

LIGHT = {f"c{k}": colour for k, colour in enumerate(_LIGHT)} | BODY_LIGHT
LIGHT |= {"middle": "var(--ink)", "estimate": _LIGHT[1], "swapped": _LIGHT[3]}
DARK = {f"c{k}": colour for k, colour in enumerate(_DARK)} | BODY_DARK
DARK |= {"middle": "var(--ink)", "estimate": _DARK[1], "swapped": hexadecimal(OTHER)}


def document(data: dict[str, Any]) -> str:
    """Return the page that shows the data of a report."""
    style = colour_style(LIGHT, DARK) + part(__package__, "report.css")
    return assembled(MARK, part(__package__, "report.html"), style, data, script())


def script() -> str:
    """Return the page's script."""
    return one_script(__package__, SCRIPTS)
