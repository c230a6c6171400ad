"""How certain a tracker is of people whom the library does not hold: intervals and modes.

One person at a time is left out of library and fit.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from numpy.typing import NDArray

from people import GROUPS as CLIPS
from people import PAIRS, SIDES, TOLD, Piece, Views
from posefit.arrays import Array
from posefit.errors import InputError
from posefit.files import new_file
from posefit.fitting.metrics import LOST_MM
from posefit.footage.training import training_clips, training_motions
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import ANGLES, JOINTS, Skeleton
from posefit.motion import recorded
from posefit.sweep.cell import cell_scene, settings_text
from posefit.sweep.check import cell_of
from posefit.tracking.modes import MIN_COST
from posefit.tracking.options import TrackOptions
from posefit.tracking.pipeline import track_scene
from posefit.uncertainty.calibration import (
    LEVELS,
    Recalibration,
    calibration_error,
    conformal_factor,
    reliability,
)
from posefit.uncertainty.intervals import angle_intervals, joint_intervals
from posefit.uncertainty.modes import APART, Posterior, modes_of, nearer_mirrored, second_side
from posefit_exemplars.calibration import Calibration, evidence, none_features
from posefit_reproduce.jobs import Progress, each
from scores import auroc
from table import WORKERS, bar, markdown

FRAMES, QUICK_FRAMES = 50, 12
METHOD, EVALUATIONS = "exemplars", 2440
TEMPERATURE = 8.0  # of the posterior
OTHERS: Mapping[str, Mapping[str, Any]] = {
    "annealed@pca": {"tracker.modes": 1},  # its own particles
    "sapso@pca": {"tracker.modes": 4, "tracker.modes_share": 2.0},  # searches of a frame, each begun elsewhere
}
DANCES, EVERYDAY = "dances", "everyday"
# a person's clips, by group; those that other measurements have no use for
MORE = {
    EVERYDAY: (
        Piece("14_13", 120, 4, "sweeps the floor"),
        Piece("17_10", 120, 0, "boxes"),
        Piece("17_10", 120, 3, "boxes"),
    ),
    "turns": (Piece("29_01", 100, 3, "walks and turns"),),
    DANCES: (
        Piece("135_07", 120, 3, "kicks of a martial art"),
        Piece("135_03", 120, 1, "a form of a martial art"),
    ),
}
LEFT_OUT = 4  # of one person's clips, no more than so many are followed


class OneTrack(NamedTuple):
    """One track: a clip, from where, and how."""

    group: str
    clip: Piece
    views: Views
    translation: str
    frames: int
    method: str = METHOD
    temperature: float = TEMPERATURE

    @property
    def spec(self) -> dict[str, Any]:
        """What its cell says."""
        own = {"exemplars.posterior_temperature": self.temperature}
        return {
            "method": self.method,
            "motion": self.clip.name,
            "train": [self.clip.library],
            "view_degrees": self.views,
            "frames": min(self.frames, self.clip.frames),
            "instance": self.clip.instance,
            "evaluations": EVALUATIONS,
            "translation": self.translation,
            "settings": own if self.method == METHOD else dict(OTHERS[self.method]),
            **TOLD,
        }


def pieces() -> list[tuple[str, Piece]]:
    """Return the clips with their groups, at most four of each person, of as many groups as he has."""
    found: list[tuple[str, Piece]] = []
    each = {group: (*clips, *MORE.get(group, ())) for group, clips in CLIPS.items()}
    for place in range(max(map(len, each.values()))):
        for group, clips in each.items():
            if place < len(clips):
                mine = [one for one in found if one[1].subject == clips[place].subject]
                if len(mine) < LEFT_OUT:
                    found.append((group, clips[place]))
    return sorted(found, key=lambda one: one[1].subject)  # whose library is made once


def planned_tracks(quick: bool) -> tuple[list[OneTrack], list[OneTrack]]:
    """Return the tracks of the method, and those of methods that only search."""
    base: list[OneTrack] = []
    others: list[OneTrack] = []
    for k, (group, clip) in enumerate(pieces()):
        sides = [SIDES[(2 * k + turn) % len(SIDES)] for turn in ((0,) if quick else (0, 1, 3))]
        frames = QUICK_FRAMES if quick else FRAMES
        tracks = [OneTrack(group, clip, side, "known", frames) for side in sides]
        if not quick:
            last = (PAIRS[k // 2 % len(PAIRS)], "known") if k % 2 else (sides[0], "aligned")
            tracks.append(OneTrack(group, clip, *last, frames))
        base += tracks
        few = min(frames, 20)
        others += [tracks[0]._replace(method=method, frames=few, temperature=0.0) for method in OTHERS]
    return base, others


@dataclass(frozen=True, eq=False)
class Followed:
    """The frames of a track."""

    seen: OneTrack
    truth: Array = field(repr=False)  # (T, 66)
    told: Array = field(repr=False)  # (T, 66)
    drawn: Array = field(repr=False)  # (T, K, 66)
    weights: Array = field(repr=False)  # (T, K)
    costs: Array = field(repr=False)  # (T,)

    def __len__(self) -> int:
        return len(self.told)

    @property
    def skeleton(self) -> Skeleton:
        """The person's bones."""
        return _skeleton(self.seen.clip.subject)

    @cached_property
    def off(self) -> Array:
        """How far each joint is from where it was told (T, 27), metres, both roots at one point."""
        true, told = (self.skeleton.joints(poses) for poses in (self.truth, self.told))
        return np.asarray(np.linalg.norm(true - told, axis=2))

    def posterior(self, k: int) -> Posterior:
        """Return what a frame may show, as nobody has recalibrated it."""
        return Posterior(self.drawn[k], np.zeros((len(self.weights[k]), 3)), self.weights[k], coherent=True)


