"""Left and right: which of two poses a mirror would bring nearer, and how likely it is that they are exchanged."""

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS, MIRROR, SIDES, Skeleton, root_centred
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import Posterior

_LEFT_HIP, _RIGHT_HIP = JOINTS.index("lhipjoint"), JOINTS.index("rhipjoint")
_PAIRED = np.array([j for j in range(len(JOINTS)) if SIDES[j] != "middle"])


def nearer_mirrored(targets: Array, joints: Array) -> NDArray[np.bool_]:
    """Return whether joints (T, 27, 3) come nearer to targets (T, 27, 3) when they are mirrored. Interpretation S15.

    The mirror is the plane through the root that the hips face each other across; left and right trade names. Roots
    are moved to one point, and only joints that have a counterpart count.
    """
    targets, joints = root_centred(targets), root_centred(joints)
    across = joints[:, _LEFT_HIP] - joints[:, _RIGHT_HIP]
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), np.finfo(float).tiny)
    mirrored = joints - 2.0 * np.einsum("tjk,tk->tj", joints, across)[..., None] * across[:, None]
    named = np.linalg.norm(targets[:, _PAIRED] - joints[:, _PAIRED], axis=-1).mean(axis=1)
    traded = np.linalg.norm(targets[:, _PAIRED] - mirrored[:, np.array(MIRROR)[_PAIRED]], axis=-1).mean(axis=1)
    return np.asarray(traded < named)


def second_side(skeleton: Skeleton, posterior: Posterior, pose: Array) -> float:
    """Return how likely a pose (66,) has left and right exchanged: the weight of poses it is nearer to mirrored."""
    reported = np.repeat(skeleton.joints(pose)[None], len(posterior), axis=0)
    return float(posterior.weights @ nearer_mirrored(skeleton.joints(posterior.poses), reported))


def unknown_sides(skeleton: Skeleton, posterior: Posterior, pose: Array) -> bool:
    """Return whether left and right of a pose (66,) are unknown: the other way round is too likely."""
    model = posterior.recalibration or Recalibration()
    return second_side(skeleton, posterior, pose) >= model.second_side
