"""How the tables call and show figures: by the labels, units and digits of `posefit.tracking.measures`."""

from posefit.tracking.measures import MEASURES


def head_of(name: str, which: str = "") -> str:
    """Return the head of a figure's column: which of its values (such as median), its label, and its unit."""
    measure = MEASURES[name]
    return " ".join(word for word in (which, measure.label, measure.unit) if word)


def number(name: str, value: float | None) -> str:
    """Return a value with a figure's digits, in its unit."""
    return MEASURES[name].number(value)
