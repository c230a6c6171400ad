"""Calibration of intervals and modes for people who are not in the library.

One person at a time is left out of library and fit.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from numpy.typing import NDArray

from clips import GROUPS as CLIPS
from clips import METHOD, PAIRS, SIDES, Clip, Views, cell_fields, track_of
from people import CHANGES
from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.errors import InputError
from posefit.files import new_file
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import ANGLES, JOINTS, Skeleton, joint_distances
from posefit.motion import recorded
from posefit.sweep.cell import cell_scene
from posefit.sweep.check import cell_of
from posefit.uncertainty.calibration import LEVELS, Recalibration, reliability
from posefit.uncertainty.intervals import angle_intervals, joint_intervals
from posefit.uncertainty.modes import APART, Posterior, modes_of, nearer_mirrored, poses_apart, second_side
from posefit_exemplars.calibration import Calibration, evidence, none_features
from posefit_exemplars.tracker import POSTERIOR_TEMPERATURE
from posefit_reproduce.jobs import Progress, each
from scores import auroc, calibration_error, conformal_factor
from table import WORKERS, bar, markdown

FRAMES = 50
DANCES, EVERYDAY = "dances", "everyday"
# clips that other measurements do not use, by group
MORE = {
    EVERYDAY: (
        Clip("14_13", 120, 4, "sweeps the floor"),
        Clip("17_10", 120, 0, "boxes"),
        Clip("17_10", 120, 3, "boxes"),
    ),
    "turns": (Clip("29_01", 100, 3, "walks and turns"),),
    DANCES: (
        Clip("135_07", 120, 3, "kicks of a martial art"),
        Clip("135_03", 120, 1, "a form of a martial art"),
    ),
}
MAX_CLIPS = 4  # of a person


# masks and a body as those of footage
HARD = {name: value for name, value in CHANGES["all of these"].items() if name != "yaw_off_degrees"}


class Case(NamedTuple):
    """One track: its clip and views."""

    group: str
    clip: Clip
    views: Views
    translation: str
    hard: bool = False

    @property
    def spec(self) -> dict[str, Any]:
        """The fields of the cell."""
        fields = {"method": METHOD, "translation": self.translation}
        fields |= HARD if self.hard else {}
        return cell_fields(self.clip, self.views, FRAMES, **fields)


def pieces() -> list[tuple[str, Clip]]:
    """Return the clips with their groups, at most four of each person, of as many groups as they have."""
    chosen: list[tuple[str, Clip]] = []
    clips_of = {group: (*clips, *MORE.get(group, ())) for group, clips in CLIPS.items()}
    for place in range(max(map(len, clips_of.values()))):
        for group, clips in clips_of.items():
            if place < len(clips):
                same_person = [clip for _, clip in chosen if clip.subject == clips[place].subject]
                if len(same_person) < MAX_CLIPS:
                    chosen.append((group, clips[place]))
    return sorted(chosen, key=lambda pair: pair[1].subject)  # a person's library is made once


def planned_tracks() -> list[Case]:
    """Return the tracks of all clips."""
    planned: list[Case] = []
    for k, (group, clip) in enumerate(pieces()):
        sides = [SIDES[(2 * k + turn) % len(SIDES)] for turn in (0, 1, 3)]
        planned += [Case(group, clip, side, "known") for side in sides]
        last = (PAIRS[k // 2 % len(PAIRS)], "known") if k % 2 else (sides[0], "aligned")
        planned.append(Case(group, clip, *last))
        planned.append(Case(group, clip, PAIRS[k // 2 % 2] if k % 2 else sides[1], "aligned", hard=True))
    return planned


@dataclass(frozen=True, eq=False)
class Samples:
    """The frames of a track, with samples."""

    case: Case
    truth: Array = field(repr=False)  # (T, 66)
    reported: Array = field(repr=False)  # (T, 66)
    drawn: Array = field(repr=False)  # (T, K, 66)
    weights: Array = field(repr=False)  # (T, K)
    costs: Array = field(repr=False)  # (T,)

    def __len__(self) -> int:
        return len(self.reported)

    @property
    def skeleton(self) -> Skeleton:
        """The skeleton of the person."""
        return recorded.clips(only=(self.case.clip.subject,))[0].skeleton

    @property
    def off(self) -> Array:
        """The error of each joint (T, 27), metres, both roots at one point."""
        return joint_distances(self.skeleton.joints(self.truth), self.skeleton.joints(self.reported))

    def posterior(self, k: int) -> Posterior:
        """Return the posterior of a frame before recalibration."""
        return Posterior(self.drawn[k], np.zeros((len(self.weights[k]), 3)), self.weights[k], coherent=True)


def sampled(case: Case) -> dict[str, Array]:
    """Return the arrays of `Samples` of the track of a clip by a library without its person."""
    cell = cell_of(case.spec)
    track = track_of(cell, cell_scene(cell))
    assert track.truth is not None
    posteriors = [frame.posterior for frame in track.frames]
    most = max(len(frame) for frame in posteriors if frame is not None)
    drawn = np.zeros((len(posteriors), most, track.truth.poses.shape[1]))
    weights = np.zeros((len(posteriors), most))
    for k, frame in enumerate(posteriors):
        assert frame is not None
        drawn[k, : len(frame)], weights[k, : len(frame)] = frame.poses, frame.weights
    costs = np.array([frame.cost for frame in track.frames])
    return dict(zip(ARRAYS, (track.truth.poses, track.motion.poses, drawn, weights, costs), strict=True))


ARRAYS = ("truth", "reported", "drawn", "weights", "costs")


def save_tracks(tracks: Sequence[Samples], path: Path) -> None:
    """Write tracks to a file .npz: angles in single precision, those of samples in half."""
    arrays: dict[str, Any] = {}
    for k, track in enumerate(tracks):
        arrays |= {f"{k}.{name}": getattr(track, name).astype(np.float32) for name in ARRAYS}
        arrays[f"{k}.drawn"] = track.drawn.astype(np.float16)
    arrays["cases"] = np.array(json.dumps([track.case for track in tracks]))  # tuples become lists
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


def load_tracks(path: str) -> list[Samples]:
    """Return the tracks of a file that `save_tracks` wrote. Raises ValueError where it is none."""
    try:
        with np.load(path) as stored:
            cases = [
                Case(group, Clip(*clip), tuple(views), *rest)
                for group, clip, views, *rest in json.loads(str(stored["cases"]))
            ]
            return [
                Samples(case, **{name: stored[f"{k}.{name}"].astype(np.float64) for name in ARRAYS})
                for k, case in enumerate(cases)
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
SPREADS = np.geomspace(0.05, 2.0, 12)  # in expected errors
EVERY = 5  # frames, of which one is used for factors, as neighbours are similar
SHARPNESSES = np.geomspace(0.05, 1.0, 24)
TINY = 1e-12
RIDGE = 1e-3
STEPS = 30  # of Newton's method


@dataclass(frozen=True, eq=False)
class TrackFeatures:
    """The features of a track's frames, which need no fit."""

    track: Samples
    evidence: Array = field(repr=False)  # (T, 4)
    error: Array = field(repr=False)  # (T,) metres, the mean over joints
    swapped: NDArray[np.bool_] = field(repr=False)  # (T,)
    second: Array = field(repr=False)  # (T,) weight of the second side
    modes: list[Array] = field(repr=False)  # weights of each frame's modes, the heaviest first
    nearest: Array = field(repr=False)  # (T, 2) the mode nearest to the truth, and its distance, metres

    @classmethod
    def of(cls, track: Samples) -> "TrackFeatures":
        """Return the features of a track."""
        skeleton, cameras = track.skeleton, len(track.case.views)
        posteriors = [track.posterior(k) for k in range(len(track))]
        frames = list(zip(posteriors, track.reported, track.costs, strict=True))
        signs = np.array([evidence(skeleton, posterior, pose, cost, cameras) for posterior, pose, cost in frames])
        swapped = nearer_mirrored(skeleton.joints(track.truth), skeleton.joints(track.reported))
        second = np.array([second_side(skeleton, posterior, pose) for posterior, pose, _ in frames])
        modes, nearest = [], []
        for posterior, truth in zip(posteriors, track.truth, strict=True):
            of_frame = modes_of(skeleton, posterior)
            distances = poses_apart(skeleton, np.array([mode.pose for mode in of_frame]), truth[None])[:, 0]
            modes.append(np.array([mode.weight for mode in of_frame]))
            nearest.append((distances.argmin(), distances.min()))
        return cls(track, signs, track.off[:, 1:].mean(axis=1), swapped, second, modes, np.array(nearest))


