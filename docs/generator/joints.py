"""The table of the joints: their names, where on a person they are, and where a pose holds their angles."""

from posefit.geometry.places import place
from posefit.geometry.skeleton import ANGLES, JOINTS, PARENTS, angle_index


def page() -> str:
    """Return the table, as Markdown."""
    lines = ["| number | joint | where it is | its bone begins at | angles in a pose |", "|---:|---|---|---|---|"]
    for number, name in enumerate(JOINTS):
        begins = "" if number == 0 else f"`{JOINTS[PARENTS[number]]}`"
        lines.append(f"| {number} | `{name}` | {place(name)} | {begins} | {_angles(number)} |")
    return "\n".join(lines) + "\n"


def _angles(number: int) -> str:
    start = 0 if number == 0 else angle_index(number)
    assert start < ANGLES
    return "none" if start < 0 else f"{start} to {start + 2}"
