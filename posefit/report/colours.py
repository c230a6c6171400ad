"""The colours of a report: those of methods, in figures and on the page, and those of bodies on the page.

Methods have the colours of Okabe and Ito, Color universal design, 2008, which colour-blind readers can tell apart too,
without their yellow. The page has them darker on white and lighter on black, so that each has a contrast of at least
4.5 to 1 with what is behind it, as small text must have; its marks tell methods apart where colours do not.
"""

from collections.abc import Mapping

from posefit.page.document import colour_style
from posefit.tracking.drawing.colours import OTHER, hexadecimal
from posefit.tracking.page.colours import BODY_DARK, BODY_LIGHT

METHODS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")  # on paper
_LIGHT = ("#0063a6", "#b84500", "#00775a", "#a63d80", "#7a5c00", "#6b4cc0", "#111111")
_DARK = ("#4aa8e0", "#f08a3c", "#2cc79a", "#e39cc6", "#f0b53c", "#b9a3ff", "#f2f2f2")


def _named(methods: tuple[str, ...], bodies: Mapping[str, str]) -> dict[str, str]:
    return {**{f"c{k}": colour for k, colour in enumerate(methods)}, **bodies}


# Of a page's variables: c0, c1, ... of methods; the limbs of a body, as in the pictures of a track; truth and estimate.
LIGHT = _named(_LIGHT, {**BODY_LIGHT, "middle": "var(--ink)", "estimate": _LIGHT[1], "swapped": _LIGHT[3]})
DARK = _named(_DARK, {**BODY_DARK, "middle": "var(--ink)", "estimate": _DARK[1], "swapped": hexadecimal(OTHER)})


def style() -> str:
    """Return the colours as variables of a page's style, for light and for dark screens."""
    return colour_style(LIGHT, DARK)
