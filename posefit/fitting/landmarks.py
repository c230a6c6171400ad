"""The likelihood of a detector's landmarks, which may have left and right exchanged."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array
from posefit.fitting.weights import logistic
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS, MIRROR, Skeleton
from posefit.silhouette.outlines import NEAR

# Joints that a detector exchanges together or not at all.
_TOGETHER = (
    ("femur", "tibia", "toes"),
    ("humerus", "radius"),
    ("clavicle", "hipjoint"),
)
# numbers of groups
LEGS = 0
ARMS = 1
GROUPS = []  # the joints of each group, the left ones first
for _bones in _TOGETHER:
    _lefts = [JOINTS.index(f"l{_bone}") for _bone in _bones]
    _rights = [JOINTS.index(f"r{_bone}") for _bone in _bones]
    GROUPS.append(np.array(_lefts + _rights))
MIRRORED = np.array(MIRROR)  # (27,) the joint that each is exchanged with
# Metres between a joint and its landmark. Much longer distances count little more.
DEVIATION = 0.05
# Share of the frames in which each group has left and right exchanged.
EXCHANGED = np.array([0.3, 0.13, 0.35])
PERSISTENCE = 0.5  # correlation of exchanges a thirtieth of a second apart


def landmark_likelihoods(
    skeleton: Skeleton,
    cameras: Sequence[Camera],
    landmarks: Array,
    poses: Array,
    places: Array,
) -> Array:
    """Return the logarithms of the likelihoods (n, K, 2) of landmarks, given poses.

    K counts the groups of joints in all views. The last axis is for the unchanged
    group, and for the group with left and right exchanged. A joint counts by its
    confidence. Distances have a Cauchy distribution.

    Args:
        skeleton: The person's skeleton.
        cameras: The cameras.
        landmarks: (V, 27, 3), see `Observation`.
        poses: (n, 66).
        places: (n, 3) metres.
    """
    joints = skeleton.joints(poses, places)
    groups = []
    for camera, view in zip(cameras, landmarks, strict=True):
        pixels, depths = camera.project(joints)
        metres = np.maximum(depths, NEAR) / np.sqrt(camera.focal.prod())  # of a pixel
        for group in GROUPS:
            both = []
            for same in (group, MIRRORED[group]):
                apart = np.linalg.norm(pixels[:, group] - view[same, :2], axis=-1)
                off = apart * metres[:, group]  # (n, joints) metres
                both.append(np.log1p(0.5 * (off / DEVIATION) ** 2) @ view[same, 2])
            groups.append(-np.stack(both, axis=-1))
    return np.stack(groups, axis=1)


def usually_exchanged(likelihoods: Array) -> Array:
    """Return how often the groups (K,) of likelihoods (..., K, 2) are exchanged."""
    return np.tile(EXCHANGED, likelihoods.shape[-2] // len(GROUPS))


def landmark_costs(likelihoods: Array, exchanged: Array | None = None) -> Array:
    """Return the negative logarithms (...) of `landmark_likelihoods` (..., K, 2).

    `exchanged` (..., K) has the probability of each group to be exchanged, by default
    its usual share of frames.
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
    """Return the probabilities of exchanged groups (..., K) `seconds` later."""
    usual = np.tile(EXCHANGED, exchanged.shape[-1] // len(GROUPS))
    return np.asarray(usual + PERSISTENCE ** (30.0 * seconds) * (exchanged - usual))


def exchanged_given(likelihoods: Array, exchanged: Array) -> Array:
    """Return the probabilities of exchanged groups (..., K), given the landmarks.

    Args:
        likelihoods: (..., K, 2) from `landmark_likelihoods`.
        exchanged: (..., K) the probabilities before the landmarks were seen.
    """
    return logistic(
        np.log(exchanged)
        - np.log1p(-exchanged)
        + likelihoods[..., 1]
        - likelihoods[..., 0]
    )


def side_odds(likelihoods: Array) -> Array:
    """Return the log odds (2,) that a pose has legs, and arms, on the right sides.

    Unknown landmarks add 0. Each limb of each view adds at most the odds of its usual
    share of exchanges.

    Args:
        likelihoods: (K, 2) from `landmark_likelihoods` of the pose.
    """
    limb = np.arange(len(likelihoods)) % len(GROUPS)
    usual = usually_exchanged(likelihoods)
    odds = []
    for group in (LEGS, ARMS):
        own = limb == group
        as_it_is = landmark_costs(likelihoods[own], usual[own])
        # with the columns swapped, the pose has its left and right limbs exchanged
        exchanged = landmark_costs(likelihoods[own, ::-1], usual[own])
        odds.append(exchanged - as_it_is)
    return np.array(odds)
