"""Calibration of intervals and modes for people outside the library.

    python docs/studies/posterior.py --store calibration.json

One person at a time is left out of library and fit. The table has the shares of true
joints within their intervals, and the radii of 80 % intervals, for all tracks, groups
of joints, views and kinds of motion; a line below it is about modes. `--store` writes
the calibration in the form that `posefit_exemplars` reads.

The libraries crepes and MAPIE treat every error as an independent draw. Here the clip
is the exchangeable unit, because the errors of its frames are correlated.
"""

import json
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import click
import numpy as np
from numpy.typing import NDArray

from clips import CHANGES, METHOD, PAIRS, SIDES, Clip, Views, cell_fields, track_of
from clips import GROUPS as CLIPS
from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.errors import InputError
from posefit.files import new_file
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import ANGLES, JOINTS, Skeleton, joint_distances
from posefit.motion import recorded
from posefit.sweep.cell import cell_scene
from posefit.sweep.check import cell_of
from posefit.uncertainty.calibration import LEVELS, Recalibration
from posefit.uncertainty.intervals import angle_intervals, joint_intervals
from posefit.uncertainty.modes import APART, Posterior, modes_of, poses_apart
from posefit_exemplars.calibration import (
    PosteriorCalibration,
    evidence,
    none_features,
    stored_calibration,
)
from posefit_reproduce.jobs import each
from table import WORKERS, bar, markdown, percent

FRAMES = 50
DANCES = "dances"
EVERYDAY = "everyday"
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
MAX_CLIPS = 4  # per person


# masks and a body like those of footage
HARD = {
    name: value
    for name, value in CHANGES["all of these"].items()
    if name != "yaw_off_degrees"
}


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
    """Return clips with their groups: up to four per person, from different groups."""
    chosen: list[tuple[str, Clip]] = []
    clips_of = {group: (*clips, *MORE.get(group, ())) for group, clips in CLIPS.items()}
    for place in range(max(map(len, clips_of.values()))):
        for group, clips in clips_of.items():
            if place < len(clips):
                same_person = [
                    clip for _, clip in chosen if clip.subject == clips[place].subject
                ]
                if len(same_person) < MAX_CLIPS:
                    chosen.append((group, clips[place]))
    # a person's library is made once
    return sorted(chosen, key=lambda pair: pair[1].subject)