def calibration_of(tracks: Sequence[TrackFeatures]) -> Calibration:
    """Return the calibration of the intervals and the weights of modes of tracks."""
    calibration = _expected_error(tracks)
    joints, angles = _spreads(calibration, tracks)
    calibration = replace(calibration, joint_spreads=joints, angle_spreads=angles)
    joint_factors, angle_factors = _factors(calibration, tracks)
    calibration = replace(calibration, joint_factors=joint_factors, angle_factors=angle_factors)
    return replace(calibration, sharpness=_sharpness(tracks), none=_none(calibration, tracks))


def sharpened(weights: Array, sharpness: float) -> Array:
    """Return the weights (n,) of modes after recalibration."""
    powers = weights**sharpness
    return np.asarray(powers / powers.sum())


def _sharpness(tracks: Sequence[TrackFeatures]) -> float:
    """Return the power of modes' weights at which the modes that are nearest to the truth are likeliest."""
    weights, likelihoods = frame_weights(tracks), []
    pairs = [(modes, int(row)) for track in tracks for modes, row in zip(track.modes, track.nearest[:, 0], strict=True)]
    for sharpness in SHARPNESSES:
        likelihoods.append(weights @ [np.log(sharpened(modes, sharpness)[row]) for modes, row in pairs])
    return float(SHARPNESSES[int(np.argmax(likelihoods))])


