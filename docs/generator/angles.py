"""The table of the clinical angles: the columns of angles.csv, and what a positive number means."""

from posefit.measuring.angles import BETWEEN, COLUMNS, MEANINGS
from posefit.measuring.segments import SIDES


def page() -> str:
    """Return the table, as Markdown."""
    lines = [
        "| column, after `left_` or `right_` | of | a positive number |",
        "|---|---|---|",
    ]
    lines += [
        f"| `{joint}_{angle}` | {' and '.join(reversed(BETWEEN[joint])).replace('_', ' ')} | {meaning} |"
        for joint, angles in MEANINGS.items()
        for angle, meaning in angles.items()
    ]
    assert len(COLUMNS) == len(SIDES) * (len(lines) - 2)
    return "\n".join(lines) + "\n"
