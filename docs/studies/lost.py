"""Which frames are lost, in which are left and right swapped, and does the tracker know?

Follows recorded clips of many motions from all sides, with clean and with realistic masks, fits the logistic models of
`posefit_exemplars`, and judges them on people they were not fitted to.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple, TypeVar

import click
import cv2
import numpy as np
from numpy.typing import NDArray

from people import CHANGES, GROUPS, PAIRS, SIDES, TOLD, WALKS, Piece, Views
from posefit.arrays import Array
from posefit.errors import InputError
from posefit.files import new_file
from posefit.fitting.metrics import LOST_MM
from posefit.fitting.tracker import Observation
from posefit.footage.training import training_clips, training_motions
from posefit.reading import parsed_json, read_text
from posefit.silhouette.corruption import shadow, wandering
from posefit.silhouette.mask import Mask, Silhouette
from posefit.sweep.cell import TrackCell, cell_scene
from posefit.sweep.check import cell_of
from posefit.tracking.evaluation import LOST
from posefit.tracking.options import TrackOptions
from posefit.tracking.pipeline import track_scene
from posefit.uncertainty.calibration import calibration_error
from posefit_exemplars.lost_model import NAMES, EvidenceMeans, FailureClassifier, LogisticModel
from posefit_reproduce.jobs import Progress, each
from scores import auroc, false_alarms, kept_errors
from table import WORKERS, bar, markdown, percent

SALT = 2026  # part of every seed
HELD = 10  # frames for which the same is wrong: a third of a second, as all clips of the experiment have 30 a second
RIM = 0.006  # of the person's height: the standard deviation of how far all borders of a track are outside
EDGE = 0.004  # and of how far a border wanders besides, in each frame anew
SMOOTH = 0.02  # over which length it does
BITES, BULGES = 0.8, 0.8  # how many there are, the mean of a Poisson distribution
SIZES = (0.02, 0.06)  # radii of these and of missing ends, as shares of the person's height
MISSING, SHADOW = 0.3, 0.3  # how likely an end is missing, and a shadow there
SHADOWS = (0.1, 0.25)  # strengths of shadows


def worn(mask: Mask, rim: float, held: np.random.Generator, fresh: np.random.Generator) -> Mask:
    """Return a mask (height, width) as a camera's is; one of which little would be left stays as it was.

    What stays for a while is drawn from `held`, in the same order whatever the mask; the rest from `fresh`.
    """
    if not mask.any():
        return mask
    rows, columns = np.nonzero(mask)
    top, tall = int(rows.min()), int(np.ptp(rows)) + 1
    left, wide = int(columns.min()), int(np.ptp(columns)) + 1
    spoilt = mask.copy()
    if held.random() < SHADOW:
        spoilt = shadow(spoilt, held.uniform(*SHADOWS), held)
    for count, value in ((held.poisson(BULGES), True), (held.poisson(BITES), False)):
        for across, down, size in held.random((count, 3)):
            near = np.hypot(columns - left - across * wide, rows - top - down * tall).argmin()
            _disc(spoilt, columns[near], rows[near], _radius(size, tall), value)
    gone, end, size = held.random(3)
    if gone < MISSING:
        ends = (columns.argmin(), columns.argmax(), rows.argmax())
        where = ends[int(end * len(ends))]
        _disc(spoilt, columns[where], rows[where], _radius(size, tall), False)
    spoilt = wandering(spoilt, rim * tall, EDGE * tall, SMOOTH * tall, fresh)
    return spoilt if spoilt.sum() > 0.5 * mask.sum() else mask


def _radius(share: float, tall: int) -> int:
    return max(1, round((SIZES[0] + share * (SIZES[1] - SIZES[0])) * tall))


def _disc(mask: Mask, x: int, y: int, radius: int, value: bool) -> None:
    drawn = np.zeros(mask.shape, dtype=np.uint8)
    cv2.circle(drawn, (int(x), int(y)), radius, 1, -1)
    mask[drawn.astype(bool)] = value


@dataclass(frozen=True, eq=False)
class Worn(Sequence[Observation]):
    """Observations whose silhouettes are as a camera's masks are, each camera's on its own; the same each time."""

    observations: Sequence[Observation] = field(repr=False)
    seed: Sequence[int]

    def __len__(self) -> int:
        return len(self.observations)

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        seen = self.observations[k]
        masks = [self._worn(silhouette.mask, k, camera) for camera, silhouette in enumerate(seen.silhouettes)]
        return replace(seen, silhouettes=[Silhouette.of(mask) for mask in masks])

    def __iter__(self) -> Iterator[Observation]:
        return (self[k] for k in range(len(self)))

    def _worn(self, mask: Mask, k: int, camera: int) -> Mask:
        whole = np.random.default_rng([SALT, *self.seed, camera])
        begins = int(whole.integers(HELD))
        held = np.random.default_rng([SALT, *self.seed, camera, 1, (k + begins) // HELD])
        fresh = np.random.default_rng([SALT, *self.seed, camera, 2, k])
        return worn(mask, RIM * whole.standard_normal(), held, fresh)


CLEAN, MASKS = "as they are", "as masks are"
CONDITIONS: Mapping[str, Mapping[str, Any]] = {CLEAN: {}, **CHANGES}
WORN = CHANGES["all of these"]["corruption"]
UNTOLD = {name: value for name, value in CHANGES["all of these"].items() if value is not WORN}
VIEWS: tuple[Views, ...] = (*SIDES, *PAIRS)
FRAMES = 48  # of a clip at most
QUICK_CLIPS = 2  # of a group, in a quick look, which are two people's
ON_THE_SPOT: dict[str, tuple[Piece, ...]] = {
    "gestures": (
        Piece("29_05", FRAMES, 1, "moves his arms"),
        Piece("14_24", FRAMES, 2, "moves his arms"),
        Piece("02_10", FRAMES, 4, "washes himself"),
        Piece("29_20", FRAMES, 0, "moves his arms and turns"),
        Piece("14_10", FRAMES, 1, "does something with his hands"),
        Piece("135_02", FRAMES, 2, "a form of a martial art, on the spot"),
        Piece("02_07", FRAMES, 4, "swings something"),
        Piece("49_20", FRAMES, 1, "lifts his arms"),
    ),
    "stands": (
        Piece("49_15", 41, 1, "stands"),
        Piece("29_02", FRAMES, 3, "stands"),
        Piece("14_05", FRAMES, 2, "stands"),
        Piece("05_12", FRAMES, 2, "stands"),
        Piece("135_06", FRAMES, 0, "stands"),
        Piece("29_24", FRAMES, 4, "stands"),
    ),
}
EVERY = {**GROUPS, **ON_THE_SPOT}
USUAL = (WALKS, *ON_THE_SPOT)  # what most footage is of


class Turn(NamedTuple):
    """One track: what of, and under which condition."""

    group: str
    clip: Piece
    views: Views
    condition: str

    def spec(self, method: str, evaluations: int) -> dict[str, Any]:
        """Return the cell of the track, followed by a method; that masks are a camera's is not in it."""
        return {
            "method": method,
            "motion": self.clip.name,
            "train": [self.clip.library],
            "view_degrees": self.views,
            "frames": min(self.clip.frames, FRAMES),
            "instance": self.clip.instance,
            "evaluations": evaluations,
            **TOLD,
            **(UNTOLD if self.condition == MASKS else CONDITIONS[self.condition]),
        }


