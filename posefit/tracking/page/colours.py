"""The colours of a track's page; on dark screens those of its pictures."""

from posefit.tracking.drawing.colours import BOTH, LEFT, MIDDLE, MISSED, OTHER, RIGHT, SPILLED, hexadecimal

# the limbs of a body, and the truth, on any page
BODY_LIGHT = {"left": "#b84500", "right": "#0063a6", "truth": "#5d6975"}
BODY_DARK = {"left": hexadecimal(LEFT), "right": hexadecimal(RIGHT), "truth": "#98a5b3"}

LIGHT = {
    **BODY_LIGHT,
    "middle": "#8d97a3",
    "both": "#8fc3a3",
    "missed": "#c8372d",
    "spilled": "#3b8fd1",
    "other": "#9a3f86",
    "unsure": "#0072b2",
    "held": "#7a8794",
}
DARK = {
    **BODY_DARK,
    "middle": hexadecimal(MIDDLE),
    "both": hexadecimal(BOTH),
    "missed": hexadecimal(MISSED),
    "spilled": hexadecimal(SPILLED),
    "other": hexadecimal(OTHER),
    "unsure": hexadecimal(RIGHT),
    "held": "#98a5b3",
}
