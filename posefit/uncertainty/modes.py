"""Weighted poses of a frame, and the few of them that are really different: the modes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.errors import InputError
from posefit.geometry.skeleton import ANGLES, Skeleton, joint_distances
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.kernels import mean_distances

# ours: metres, the mean over joints, beyond which two poses are of two modes; a mirrored stride is 0.15 to 0.2 off
APART = 0.1
DIGITS = 6  # of radians, metres and weights in a file
ARRAYS = ("poses", "translations", "weights")


@dataclass(frozen=True, eq=False)
class Mode:
    """A pose that a frame may show, and how likely that is."""

    weight: float
    pose: Array = field(repr=False)  # (66,)
    translation: Array = field(repr=False)  # (3,) metres


@dataclass(frozen=True, eq=False)
class TrackMode:
    """A track that all frames may show, and how likely that is."""

    weight: float
    poses: Array = field(repr=False)  # (T, 66)
    translations: Array = field(repr=False)  # (T, 3) metres


@dataclass(frozen=True, eq=False)
class Posterior:
    """The poses that one frame may show, each with its weight; weights are divided by their sum.

    Where it is `coherent`, row k of each frame is of one and the same track that may be the true one.
    """

    poses: Array = field(repr=False)  # (K, 66)
    translations: Array = field(repr=False)  # (K, 3) metres
    weights: Array = field(repr=False)  # (K,) which sum to 1
    coherent: bool = False
    recalibration: Recalibration | None = field(default=None, repr=False)  # learned corrections of these poses' errors

    def __post_init__(self) -> None:
        count = len(np.atleast_1d(self.weights))
        for name, shape in (("poses", (count, ANGLES)), ("translations", (count, 3)), ("weights", (count,))):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if value.shape != shape or not count:
                raise InputError(f"{name} of a posterior must have shape {shape}, got {value.shape}")
            if not np.isfinite(value).all():
                raise InputError(
                    f"{name} of a posterior must be finite, got {np.isfinite(value).sum()} of {value.size}"
                )
            object.__setattr__(self, name, value)
        total, least = float(self.weights.sum()), float(self.weights.min())
        if least < 0.0 or not total > 0.0:
            raise InputError(
                f"weights of a posterior must be 0 or more, not all 0, got {least:g} or more, sum {total:g}"
            )
        object.__setattr__(self, "weights", self.weights / total)

    def __len__(self) -> int:
        return len(self.weights)

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it, to a millionth."""
        held: dict[str, Any] = {name: getattr(self, name).round(DIGITS).tolist() for name in ARRAYS}
        learned = None if self.recalibration is None else self.recalibration.as_dict()
        return {**held, "coherent": self.coherent, "recalibration": learned}

    @classmethod
    def from_dict(cls, held: Mapping[str, Any]) -> Self:
        """Return what `as_dict` gave."""
        learned = None if held["recalibration"] is None else Recalibration(**held["recalibration"])
        poses, translations, weights = (np.array(held[name]) for name in ARRAYS)
        return cls(poses, translations, weights, held["coherent"], learned)


def modes_of(skeleton: Skeleton, posterior: Posterior, apart: float = APART) -> list[Mode]:
    """Return what a frame may show, the likeliest first: similar poses are one mode.

    Poses are similar where their joints are at most `apart` metres from each other, the mean over joints, both roots at
    one point. The pose of a mode is that of its medoid, a pose that is possible; a mean might not be.
    Weights are shares of the poses' weight, raised to the sharpness of the posterior's recalibration; they sum to 1,
    less its probability that the truth is like none of them.
    """
    clusters = _clusters(_distances(skeleton.joints(posterior.poses)), posterior.weights, apart)
    if posterior.recalibration is not None:
        powers = [weight**posterior.recalibration.sharpness for weight, _ in clusters]  # temperature scaling
        share = (1.0 - posterior.recalibration.none) / sum(powers)
        clusters = [(share * power, row) for power, (_, row) in zip(powers, clusters, strict=True)]
    return [Mode(weight, posterior.poses[row], posterior.translations[row]) for weight, row in clusters]