def _rounded(values: Any) -> Any:
    """Return values as JSON holds them, numbers to four digits."""
    if isinstance(values, dict):
        return {name: _rounded(value) for name, value in values.items()}
    return [_rounded(value) for value in values] if np.ndim(values) else float(f"{float(values):.4g}")


def _none(calibration: Calibration, tracks: Sequence[TrackFeatures]) -> Array:
    """Return the coefficients (3,) of the log-odds that no mode is right: the truth is far from the nearest one."""
    signs = np.array([none_features(calibration.log(signs)) for track in tracks for signs in track.evidence])
    far = np.concatenate([track.nearest[:, 1] > APART for track in tracks])
    return logistic(signs, far, frame_weights(tracks))


def frame_weights(tracks: Sequence[TrackFeatures]) -> Array:
    """Return the weights of all frames, which sum to 1: every clip has the same, and every frame of one."""
    frames: dict[Clip, int] = {}
    for features in tracks:
        clip = features.track.case.clip
        frames[clip] = frames.get(clip, 0) + len(features.track)
    weights = [np.full(len(features.track), 1.0 / frames[features.track.case.clip]) for features in tracks]
    return np.asarray(np.concatenate(weights) / len(frames))


def _expected_error(tracks: Sequence[TrackFeatures]) -> Calibration:
    """Return the logarithm of the error as a function of evidence, by weighted least squares."""
    signs, errors = (np.concatenate([getattr(track, name) for track in tracks]) for name in ("evidence", "error"))
    weighted = signs.T * frame_weights(tracks)
    slopes = np.linalg.solve(weighted @ signs + RIDGE * np.eye(signs.shape[1]), weighted @ np.log(errors))
    low, high = np.quantile(signs @ slopes, [0.005, 0.995])
    plain = Recalibration()
    corrections = plain.joint_spreads, plain.angle_spreads, plain.joint_factors, plain.angle_factors
    return Calibration(slopes, (float(low), float(high)), *corrections, 1.0, np.zeros(3))


