"""The page of one track, `track.html`: one file that needs no network.

| looking for | file |
|---|---|
| the document and its colours | this file |
| the data of the page, as the scripts read them | data.py |
| small pictures of footage and masks, within a limited size | stills.py |
| the empty layout and its style | track.html, track.css |
| bodies of tapered cones on a canvas; a view that can be turned | body.js |
| the clock that plays frames; mouse, touch and keys | play.js |
| a camera's picture with the body on it; the body in 3D | panels.js |
| curves with intervals, and rows of marks | curves.js |
| the player, its keys, and the text above and below it | main.js |

The constant `D` is the data that data.py returns. `posefit.page` has the parts that
all pages share.
"""

from typing import Any

from posefit.output.drawing import (
    BOTH,
    LEFT,
    MIDDLE,
    MISSED,
    OTHER,
    RIGHT,
    SPILLED,
    hexadecimal,
)
from posefit.page.document import assembled, colour_style, one_script, part

LIGHT = {
    "left": "#b84500",
    "right": "#0063a6",
    "truth": "#5d6975",
    "middle": "#8d97a3",
    "both": "#8fc3a3",
    "missed": "#c8372d",
    "spilled": "#3b8fd1",
    "other": "#9a3f86",
    "unsure": "#0072b2",
    "held": "#7a8794",
}
DARK = {
    "left": hexadecimal(LEFT),
    "right": hexadecimal(RIGHT),
    "truth": "#98a5b3",
    "middle": hexadecimal(MIDDLE),
    "both": hexadecimal(BOTH),
    "missed": hexadecimal(MISSED),
    "spilled": hexadecimal(SPILLED),
    "other": hexadecimal(OTHER),
    "unsure": hexadecimal(RIGHT),
    "held": "#98a5b3",
}

SCRIPTS = ("body", "play", "panels", "curves", "main")  # in this order
_MARK = "<!doctype html>\n<!-- a track of posefit -->\n"


def track_document(data: dict[str, Any]) -> str:
    """Return the page that shows the data of a track."""
    style = colour_style(LIGHT, DARK) + part(__package__, "track.css")
    parts = assembled(
        _MARK,
        part(__package__, "track.html"),
        style,
        data,
        one_script(__package__, SCRIPTS),
    )
    return "".join(parts)
