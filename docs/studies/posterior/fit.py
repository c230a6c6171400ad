"""From tracks whose truth is known to what a posterior does not know of its own error."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import ANGLES, JOINTS
from posefit.uncertainty.calibration import LEVELS, Recalibration, conformal_factor
from posefit.uncertainty.intervals import angle_intervals, joint_intervals
from posefit.uncertainty.modes import APART, modes_of
from posefit.uncertainty.sides import nearer_mirrored, second_side
from posefit_exemplars.doubt import Doubt, evidence, none_signs
from posterior.frames import Followed

GROUPS: dict[str, tuple[str, ...]] = {
    "hips": ("lhipjoint", "rhipjoint"),
    "knees": ("lfemur", "rfemur"),
    "ankles": ("ltibia", "rtibia"),
    "feet": ("lfoot", "ltoes", "rfoot", "rtoes"),
    "spine": ("lowerback", "upperback", "thorax"),
    "head": ("lowerneck", "upperneck", "head"),
    "shoulders": ("lclavicle", "rclavicle"),
    "elbows": ("lhumerus", "rhumerus"),
    "hands": ("lradius", "lwrist", "lhand", "rradius", "rwrist", "rhand"),
}
MEMBERS = {name: np.array([JOINTS.index(joint) for joint in joints]) for name, joints in GROUPS.items()}
ALONE = {str(angle): np.array([angle]) for angle in range(ANGLES)}  # some have no freedom, and so no error
TRIED = np.geomspace(0.05, 2.0, 12)  # spreads, in doubts
EVERY = 5  # of the frames that factors are found from; neighbours say the same
SHARPNESSES = np.geomspace(0.05, 1.0, 24)
TINY = 1e-12
RIDGE = 1e-3
STEPS = 30  # of Newton's method


@dataclass(frozen=True, eq=False)
class Kept:
    """What a track's frames say that needs no fit."""

    track: Followed
    seen: Array = field(repr=False)  # (T, 4) evidence
    error: Array = field(repr=False)  # (T,) metres, the mean over joints
    swapped: NDArray[np.bool_] = field(repr=False)  # (T,)
    second: Array = field(repr=False)  # (T,) weight of the second side
    modes: list[Array] = field(repr=False)  # weights of each frame's modes, the heaviest first
    nearest: Array = field(repr=False)  # (T, 2) which of them is nearest to the truth, and how far that is, metres

    @classmethod
    def of(cls, track: Followed) -> "Kept":
        """Return what a track's frames say."""
        skeleton, cameras = track.skeleton, len(track.seen.views)
        posteriors = [track.posterior(k) for k in range(len(track))]
        pairs = list(zip(posteriors, track.told, track.costs, strict=True))
        seen = np.array([evidence(skeleton, one, pose, cost, cameras) for one, pose, cost in pairs])
        swapped = nearer_mirrored(skeleton.joints(track.truth), skeleton.joints(track.told))
        second = np.array([second_side(skeleton, one, pose) for one, pose, _ in pairs])
        modes, nearest = [], []
        for one, truth in zip(posteriors, track.truth, strict=True):
            found = modes_of(skeleton, one)
            joints = skeleton.joints(np.array([mode.pose for mode in found]))
            off = np.linalg.norm(joints - skeleton.joints(truth), axis=2).mean(axis=1)
            modes.append(np.array([mode.weight for mode in found]))
            nearest.append((off.argmin(), off.min()))
        return cls(track, seen, track.off[:, 1:].mean(axis=1), swapped, second, modes, np.array(nearest))


def doubt_of(tracks: Sequence[Kept]) -> Doubt:
    """Return what makes the intervals and the weights of modes of tracks mean what they say."""
    doubt = _doubt(tracks)
    joints, angles = _spreads(doubt, tracks)
    doubt = replace(doubt, joint_spreads=joints, angle_spreads=angles)
    joint_factors, angle_factors = _factors(doubt, tracks)
    doubt = replace(doubt, joint_factors=joint_factors, angle_factors=angle_factors)
    return replace(doubt, sharpness=_sharpness(tracks), none=_none(doubt, tracks))


def sharpened(weights: Array, sharpness: float) -> Array:
    """Return the weights (n,) of modes, as a recalibration makes them."""
    powers = weights**sharpness
    return np.asarray(powers / powers.sum())


def _sharpness(tracks: Sequence[Kept]) -> float:
    """Return the power of modes' weights at which the modes that are nearest to the truth are likeliest."""
    weights, likely = frame_weights(tracks), []
    pairs = [(modes, int(row)) for one in tracks for modes, row in zip(one.modes, one.nearest[:, 0], strict=True)]
    for tried in SHARPNESSES:
        likely.append(weights @ [np.log(sharpened(modes, tried)[row]) for modes, row in pairs])
    return float(SHARPNESSES[int(np.argmax(likely))])


def _none(doubt: Doubt, tracks: Sequence[Kept]) -> Array:
    """Return the coefficients (3,) of the log-odds that no mode is right: the truth is far from the nearest one."""
    signs = np.array([none_signs(doubt.log(seen)) for one in tracks for seen in one.seen])
    return logistic(signs, np.concatenate([one.nearest[:, 1] > APART for one in tracks]), frame_weights(tracks))


def frame_weights(tracks: Sequence[Kept]) -> Array:
    """Return the weights of all frames, which sum to 1: every clip counts alike, and so does every frame of one."""
    names = [one.track.seen.clip for one in tracks]
    frames = {name: sum(len(one.track) for one in tracks if one.track.seen.clip == name) for name in names}
    each = [np.full(len(one.track), 1.0 / frames[name]) for one, name in zip(tracks, names, strict=True)]
    return np.asarray(np.concatenate(each) / len(frames))


