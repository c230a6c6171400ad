"""The page of a report as one document; what it shares with other pages is in `posefit.page`."""

from typing import Any

from posefit.page.document import SHARED, as_one, assembled, part
from posefit.report import colours

COMMON = ("ledger", "table", "failures", "chart", "standing", "live")  # scripts of every report
SCRIPTS = (  # in this order, after those
    *("tables", "charts", "certainty", "ranks", "scene", "gallery"),
    *("lead", "selection", "author", "main"),
)
MARK = "<!doctype html>\n<!-- a report of posefit -->\n"  # how every report begins


def document(data: dict[str, Any]) -> str:
    """Return the page that shows the data of a report."""
    style = colours.style() + part(__package__, "report.css")
    return assembled(MARK, part(__package__, "report.html"), style, data, script())


def script() -> str:
    """Return the page's script."""
    return as_one(SHARED, (__package__, (*COMMON, *SCRIPTS)))
