"""How well the tracker detects lost frames, and exchanged left and right.

    python docs/studies/lost.py --rows rows.jsonl --store lost_model.json

The study tracks recorded clips of many motions from all sides, with clean and with
realistic masks. It fits the logistic models of `posefit_exemplars`, and evaluates them
on people to whom they were not fitted. The table has a line for all tracks, for each
kind of motion and for each number of cameras: how many frames are lost or exchanged,
how well the models rank them (AUROC), and how many they flag rightly and wrongly. Below
it are the error of the half of the frames least likely lost, and the false alarms that
it takes to find most of the lost ones. `--store` writes the fitted models in the form
that `posefit_exemplars` reads.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import click
import cv2
import numpy as np
from numpy.typing import NDArray

from clips import (
    CHANGES,
    FOUR,
    GROUPS,
    PAIRS,
    SIDES,
    WALKS,
    Clip,
    Views,
    cell_fields,
    track_of,
)
from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.errors import InputError
from posefit.evaluation.errors import LOST
from posefit.files import new_file
from posefit.fitting.metrics import LOST_MM
from posefit.fitting.tracker import Observation
from posefit.silhouette.corruption import shadow, wandering
from posefit.silhouette.mask import Mask, Silhouette
from posefit.sweep.cell import TrackCell, cell_scene
from posefit.sweep.check import cell_of
from posefit.uncertainty.modes import mirrored_gain
from posefit_exemplars.lost_model import (
    NAMES,
    EvidenceMeans,
    FailureClassifier,
    LogisticModel,
)
from table import WORKERS, markdown, measured, percent

RNG_STREAM = 2026  # part of every seed
LASTING = 10  # frames of a lasting error, a third of a second
# standard deviation of a track's common border offset, as a share of the person's
# height
RIM = 0.006
EDGE = 0.004  # and of the border's fluctuation in each frame
SMOOTH = 0.02  # correlation length of the fluctuation
# mean numbers, Poisson distributed
BITES = 0.8
BULGES = 0.8
# radii of bites, bulges and missing ends, as shares of the person's height
SIZES = (0.02, 0.06)
# probabilities of a missing end and of a shadow
MISSING = 0.3
SHADOW = 0.3
SHADOWS = (0.1, 0.25)  # strengths of shadows


def noisy_mask(
    mask: Mask, rim: float, lasting: np.random.Generator, fresh: np.random.Generator
) -> Mask:
    """Return a mask (height, width) with the errors of a real one.

    If little of a mask would be left, it is returned unchanged. Lasting errors are
    drawn from `lasting`, in the same order for every mask; the others from `fresh`.
    """
    if not mask.any():
        return mask
    rows, columns = np.nonzero(mask)
    top = int(rows.min())
    tall = int(np.ptp(rows)) + 1
    left = int(columns.min())
    wide = int(np.ptp(columns)) + 1
    noisy = mask.copy()
    if lasting.random() < SHADOW:
        noisy = shadow(noisy, lasting.uniform(*SHADOWS), lasting)
    for count, value in (
        (lasting.poisson(BULGES), True),
        (lasting.poisson(BITES), False),
    ):
        for across, down, size in lasting.random((count, 3)):
            near = np.hypot(
                columns - left - across * wide, rows - top - down * tall
            ).argmin()
            _disc(noisy, columns[near], rows[near], _radius(size, tall), value)
    gone, end, size = lasting.random(3)
    if gone < MISSING:
        ends = (columns.argmin(), columns.argmax(), rows.argmax())
        where = ends[int(end * len(ends))]
        _disc(noisy, columns[where], rows[where], _radius(size, tall), False)
    noisy = wandering(noisy, rim * tall, EDGE * tall, SMOOTH * tall, fresh)
    return noisy if noisy.sum() > 0.5 * mask.sum() else mask


def _radius(share: float, tall: int) -> int:
    return max(1, round((SIZES[0] + share * (SIZES[1] - SIZES[0])) * tall))


def _disc(mask: Mask, x: int, y: int, radius: int, value: bool) -> None:
    drawn = np.zeros(mask.shape, dtype=np.uint8)
    cv2.circle(drawn, (int(x), int(y)), radius, 1, -1)
    mask[drawn.astype(bool)] = value


def with_mask_noise(
    observations: Sequence[Observation], seed: Sequence[int]
) -> list[Observation]:
    """Return observations with errors in the masks.

    The errors are independent for each camera, and reproducible.
    """

    def noisy(mask: Mask, k: int, camera: int) -> Silhouette:
        whole = np.random.default_rng([RNG_STREAM, *seed, camera])
        begins = int(whole.integers(LASTING))
        lasting = np.random.default_rng(
            [RNG_STREAM, *seed, camera, 1, (k + begins) // LASTING]
        )
        fresh = np.random.default_rng([RNG_STREAM, *seed, camera, 2, k])
        return Silhouette.of(
            noisy_mask(mask, RIM * whole.standard_normal(), lasting, fresh)
        )

    return [
        replace(
            seen,
            silhouettes=[
                noisy(each.mask, k, camera)
                for camera, each in enumerate(seen.silhouettes)
            ],
        )
        for k, seen in enumerate(observations)
    ]


CLEAN = "as they are"
MASKS = "as masks are"
ALL_CHANGES = {
    name: value
    for name, value in CHANGES["all of these"].items()
    if name != "corruption"
}
CONDITIONS: Mapping[str, Mapping[str, Any]] = {CLEAN: {}, **CHANGES, MASKS: ALL_CHANGES}
VIEWS: tuple[Views, ...] = (*SIDES, *PAIRS)
FRAMES = 48  # most frames of a clip
ON_THE_SPOT: dict[str, tuple[Clip, ...]] = {
    "gestures": (
        Clip("29_05", FRAMES, 1, "moves their arms"),
        Clip("14_24", FRAMES, 2, "moves their arms"),
        Clip("02_10", FRAMES, 4, "washes himself"),
        Clip("29_20", FRAMES, 0, "moves their arms and turns"),
        Clip("14_10", FRAMES, 1, "does something with their hands"),
        Clip("135_02", FRAMES, 2, "a form of a martial art, on the spot"),
        Clip("02_07", FRAMES, 4, "swings something"),
        Clip("49_20", FRAMES, 1, "lifts their arms"),
    ),
    "stands": (
        Clip("49_15", 41, 1, "stands"),
        Clip("29_02", FRAMES, 3, "stands"),
        Clip("14_05", FRAMES, 2, "stands"),
        Clip("05_12", FRAMES, 2, "stands"),
        Clip("135_06", FRAMES, 0, "stands"),
        Clip("29_24", FRAMES, 4, "stands"),
    ),
}
EVERY = {**GROUPS, **ON_THE_SPOT}
COMMON = (WALKS, *ON_THE_SPOT)  # groups like most footage


class Case(NamedTuple):
    """One track: its clip, views and condition."""

    group: str
    clip: Clip
    views: Views
    condition: str

    @property
    def spec(self) -> dict[str, Any]:
        """The fields of the cell, without the noise of masks."""
        return cell_fields(self.clip, self.views, FRAMES, **CONDITIONS[self.condition])


def cases() -> list[Case]:
    """Return the tracks. A person's tracks are adjacent, as they share a library."""
    clips = [(group, clip) for group, some in EVERY.items() for clip in some]
    conditions = [name for name in CONDITIONS if name != MASKS]
    tracks = []
    for k, (group, clip) in enumerate(clips):
        tracks.append(
            Case(
                group,
                clip,
                VIEWS[k % len(VIEWS)],
                conditions[(3 * k + k // len(VIEWS)) % len(conditions)],
            )
        )
        tracks.append(Case(group, clip, VIEWS[(k + 2) % len(VIEWS)], MASKS))
        if group in COMMON:
            tracks.append(Case(group, clip, SIDES[(k + 4) % len(SIDES)], MASKS))
            tracks.append(Case(group, clip, FOUR, MASKS))
    return sorted(set(tracks), key=lambda track: (track.clip.subject, track))


Row = Mapping[str, Any]
Flags = NDArray[np.bool_]

# millimetres by which a mirrored pose is nearer to the truth; below, the sides hardly
# differ
EXCHANGED = 10.0
STRENGTH = 0.03  # variance of the normal prior of weights
# accepted share of exchanged sides among frames with known sides, within `BOUNDS`
SWAPPED = 0.02
BOUNDS = (0.01, 0.5)  # range of the probability from which sides are unknown
DIGITS = 6
# Features of each model: the evidence of a frame, and its means
LOST_SIGNS = ("cost", "cost, lately", "farthest", "farthest, lately", "views")
SIDES_SIGNS = (
    *(
        f"{name}{mean}"
        for name in ("cost", "reflected", "mirrored", "second")
        for mean in ("", ", in general")
    ),
    *("farthest, in general", "across", "views"),
)


class Predictions(NamedTuple):
    """The predictions for the frames of a row."""

    lost: Array  # (T,) probability that a frame is lost
    exchanged: Array  # (T,) probability that a frame's sides are exchanged
    unknown: Flags  # (T,)


def features(row: Row) -> Array:
    """Return the features (T, F) of a track's frames, as in the tracker."""
    memory = EvidenceMeans(row["fps"])
    return np.array([memory.features(values) for values in row["evidence"]])


def lost_frames(rows: Sequence[Row]) -> Flags:
    """Return which frames of all rows are lost."""
    return np.concatenate([np.array(row["mpjpe_mm"]) > LOST_MM for row in rows])


def swapped_frames(rows: Sequence[Row]) -> Flags:
    """Return the frames of all rows in which left and right are exchanged."""
    return np.concatenate(
        [np.array(row["mirrored_gain_mm"]) > EXCHANGED for row in rows]
    )


def fit(rows: Sequence[Row]) -> dict[str, Any]:
    """Return the models fitted to rows, ready for JSON.

    Raises ValueError if the rows are of one person.
    """
    return _fitted(rows, [features(row) for row in rows])


def judge(rows: Sequence[Row]) -> list[Predictions]:
    """Return the predictions for each row by models fitted to other people.

    Raises ValueError if there are fewer than three people: the fit, too, leaves out
    each of the other people once.
    """
    if len(people := dict.fromkeys(row["subject"] for row in rows)) < 3:
        raise InputError(
            f"rows must be of three people or more, got {', '.join(people)}"
        )
    known = [features(row) for row in rows]
    predictions: dict[int, Predictions] = {}
    for own, others in _left_out(rows):
        models = FailureClassifier.from_dict(
            _fitted([rows[k] for k in others], [known[k] for k in others])
        )
        for k in own:
            exchanged, lost = (
                np.array([model.probability(values) for values in known[k]])
                for model in (models.sides, models.lost)
            )
            predictions[k] = Predictions(lost, exchanged, exchanged >= models.unknown)
    return [predictions[k] for k in range(len(rows))]


def _left_out(rows: Sequence[Row]) -> list[tuple[list[int], list[int]]]:
    """Return the rows of each person, and the rows of the others."""
    people = list(dict.fromkeys(row["subject"] for row in rows))
    each = [
        [k for k, row in enumerate(rows) if row["subject"] == person]
        for person in people
    ]
    return [(own, [k for k in range(len(rows)) if k not in own]) for own in each]


def _fitted(rows: Sequence[Row], known: Sequence[Array]) -> dict[str, Any]:
    """Return both models, and the probability from which sides are unknown.

    That probability comes from models without each person in turn.
    """
    lost = _logistic("lost", np.concatenate(known), lost_frames(rows), LOST_SIGNS)
    sides = _logistic(
        "swapped", np.concatenate(known), swapped_frames(rows), SIDES_SIGNS
    )
    exchanged = list[Array]()
    swapped = list[Flags]()
    for own, others in _left_out(rows):
        truth = swapped_frames([rows[k] for k in others])
        fitted = _logistic(
            "swapped", np.concatenate([known[k] for k in others]), truth, SIDES_SIGNS
        )
        model = LogisticModel.from_dict(fitted)
        exchanged.append(
            np.array([model.probability(values) for k in own for values in known[k]])
        )
        swapped.append(swapped_frames([rows[k] for k in own]))
    return {
        "lost": lost,
        "sides": sides,
        "unknown": _unknown(np.concatenate(exchanged), np.concatenate(swapped)),
    }


def _unknown(exchanged: Array, swapped: Flags) -> float:
    """Return the probability of exchanged sides from which they are unknown.

    About a share `SWAPPED` of the other frames is exchanged.
    """
    order = np.argsort(exchanged, kind="stable")
    shares = np.cumsum(swapped[order]) / np.arange(1, len(order) + 1)
    few = np.flatnonzero(shares <= SWAPPED)
    return round(
        float(np.clip(exchanged[order][few[-1]] if len(few) else 0.0, *BOUNDS)), DIGITS
    )


def _logistic(
    name: str, known: Array, truth: Flags, signs: Sequence[str]
) -> dict[str, Any]:
    """Return a logistic model of some of the features (n, F), ready for JSON."""
    from sklearn.linear_model import LogisticRegression

    if truth.all() or not truth.any():
        raise InputError(
            f"some frames must be {name} and some not, "
            f"got {int(truth.sum())} of {len(truth)}"
        )
    mean = known.mean(axis=0)
    spread = known.std(axis=0)
    used = [k for k, sign in enumerate(NAMES) if sign in signs and spread[k] > 1e-9]
    model = LogisticRegression(C=STRENGTH, max_iter=2000)
    model.fit((known[:, used] - mean[used]) / spread[used], truth)
    weights = model.coef_[0] / spread[used]
    bias = float(model.intercept_[0] - weights @ mean[used])
    named = {
        NAMES[row]: round(float(weight), DIGITS)
        for row, weight in zip(used, weights, strict=True)
    }
    return {"weights": named, "bias": round(bias, DIGITS)}


RECALL = 0.95  # recall of lost frames at which false alarms are counted


def row_of(cell: TrackCell, track: Case) -> dict[str, Any]:
    """Return the row of a track: errors of its frames, and the tracker's evidence."""
    scene = cell_scene(cell)
    if track.condition == MASKS:
        seed = [track.clip.instance, *track.clip.name.encode()]
        scene = replace(scene, observations=with_mask_noise(scene.observations, seed))
    result = track_of(cell, scene)
    assert result.truth is not None
    gains = 1e3 * mirrored_gain(result.truth.joints, result.motion.joints)
    evidence = [frame.details["evidence"] for frame in result.frames]
    return {
        "subject": track.clip.subject,
        "group": track.group,
        "clip": track.clip.name,
        "views_degrees": list(track.views),
        "condition": track.condition,
        "fps": scene.fps,
        "mpjpe_mm": result.table["mpjpe_mm"].round(2).tolist(),
        "mirrored_gain_mm": [round(gain, 1) for gain in gains.tolist()],
        "evidence": [
            {name: round(value, DIGITS) for name, value in values.items()}
            for values in evidence
        ],
    }


def key_of(row: Row) -> tuple[Any, ...]:
    return row["group"], row["clip"], tuple(row["views_degrees"]), row["condition"]


def cameras(row: Row) -> str:
    """Return the number of cameras of a row, in words."""
    count = len(row["views_degrees"])
    return f"{count} camera{'s' * (count > 1)}"


def line_of(rows: Sequence[Row], predictions: Sequence[Predictions]) -> Iterator[str]:
    """Yield how well exchanged sides and lost frames of rows are detected."""
    swapped = swapped_frames(rows)
    lost = lost_frames(rows)
    lost_by, exchanged, unknown = (
        np.concatenate(parts) for parts in zip(*predictions, strict=True)
    )
    yield from (percent(swapped.mean()), auroc(exchanged, swapped))
    yield from (percent(unknown.mean()), share(swapped, ~unknown))
    yield from (percent(lost.mean()), auroc(lost_by, lost))
    yield from (share(lost_by >= LOST, lost), share(lost_by >= LOST, ~lost))


def share(flags: Flags, of: Flags) -> str:
    """Return the percentage of the frames `of` that have a flag, or a dash."""
    return percent(float(flags[of].mean()) if of.any() else None)


def auroc(scores: Array, positive: Flags) -> str:
    """Return how often a positive scores higher than a negative, or a dash.

    Ties count half.
    """
    from sklearn.metrics import roc_auc_score

    if positive.all() or not positive.any():
        return "-"
    return f"{roc_auc_score(positive, scores):.3f}"


def lost_lines(
    rows: Sequence[Row], predictions: Sequence[Predictions]
) -> Iterator[str]:
    """Yield the printed table, and the error of the frames least likely lost."""
    from sklearn.metrics import roc_curve

    every = list(zip(rows, predictions, strict=True))
    parts = {"all": every}
    for kind in (lambda row: row["group"], cameras):
        for name in dict.fromkeys(map(kind, rows)):
            parts[name] = [
                (row, predicted) for row, predicted in every if kind(row) == name
            ]
    heads = ["swapped %", "AUROC", "unknown %", "swapped of known ones %"]
    heads += ["lost %", "AUROC", "called lost: recall %", "false alarms %"]
    yield from markdown(
        ["", *heads],
        [[name, *line_of(*zip(*part, strict=True))] for name, part in parts.items()],
    )
    errors = np.concatenate([row["mpjpe_mm"] for row in rows])
    lost = lost_frames(rows)
    probable = np.concatenate([prediction.lost for prediction in predictions])
    alarms, recalls, _ = roc_curve(lost, probable, drop_intermediate=False)
    half = errors[np.argsort(probable, kind="stable")[: len(errors) // 2]]
    needed = percent(alarms[np.searchsorted(recalls, RECALL)])
    recall = percent(RECALL, 0)
    yield f"\nto recall {recall} % of the lost frames takes {needed} % false alarms"
    yield (
        f"the least doubted half of the frames is {half.mean():.0f} mm off, "
        f"all are {errors.mean():.0f}"
    )


@click.command(cls=Command, help=__doc__)
@click.option(
    "--rows",
    metavar="FILE",
    help="File with one row a line. An earlier run there is continued.",
)
@click.option(
    "--store",
    metavar="FILE.json",
    help="New file for the fitted models, which exemplars can read.",
)
@WORKERS
def main(rows: str | None, store: str | None, workers: int | None) -> None:
    with new_file(store) if store else nullcontext() as stored:
        # all cells are made, and so checked, before any of them runs
        cells = [(track, cell_of(track.spec)) for track in cases()]
        jobs = {
            (track.group, track.clip.name, *track[2:]): partial(row_of, cell, track)
            for track, cell in cells
        }
        tracks = [*measured(jobs, rows, key_of, workers).values()]
        for line in lost_lines(tracks, judge(tracks)):
            click.echo(line)
        if stored is not None:
            stored.write_text(
                json.dumps(fit(tracks), indent=1) + "\n", encoding="utf-8"
            )


if __name__ == "__main__":
    main()