@lru_cache(maxsize=16)
def _skeleton(subject: str) -> Skeleton:
    return recorded.clips(only=(subject,))[0].skeleton


def followed(seen: OneTrack) -> Followed:
    """Return a clip that was followed by a library without the person who moves in it."""
    cell = cell_of(seen.spec)
    scene = cell_scene(cell)
    training = training_motions(training_clips(cell.train, followed=cell.motion), scene.fps)
    options = TrackOptions(
        method=cell.method,
        settings=settings_text(cell.settings),
        evaluations=cell.evaluations,
        translation="known" if cell.translation == "known" else "aligned",
    )
    track = track_scene(scene, training, options)
    assert track.truth is not None
    posteriors = [one.posterior for one in track.estimates]
    most = max(len(one) for one in posteriors if one is not None)
    drawn = np.zeros((len(posteriors), most, track.truth.poses.shape[1]))
    weights = np.zeros((len(posteriors), most))
    for k, one in enumerate(posteriors):
        assert one is not None
        drawn[k, : len(one)], weights[k, : len(one)] = one.poses, one.weights
    costs = np.array([one.cost for one in track.estimates])
    return Followed(seen, track.truth.poses, track.motion.poses, drawn, weights, costs)


ARRAYS = tuple(one.name for one in fields(Followed) if one.name != "seen")


def save_tracks(tracks: Sequence[Followed], path: Path) -> None:
    """Write tracks to a file .npz: angles in single precision, those of samples to a thousandth of a radian or two."""
    arrays: dict[str, Any] = {}
    for k, one in enumerate(tracks):
        arrays |= {f"{k}.{name}": getattr(one, name).astype(np.float32) for name in ARRAYS}
        arrays[f"{k}.drawn"] = one.drawn.astype(np.float16)
    arrays["seen"] = np.array(json.dumps([one.seen for one in tracks]))  # tuples become lists
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


def load_tracks(path: str) -> list[Followed]:
    """Return the tracks of a file that `save_tracks` wrote. Raises ValueError where it is none."""
    try:
        with np.load(path) as held:
            seen = [
                OneTrack(group, Piece(*clip), tuple(views), *rest)
                for group, clip, views, *rest in json.loads(str(held["seen"]))
            ]
            return [
                Followed(one, **{name: held[f"{k}.{name}"].astype(np.float64) for name in ARRAYS})
                for k, one in enumerate(seen)
            ]
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: expected tracks that --out wrote, got {error}") from None


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


def doubt_of(tracks: Sequence[Kept]) -> Calibration:
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


def _rounded(values: Any) -> Any:
    """Return values as JSON holds them, numbers to four digits."""
    if isinstance(values, dict):
        return {name: _rounded(value) for name, value in values.items()}
    return [_rounded(value) for value in values] if np.ndim(values) else float(f"{float(values):.4g}")


def _none(doubt: Calibration, tracks: Sequence[Kept]) -> Array:
    """Return the coefficients (3,) of the log-odds that no mode is right: the truth is far from the nearest one."""
    signs = np.array([none_features(doubt.log(seen)) for one in tracks for seen in one.seen])
    return logistic(signs, np.concatenate([one.nearest[:, 1] > APART for one in tracks]), frame_weights(tracks))