def turns(quick: bool) -> list[Turn]:
    """Return the tracks, those of one person together, since they learn from one library."""
    clips = [(group, clip) for group, found in EVERY.items() for clip in found[: QUICK_CLIPS if quick else None]]
    conditions, tracks = list(CONDITIONS), []
    for k, (group, clip) in enumerate(clips):
        tracks.append(Turn(group, clip, VIEWS[k % len(VIEWS)], conditions[(3 * k + k // len(VIEWS)) % len(conditions)]))
        tracks.append(Turn(group, clip, VIEWS[(k + 2) % len(VIEWS)], MASKS))
        if group in USUAL and not quick:
            tracks.append(Turn(group, clip, SIDES[(k + 4) % len(SIDES)], MASKS))
    return sorted(set(tracks), key=lambda track: (track.clip.subject, track))


Row = Mapping[str, Any]
Flags = NDArray[np.bool_]

STRENGTH = 0.03  # of the weights' prior, a normal one: its variance
SWAPPED = 0.05  # of the frames whose sides are not called unknown: about, for `BOUNDS` come first, and footage differs
BOUNDS = (0.01, 0.5)  # of how likely exchanged sides have to be for that; from a half on they are likelier than not
DIGITS = 6
# What each model looks at, of the evidence of a frame: now, and its means
LOST_SIGNS = ("cost", "cost, lately", "farthest", "farthest, lately", "views")
SIDES_SIGNS = (
    *(f"{name}{mean}" for name in ("cost", "reflected", "mirrored", "second") for mean in ("", ", in general")),
    *("farthest, in general", "across", "ahead", "speed", "views"),
)


class Predictions(NamedTuple):
    """What is said of the frames of a row."""

    lost: Array  # (T,) how likely each is lost
    exchanged: Array  # (T,) how likely its sides are exchanged
    unknown: Flags  # (T,)


def features(row: Row) -> Array:
    """Return the features (T, F) of a track's frames, as the tracker has them."""
    memory = EvidenceMeans(row["fps"])
    return np.array([memory.features(told) for told in row["evidence"]])


def lost_frames(rows: Sequence[Row]) -> Flags:
    """Return which frames of all rows are lost."""
    return np.concatenate([np.array(row["mpjpe_mm"]) > LOST_MM for row in rows])


def swapped_frames(rows: Sequence[Row]) -> Flags:
    """Return in which frames of all rows left and right are exchanged."""
    return np.concatenate([np.array(row["swapped"]) > 0 for row in rows])


def fit(rows: Sequence[Row]) -> dict[str, Any]:
    """Return the models that are fitted to rows, as JSON holds them. Raises ValueError where they are of one person."""
    return _fitted(rows, [features(row) for row in rows])


def judge(rows: Sequence[Row]) -> list[Predictions]:
    """Return what is said of each row by models that were fitted to other people.

    Raises ValueError where there are fewer than three: of the others, too, each is left out once.
    """
    if len(people := dict.fromkeys(row["subject"] for row in rows)) < 3:
        raise InputError(f"rows must be of three people or more, got those of {', '.join(people)}")
    known = [features(row) for row in rows]
    found: list[Predictions] = [Predictions(np.empty(0), np.empty(0), np.empty(0, dtype=np.bool_))] * len(rows)
    for his, others in _left_out(rows):
        models = FailureClassifier.from_dict(_fitted([rows[k] for k in others], [known[k] for k in others]))
        for k in his:
            exchanged = np.array([models.sides.probability(one) for one in known[k]])
            lost = np.array([models.lost.probability(one) for one in known[k]])
            found[k] = Predictions(lost, exchanged, exchanged >= models.unknown)
    return found


def _left_out(rows: Sequence[Row]) -> list[tuple[list[int], list[int]]]:
    """Return the rows of each person, and those of the others."""
    people = list(dict.fromkeys(row["subject"] for row in rows))
    each = [[k for k, row in enumerate(rows) if row["subject"] == person] for person in people]
    return [(his, [k for k in range(len(rows)) if k not in his]) for his in each]


def _fitted(rows: Sequence[Row], known: Sequence[Array]) -> dict[str, Any]:
    """Return both models, and from where on sides are unknown: judged on each person by what the others say."""
    lost = _logistic("lost", np.concatenate(known), lost_frames(rows), LOST_SIGNS)
    sides = _logistic("swapped", np.concatenate(known), swapped_frames(rows), SIDES_SIGNS)
    exchanged, swapped = list[Array](), list[Flags]()
    for his, others in _left_out(rows):
        mine = [rows[k] for k in others]
        told = _logistic("swapped", np.concatenate([known[k] for k in others]), swapped_frames(mine), SIDES_SIGNS)
        detector = LogisticModel.from_dict(told)
        exchanged.append(np.array([detector.probability(one) for k in his for one in known[k]]))
        swapped.append(swapped_frames([rows[k] for k in his]))
    return {"lost": lost, "sides": sides, "unknown": _unknown(np.concatenate(exchanged), np.concatenate(swapped))}


def _unknown(exchanged: Array, swapped: Flags) -> float:
    """Return from which probability of exchanged sides on they are unknown: of the rest about `SWAPPED` are swapped."""
    order = np.argsort(exchanged, kind="stable")
    shares = np.cumsum(swapped[order]) / np.arange(1, len(order) + 1)
    few = np.flatnonzero(shares <= SWAPPED)
    return round(float(np.clip(exchanged[order][few[-1]] if len(few) else 0.0, *BOUNDS)), DIGITS)


def _logistic(name: str, known: Array, came: Flags, signs: Sequence[str]) -> dict[str, Any]:
    """Return a logistic model of some of the features (n, F), as JSON holds it."""
    from sklearn.linear_model import LogisticRegression

    if came.all() or not came.any():
        raise InputError(
            f"frames must be {name} and not {name}, to be told apart, got {int(came.sum())} of {len(came)}"
        )
    mean, spread = known.mean(axis=0), known.std(axis=0)
    used = [k for k, sign in enumerate(NAMES) if sign in signs and spread[k] > 1e-9]
    model = LogisticRegression(C=STRENGTH, max_iter=2000)
    model.fit((known[:, used] - mean[used]) / spread[used], came)
    weights = model.coef_[0] / spread[used]
    bias = float(model.intercept_[0] - weights @ mean[used])
    named = {NAMES[row]: round(float(weight), DIGITS) for row, weight in zip(used, weights, strict=True)}
    return {"weights": named, "bias": round(bias, DIGITS)}


METHOD = "exemplars"
EVALUATIONS = 2440  # of a frame
LARGEST = 200_000_000  # bytes of such a file


def lost(
    quick: bool,
    store: str | None,
    workers: int | None,
    rows: str | None,
    out: str | None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return how well it is told which frames are lost and swapped, of people whom neither model nor library has seen.

    `out` is a new file for a row a track, and `rows` such a file, from which the models are fitted without following
    anybody again. `store` is a new file for the models that are fitted to all of them, for `exemplars` to read.
    """
    if store and quick:
        raise InputError("store must be asked for with all tracks, got --store with --quick")
    if rows is not None and out is not None:
        raise InputError("out must be given for tracks that are followed, got --out with --rows")
    with new_file(out) if out else nullcontext() as file, new_file(store) if store else nullcontext() as kept:
        found = (
            [parsed_json(line) for line in read_text(rows, LARGEST).splitlines()]
            if rows is not None
            else _followed(turns(quick), workers, progress)
        )
        if file is not None:
            file.write_text("".join(f"{json.dumps(row)}\n" for row in found), encoding="utf-8")
        told = {"tracks": len(found)}
        said, model = judge(found), fit(found)
        if kept is not None:
            kept.write_text(json.dumps(model, indent=1) + "\n", encoding="utf-8")
    tables = lost_tables(found, [one.lost for one in said]) | {"sides": sides_table(found, said)}
    return told | {"model": model} | tables


def _followed(tracks: Sequence[Turn], workers: int | None, progress: Progress | None) -> list[dict[str, Any]]:
    # all cells are made, and so checked, before any runs
    cells = {track: cell_of(track.spec(METHOD, EVALUATIONS)) for track in tracks}
    found = each({track: partial(_tracked, cell, track) for track, cell in cells.items()}, workers, progress)
    return [found[track] for track in tracks]


def _tracked(cell: TrackCell, track: Turn) -> dict[str, Any]:
    """Return a row of a track: its frames' errors, costs, and evidence where the tracker tells it."""
    scene = cell_scene(cell)
    if track.condition == MASKS:
        seed = [track.clip.instance, *track.clip.name.encode()]
        scene = replace(scene, observations=Worn(scene.observations, seed))
    training = training_motions(training_clips(cell.train, followed=cell.motion), scene.fps)
    options = TrackOptions(
        method=cell.method,
        evaluations=cell.evaluations,
        translation=cell.translation,  # type: ignore[arg-type]
        seed=cell.seed,
    )
    told = track_scene(scene, training, options)
    row = {
        "subject": track.clip.subject,
        "group": track.group,
        "clip": track.clip.name,
        "views_degrees": list(track.views),
        "condition": track.condition,
        "fps": scene.fps,
        "mpjpe_mm": [round(one["mpjpe_mm"], 2) for one in told.frames],
        "swapped": [int(one["swapped"]) for one in told.frames],
        "cost": [round(one["cost"], DIGITS) for one in told.frames],
    }
    evidence = [frame.details.get("evidence", {}) for frame in told.estimates]
    if all(evidence):
        row["evidence"] = [{name: round(value, DIGITS) for name, value in one.items()} for one in evidence]
    return row


T = TypeVar("T")

RECALLS = (0.9, 0.95)
SHARES = (0.25, 0.5, 0.75, 0.9, 1.0)  # of frames that are kept, the least doubted first
NEAR_MM = (100.0, 200.0)  # frames in between are neither clearly lost nor clearly not


def lost_tables(rows: Sequence[Row], doubts: Sequence[Array]) -> dict[str, Any]:
    """Return the tables of rows whose frames have such doubts (T,): probabilities, or else whatever grows with them."""
    every = list(zip(rows, doubts, strict=True))
    return {
        "frames": sum(len(one) for one in doubts),
        "lost": [_figures(name, part) for name, part in _parted(every)],
        "kept": {
            f"{share:g}": float(error)
            for share, error in zip(SHARES, kept_errors(_errors(rows), np.concatenate(doubts), SHARES), strict=True)
        },
    }


def _parted(every: Sequence[tuple[Row, T]]) -> Iterator[tuple[str, list[tuple[Row, T]]]]:
    """Yield all rows with what is said of them; then those of each group, number of views and condition, by name."""
    yield "all", list(every)
    for of in (_group, _cameras, _condition):
        for name in dict.fromkeys(of(row) for row, _ in every):
            yield name, [one for one in every if of(one[0]) == name]


def _group(row: Row) -> str:
    return str(row["group"])


def _cameras(row: Row) -> str:
    count = len(row["views_degrees"])
    return f"{count} camera{'s' * (count > 1)}"


def _condition(row: Row) -> str:
    return str(row["condition"])


def _figures(name: str, found: Sequence[tuple[Row, Array]]) -> dict[str, Any]:
    rows, told = [row for row, _ in found], np.concatenate([doubts for _, doubts in found])
    lost, errors = lost_frames(rows), _errors(rows)
    clear = (errors < NEAR_MM[0]) | (errors > NEAR_MM[1])
    likely = bool(told.min() >= 0.0 and told.max() <= 1.0)
    said = told >= LOST
    return {
        "name": name,
        "tracks": len(rows),
        "frames": len(lost),
        "lost_rate": float(lost.mean()),
        "auroc": auroc(told, lost),
        "auroc_clear": auroc(told[clear], lost[clear]) if clear.any() else None,
        **{f"false_alarms_{100 * recall:.0f}": false_alarms(told, lost, recall) for recall in RECALLS},
        "said_recall": float(said[lost].mean()) if likely and lost.any() else None,
        "said_false_alarms": float(said[~lost].mean()) if likely and not lost.all() else None,
        "calibration_error": calibration_error(told, lost) if likely else None,
    }


def _errors(rows: Sequence[Row]) -> Array:
    return np.concatenate([np.array(row["mpjpe_mm"]) for row in rows])


def sides_table(rows: Sequence[Row], said: Sequence[Predictions]) -> list[dict[str, Any]]:
    """Return how often sides are exchanged, called unknown, and both, of all rows and of parts of them."""
    every = list(zip(rows, said, strict=True))
    return [_sides_figures(name, part) for name, part in _parted(every)]


def _sides_figures(name: str, found: Sequence[tuple[Row, Predictions]]) -> dict[str, Any]:
    swapped = swapped_frames([row for row, _ in found])
    exchanged, unknown = (np.concatenate([getattr(one, key) for _, one in found]) for key in ("exchanged", "unknown"))

    def share(flags: Any, of: Any) -> float | None:
        return float(flags[of].mean()) if of.any() else None

    return {
        "name": name,
        "tracks": len(found),
        "frames": len(swapped),
        "swapped": float(swapped.mean()),
        "auroc": auroc(exchanged, swapped),
        "calibration_error": calibration_error(exchanged, swapped),
        "unknown": float(unknown.mean()),
        "unknown_right": share(unknown, ~swapped),
        "swapped_unknown": share(swapped, unknown),
        "swapped_known": share(swapped, ~unknown),
    }


def lost_lines(told: Mapping[str, Any]) -> Iterator[str]:
    """Yield the tables as they are printed."""
    heads = ["tracks", "frames", "lost %", "AUROC", "AUROC, clear cases"]
    heads += [f"false alarms at {100 * recall:.0f} % recall, %" for recall in RECALLS]
    heads += ["called lost: recall %", "false alarms %", "calibration error"]
    table = []
    for one in told["lost"]:
        shares = [one[f"false_alarms_{100 * recall:.0f}"] for recall in RECALLS]
        cells = [one["name"], str(one["tracks"]), str(one["frames"]), percent(one["lost_rate"])]
        cells += [_number(one["auroc"]), _number(one["auroc_clear"]), *(percent(share) for share in shares)]
        cells += [percent(one["said_recall"]), percent(one["said_false_alarms"]), _number(one["calibration_error"])]
        table.append(cells)
    yield from markdown(["", *heads], table)
    yield ""
    kept = (f"{100 * float(share):g} % kept {error:.0f} mm" for share, error in told["kept"].items())
    yield f"mean MPJPE, least doubted frames first: {', '.join(kept)}"
    yield ""
    heads = ["tracks", "frames", "swapped %", "AUROC", "calibration error", "unknown %", "unknown of right ones %"]
    heads += ["swapped of unknown ones %", "swapped of known ones %"]
    table = []
    for one in told["sides"]:
        cells = [one["name"], str(one["tracks"]), str(one["frames"]), percent(one["swapped"])]
        cells += [_number(one["auroc"]), _number(one["calibration_error"])]
        table.append(
            [*cells, *(percent(one[key]) for key in ("unknown", "unknown_right", "swapped_unknown", "swapped_known"))]
        )
    yield from markdown(["", *heads], table)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


@click.command(help=__doc__)
@click.option("--quick", is_flag=True, help="Two clips of each group: a look, not a measurement.")
@click.option("--store", metavar="FILE.json", help="New file for the models that are fitted, for exemplars to read.")
@click.option("--rows", metavar="FILE", help="Fit to what --out wrote, instead of following.")
@click.option("--out", metavar="FILE", help="New file for a row a track, in JSON.")
@WORKERS
def main(**asked: Any) -> None:
    for line in lost_lines(lost(**asked, progress=bar)):
        click.echo(line)


if __name__ == "__main__":
    main()
