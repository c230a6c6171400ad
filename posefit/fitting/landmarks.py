"""How far joints are from a detector's landmarks, whose left and right may be exchanged."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array
from posefit.fitting.weights import logistic
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS, MIRROR, Skeleton
from posefit.silhouette.rasteriser import NEAR

# joints whose left and right a detector exchanges together or not at all
_TOGETHER = (
    ("femur", "tibia", "toes"),
    ("humerus", "radius"),
    ("clavicle", "hipjoint"),
)
# numbers of groups
LEGS = 0
ARMS = 1
GROUPS = [
    np.array([JOINTS.index(side + bone) for side in "lr" for bone in bones])
    for bones in _TOGETHER
]
MIRRORED = np.array(MIRROR)  # (27,) the joint that each is exchanged with
# metres between a joint and its landmark; much longer distances count little more
DEVIATION = 0.05
# share of the frames in which left and right of each group are exchanged
EXCHANGED = np.array([0.3, 0.13, 0.35])
PERSISTENCE = 0.5  # correlation of exchanges a thirtieth of a second apart


def landmark_likelihoods(
    skeleton: Skeleton,
    cameras: Sequence[Camera],
    landmarks: Array,
    poses: Array,
    places: Array,
) -> Array:
    """Return how likely poses (n, 66) at places (n, 3) make landmarks (V, 27, 3): logarithms (n, K, 2).

    K are the groups of each view; each is as it is, or has left and right exchanged. Landmarks are those of an
    `Observation`. A joint counts by its confidence; distances have a Cauchy distribution.
    """
    joints = skeleton.joints(poses, places)
    groups = []
    for camera, view in zip(cameras, landmarks, strict=True):
        pixels, depths = camera.project(joints)
        metres = np.maximum(depths, NEAR) / np.sqrt(camera.focal.prod())  # of a pixel
        for group in GROUPS:
            both = []
            for same in (group, MIRRORED[group]):
                off = (
                    np.linalg.norm(pixels[:, group] - view[same, :2], axis=-1)
                    * metres[:, group]
                )
                both.append(np.log1p(0.5 * (off / DEVIATION) ** 2) @ view[same, 2])
            groups.append(-np.stack(both, axis=-1))
    return np.stack(groups, axis=1)


def usually_exchanged(likelihoods: Array) -> Array:
    """Return how often the groups (K,) of `landmark_likelihoods` (..., K, 2) are exchanged."""
    return np.tile(EXCHANGED, likelihoods.shape[-2] // len(GROUPS))


def landmark_costs(likelihoods: Array, exchanged: Array | None = None) -> Array:
    """Return the negative logarithms (...) of `landmark_likelihoods` (..., K, 2).

    `exchanged` (..., K) is how likely each group is exchanged; as often as any frame's, where nothing is known.
    """
    direct = likelihoods[..., 0]
    other = likelihoods[..., 1]
    if exchanged is None:
        exchanged = usually_exchanged(likelihoods)
    return np.asarray(
        -np.logaddexp(np.log1p(-exchanged) + direct, np.log(exchanged) + other).sum(
            axis=-1
        )
    )


def exchanged_next(exchanged: Array, seconds: float) -> Array:
    """Return how likely groups (..., K) are exchanged `seconds` later, by how likely they are now."""
    usual = np.tile(EXCHANGED, exchanged.shape[-1] // len(GROUPS))
    return np.asarray(usual + PERSISTENCE ** (30.0 * seconds) * (exchanged - usual))


def exchanged_given(likelihoods: Array, exchanged: Array) -> Array:
    """Return how likely groups (..., K) are exchanged, by `landmark_likelihoods` and how likely they were before."""
    return logistic(
        np.log(exchanged)
        - np.log1p(-exchanged)
        + likelihoods[..., 1]
        - likelihoods[..., 0]
    )


def side_odds(likelihoods: Array) -> Array:
    """Return the logarithms of the odds (2,) that legs, and arms, are on a pose's sides, by its likelihoods (K, 2).

    Unknown landmarks add 0, and each limb of each view at most the odds of its usual share of exchanges.
    """
    limb = np.arange(len(likelihoods)) % len(GROUPS)
    usual = usually_exchanged(likelihoods)
    return np.array(
        [
            landmark_costs(likelihoods[limb == group, ::-1], usual[limb == group])
            - landmark_costs(likelihoods[limb == group], usual[limb == group])
            for group in (LEGS, ARMS)
        ]
    )
