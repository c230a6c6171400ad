"""Weighted poses of a frame, their modes, and how likely it is that left and right are exchanged."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, frozen
from posefit.errors import InputError
from posefit.geometry import kernels
from posefit.geometry.skeleton import (
    ANGLES,
    JOINTS,
    MIRROR,
    SIDES,
    Skeleton,
    joint_distances,
    root_centred,
)
from posefit.uncertainty.calibration import Recalibration

# ours: metres, the mean over joints, beyond which poses are of different modes; a mirrored stride is 0.15 to 0.2 off
APART = 0.1
DIGITS = 6  # of radians, metres and weights in a file
ARRAYS = ("poses", "translations", "weights")


@dataclass(frozen=True, eq=False)
class Mode:
    """A possible pose of a frame, with its probability."""

    weight: float
    pose: Array = field(repr=False)  # (66,)
    translation: Array = field(repr=False)  # (3,) metres


@dataclass(frozen=True, eq=False)
class TrackMode:
    """A possible track of all frames, with its probability."""

    weight: float
    poses: Array = field(repr=False)  # (T, 66)
    translations: Array = field(repr=False)  # (T, 3) metres


@dataclass(frozen=True, eq=False)
class Posterior:
    """The possible poses of one frame, each with its weight; weights are divided by their sum.

    Where it is `coherent`, row k of all frames is one possible track.
    """

    poses: Array = field(repr=False)  # (K, 66)
    translations: Array = field(repr=False)  # (K, 3) metres
    weights: Array = field(repr=False)  # (K,) which sum to 1
    coherent: bool = False
    # learned corrections of these poses' errors
    recalibration: Recalibration | None = field(default=None, repr=False)
    # see `modes_of`, which the frames of a track have filled in
    modes: Sequence[Mode] = ()

    def __post_init__(self) -> None:
        count = len(np.atleast_1d(self.weights))
        for name, shape in (
            ("poses", (count, ANGLES)),
            ("translations", (count, 3)),
            ("weights", (count,)),
        ):
            object.__setattr__(
                self, name, frozen(f"{name} of a posterior", getattr(self, name), shape)
            )
        total = float(self.weights.sum())
        least = float(self.weights.min(initial=0.0))
        if least < 0.0 or not total > 0.0:
            came = f"{least:g}, sum {total:g}"
            raise InputError(
                f"weights of a posterior must be 0 or more, with a sum above 0, got {came}"
            )
        object.__setattr__(self, "weights", self.weights / total)

    def __len__(self) -> int:
        return len(self.weights)

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it, to a millionth."""
        arrays = {name: getattr(self, name).round(DIGITS).tolist() for name in ARRAYS}
        corrections = (
            None if self.recalibration is None else self.recalibration.as_dict()
        )
        return {**arrays, "coherent": self.coherent, "recalibration": corrections}

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> Self:
        """Return the posterior that `as_dict` gave."""
        corrections = (
            None
            if stored["recalibration"] is None
            else Recalibration(**stored["recalibration"])
        )
        poses, translations, weights = (np.array(stored[name]) for name in ARRAYS)
        return cls(
            poses,
            translations,
            weights,
            coherent=stored["coherent"],
            recalibration=corrections,
        )


def modes_of(skeleton: Skeleton, posterior: Posterior) -> list[Mode]:
    """Return the modes of a frame, the likeliest first: similar poses are one mode.

    Poses are similar where they are at most a tenth of a metre from each other, see `poses_apart`. The pose of a mode
    is its medoid; a mean might be no possible pose. Weights are shares of the poses' weight, raised to the sharpness of
    the posterior's recalibration; they sum to 1, less its probability that no mode is right.
    """
    distances = poses_apart(skeleton, posterior.poses, posterior.poses)
    clusters = [
        (weight, row)
        for weight, row, _ in clusters_of(distances, posterior.weights, APART)
    ]
    if posterior.recalibration is not None:
        # temperature scaling
        powers = [weight**posterior.recalibration.sharpness for weight, _ in clusters]
        share = (1.0 - posterior.recalibration.none) / sum(powers)
        clusters = [
            (share * power, row)
            for power, (_, row) in zip(powers, clusters, strict=True)
        ]
    return [
        Mode(weight, posterior.poses[row], posterior.translations[row])
        for weight, row in clusters
    ]


def other_modes(
    skeleton: Skeleton, modes: Sequence[Mode], pose: Array, above: float = 0.0
) -> list[Mode]:
    """Return the modes with weights above `above` but the one nearest to a pose (66,), the likeliest first."""
    if len(modes) < 2:
        return []
    nearest = _nearest(skeleton, modes, skeleton.joints(pose))[0]
    others = [
        mode for k, mode in enumerate(modes) if k != nearest and mode.weight > above
    ]
    return sorted(others, key=lambda mode: -mode.weight)


def other_mode(
    skeleton: Skeleton, modes: Sequence[Mode], pose: Array, above: float = 0.0
) -> Mode | None:
    """Return the likeliest of the `other_modes`; None where there are none."""
    return next(iter(other_modes(skeleton, modes, pose, above)), None)


def likeliest_is_right(
    skeleton: Skeleton, modes: Sequence[Mode], joints: Array, apart: float = APART
) -> bool:
    """Return whether true joints (27, 3) are nearest to the likeliest mode, and at most `apart` metres from it."""
    nearest, off = _nearest(skeleton, modes, joints)
    return (
        nearest == max(range(len(modes)), key=lambda k: modes[k].weight)
        and off <= apart
    )


