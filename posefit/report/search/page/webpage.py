"""The page of a report of single searches as one document."""

from typing import Any

from posefit.page.document import SHARED, as_one, assembled, part
from posefit.report import colours
from posefit.report.page.webpage import COMMON, MARK

REPORT = "posefit.report.page"
SCRIPTS = ("times", "reached", "main")  # in this order, after those that every report has


def search_document(data: dict[str, Any]) -> str:
    """Return the page that shows the data of single searches."""
    style = colours.style() + part(REPORT, "report.css")
    return assembled(MARK, part(__package__, "search.html"), style, data, search_script())


def search_script() -> str:
    """Return the page's script."""
    return as_one(SHARED[:1], (REPORT, COMMON), (__package__, SCRIPTS))