def frame_weights(tracks: Sequence[Kept]) -> Array:
    """Return the weights of all frames, which sum to 1: every clip counts alike, and so does every frame of one."""
    names = [one.track.seen.clip for one in tracks]
    frames = {name: sum(len(one.track) for one in tracks if one.track.seen.clip == name) for name in names}
    each = [np.full(len(one.track), 1.0 / frames[name]) for one, name in zip(tracks, names, strict=True)]
    return np.asarray(np.concatenate(each) / len(frames))


def _doubt(tracks: Sequence[Kept]) -> Calibration:
    """Return how the logarithm of the error follows from what is seen, by weighted least squares."""
    seen, error = np.concatenate([one.seen for one in tracks]), np.concatenate([one.error for one in tracks])
    weights = frame_weights(tracks)
    slopes = np.linalg.solve(
        (seen.T * weights) @ seen + RIDGE * np.eye(seen.shape[1]), (seen.T * weights) @ np.log(error)
    )
    low, high = np.quantile(seen @ slopes, [0.005, 0.995])
    ones = Recalibration()
    return Calibration(
        slopes, (float(low), float(high)), ones.joint_spreads, ones.angle_spreads, ones.joint_factors,
        ones.angle_factors, 1.0, np.zeros(3),
    )  # fmt: skip


def _spreads(doubt: Calibration, tracks: Sequence[Kept]) -> tuple[Array, Array]:
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


def _factors(doubt: Calibration, tracks: Sequence[Kept]) -> tuple[Array, Array]:
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


def scores(doubt: Calibration, one: Kept, every: int = 1) -> tuple[Array, Array]:
    """Return how far joints (T, levels, 27) and angles (T, levels, 66) are off, in radii of their intervals."""
    track = one.track
    turned = np.abs(wrapped(track.truth - track.told))[::every, None]
    radii, halves = radii_of(doubt, one, every)
    return track.off[::every, None] / np.maximum(radii, TINY), turned / np.maximum(halves, TINY)


def radii_and_angles_held(doubt: Calibration, one: Kept) -> tuple[Array, NDArray[np.bool_]]:
    """Return the radii of joints (T, levels, 27), metres, and whether angles (T, levels, 66) are in their intervals."""
    radii, halves = radii_of(doubt, one)
    return radii, np.abs(wrapped(one.track.truth - one.track.told))[:, None] <= halves


def radii_of(doubt: Calibration, one: Kept, every: int = 1) -> tuple[Array, Array]:
    """Return the radii of joints (T, levels, 27) and the half intervals of angles (T, levels, 66)."""
    joints, angles, track = [], [], one.track
    for k in range(0, len(track), every):
        recalibration = doubt.recalibration(doubt.log(one.seen[k]))
        posterior = replace(track.posterior(k), recalibration=recalibration)
        joints.append(joint_intervals(track.skeleton, posterior, track.told[k]))
        angles.append(angle_intervals(posterior, track.told[k]))
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


PEOPLE = 3  # at least, of which one is left out at a time


