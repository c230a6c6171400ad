"""The table of clinical angles: columns of angles.csv and meanings of their signs."""

from posefit.measuring.angles import BETWEEN, COLUMNS, MEANINGS
from posefit.measuring.segments import SIDES


def page() -> str:
    """Return the table, as Markdown."""
    lines = [
        "| column, after `left_` or `right_` | of | a positive number |",
        "|---|---|---|",
    ]
    for joint, angles in MEANINGS.items():
        segments = " and ".join(reversed(BETWEEN[joint])).replace("_", " ")
        for angle, meaning in angles.items():
            lines.append(f"| `{joint}_{angle}` | {segments} | {meaning} |")
    assert len(COLUMNS) == len(SIDES) * (len(lines) - 2)
    return "\n".join(lines) + "\n"
