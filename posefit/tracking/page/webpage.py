"""The viewer of a track as one document."""

from typing import Any

from posefit.page.document import SHARED, as_one, assembled, colour_style, part
from posefit.tracking.page.colours import DARK, LIGHT

SCRIPTS = ("panels", "curves", "main")  # in this order
_MARK = "<!doctype html>\n<!-- a track of posefit -->\n"


def viewer_document(data: dict[str, Any]) -> str:
    """Return the page that shows the data of a track."""
    style = colour_style(LIGHT, DARK) + part(__package__, "viewer.css")
    return assembled(_MARK, part(__package__, "viewer.html"), style, data, viewer_script())


def viewer_script() -> str:
    """Return the page's script."""
    return as_one(SHARED, (__package__, SCRIPTS))
