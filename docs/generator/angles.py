"""The table of the clinical angles: the columns of angles.csv, and what a positive number means."""

from posefit.measuring.angles import COLUMNS, MEANINGS
from posefit.measuring.segments import SIDES

BETWEEN = {
    "hip": "thigh and pelvis",
    "knee": "shank and thigh",
    "ankle": "foot and shank",
    "shoulder": "upper arm and thorax",
    "elbow": "forearm and upper arm",
}


def page() -> str:
    """Return the table, as Markdown."""
    lines = ["| column, after `left_` or `right_` | of | a positive number |", "|---|---|---|"]
    lines += [
        f"| `{joint}_{angle}` | {BETWEEN[joint]} | {meaning} |"
        for joint, angles in MEANINGS.items()
        for angle, meaning in angles.items()
    ]
    assert len(COLUMNS) == len(SIDES) * (len(lines) - 2)
    return "\n".join(lines) + "\n"
