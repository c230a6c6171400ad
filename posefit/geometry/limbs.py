"""Which bones and angles belong to a limb."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from posefit.errors import InputError
from posefit.geometry.skeleton import BONES, JOINTS, PARENTS, channel_angles

# The chains of bones between the joints where several begin; what is left, from the root to the thorax, is the torso.
LIMBS: Mapping[str, Sequence[str]] = {
    "left leg": ("lhipjoint", "lfemur", "ltibia", "lfoot", "ltoes"),
    "right leg": ("rhipjoint", "rfemur", "rtibia", "rfoot", "rtoes"),
    "left arm": ("lclavicle", "lhumerus", "lradius", "lwrist", "lhand"),
    "right arm": ("rclavicle", "rhumerus", "rradius", "rwrist", "rhand"),
    "head": ("lowerneck", "upperneck", "head"),
}


def check_limbs(limbs: Mapping[str, Sequence[str]]) -> None:
    """Return nothing. Raises ValueError where a bone is unknown, is in two limbs, or hangs from another limb's bone."""
    if not limbs:
        raise InputError("limbs must be at least one, got none")
    of = np.full(len(JOINTS), -1)  # the limb of the bone that ends in a joint, -1 for the torso and the root
    for number, (name, bones) in enumerate(limbs.items()):
        for bone in bones:
            if bone not in BONES:
                raise InputError(f"limbs must be of {', '.join(BONES)}, got {bone!r} in {name!r}")
            if of[JOINTS.index(bone)] >= 0:
                raise InputError(f"limbs must not share a bone, got {bone!r} twice, the second time in {name!r}")
            of[JOINTS.index(bone)] = number
    for joint in range(1, len(JOINTS)):
        before = of[PARENTS[joint]]
        if before >= 0 and of[joint] != before:
            names = list(limbs)
            raise InputError(
                f"limbs must hold all bones that hang from theirs, got {names[before]!r} without {JOINTS[joint]!r}"
            )


def turns_of(bones: Sequence[str]) -> NDArray[np.intp]:
    """Return where in a pose (66,) the angles stand that turn bones."""
    return np.array([angle for bone in bones for angle in channel_angles(bone, ("rx", "ry", "rz"))], dtype=np.intp)
