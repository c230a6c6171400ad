"""Weighted poses of a frame, their modes, and the probability of exchanged sides."""

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

# ours: the largest distance between poses of one mode, in metres, the mean over joints;
# a mirrored stride is 0.15 to 0.2 away
APART = 0.1
DIGITS = 6  # of radians, metres and weights in a file
ARRAYS = ("poses", "translations", "weights")


@dataclass(frozen=True, eq=False)
class Mode:
    """A possible pose of a frame, with its probability.

    Attributes:
        weight: The probability.
        pose: The pose (66,).
        translation: The place of the root (3,) in metres.
    """

    weight: float
    pose: Array = field(repr=False)
    translation: Array = field(repr=False)


@dataclass(frozen=True, eq=False)
class TrackMode:
    """A possible track of all frames, with its probability.

    Attributes:
        weight: The probability.
        poses: The poses (T, 66).
        translations: The places of the root (T, 3) in metres.
    """

    weight: float
    poses: Array = field(repr=False)
    translations: Array = field(repr=False)


@dataclass(frozen=True, eq=False)
class Posterior:
    """The possible poses of one frame with their weights.

    Attributes:
        poses: The poses (K, 66).
        translations: The places of the root (K, 3) in metres.
        weights: The weights (K,). They are divided by their sum.
        coherent: Whether the rows k of all frames of a track form one possible track.
        recalibration: Learned corrections of the poses' errors.
        modes: The result of `modes_of`, which is filled in for the frames of a track.

    Raises:
        InputError: An array has another shape, or a weight is negative, or all are 0.

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import Posterior
        >>> posterior = Posterior(np.zeros((2, 66)), np.zeros((2, 3)), [1.0, 3.0])
        >>> posterior.weights.tolist()
        [0.25, 0.75]
    """

    poses: Array = field(repr=False)
    translations: Array = field(repr=False)
    weights: Array = field(repr=False)
    coherent: bool = False
    recalibration: Recalibration | None = field(default=None, repr=False)
    modes: Sequence[Mode] = ()

    def __post_init__(self) -> None:
        count = len(np.atleast_1d(self.weights))
        for name, shape in (
            ("poses", (count, ANGLES)),
            ("translations", (count, 3)),
            ("weights", (count,)),
        ):
            value = frozen(f"{name} of a posterior", getattr(self, name), shape)
            object.__setattr__(self, name, value)
        total = float(self.weights.sum())
        least = float(self.weights.min(initial=0.0))
        if least < 0.0 or not total > 0.0:
            raise InputError(
                "weights of a posterior must be 0 or more, with a sum above 0, "
                f"got {least:g}, sum {total:g}"
            )
        object.__setattr__(self, "weights", self.weights / total)

    def __len__(self) -> int:
        return len(self.weights)

    def as_dict(self) -> dict[str, Any]:
        """Return the posterior, rounded to a millionth, as values for JSON.

        The modes are not part of the result.
        """
        stored = dict[str, Any]()
        for name in ARRAYS:
            stored[name] = getattr(self, name).round(DIGITS).tolist()
        stored["coherent"] = self.coherent
        stored["recalibration"] = None
        if self.recalibration is not None:
            stored["recalibration"] = self.recalibration.as_dict()
        return stored

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> Self:
        """Return the posterior from the result of `as_dict`."""
        corrections = None
        if stored["recalibration"] is not None:
            corrections = Recalibration(**stored["recalibration"])
        return cls(
            poses=np.array(stored["poses"]),
            translations=np.array(stored["translations"]),
            weights=np.array(stored["weights"]),
            coherent=stored["coherent"],
            recalibration=corrections,
        )


