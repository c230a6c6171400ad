"""Where on a person the joints are: words for the bones that end in them."""

from posefit.geometry.skeleton import kind, side

PLACES = {
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


def place(joint: str) -> str:
    """Return where on a person a joint is: `left knee` of `lfemur`, `pelvis` of `root`."""
    word = PLACES[kind(joint)]
    return word if side(joint) == "middle" else f"{side(joint)} {word}"