def _spreads(calibration: Calibration, tracks: Sequence[TrackFeatures]) -> tuple[Array, Array]:
    """Return the spreads of joints (27,) and angles (66,), in expected errors, at which the truth is likeliest."""
    joints, angles = np.zeros((len(SPREADS), len(JOINTS))), np.zeros((len(SPREADS), ANGLES))
    weights, begin = frame_weights(tracks), 0
    for features in tracks:
        track, rows = features.track, np.arange(0, len(features.track), EVERY)
        row_weights = weights[begin + rows]
        begin += len(track)
        errors = np.exp([calibration.log(signs) for signs in features.evidence[rows]])[:, None]
        skeleton = track.skeleton
        true = skeleton.joints(track.truth[rows])
        off = np.array([np.linalg.norm(skeleton.joints(track.drawn[k]) - true[i], axis=2) for i, k in enumerate(rows)])
        turned = np.abs(wrapped(track.drawn[rows] - track.truth[rows, None]))
        for sums, distances, dimensions in ((joints, off, 3), (angles, turned, 1)):
            for t, spread in enumerate(SPREADS):
                wide = spread * errors
                logs = -0.5 * (distances / wide[:, None]) ** 2
                top = logs.max(axis=1)
                likelihoods = np.einsum("tk,tkn->tn", track.weights[rows], np.exp(logs - top[:, None]))
                sums[t] += row_weights @ (np.log(likelihoods) + top - dimensions * np.log(wide))
    best = SPREADS[joints.argmax(axis=0)]
    best[0] = 0.0  # all roots are at one point
    return best, SPREADS[angles.argmax(axis=0)]


def _factors(calibration: Calibration, tracks: Sequence[TrackFeatures]) -> tuple[Array, Array]:
    """Return the conformal factors of joints (levels, 27) and angles (levels, 66), each of its group."""
    clips: dict[object, list[tuple[Array, Array]]] = {}
    for features in tracks:
        clips.setdefault(features.track.case.clip, []).append(scores(calibration, features, EVERY))
    by_clip = [[np.concatenate(parts) for parts in zip(*some, strict=True)] for some in clips.values()]
    factors = [np.ones((len(LEVELS), count)) for count in (len(JOINTS), ANGLES)]
    for kind, groups in enumerate((MEMBERS, ALONE)):
        for members in groups.values():
            for level, share in enumerate(LEVELS):
                clip_scores = [clip[kind][:, level, members].ravel() for clip in by_clip]
                factors[kind][level, members] = conformal_factor(clip_scores, share)
    return factors[0], factors[1]


def scores(calibration: Calibration, features: TrackFeatures, every: int = 1) -> tuple[Array, Array]:
    """Return the errors of joints (T, levels, 27) and angles (T, levels, 66), in radii of their intervals."""
    track = features.track
    turned = np.abs(wrapped(track.truth - track.reported))[::every, None]
    radii, halves = radii_of(calibration, features, every)
    return track.off[::every, None] / np.maximum(radii, TINY), turned / np.maximum(halves, TINY)


def radii_and_angles_inside(calibration: Calibration, features: TrackFeatures) -> tuple[Array, NDArray[np.bool_]]:
    """Return the radii of joints (T, levels, 27), metres, and whether angles (T, levels, 66) are in their intervals."""
    radii, halves = radii_of(calibration, features)
    track = features.track
    return radii, np.abs(wrapped(track.truth - track.reported))[:, None] <= halves


def radii_of(calibration: Calibration, features: TrackFeatures, every: int = 1) -> tuple[Array, Array]:
    """Return the radii of joints (T, levels, 27) and the half intervals of angles (T, levels, 66)."""
    joints, angles, track = [], [], features.track
    for k in range(0, len(track), every):
        recalibration = calibration.recalibration(calibration.log(features.evidence[k]))
        posterior = replace(track.posterior(k), recalibration=recalibration)
        joints.append(joint_intervals(track.skeleton, posterior, track.reported[k]))
        angles.append(angle_intervals(posterior, track.reported[k]))
    return np.array(joints), np.array(angles)


def logistic(design: Array, truth: NDArray[np.bool_], weights: Array) -> Array:
    """Return the coefficients (d,) of the log-odds of a truth (n,), by Newton's method with a small ridge."""
    coefficients = np.zeros(design.shape[1])
    for _ in range(STEPS):
        probable = 1.0 / (1.0 + np.exp(-np.clip(design @ coefficients, -30.0, 30.0)))
        slope = design.T @ (weights * (truth - probable)) - RIDGE * coefficients
        bend = (design.T * (weights * probable * (1.0 - probable))) @ design + RIDGE * np.eye(len(coefficients))
        coefficients = coefficients + np.linalg.solve(bend, slope)
    return np.asarray(coefficients)