def modes_of(skeleton: Skeleton, posterior: Posterior) -> list[Mode]:
    """Return the modes of a frame, the likeliest first.

    Poses at most a tenth of a metre from each other are one mode, see `poses_apart`.
    The pose of a mode is its medoid, because a mean may be an impossible pose.

    Args:
        skeleton: The skeleton.
        posterior: The weighted poses.

    Returns:
        The modes. A weight is the sum of the poses' weights, raised to the sharpness of
        the posterior's recalibration. The weights sum to 1 minus its probability that
        no mode is right.

    Example:
        >>> import numpy as np
        >>> from posefit import load_motion, modes_of
        >>> from posefit.plugin import Posterior
        >>> walk = load_motion("walk")
        >>> posterior = Posterior(walk.poses[:2], walk.translations[:2], np.ones(2))
        >>> [mode.weight for mode in modes_of(walk.skeleton, posterior)]
        [1.0]
    """
    distances = poses_apart(skeleton, posterior.poses, posterior.poses)
    clusters = clusters_of(distances, posterior.weights, APART)
    weights = [weight for weight, _, _ in clusters]
    if posterior.recalibration is not None:
        # temperature scaling, because the weights of samples are not calibrated
        powers = [weight**posterior.recalibration.sharpness for weight in weights]
        share = (1.0 - posterior.recalibration.none) / sum(powers)
        weights = [share * power for power in powers]
    modes = []
    for weight, (_, row, _) in zip(weights, clusters, strict=True):
        mode = Mode(weight, posterior.poses[row], posterior.translations[row])
        modes.append(mode)
    return modes


def other_modes(
    skeleton: Skeleton, modes: Sequence[Mode], pose: Array, above: float = 0.0
) -> list[Mode]:
    """Return all modes but the nearest one to a pose, the likeliest first.

    Args:
        skeleton: The skeleton.
        modes: The modes of a frame.
        pose: The pose (66,).
        above: Only modes with a weight above this are returned.

    Returns:
        The other modes.
    """
    if len(modes) < 2:
        return []
    nearest = _nearest(skeleton, modes, skeleton.joints(pose))[0]
    others = []
    for k, mode in enumerate(modes):
        if k != nearest and mode.weight > above:
            others.append(mode)
    return sorted(others, key=lambda mode: -mode.weight)


def other_mode(
    skeleton: Skeleton, modes: Sequence[Mode], pose: Array, above: float = 0.0
) -> Mode | None:
    """Return the likeliest of the `other_modes`, or None if there are none."""
    return next(iter(other_modes(skeleton, modes, pose, above)), None)


def likeliest_is_right(
    skeleton: Skeleton, modes: Sequence[Mode], joints: Array, apart: float = APART
) -> bool:
    """Return whether the likeliest mode is right.

    Args:
        skeleton: The skeleton.
        modes: The modes of a frame.
        joints: The true joints (27, 3) in metres.
        apart: The largest distance of a right mode from the truth, in metres.

    Returns:
        Whether the likeliest mode is the nearest one to the truth, and near enough.
    """
    nearest, distance = _nearest(skeleton, modes, joints)
    likeliest = max(range(len(modes)), key=lambda k: modes[k].weight)
    return nearest == likeliest and distance <= apart


def _nearest(
    skeleton: Skeleton, modes: Sequence[Mode], joints: Array
) -> tuple[int, float]:
    """Return the nearest mode to joints (27, 3), and its distance in metres."""
    centres = skeleton.joints(np.array([mode.pose for mode in modes]))
    distances = joint_distances(centres, joints).mean(axis=-1)
    return int(distances.argmin()), float(distances.min())


def poses_apart(skeleton: Skeleton, poses: Array, others: Array) -> Array:
    """Return the distances (n, K) of poses (n, 66) from others (K, 66), in metres.

    A distance is the mean over joints, with both roots at one point.
    """
    joints = skeleton.joints(poses)
    targets = skeleton.joints(others)
    distances = np.empty((len(joints), len(targets)))
    kernels.write_mean_distances(joints, targets, distances)
    return distances