def _nearest(
    skeleton: Skeleton, modes: Sequence[Mode], joints: Array
) -> tuple[int, float]:
    """Return the nearest mode to joints (27, 3), and how far it is away, in metres."""
    centres = skeleton.joints(np.array([mode.pose for mode in modes]))
    distances = joint_distances(centres, joints).mean(axis=-1)
    return int(distances.argmin()), float(distances.min())


def poses_apart(skeleton: Skeleton, poses: Array, others: Array) -> Array:
    """Return the distances (n, K), metres, of poses (n, 66) from others (K, 66): the mean over joints, root-centred."""
    joints = skeleton.joints(poses)
    targets = skeleton.joints(others)
    distances = np.empty((len(joints), len(targets)))
    kernels.write_mean_distances(joints, targets, distances)
    return distances


def track_modes(
    skeleton: Skeleton, posteriors: Sequence[Posterior | None], apart: float = APART
) -> list[TrackMode]:
    """Return the possible tracks of a clip, the likeliest first, by the posteriors of its frames.

    Tracks are similar as poses are in `modes_of`, by the mean over frames. There are none where rows are no tracks.
    """
    coherent = [frame for frame in posteriors if frame is not None and frame.coherent]
    if len(coherent) < len(posteriors) or len({len(frame) for frame in coherent}) != 1:
        return []
    distances = np.mean(
        [poses_apart(skeleton, frame.poses, frame.poses) for frame in coherent], axis=0
    )
    weights = np.mean([frame.weights for frame in coherent], axis=0)
    poses = np.array([frame.poses for frame in coherent])
    translations = np.array([frame.translations for frame in coherent])
    clusters = clusters_of(distances, weights, apart)
    return [
        TrackMode(weight, poses[:, row], translations[:, row])
        for weight, row, _ in clusters
    ]


def clusters_of(
    distances: Array, weights: Array, apart: float
) -> list[tuple[float, int, NDArray[np.intp]]]:
    """Return the weight, the medoid and all rows of each cluster, the heaviest first.

    A centre is the row with the greatest weight near it among those that are near no earlier centre; then every row
    joins its nearest centre.
    """
    near = distances <= apart
    remaining = weights > 0.0
    centres: list[int] = []
    while remaining.any():
        about = np.where(remaining, near @ np.where(remaining, weights, 0.0), -1.0)
        centres.append(int(about.argmax()))
        remaining &= ~near[centres[-1]]
    owners = distances[:, centres].argmin(axis=1)
    clusters = []
    for k in range(len(centres)):
        rows = np.flatnonzero(owners == k)
        medoid = int(rows[(distances[np.ix_(rows, rows)] @ weights[rows]).argmin()])
        clusters.append((float(weights[rows].sum()), medoid, rows))
    return sorted(clusters, key=lambda cluster: -cluster[0])


_LEFT_HIP = JOINTS.index("lhipjoint")
_RIGHT_HIP = JOINTS.index("rhipjoint")
_PAIRED = np.array([j for j in range(len(JOINTS)) if SIDES[j] != "middle"])


def nearer_mirrored(targets: Array, joints: Array) -> NDArray[np.bool_]:
    """Return whether joints (T, 27, 3) are nearer to targets (T, 27, 3) when they are mirrored. Interpretation S15.

    In a side view a pose and its mirror image have nearly one silhouette.
    """
    return mirrored_gain(targets, joints) > 0.0


def mirrored_gain(targets: Array, joints: Array) -> Array:
    """Return how much nearer (T,) joints (T, 27, 3) are to targets (T, 27, 3) when they are mirrored, metres.

    The mirror is the plane through the root between the hips; left and right are exchanged. Roots are at one point, and
    only joints that have a counterpart count.
    """
    targets = root_centred(targets)
    joints = root_centred(joints)
    across = joints[:, _LEFT_HIP] - joints[:, _RIGHT_HIP]
    across /= np.maximum(
        np.linalg.norm(across, axis=1, keepdims=True), np.finfo(float).tiny
    )
    mirrored = (
        joints
        - 2.0 * np.einsum("tjk,tk->tj", joints, across)[..., None] * across[:, None]
    )
    direct = np.linalg.norm(targets[:, _PAIRED] - joints[:, _PAIRED], axis=-1).mean(
        axis=1
    )
    exchanged = np.linalg.norm(
        targets[:, _PAIRED] - mirrored[:, np.array(MIRROR)[_PAIRED]], axis=-1
    ).mean(axis=1)
    return np.asarray(direct - exchanged)


def second_side(skeleton: Skeleton, posterior: Posterior, pose: Array) -> float:
    """Return the probability that left and right of a pose (66,) are exchanged: the weight of poses nearer to it so."""
    reported = np.repeat(skeleton.joints(pose)[None], len(posterior), axis=0)
    return float(
        posterior.weights @ nearer_mirrored(skeleton.joints(posterior.poses), reported)
    )


def unknown_sides(skeleton: Skeleton, posterior: Posterior, pose: Array) -> bool:
    """Return whether left and right of a pose (66,) are unknown: the other way round is too likely."""
    model = posterior.recalibration or Recalibration()
    return second_side(skeleton, posterior, pose) >= model.second_side
