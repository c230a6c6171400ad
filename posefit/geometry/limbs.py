"""Which bones and angles belong to a limb."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from posefit.geometry.skeleton import channel_angles

# The chains of bones between the joints where several begin; what is left, from the root to the thorax, is the torso.
LIMBS: Mapping[str, Sequence[str]] = {
    "left leg": ("lhipjoint", "lfemur", "ltibia", "lfoot", "ltoes"),
    "right leg": ("rhipjoint", "rfemur", "rtibia", "rfoot", "rtoes"),
    "left arm": ("lclavicle", "lhumerus", "lradius", "lwrist", "lhand"),
    "right arm": ("rclavicle", "rhumerus", "rradius", "rwrist", "rhand"),
    "head": ("lowerneck", "upperneck", "head"),
}


def turns_of(bones: Sequence[str]) -> NDArray[np.intp]:
    """Return where in a pose (66,) the angles stand that turn bones."""
    return np.array([angle for bone in bones for angle in channel_angles(bone, ("rx", "ry", "rz"))], dtype=np.intp)