def track_modes(
    skeleton: Skeleton, posteriors: Sequence[Posterior | None], apart: float = APART
) -> list[TrackMode]:
    """Return the possible tracks of a clip, the likeliest first.

    Args:
        skeleton: The skeleton.
        posteriors: The posterior of each frame, or None.
        apart: The largest distance of tracks of one mode in metres. It is the mean over
            frames of the distance of their poses, see `poses_apart`.

    Returns:
        The tracks. There are none unless the posteriors of all frames are coherent.
    """
    # otherwise row k of different frames would not be one track
    coherent = [frame for frame in posteriors if frame is not None and frame.coherent]
    counts = {len(frame) for frame in coherent}
    if len(coherent) < len(posteriors) or len(counts) != 1:
        return []
    poses_of_frames = []
    places_of_frames = []
    weights_of_frames = []
    distances_of_frames = []
    for frame in coherent:
        poses_of_frames.append(frame.poses)
        places_of_frames.append(frame.translations)
        weights_of_frames.append(frame.weights)
        distances_of_frames.append(poses_apart(skeleton, frame.poses, frame.poses))
    poses = np.array(poses_of_frames)  # (T, K, 66)
    translations = np.array(places_of_frames)  # (T, K, 3)
    weights = np.mean(weights_of_frames, axis=0)  # (K,)
    distances = np.mean(distances_of_frames, axis=0)  # (K, K)
    clusters = clusters_of(distances, weights, apart)
    tracks = []
    for weight, row, _ in clusters:
        tracks.append(TrackMode(weight, poses[:, row], translations[:, row]))
    return tracks


def clusters_of(
    distances: Array, weights: Array, apart: float
) -> list[tuple[float, int, NDArray[np.intp]]]:
    """Return clusters of weighted points, the heaviest first.

    The next centre is always the row with the greatest weight near it, among the rows
    that are not near an earlier centre. Then every row joins its nearest centre.

    Args:
        distances: The distances between the points (K, K).
        weights: Their weights (K,).
        apart: The largest distance at which two points count as near.

    Returns:
        The weight, the medoid and all rows of each cluster.
    """
    # a pose between two modes must not be a centre, so the next centre is
    # where most weight is near
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
    """Return whether joints are nearer to targets when mirrored. Interpretation S15.

    In a side view a pose and its mirror image have nearly the same silhouette.

    Args:
        targets: The target joints (T, 27, 3).
        joints: The joints (T, 27, 3).

    Returns:
        Whether the mirrored joints are nearer (T,).
    """
    return mirrored_gain(targets, joints) > 0.0


def mirrored_gain(targets: Array, joints: Array) -> Array:
    """Return how much nearer joints are to targets when they are mirrored.

    The mirror is the plane through the root between the hips. Left and right are
    exchanged, and both roots are at one point. Only joints with a counterpart count.

    Args:
        targets: The target joints (T, 27, 3) in metres.
        joints: The joints (T, 27, 3) in metres.

    Returns:
        The mean distance of the joints minus that of the mirrored joints (T,), in
        metres.
    """
    targets = root_centred(targets)
    joints = root_centred(joints)
    across = joints[:, _LEFT_HIP] - joints[:, _RIGHT_HIP]
    lengths = np.linalg.norm(across, axis=1, keepdims=True)
    across /= np.maximum(lengths, np.finfo(float).tiny)  # (T, 3), unit vectors
    # (T, 27), from the mirror's plane
    heights = np.einsum("tjk,tk->tj", joints, across)
    mirrored = joints - 2.0 * heights[..., None] * across[:, None]
    counterparts = np.array(MIRROR)[_PAIRED]
    direct = targets[:, _PAIRED] - joints[:, _PAIRED]
    exchanged = targets[:, _PAIRED] - mirrored[:, counterparts]
    direct_distances = np.linalg.norm(direct, axis=-1).mean(axis=1)
    exchanged_distances = np.linalg.norm(exchanged, axis=-1).mean(axis=1)
    return np.asarray(direct_distances - exchanged_distances)


def second_side(skeleton: Skeleton, posterior: Posterior, pose: Array) -> float:
    """Return the probability that left and right of a pose (66,) are exchanged.

    It is the weight of the posterior's poses that are nearer to the mirrored pose.
    """
    reported = np.repeat(skeleton.joints(pose)[None], len(posterior), axis=0)
    is_exchanged = nearer_mirrored(skeleton.joints(posterior.poses), reported)
    return float(posterior.weights @ is_exchanged)


def unknown_sides(skeleton: Skeleton, posterior: Posterior, pose: Array) -> bool:
    """Return whether left and right of a pose (66,) are unknown.

    They are if it is too likely that they are exchanged.
    """
    model = posterior.recalibration or Recalibration()
    return second_side(skeleton, posterior, pose) >= model.second_side
