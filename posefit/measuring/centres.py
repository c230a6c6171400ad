"""Names the 27 joints of the skeleton in the words of anatomy.

The skeleton calls a joint after the bone that ends in it, so that `lfemur` is the left
knee. Tables and markers have the names below; poses and motion capture files have the
skeleton's names.
"""

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS, kind, side
from posefit.motion.motion import Motion

_PLACES = {
    "root": "pelvis",
    "hipjoint": "hip",
    "femur": "knee",
    "tibia": "ankle",
    "foot": "ball",
    "toes": "toe",
    "lowerback": "lumbar",
    "upperback": "mid_spine",
    "thorax": "neck_base",
    "lowerneck": "mid_neck",
    "upperneck": "head_base",
    "head": "head_top",
    "clavicle": "shoulder",
    "humerus": "elbow",
    "radius": "wrist",
    "wrist": "palm",
    "hand": "hand",
}


def place_name(joint: str) -> str:
    """Return a joint's anatomical name: `left_knee` for `lfemur`."""
    place = _PLACES[kind(joint)]
    if side(joint) == "middle":
        return place
    return f"{side(joint)}_{place}"


PLACES = tuple(place_name(joint) for joint in JOINTS)  # (27,) in the order of JOINTS
_LARGE = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
CENTRES = tuple(f"{which}_{joint}" for joint in _LARGE for which in ("left", "right"))


def joint_centres(motion: Motion) -> dict[str, Array]:
    """Return the centres of the twelve large joints by name.

    They have shape (T, 3), in metres in the world.

    Args:
        motion: The motion.

    Returns:
        The centres (T, 3) by name.

    Example:
        >>> from posefit import joint_centres, load_motion
        >>> centres = joint_centres(load_motion("walk", fps=30.0))
        >>> len(centres), centres["left_knee"].shape[1]
        (12, 3)
    """
    joints = motion.joints
    return {name: joints[:, PLACES.index(name)] for name in CENTRES}
