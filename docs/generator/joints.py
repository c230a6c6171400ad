"""The table of joints: names, places on a person, and angles in a pose."""

from posefit.geometry.skeleton import ANGLES, JOINTS, angle_index
from posefit.measuring.centres import PLACES


def page() -> str:
    """Return the table, as Markdown."""
    lines = [
        "| number | joint | place, in tables and markers | angles in a pose |",
        "|---:|---|---|---|",
    ]
    for number, name in enumerate(JOINTS):
        lines.append(
            f"| {number} | `{name}` | `{PLACES[number]}` | {_angles(number)} |"
        )
    return "\n".join(lines) + "\n"


def _angles(number: int) -> str:
    start = 0 if number == 0 else angle_index(number)
    assert start < ANGLES
    return "none" if start < 0 else f"{start} to {start + 2}"
