"""The colours of a report: those of methods, in figures and on the page, and those of bodies on the page.

Methods have the colours of Okabe and Ito, Color universal design, 2008, which colour-blind readers can tell apart too,
without their yellow. The page has them a little darker where white would swallow them, and lighter on black.
"""

from collections.abc import Mapping

from posefit.page.document import colour_style
from posefit.tracking.drawing.colours import OTHER, hexadecimal
from posefit.tracking.page.colours import BODY_DARK, BODY_LIGHT

METHODS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")  # on paper
_LIGHT = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b97a00", "#3b9bd1", "#111")
_DARK = ("#4aa8e0", "#f08a3c", "#2cc79a", "#e39cc6", "#f0b53c", "#8fd0f5", "#f2f2f2")


def _named(methods: tuple[str, ...], bodies: Mapping[str, str]) -> dict[str, str]:
    return {**{f"c{k}": colour for k, colour in enumerate(methods)}, **bodies}


# Of a page's variables: c0, c1, ... of methods; the limbs of a body, as in the pictures of a track; truth and estimate.
LIGHT = _named(_LIGHT, {**BODY_LIGHT, "middle": "var(--ink)", "estimate": _LIGHT[1], "swapped": _LIGHT[3]})
DARK = _named(_DARK, {**BODY_DARK, "middle": "var(--ink)", "estimate": _DARK[1], "swapped": hexadecimal(OTHER)})


def style() -> str:
    """Return the colours as variables of a page's style, for light and for dark screens."""
    return colour_style(LIGHT, DARK)