def planned_tracks() -> list[Case]:
    planned: list[Case] = []
    for k, (group, clip) in enumerate(pieces()):
        sides = [SIDES[(2 * k + turn) % len(SIDES)] for turn in (0, 1, 3)]
        planned += [Case(group, clip, side, "known") for side in sides]
        last = (PAIRS[k // 2 % len(PAIRS)], "known") if k % 2 else (sides[0], "aligned")
        planned.append(Case(group, clip, *last))
        planned.append(
            Case(
                group,
                clip,
                PAIRS[k // 2 % 2] if k % 2 else sides[1],
                "aligned",
                hard=True,
            )
        )
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
        return joint_distances(
            self.skeleton.joints(self.truth), self.skeleton.joints(self.reported)
        )

    def posterior(self, k: int) -> Posterior:
        """Return the posterior of a frame before recalibration."""
        return Posterior(
            self.drawn[k],
            np.zeros((len(self.weights[k]), 3)),
            self.weights[k],
            coherent=True,
        )


def sampled(case: Case) -> Samples:
    """Return the track of a clip by a library without its person."""
    cell = cell_of(case.spec)
    track = track_of(cell, cell_scene(cell))
    assert track.truth is not None
    posteriors = [frame.posterior for frame in track.frames]
    most = max(len(frame) for frame in posteriors if frame is not None)
    drawn = np.zeros((len(posteriors), most, track.truth.poses.shape[1]))
    weights = np.zeros((len(posteriors), most))
    for k, frame in enumerate(posteriors):
        assert frame is not None
        drawn[k, : len(frame)] = frame.poses
        weights[k, : len(frame)] = frame.weights
    costs = np.array([frame.cost for frame in track.frames])
    return Samples(case, track.truth.poses, track.motion.poses, drawn, weights, costs)


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
MEMBERS = {
    name: np.array([JOINTS.index(joint) for joint in joints])
    for name, joints in GROUPS.items()
}
# some angles have no freedom, and thus no error
ALONE = {str(angle): np.array([angle]) for angle in range(ANGLES)}
SPREADS = np.geomspace(0.05, 2.0, 12)  # in units of the expected error
EVERY = 5  # only every fifth frame is used for factors: neighbours are similar
SHARPNESSES = np.geomspace(0.05, 1.0, 24)
TINY = 1e-12
RIDGE = 1e-3
STEPS = 30  # iterations of Newton's method


@dataclass(frozen=True, eq=False)
class TrackFeatures:
    """The features of a track's frames that do not depend on a fit."""

    track: Samples
    evidence: Array = field(repr=False)  # (T, 4)
    error: Array = field(repr=False)  # (T,) metres, the mean over joints
    # weights of each frame's modes, the heaviest first
    modes: list[Array] = field(repr=False)
    # (T, 2) the mode nearest to the truth, and its distance, metres
    nearest: Array = field(repr=False)

    @classmethod
    def of(cls, track: Samples) -> "TrackFeatures":
        """Return the features of a track."""
        skeleton = track.skeleton
        cameras = len(track.case.views)
        posteriors = [track.posterior(k) for k in range(len(track))]
        frames = list(zip(posteriors, track.reported, track.costs, strict=True))
        signs = np.array(
            [
                evidence(skeleton, posterior, pose, cost, cameras)
                for posterior, pose, cost in frames
            ]
        )
        modes = []
        nearest = []
        for posterior, truth in zip(posteriors, track.truth, strict=True):
            of_frame = modes_of(skeleton, posterior)
            distances = poses_apart(
                skeleton, np.array([mode.pose for mode in of_frame]), truth[None]
            )[:, 0]
            modes.append(np.array([mode.weight for mode in of_frame]))
            nearest.append((distances.argmin(), distances.min()))
        return cls(
            track, signs, track.off[:, 1:].mean(axis=1), modes, np.array(nearest)
        )


def calibration_of(tracks: Sequence[TrackFeatures]) -> PosteriorCalibration:
    """Return the calibration of the intervals and the weights of modes of tracks."""
    calibration = _expected_error(tracks)
    joints, angles = _spreads(calibration, tracks)
    calibration = replace(calibration, joint_spreads=joints, angle_spreads=angles)
    joint_factors, angle_factors = _factors(calibration, tracks)
    calibration = replace(
        calibration, joint_factors=joint_factors, angle_factors=angle_factors
    )
    return replace(
        calibration, sharpness=_sharpness(tracks), none=_none(calibration, tracks)
    )


def sharpened(weights: Array, sharpness: float) -> Array:
    """Return the weights (n,) of modes after recalibration."""
    powers = weights**sharpness
    return np.asarray(powers / powers.sum())


def _sharpness(tracks: Sequence[TrackFeatures]) -> float:
    """Return the power of modes' weights that makes the nearest modes likeliest.

    The nearest mode of a frame is the one nearest to the truth.
    """
    weights = frame_weights(tracks)
    likelihoods = []
    pairs = [
        (modes, int(row))
        for track in tracks
        for modes, row in zip(track.modes, track.nearest[:, 0], strict=True)
    ]
    for sharpness in SHARPNESSES:
        likelihoods.append(
            weights @ [np.log(sharpened(modes, sharpness)[row]) for modes, row in pairs]
        )
    return float(SHARPNESSES[int(np.argmax(likelihoods))])


def _rounded(values: Any) -> Any:
    """Return values ready for JSON, numbers with four digits."""
    if isinstance(values, dict):
        return {name: _rounded(value) for name, value in values.items()}
    if np.ndim(values):
        return [_rounded(value) for value in values]
    return float(f"{float(values):.4g}")


def _none(calibration: PosteriorCalibration, tracks: Sequence[TrackFeatures]) -> Array:
    """Return the coefficients (3,) of the log-odds that no mode is right.

    No mode is right if the truth is far from the nearest one.
    """
    signs = np.array(
        [
            none_features(calibration.log_error(signs))
            for track in tracks
            for signs in track.evidence
        ]
    )
    far = np.concatenate([track.nearest[:, 1] > APART for track in tracks])
    return logistic(signs, far, frame_weights(tracks))


def frame_weights(tracks: Sequence[TrackFeatures]) -> Array:
    """Return the weights of all frames, which sum to 1.

    Every clip has the same weight, and so has every frame of a clip.
    """
    frames: dict[Clip, int] = {}
    for features in tracks:
        clip = features.track.case.clip
        frames[clip] = frames.get(clip, 0) + len(features.track)
    weights = [
        np.full(len(features.track), 1.0 / frames[features.track.case.clip])
        for features in tracks
    ]
    return np.asarray(np.concatenate(weights) / len(frames))


def _expected_error(tracks: Sequence[TrackFeatures]) -> PosteriorCalibration:
    """Return a fit of the error's logarithm to evidence, by weighted least squares."""
    signs, errors = (
        np.concatenate([getattr(track, name) for track in tracks])
        for name in ("evidence", "error")
    )
    weighted = signs.T * frame_weights(tracks)
    slopes = np.linalg.solve(
        weighted @ signs + RIDGE * np.eye(signs.shape[1]), weighted @ np.log(errors)
    )
    low, high = np.quantile(signs @ slopes, [0.005, 0.995])
    plain = Recalibration()
    corrections = (
        plain.joint_spreads,
        plain.angle_spreads,
        plain.joint_factors,
        plain.angle_factors,
    )
    return PosteriorCalibration(
        # the tracks were sampled with the present temperature
        stored_calibration().temperature,
        slopes,
        (float(low), float(high)),
        *corrections,
        1.0,
        np.zeros(3),
    )


def _spreads(
    calibration: PosteriorCalibration, tracks: Sequence[TrackFeatures]
) -> tuple[Array, Array]:
    """Return the likeliest spreads of joints (27,) and angles (66,).

    They are in units of the expected error.
    """
    joints = np.zeros((len(SPREADS), len(JOINTS)))
    angles = np.zeros((len(SPREADS), ANGLES))
    weights = frame_weights(tracks)
    begin = 0
    for features in tracks:
        track = features.track
        rows = np.arange(0, len(features.track), EVERY)
        row_weights = weights[begin + rows]
        begin += len(track)
        errors = np.exp(
            [calibration.log_error(signs) for signs in features.evidence[rows]]
        )[:, None]
        skeleton = track.skeleton
        true = skeleton.joints(track.truth[rows])
        off = np.array(
            [
                np.linalg.norm(skeleton.joints(track.drawn[k]) - true[i], axis=2)
                for i, k in enumerate(rows)
            ]
        )
        turned = np.abs(wrapped(track.drawn[rows] - track.truth[rows, None]))
        for sums, distances, dimensions in ((joints, off, 3), (angles, turned, 1)):
            for t, spread in enumerate(SPREADS):
                wide = spread * errors
                logs = -0.5 * (distances / wide[:, None]) ** 2
                top = logs.max(axis=1)
                likelihoods = np.einsum(
                    "tk,tkn->tn", track.weights[rows], np.exp(logs - top[:, None])
                )
                sums[t] += row_weights @ (
                    np.log(likelihoods) + top - dimensions * np.log(wide)
                )
    best = SPREADS[joints.argmax(axis=0)]
    best[0] = 0.0  # all roots are at one point
    return best, SPREADS[angles.argmax(axis=0)]


def _factors(
    calibration: PosteriorCalibration, tracks: Sequence[TrackFeatures]
) -> tuple[Array, Array]:
    """Return the conformal factors of joints (levels, 27) and angles (levels, 66).

    Each group of joints has common factors.
    """
    clips: dict[object, list[tuple[Array, Array]]] = {}
    for features in tracks:
        clips.setdefault(features.track.case.clip, []).append(
            scores(calibration, features, EVERY)
        )
    by_clip = [
        [np.concatenate(parts) for parts in zip(*some, strict=True)]
        for some in clips.values()
    ]
    factors = [np.ones((len(LEVELS), count)) for count in (len(JOINTS), ANGLES)]
    for kind, groups in enumerate((MEMBERS, ALONE)):
        for members in groups.values():
            for level, share in enumerate(LEVELS):
                clip_scores = [
                    clip[kind][:, level, members].ravel() for clip in by_clip
                ]
                factors[kind][level, members] = conformal_factor(clip_scores, share)
    return factors[0], factors[1]


def conformal_factor(scores: Sequence[Array], level: float) -> float:
    """Return the factor at which radii hold a share `level` of a new clip's errors.

    `scores` has an array of distances over radii for each of n clips. Every clip counts
    the same, however long it is. The new clip counts as infinitely far off. The factor
    is the smallest at which the mean share within it, over n + 1 clips, is at least the
    level. Raises ValueError if there are too few clips. R. Dunn, L. Wasserman, A.
    Ramdas, Distribution-free prediction sets for two-layer hierarchical models, 2023:
    the pooled CDF.
    """
    if not scores or any(not len(clip) for clip in scores):
        raise InputError(
            "scores must be of one clip or more, each with one score or more"
        )
    if not 0.0 < level < 1.0:
        raise InputError(f"level must be between 0 and 1, got {level}")
    clips = len(scores)
    if level > clips / (clips + 1):
        needed = int(np.ceil(level / (1.0 - level) - 1e-9))
        raise InputError(
            f"clips must be at least {needed} for a level of {level}, got {clips}"
        )
    values = np.concatenate([np.asarray(clip, dtype=np.float64) for clip in scores])
    weights = np.concatenate(
        [np.full(len(clip), 1.0 / (len(clip) * (clips + 1))) for clip in scores]
    )
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(weights[order])  # the pooled CDF
    return float(
        values[order][
            min(int(np.searchsorted(reached, level - 1e-12)), len(values) - 1)
        ]
    )


def scores(
    calibration: PosteriorCalibration, features: TrackFeatures, every: int = 1
) -> tuple[Array, Array]:
    """Return the errors of joints (T, levels, 27) and angles (T, levels, 66).

    They are in units of the radii of their intervals.
    """
    track = features.track
    turned = np.abs(wrapped(track.truth - track.reported))[::every, None]
    radii, halves = radii_of(calibration, features, every)
    return track.off[::every, None] / np.maximum(radii, TINY), turned / np.maximum(
        halves, TINY
    )


def radii_of(
    calibration: PosteriorCalibration, features: TrackFeatures, every: int = 1
) -> tuple[Array, Array]:
    """Return joints' radii (T, levels, 27), angles' half intervals (T, levels, 66)."""
    joints = []
    angles = []
    track = features.track
    for k in range(0, len(track), every):
        recalibration = calibration.recalibration(
            calibration.log_error(features.evidence[k])
        )
        posterior = replace(track.posterior(k), recalibration=recalibration)
        joints.append(joint_intervals(track.skeleton, posterior, track.reported[k]))
        angles.append(angle_intervals(posterior, track.reported[k]))
    return np.array(joints), np.array(angles)


def logistic(design: Array, truth: NDArray[np.bool_], weights: Array) -> Array:
    """Return the coefficients (d,) of the log-odds of a truth (n,).

    Newton's method with a small ridge.
    """
    coefficients = np.zeros(design.shape[1])
    for _ in range(STEPS):
        probable = 1.0 / (1.0 + np.exp(-np.clip(design @ coefficients, -30.0, 30.0)))
        slope = design.T @ (weights * (truth - probable)) - RIDGE * coefficients
        bend = (
            design.T * (weights * probable * (1.0 - probable))
        ) @ design + RIDGE * np.eye(len(coefficients))
        coefficients = coefficients + np.linalg.solve(bend, slope)
    return np.asarray(coefficients)


MIN_PEOPLE = 3  # one of them is left out at a time


def judged(tracks: Sequence[TrackFeatures]) -> list["Evaluation"]:
    """Return the evaluation of each track by a calibration fitted to other people."""
    people = list(dict.fromkeys(map(_person, tracks)))
    if len(people) < MIN_PEOPLE:
        raise InputError(
            f"tracks must be of {MIN_PEOPLE} people or more, got {len(people)}"
        )
    evaluations = []
    for person in people:
        calibration = calibration_of(
            [features for features in tracks if _person(features) != person]
        )
        evaluations += [
            evaluated(calibration, features)
            for features in tracks
            if _person(features) == person
        ]
    return evaluations


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


def evaluated(calibration: PosteriorCalibration, features: TrackFeatures) -> Evaluation:
    none = np.array(
        [
            calibration.recalibration(calibration.log_error(signs)).none
            for signs in features.evidence
        ]
    )
    track = features.track
    radii, halves = radii_of(calibration, features)
    inside = track.off[:, None] <= radii
    angles = np.abs(wrapped(track.truth - track.reported))[:, None] <= halves
    return Evaluation(
        features, calibration.sharpness, none, inside, radii, angles.mean(axis=(0, 2))
    )


def coverage(
    name: str, tracks: Sequence[Evaluation], joints: Any = slice(1, None)
) -> list[str]:
    """Return the line of some joints: shares within intervals, and 80 % radii."""
    weights = frame_weights([track.features for track in tracks])
    inside, radii = (
        np.concatenate(
            [getattr(track, kind)[:, :, joints].mean(axis=2) for track in tracks]
        )
        for kind in ("inside", "radii")
    )
    held = weights @ inside
    widths = (1e3 * weights @ radii[:, 1], 1e3 * np.median(radii[:, 1]))
    return [name, *map(percent, held.tolist()), *(f"{width:.0f}" for width in widths)]


def coverage_lines(tracks: Sequence[Evaluation]) -> Iterator[str]:
    """Yield the table of left-out people.

    It has lines for all, for groups of joints, for views and for kinds of motion.
    """
    cells = [
        coverage("all", tracks),
        *(coverage(name, tracks, members) for name, members in MEMBERS.items()),
    ]
    for label in (
        lambda case: ", ".join(f"{view:g}" for view in case.views),
        lambda case: case.group,
    ):
        labels = [label(track.features.track.case) for track in tracks]
        for name in sorted(set(labels)):
            cells.append(
                coverage(
                    name,
                    [
                        track
                        for track, own in zip(tracks, labels, strict=True)
                        if own == name
                    ],
                )
            )
    angles = np.mean([track.turned for track in tracks], axis=0).tolist()
    cells.append(["angles instead of joints", *map(percent, angles), "", ""])
    heads = [
        "joints of",
        *(f"{100 * level:.0f} % hold %" for level in LEVELS),
        "80 % radius mm",
        "median mm",
    ]
    yield from markdown(heads, cells)


def modes_line(evaluations: Sequence[Evaluation]) -> str:
    """Return how often the best mode is right, its claimed probability, and no mode's.

    It is right if the truth is nearer to it than to any other mode, and as near as
    poses of one mode are.
    """
    none = np.concatenate([evaluation.none for evaluation in evaluations])
    best = [
        sharpened(modes, track.sharpness)[0]
        for track in evaluations
        for modes in track.features.modes
    ]
    nearest = np.concatenate(
        [evaluation.features.nearest for evaluation in evaluations]
    )
    far = nearest[:, 1] > APART
    flags = (nearest[:, 0] == 0.0) & ~far, (1.0 - none) * best, far
    right, claimed, never = (percent(float(values.mean())) for values in flags)
    return (
        f"best mode: right in {right} % of the frames, claimed in {claimed} %; "
        f"none is right in {never} %"
    )


@click.command(cls=Command, help=__doc__)
@click.option(
    "--store",
    metavar="FILE.json",
    help="New file for the calibration, which exemplars can read.",
)
@WORKERS
def main(store: str | None, workers: int | None) -> None:
    with new_file(store) if store else nullcontext() as file:
        jobs = {case: partial(sampled, case) for case in planned_tracks()}
        tracks = [
            TrackFeatures.of(track) for track in each(jobs, workers, bar).values()
        ]
        evaluations = judged(tracks)
        click.echo(
            "\n".join([*coverage_lines(evaluations), "", modes_line(evaluations)])
        )
        if file is not None:
            fitted = _rounded(vars(calibration_of(tracks)))
            file.write_text(json.dumps(fitted) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