MIN_PEOPLE = 3  # of which one is left out at a time


def posterior(
    again: str | None,
    out: str | None,
    store: str | None,
    workers: int | None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return the calibration of intervals and modes on people left out of library and fit.

    `again` is a file of tracks that an earlier `out` wrote, instead of tracking. `out` is a new file .npz for the
    frames of all tracks, `store` a new one .json for the calibration fitted to all people.
    """
    if again is not None and out:
        raise InputError(f"again must not be given beside --out, got --again {again}")
    with ExitStack() as stack:
        file, table = (stack.enter_context(new_file(path)) if path else None for path in (out, store))
        if again is not None:
            tracks = load_tracks(again)
        else:
            arrays = each({case: partial(sampled, case) for case in planned_tracks()}, workers, progress)
            tracks = [Samples(case, **some) for case, some in arrays.items()]
            if file is not None:
                save_tracks(tracks, file)
        sampling = [TrackFeatures.of(track) for track in tracks]
        people = list(dict.fromkeys(map(_person, sampling)))
        if len(people) < MIN_PEOPLE:
            raise InputError(f"tracks must be of {MIN_PEOPLE} people or more, got {len(people)}")
        evaluations = []
        for person in people:
            calibration = calibration_of([features for features in sampling if _person(features) != person])
            evaluations += [evaluated(calibration, features) for features in sampling if _person(features) == person]
        if table is not None:
            fitted = {"temperature": POSTERIOR_TEMPERATURE, **_rounded(vars(calibration_of(sampling)))}
            table.write_text(json.dumps(fitted) + "\n", encoding="utf-8")
    left_out = [evaluation.features for evaluation in evaluations]
    return {
        "coverage": coverages(evaluations),
        "modes": {"recalibrated": best_modes(left_out, evaluations), "as drawn": best_modes(sampling)},
    }


def _person(features: TrackFeatures) -> str:
    return features.track.case.clip.subject


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A track of a person who was left out of the fit, with its intervals."""

    features: TrackFeatures
    sharpness: float
    none: Array = field(repr=False)  # (T,) probability that no mode is right
    inside: NDArray[np.bool_] = field(repr=False)  # (T, levels, 27)
    radii: Array = field(repr=False)  # (T, levels, 27) metres
    turned: Array = field(repr=False)  # (levels,) share of angles that are inside


def evaluated(calibration: Calibration, features: TrackFeatures) -> Evaluation:
    """Return the evaluation of a track by a calibration."""
    none = np.array([calibration.recalibration(calibration.log(signs)).none for signs in features.evidence])
    radii, angles = radii_and_angles_inside(calibration, features)
    inside = features.track.off[:, None] <= radii
    return Evaluation(features, calibration.sharpness, none, inside, radii, angles.mean(axis=(0, 2)))


def coverages(tracks: Sequence[Evaluation]) -> dict[str, Any]:
    """Return the coverage of left-out people: overall, by group of joints, by view and by kind of motion."""

    def figures(some: Sequence[Evaluation], joints: Any = slice(1, None)) -> dict[str, Any]:
        weights = frame_weights([track.features for track in some])
        inside, radii = (
            weights @ np.concatenate([getattr(track, name)[:, :, joints].mean(axis=2) for track in some])
            for name in ("inside", "radii")
        )
        radius = np.concatenate([track.radii[:, 1, joints].mean(axis=1) for track in some])
        return {
            "tracks": len(some),
            "coverage": {f"{100 * level:.0f}": float(inside[k]) for k, level in enumerate(LEVELS)},
            "radius_mm": {f"{100 * level:.0f}": float(1e3 * radii[k]) for k, level in enumerate(LEVELS)},
            "median_radius_mm": float(1e3 * np.median(radius)),
        }

    def by(label: Callable[[Case], str]) -> dict[str, Any]:
        labels = [label(track.features.track.case) for track in tracks]
        groups = {name: [track for track, own in zip(tracks, labels, strict=True) if own == name] for name in labels}
        return {name: figures(groups[name]) for name in sorted(groups)}

    angles = np.mean([track.turned for track in tracks], axis=0).tolist()
    return {
        "overall": figures(tracks),
        "joints": {name: figures(tracks, members) for name, members in MEMBERS.items()},
        "views": by(lambda case: ", ".join(f"{view:03.0f}" for view in case.views)),
        "motions": by(lambda case: case.group),
        "translations": by(lambda case: case.translation),
        "people": by(lambda case: case.clip.subject),
        "angles": dict(zip(("50", "80", "95"), angles, strict=True)),
    }


def best_modes(tracks: Sequence[TrackFeatures], evaluations: Sequence[Evaluation] = ()) -> dict[str, Any]:
    """Return the calibration of the probability of the best mode.

    It is right where the truth is nearer to it than to any other mode, and as near as poses of one mode are; `several`
    are the frames that have others, `none` those in which no mode is right. Weights are recalibrated by `evaluations`,
    in the order of the tracks; without them they are as drawn.
    """
    powers = [evaluation.sharpness for evaluation in evaluations] or [1.0] * len(tracks)
    zeros = [np.zeros(len(features.track)) for features in tracks]
    none = np.concatenate([evaluation.none for evaluation in evaluations] or zeros)
    pairs = zip(tracks, powers, strict=True)
    probable = (1.0 - none) * [sharpened(modes, power)[0] for features, power in pairs for modes in features.modes]
    several = np.array([len(modes) > 1 for features in tracks for modes in features.modes])
    nearest = np.concatenate([features.nearest for features in tracks])
    far = nearest[:, 1] > APART
    right = (nearest[:, 0] == 0.0) & ~far
    second, swapped = (
        np.concatenate([getattr(features, name) for features in tracks]) for name in ("second", "swapped")
    )
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


def posterior_lines(figures: Mapping[str, Any]) -> Iterator[str]:
    """Yield the printed tables."""
    levels = [f"{100 * level:.0f}" for level in LEVELS]
    coverage = figures["coverage"]
    heads = ["of", "which", "tracks", *(f"{level} % hold %" for level in levels), "80 % radius mm", "median mm"]
    table = []
    for part in ("overall", "joints", "views", "motions", "translations", "people"):
        rows = {"": coverage[part]} if part == "overall" else coverage[part]
        for name, row in rows.items():
            shares = [f"{100 * row['coverage'][level]:.1f}" for level in levels]
            widths = [f"{row['radius_mm']['80']:.0f}", f"{row['median_radius_mm']:.0f}"]
            table.append([part, name, str(row["tracks"]), *shares, *widths])
    table.append(["angles", "", "", *(f"{100 * coverage['angles'][level]:.1f}" for level in levels), "", ""])
    yield from markdown(heads, table, 2)
    yield ""
    heads = ["best mode %", "right %", "error %", "several modes %", "error %", "none right %", "error %"]
    table = []
    shares = ["mean_probability", "right", "calibration_error", "several", "calibration_error_several"]
    shares += ["none", "calibration_error_none"]
    for name, row in figures["modes"].items():
        ranks = ["" if row[key] is None else f"{row[key]:.2f}" for key in ("auroc", "second_side_auroc")]
        table.append([name, str(row["tracks"]), *(f"{100 * row[key]:.1f}" for key in shares), *ranks])
    yield from markdown(["modes", "tracks", *heads, "AUROC", "second side AUROC"], table)


@click.command(cls=Command, help=__doc__)
@click.option("--again", metavar="FILE", help="Tracks that --out wrote, instead of tracking.")
@click.option("--out", metavar="FILE.npz", help="New file for the frames of all tracks.")
@click.option("--store", metavar="FILE.json", help="New file for the calibration, for exemplars to read.")
@WORKERS
def main(**arguments: Any) -> None:
    for line in posterior_lines(posterior(**arguments, progress=bar)):
        click.echo(line)


if __name__ == "__main__":
    main()
