"""How far joints are from a detector's landmarks, whose left and right may be exchanged."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS, MIRROR, Skeleton
from posefit.silhouette.rasteriser import NEAR

# joints whose left and right a detector exchanges together or not at all
_TOGETHER = (("femur", "tibia", "toes"), ("humerus", "radius"), ("clavicle", "hipjoint"))
GROUPS = [np.array([JOINTS.index(side + bone) for side in "lr" for bone in bones]) for bones in _TOGETHER]
MIRRORED = np.array(MIRROR)  # (27,) the joint that each is exchanged with
DEVIATION = 0.05  # metres between a joint and its landmark; much longer distances count little more
EXCHANGED = 0.25  # share of the frames in which left and right of a group are exchanged


def landmark_costs(
    skeleton: Skeleton, cameras: Sequence[Camera], landmarks: Array, poses: Array, places: Array
) -> Array:
    """Return how unlikely poses (n, 66) at places (n, 3) make landmarks (V, 27, 3): negative log-likelihoods (n,).

    Landmarks are those of an `Observation`. A joint counts by its confidence; distances have a Cauchy distribution.
    """
    joints, total = skeleton.joints(poses, places), np.zeros(len(poses))
    for camera, view in zip(cameras, landmarks, strict=True):
        pixels, depths = camera.project(joints)
        metres = np.maximum(depths, NEAR) / np.sqrt(camera.focal.prod())  # of a pixel
        for group in GROUPS:
            direct, exchanged = (
                np.log1p(0.5 * (_distances(pixels[:, group], view[same]) * metres[:, group] / DEVIATION) ** 2)
                @ view[same, 2]
                for same in (group, MIRRORED[group])
            )
            total -= np.logaddexp(np.log(1.0 - EXCHANGED) - direct, np.log(EXCHANGED) - exchanged)
    return total


def _distances(pixels: Array, landmarks: Array) -> Array:
    return np.asarray(np.linalg.norm(pixels - landmarks[:, :2], axis=-1))