def other_mode(skeleton: Skeleton, modes: Sequence[Mode], pose: Array, above: float = 0.0) -> Mode | None:
    """Return the likeliest mode that a pose (66,) is not of; None where there is none whose weight is above that.

    A pose is of the mode that it is nearest to.
    """
    if len(modes) < 2:
        return None
    mine = _nearest(skeleton, modes, skeleton.joints(pose))[0]
    rest = [mode for k, mode in enumerate(modes) if k != mine]
    other = max(rest, key=lambda mode: mode.weight)
    return other if other.weight > above else None


def likeliest_is_right(skeleton: Skeleton, modes: Sequence[Mode], joints: Array, apart: float = APART) -> bool:
    """Return whether true joints (27, 3) are those of the likeliest mode: nearest to it of all, and similar.

    Similar as in `modes_of`: at most `apart` metres from each other, the mean over joints.
    """
    nearest, off = _nearest(skeleton, modes, joints)
    return nearest == max(range(len(modes)), key=lambda k: modes[k].weight) and off <= apart


def _nearest(skeleton: Skeleton, modes: Sequence[Mode], joints: Array) -> tuple[int, float]:
    """Return which mode joints (27, 3) are nearest to, and how far off, metres, both roots at one point."""
    each = skeleton.joints(np.array([mode.pose for mode in modes]))
    off = joint_distances(each, joints).mean(axis=-1)
    return int(off.argmin()), float(off.min())


def track_modes(skeleton: Skeleton, posteriors: Sequence[Posterior], apart: float = APART) -> list[TrackMode]:
    """Return the tracks that a clip may show, the likeliest first, given what each of its frames may show.

    Tracks are similar as poses are in `modes_of`, by the mean over frames. Raises ValueError where rows are no tracks.
    """
    if not posteriors or any(not one.coherent or len(one) != len(posteriors[0]) for one in posteriors):
        raise InputError("posteriors must be coherent, of one length and at least one, to be tracks")
    distances = np.mean([_distances(skeleton.joints(one.poses)) for one in posteriors], axis=0)
    weights = np.mean([one.weights for one in posteriors], axis=0)
    return [
        TrackMode(
            weight,
            np.array([one.poses[row] for one in posteriors]),
            np.array([one.translations[row] for one in posteriors]),
        )
        for weight, row in _clusters(distances, weights, apart)
    ]


def _distances(joints: Array) -> Array:
    """Return how far joints (K, 27, 3) are from each other (K, K), metres, the mean over joints."""
    return np.asarray(mean_distances(writeable(joints)))


def _clusters(distances: Array, weights: Array, apart: float) -> list[tuple[float, int]]:
    """Return the weight and the medoid of each cluster, the heaviest first.

    A centre is the row that has most weight about it among those that no earlier centre is near; then every row goes
    to its nearest centre.
    """
    near = distances <= apart
    left = weights > 0.0
    centres: list[int] = []
    while left.any():
        about = np.where(left, near @ np.where(left, weights, 0.0), -1.0)
        centres.append(int(about.argmax()))
        left &= ~near[centres[-1]]
    owners = distances[:, centres].argmin(axis=1)
    members = [owners == k for k in range(len(centres))]
    clusters = [(float(weights[rows].sum()), _medoid(distances, weights, rows)) for rows in members]
    return sorted(clusters, key=lambda cluster: -cluster[0])


def _medoid(distances: Array, weights: Array, members: NDArray[np.bool_]) -> int:
    """Return which of the members of a cluster (K,) is nearest to them all."""
    rows = np.flatnonzero(members)
    return int(rows[(distances[np.ix_(rows, rows)] @ weights[rows]).argmin()])
