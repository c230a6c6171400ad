"""The table of the joints: their names, where on a person they are, and where a pose holds their angles."""

from posefit.geometry.skeleton import ANGLES, JOINTS, angle_index, kind, side
from posefit.measuring.centres import PLACES

WHERE = {
    "root": "pelvis",
    "hipjoint": "hip",
    "femur": "knee",
    "tibia": "ankle",
    "foot": "ball of the foot",
    "toes": "tip of the toes",
    "lowerback": "lower spine",
    "upperback": "middle of the spine",
    "thorax": "base of the neck",
    "lowerneck": "middle of the neck",
    "upperneck": "base of the head",
    "head": "top of the head",
    "clavicle": "shoulder",
    "humerus": "elbow",
    "radius": "wrist",
    "wrist": "palm, where the hand's own bone begins",
    "hand": "end of the hand",
}


def page() -> str:
    """Return the table, as Markdown."""
    lines = [
        "| number | joint | where it is | in tables and markers | angles in a pose |",
        "|---:|---|---|---|---|",
    ]
    for number, name in enumerate(JOINTS):
        place = WHERE[kind(name)] if side(name) == "middle" else f"{side(name)} {WHERE[kind(name)]}"
        lines.append(f"| {number} | `{name}` | {place} | `{PLACES[number]}` | {_angles(number)} |")
    return "\n".join(lines) + "\n"


def _angles(number: int) -> str:
    start = 0 if number == 0 else angle_index(number)
    assert start < ANGLES
    return "none" if start < 0 else f"{start} to {start + 2}"