def posterior(
    quick: bool,
    again: str | None,
    out: str | None,
    store: str | None,
    workers: int | None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return what intervals and modes are worth on everybody who was left out of library and fit.

    `again` is a file of tracks that an earlier `out` wrote, in place of following. `out` is a new file .npz for the
    frames of all tracks, `store` a new one .json for what was fitted to all people.
    """
    if again is not None and (quick or out):
        raise InputError(f"again must not be given beside {'--quick' if quick else '--out'}, got --again {again}")
    with ExitStack() as stack:
        file, table = (stack.enter_context(new_file(path)) if path else None for path in (out, store))
        if again is not None:
            tracks = load_tracks(again)
        else:
            base, more = planned_tracks(quick)
            found = each({seen: partial(followed, seen) for seen in (*base, *more)}, workers, progress)
            tracks = list(found.values())
            if file is not None:
                save_tracks(tracks, file)
        kept = [Kept.of(one) for one in tracks]
        mine = [one for one in kept if one.track.seen.method == METHOD]
        people = list(dict.fromkeys(one.track.seen.clip.subject for one in mine))
        if len(people) < PEOPLE:
            raise InputError(f"tracks must be of {PEOPLE} people or more, got {len(people)}")
        said = []
        for person in people:
            doubt = doubt_of([one for one in mine if one.track.seen.clip.subject != person])
            his = [one for one in mine if one.track.seen.clip.subject == person]
            said += [judgement(doubt, one) for one in his]
        if table is not None:
            doubt = doubt_of(mine)
            table.write_text(json.dumps({"temperature": TEMPERATURE, **_rounded(vars(doubt))}) + "\n", encoding="utf-8")
    others = [one for one in kept if one.track.seen.method in OTHERS]
    return {
        "coverage": coverages(said),
        "modes": {"recalibrated": best_modes([one.kept for one in said], said), "as drawn": best_modes(mine)},
        "searches": searches_lost(others) if others else {},
    }


LOST_METRES = 1e-3 * LOST_MM


@dataclass(frozen=True, eq=False)
class Judged:
    """A track of somebody who was left out of the fit, and what was said of it."""

    kept: Kept
    doubts: Array = field(repr=False)  # (T,) metres
    sharpness: float
    none: Array = field(repr=False)  # (T,) probability that no mode is right
    inside: NDArray[np.bool_] = field(repr=False)  # (T, levels, 27)
    radii: Array = field(repr=False)  # (T, levels, 27) metres
    turned: Array = field(repr=False)  # (levels,) share of angles that are inside


def judgement(doubt: Calibration, kept: Kept) -> Judged:
    """Return what is said of a track."""
    logs = np.array([doubt.log(seen) for seen in kept.seen])
    radii, angles = radii_and_angles_held(doubt, kept)
    return Judged(
        kept,
        np.exp(logs),
        doubt.sharpness,
        np.array([doubt.recalibration(log).none for log in logs]),
        kept.track.off[:, None] <= radii,
        radii,
        angles.mean(axis=(0, 2)),
    )


def coverages(tracks: Sequence[Judged]) -> dict[str, Any]:
    """Return the coverage of left-out people: overall, by group of joints, by view and by kind of motion."""

    def told(mine: Sequence[Judged], joints: Any = slice(1, None)) -> dict[str, Any]:
        weights = frame_weights([one.kept for one in mine])
        inside, radii = (
            weights @ np.concatenate([getattr(one, name)[:, :, joints].mean(axis=2) for one in mine])
            for name in ("inside", "radii")
        )
        radius = np.concatenate([one.radii[:, 1, joints].mean(axis=1) for one in mine])
        return {
            "tracks": len(mine),
            "coverage": {f"{100 * level:.0f}": float(inside[k]) for k, level in enumerate(LEVELS)},
            "radius_mm": {f"{100 * level:.0f}": float(1e3 * radii[k]) for k, level in enumerate(LEVELS)},
            "median_radius_mm": float(1e3 * np.median(radius)),
        }

    def by(name: Callable[[Judged], str]) -> dict[str, Any]:
        names = sorted({name(one) for one in tracks})
        return {each: told([one for one in tracks if name(one) == each]) for each in names}

    return {
        "overall": told(tracks),
        "joints": {name: told(tracks, members) for name, members in MEMBERS.items()},
        "views": by(lambda one: seen_from(one.kept)),
        "motions": by(_group),
        "translations": by(_translation),
        "people": by(lambda one: one.kept.track.seen.clip.subject),
        "angles": dict(zip(("50", "80", "95"), np.mean([one.turned for one in tracks], axis=0).tolist(), strict=True)),
    }


def seen_from(kept: Kept) -> str:
    """Return from where a track is seen, three digits a view."""
    return ", ".join(f"{view:03.0f}" for view in kept.track.seen.views)


def _group(one: Judged) -> str:
    return one.kept.track.seen.group


def _translation(one: Judged) -> str:
    return one.kept.track.seen.translation


def best_modes(tracks: Sequence[Kept], said: Sequence[Judged] = ()) -> dict[str, Any]:
    """Return how far the best mode's probability is from how often it is right.

    It is right where the truth is nearer to it than to any other mode, and as near as poses of one mode are; `several`
    are the frames that have others, `none` those in which no mode is right. Modes' weights are those that `said` makes
    of them, in the order of the tracks; without it they are as they were drawn.
    """
    powers = [one.sharpness for one in said] or [1.0] * len(tracks)
    none = np.concatenate([one.none for one in said] or [np.zeros(len(one.track)) for one in tracks])
    pairs = zip(tracks, powers, strict=True)
    probable = (1.0 - none) * [sharpened(modes, power)[0] for one, power in pairs for modes in one.modes]
    several = np.array([len(modes) > 1 for one in tracks for modes in one.modes])
    nearest = np.concatenate([one.nearest for one in tracks])
    far = nearest[:, 1] > APART
    right = (nearest[:, 0] == 0.0) & ~far
    second, swapped = (np.concatenate([getattr(one, name) for one in tracks]) for name in ("second", "swapped"))
    return {
        "tracks": len(tracks),
        "mean_probability": float(probable.mean()),
        "right": float(right.mean()),
        "calibration_error": calibration_error(probable, right),
        "several": float(several.mean()),
        "calibration_error_several": calibration_error(probable[several], right[several]) if several.any() else 0.0,
        "none": float(far.mean()),
        "calibration_error_none": calibration_error(none, far),
        "auroc": auroc(probable, right),
        "second_side_auroc": auroc(second, swapped),
        "reliability": reliability(probable, right),
    }


def searches_lost(others: Sequence[Kept]) -> dict[str, float]:
    """Return how frames that searches lose follow from their costs: the model that is fitted to all of them.

    And what one is worth on everybody who was left out of its fit.
    """
    said, came = [], []
    for person in dict.fromkeys(one.track.seen.clip.subject for one in others):
        his, rest = (
            [one for one in others if (one.track.seen.clip.subject == person) == mine] for mine in (True, False)
        )
        if rest:
            design, off = _costs(his)
            said.append(1.0 / (1.0 + np.exp(-design @ logistic(*_costs(rest), frame_weights(rest)))))
            came.append(off)
    bias, slope = logistic(*_costs(others), frame_weights(others))
    told = {"even": float(np.exp(-bias / slope)), "steepness": float(slope)}
    if not said:
        return told
    likely, off = np.concatenate(said), np.concatenate(came)
    rank = auroc(likely, off)
    ranked = {} if rank is None else {"auroc": rank}
    return {**told, "lost": float(off.mean()), "calibration_error": calibration_error(likely, off), **ranked}


def _costs(tracks: Sequence[Kept]) -> tuple[Array, NDArray[np.bool_]]:
    """Return 1 and the logarithm of the cost of each frame (n, 2), and whether it is lost (n,)."""
    costs = np.concatenate([one.track.costs for one in tracks])
    off = np.concatenate([one.error for one in tracks]) > LOST_METRES
    return np.column_stack([np.ones(len(costs)), np.log(np.maximum(costs, MIN_COST))]), off


def posterior_lines(told: Mapping[str, Any]) -> Iterator[str]:
    """Yield the tables as they are printed."""
    levels = [f"{100 * level:.0f}" for level in LEVELS]
    held = told["coverage"]
    heads = ["of", "which", "tracks", *(f"{level} % hold %" for level in levels), "80 % radius mm", "median mm"]
    table = []
    for part in ("overall", "joints", "views", "motions", "translations", "people"):
        rows = {"": held[part]} if part == "overall" else held[part]
        for name, one in rows.items():
            shown = [f"{100 * one['coverage'][level]:.1f}" for level in levels]
            widths = [f"{one['radius_mm']['80']:.0f}", f"{one['median_radius_mm']:.0f}"]
            table.append([part, name, str(one["tracks"]), *shown, *widths])
    table.append(["angles", "", "", *(f"{100 * held['angles'][level]:.1f}" for level in levels), "", ""])
    yield from markdown(heads, table, 2)
    yield ""
    heads = ["best mode %", "right %", "error %", "several modes %", "error %", "none right %", "error %"]
    table = []
    for name, one in told["modes"].items():
        each = ["mean_probability", "right", "calibration_error", "several", "calibration_error_several"]
        each += ["none", "calibration_error_none"]
        ranks = ["" if one[key] is None else f"{one[key]:.2f}" for key in ("auroc", "second_side_auroc")]
        table.append([name, str(one["tracks"]), *(f"{100 * one[key]:.1f}" for key in each), *ranks])
    yield from markdown(["modes", "tracks", *heads, "AUROC", "second side AUROC"], table)
    if told["searches"]:
        yield ""
        yield "lost, by the cost of what other methods found: " + ", ".join(
            f"{name} {value:.3g}" for name, value in told["searches"].items()
        )


@click.command(help=__doc__)
@click.option("--quick", is_flag=True, help="A few frames of every clip from one side: a look, not a measurement.")
@click.option("--again", metavar="FILE", help="Tracks that --out wrote, instead of following.")
@click.option("--out", metavar="FILE.npz", help="New file for the frames of all tracks.")
@click.option("--store", metavar="FILE.json", help="New file of what is learned of all people, for exemplars to read.")
@WORKERS
def main(**asked: Any) -> None:
    for line in posterior_lines(posterior(**asked, progress=bar)):
        click.echo(line)


if __name__ == "__main__":
    main()