def _doubt(tracks: Sequence[Kept]) -> Doubt:
    """Return how the logarithm of the error follows from what is seen, by weighted least squares."""
    seen, error = np.concatenate([one.seen for one in tracks]), np.concatenate([one.error for one in tracks])
    weights = frame_weights(tracks)
    slopes = np.linalg.solve(
        (seen.T * weights) @ seen + RIDGE * np.eye(seen.shape[1]), (seen.T * weights) @ np.log(error)
    )
    low, high = np.quantile(seen @ slopes, [0.005, 0.995])
    ones = Recalibration()
    return Doubt(
        slopes, (float(low), float(high)), ones.joint_spreads, ones.angle_spreads, ones.joint_factors,
        ones.angle_factors, 1.0, np.zeros(3),
    )  # fmt: skip


def _spreads(doubt: Doubt, tracks: Sequence[Kept]) -> tuple[Array, Array]:
    """Return the spreads of joints (27,) and angles (66,), in doubts, at which the truth is likeliest."""
    joints, angles = np.zeros((len(TRIED), len(JOINTS))), np.zeros((len(TRIED), ANGLES))
    weights, begin = frame_weights(tracks), 0
    for one in tracks:
        track, rows = one.track, np.arange(0, len(one.track), EVERY)
        here = weights[begin + rows]
        begin += len(track)
        spread = np.exp([doubt.log(seen) for seen in one.seen[rows]])[:, None]
        skeleton = track.skeleton
        true = skeleton.joints(track.truth[rows])
        off = np.array([np.linalg.norm(skeleton.joints(track.drawn[k]) - true[i], axis=2) for i, k in enumerate(rows)])
        turned = np.abs(wrapped(track.drawn[rows] - track.truth[rows, None]))
        for sums, distances, dimensions in ((joints, off, 3), (angles, turned, 1)):
            for t, tried in enumerate(TRIED):
                wide = tried * spread
                logs = -0.5 * (distances / wide[:, None]) ** 2
                top = logs.max(axis=1)
                likely = np.einsum("tk,tkn->tn", track.weights[rows], np.exp(logs - top[:, None]))
                sums[t] += here @ (np.log(likely) + top - dimensions * np.log(wide))
    found = TRIED[joints.argmax(axis=0)]
    found[0] = 0.0  # of the root, which both have in one place
    return found, TRIED[angles.argmax(axis=0)]


def _factors(doubt: Doubt, tracks: Sequence[Kept]) -> tuple[Array, Array]:
    """Return the conformal factors of joints (levels, 27) and angles (levels, 66), each of its group."""
    clips: dict[object, list[tuple[Array, Array]]] = {}
    for one in tracks:
        clips.setdefault(one.track.seen.clip, []).append(scores(doubt, one, EVERY))
    held = [[np.concatenate(parts) for parts in zip(*found, strict=True)] for found in clips.values()]
    factors = []
    for which, (groups, count) in enumerate(((MEMBERS, len(JOINTS)), (ALONE, ANGLES))):
        found = np.ones((len(LEVELS), count))
        for members in groups.values():
            for level, share in enumerate(LEVELS):
                each = [clip[which][:, level, members].ravel() for clip in held]
                found[level, members] = conformal_factor(each, share)
        factors.append(found)
    return factors[0], factors[1]


def scores(doubt: Doubt, one: Kept, every: int = 1) -> tuple[Array, Array]:
    """Return how far joints (T, levels, 27) and angles (T, levels, 66) are off, in radii of their intervals."""
    track = one.track
    turned = np.abs(wrapped(track.truth - track.told))[::every, None]
    radii, halves = radii_of(doubt, one, every)
    return track.off[::every, None] / np.maximum(radii, TINY), turned / np.maximum(halves, TINY)


def radii_and_angles_held(doubt: Doubt, one: Kept) -> tuple[Array, NDArray[np.bool_]]:
    """Return the radii of joints (T, levels, 27), metres, and whether angles (T, levels, 66) are in their intervals."""
    radii, halves = radii_of(doubt, one)
    return radii, np.abs(wrapped(one.track.truth - one.track.told))[:, None] <= halves


def radii_of(doubt: Doubt, one: Kept, every: int = 1) -> tuple[Array, Array]:
    """Return the radii of joints (T, levels, 27) and the half intervals of angles (T, levels, 66)."""
    joints, angles, track = [], [], one.track
    for k in range(0, len(track), every):
        recalibration = doubt.recalibration(doubt.log(one.seen[k]))
        posterior = replace(track.posterior(k), recalibration=recalibration)
        joints.append(joint_intervals(track.skeleton, posterior, track.told[k]).radii)
        angles.append(angle_intervals(posterior, track.told[k]).halves)
    return np.array(joints), np.array(angles)


def logistic(design: Array, came: NDArray[np.bool_], weights: Array) -> Array:
    """Return the coefficients (d,) of the log-odds of what came (n,), by Newton's method with a small ridge."""
    found = np.zeros(design.shape[1])
    for _ in range(STEPS):
        probable = 1.0 / (1.0 + np.exp(-np.clip(design @ found, -30.0, 30.0)))
        slope = design.T @ (weights * (came - probable)) - RIDGE * found
        bend = (design.T * (weights * probable * (1.0 - probable))) @ design + RIDGE * np.eye(len(found))
        found = found + np.linalg.solve(bend, slope)
    return np.asarray(found)
