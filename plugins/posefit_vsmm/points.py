"""The 17 points of a body that a silhouette may show, and where they are on a skeleton. VSMM 6.1, Interpretation V2."""

import numpy as np

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS

# Each point is the middle of two joints, or one joint twice.
_BETWEEN = {
    "head": ("upperneck", "head"),
    "root": ("root", "root"),
    "torso": ("upperback", "upperback"),
    "left clavicle": ("thorax", "lclavicle"),
    "right clavicle": ("thorax", "rclavicle"),
    "left shoulder": ("lclavicle", "lclavicle"),
    "right shoulder": ("rclavicle", "rclavicle"),
    "left elbow": ("lhumerus", "lhumerus"),
    "right elbow": ("rhumerus", "rhumerus"),
    "left hand": ("lwrist", "lwrist"),
    "right hand": ("rwrist", "rwrist"),
    "left hip": ("lhipjoint", "lhipjoint"),
    "right hip": ("rhipjoint", "rhipjoint"),
    "left knee": ("lfemur", "lfemur"),
    "right knee": ("rfemur", "rfemur"),
    "left foot": ("lfoot", "lfoot"),
    "right foot": ("rfoot", "rfoot"),
}
POINTS = tuple(_BETWEEN)
AT = {name: k for k, name in enumerate(POINTS)}
ENDS = np.array([[JOINTS.index(joint) for joint in pair] for pair in _BETWEEN.values()])  # (17, 2) two joints a point


def points_of(joints: Array) -> Array:
    """Return the points (..., 17, 3) of joints (..., 27, 3)."""
    return np.asarray(0.5 * (joints[..., ENDS[:, 0], :] + joints[..., ENDS[:, 1], :]))
