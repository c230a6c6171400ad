"""Videos made from the truth, tracked as any footage: each row is kept as it comes."""

import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from numpy.typing import NDArray

from composites_scene import (
    ALWAYS,
    BEFORE,
    PASSING,
    PLACES,
    SHOWS,
    SIZE,
    Situation,
    check_situation,
    check_video,
    film,
    plate,
    situation,
)
from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.fitting.metrics import LOST_MM
from posefit.footage.extract import extract
from posefit.footage.segmentation import Extraction
from posefit.geometry.body import Body
from posefit.motion import recorded
from posefit.motion.motion import Motion
from posefit.motion.steadiness import acceleration, slides, standing
from posefit.registry import registry
from posefit.settings import parse_texts
from posefit.silhouette.cost import project
from posefit.tracking.evaluation import LOST
from posefit.tracking.front import track
from posefit.tracking.summary import Track
from posefit_reproduce.jobs import each
from table import WORKERS, earlier, kept

Masks = NDArray[np.bool_]  # (views, T, height, width)


def uncut(masks: Masks) -> NDArray[np.bool_]:
    """Return in which frames of each view (views, T) somebody is seen and nowhere cut by the picture's border."""
    edges = (masks[:, :, 0], masks[:, :, -1], masks[..., 0], masks[..., -1])
    return np.asarray(masks.any(axis=(2, 3)) & ~np.any([edge.any(axis=2) for edge in edges], axis=0))


def extraction_figures(masks: Masks, usable: NDArray[np.bool_], truth: Masks) -> dict[str, Any]:
    """Return how well masks (views, T) that were taken out agree with the true ones, where somebody is whole."""
    seen = uncut(truth)
    overlaps = _overlaps(masks, truth)
    return {
        "mask_iou": float(overlaps[seen].mean()),
        "mask_iou_worst_view": float(min(one[ok].mean() for one, ok in zip(overlaps, seen, strict=True) if ok.any())),
        "mask_half": float((overlaps[seen] < 0.5).mean()),
        "usable": float(usable[seen].mean()),
    }


def track_figures(track: Track, radii: Array, situation: Situation, truth: Masks) -> dict[str, Any]:
    """Return what a track is worth in the frames in which a camera sees all of the person."""
    actor = situation.actors[0]
    seen = np.asarray(uncut(truth).any(axis=0))
    estimate, body = track.motion, Body(track.motion.skeleton, radii)
    true_joints = actor.motion.skeleton.joints(actor.motion.poses, actor.motion.translations)
    joints = estimate.skeleton.joints(estimate.poses, estimate.translations)
    mpjpe = metrics.mpjpe_mm(true_joints, joints)
    away = 1e3 * np.linalg.norm(joints[:, 0] - true_joints[:, 0], axis=1)
    facing = np.cos(estimate.poses[:, 0] - actor.motion.poses[:, 0]) > 0.0
    said = {name: np.array([row.get(name, np.nan) for row in track.frames]) for name in ("lost", "unknown_sides")}
    return {
        "seen": int(seen.sum()),
        "body_iou": _body_iou(estimate, body, situation, truth),
        "claimed_iou": track.measures.iou,
        "mpjpe_mm": float(mpjpe[seen].mean()),
        "place_mm": float(np.median(away[seen])),
        "facing_right": float(facing[seen].mean()),
        "lost": float((mpjpe[seen] > LOST_MM).mean()),
        "swapped": float(metrics.swapped(true_joints, joints)[seen].mean()),
        "said_lost": _share(said["lost"][seen] >= LOST, said["lost"][seen]),
        "said_unknown": _share(said["unknown_sides"][seen] == 1.0, said["unknown_sides"][seen]),
        "held": float(1.0 - np.array([row["usable"] for row in track.frames])[seen].mean()),
        "stature_cm": 100.0 * (body.stature - actor.body.stature),
        **steadiness(true_joints, joints, seen, estimate.fps),
        **_others(situation, joints, seen),
    }


def steadiness(true_joints: Array, joints: Array, seen: NDArray[np.bool_], fps: float) -> dict[str, Any]:
    """Return how joints accelerate and feet slide beside the truth's own, in the runs of frames that are seen.

    A fitted foot slides while the true one stands, and, as anybody would see it, while it stands itself.
    """
    felt, true_felt = (acceleration(one, fps) for one in (joints, true_joints))
    inner = seen & np.roll(seen, 1) & np.roll(seen, -1) & np.isfinite(felt)
    stands = standing(true_joints, fps) & seen[:, None]
    own = standing(joints, fps) & seen[:, None]
    found = {
        "slide_cm": slides(joints, stands),
        "own_slide_cm": slides(joints, own),
        "true_slide_cm": slides(true_joints, stands),
    }
    mean, true_mean = (float(one[inner].mean()) for one in (felt, true_felt))
    return {
        "acceleration": mean,
        "true_acceleration": true_mean,
        **{name: 100.0 * float(steps.mean()) if len(steps) else None for name, steps in found.items()},
    }


def _others(situation: Situation, joints: Array, seen: NDArray[np.bool_]) -> dict[str, Any]:
    """Return in what share of the frames somebody else is followed, where there is anybody else."""
    if len(situation.actors) < 2:
        return {}
    away = [
        np.where(actor.present, np.linalg.norm(joints[:, 0] - actor.motion.translations, axis=1), np.inf)
        for actor in situation.actors
    ]
    return {"other_person": float((np.argmin(away, axis=0) > 0)[seen].mean())}


def _body_iou(estimate: Motion, body: Body, situation: Situation, truth: Masks) -> float:
    """Return the overlap of the fitted body with the whole true one, seen by the cameras that see all of it."""
    actor, found = situation.actors[0], []
    for camera, seen in zip(situation.cameras, uncut(truth), strict=True):
        for k in np.flatnonzero(seen):
            true = project(actor.body, camera, actor.motion.poses[k], actor.motion.translations[k])
            fitted = project(body, camera, estimate.poses[k], estimate.translations[k])
            found.append(float(_overlaps(fitted, true)))
    return float(np.mean(found))


def _overlaps(first: NDArray[np.bool_], second: NDArray[np.bool_]) -> Array:
    """Return the intersection over union of masks (..., height, width); 1 where both are empty."""
    either = (first | second).sum(axis=(-2, -1))
    return np.asarray(np.where(either > 0, (first & second).sum(axis=(-2, -1)) / np.maximum(either, 1), 1.0))


def _share(flags: NDArray[np.bool_], values: Array) -> float | None:
    """Return the share of true flags, None where nobody says."""
    return float(flags.mean()) if np.isfinite(values).any() else None


Row = Mapping[str, Any]

# What a table shows of a row: its head, digits, and what a value is multiplied by.
COLUMNS: Mapping[str, tuple[str, int, float]] = {
    "mask_iou": ("mask IoU", 2, 1.0),
    "body_iou": ("body IoU", 2, 1.0),
    "claimed_iou": ("own IoU", 2, 1.0),
    "mpjpe_mm": ("MPJPE mm", 0, 1.0),
    "place_mm": ("place mm", 0, 1.0),
    "facing_right": ("facing %", 0, 100.0),
    "lost": ("lost %", 0, 100.0),
    "said_lost": ("said lost %", 0, 100.0),
    "swapped": ("swapped %", 0, 100.0),
    "said_unknown": ("unknown %", 0, 100.0),
    "acceleration": ("m/s2", 1, 1.0),
    "true_acceleration": ("true m/s2", 1, 1.0),
    "slide_cm": ("slide cm", 1, 1.0),
    "own_slide_cm": ("own cm", 1, 1.0),
    "true_slide_cm": ("true cm", 1, 1.0),
}
GROUPS = {"passing": PASSING, "always there": ALWAYS}
COMPARED = ("mask_iou", "body_iou", "mpjpe_mm", "facing_right", "lost", "swapped", "acceleration", "own_slide_cm")


def by_presence(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return the means over rows of those who pass and of those who are always there, by extraction and cameras.

    Of what was refused there are no figures; `refused` is how many rows that are.
    """
    found = []
    for extraction, views in dict.fromkeys((row["extraction"], row["views"]) for row in rows):
        for group, situations in GROUPS.items():
            mine = [
                row
                for row in rows
                if (row["extraction"], row["views"]) == (extraction, views) and row["situation"] in situations
            ]
            told = [row for row in mine if "refused" not in row]
            if mine:
                means = {name: _mean([row.get(name) for row in told]) for name in COMPARED}
                counts = {"rows": len(mine), "refused": len(mine) - len(told)}
                found.append({"extraction": extraction, "views": views, "group": group, **counts, **means})
    return found


def composites_lines(told: Mapping[str, Any]) -> Iterator[str]:
    """Yield a line a row, then one for each group of situations."""
    names = [name for name in COLUMNS if any(name in row for row in told["rows"])]
    yield f"{'situation':10} {'cameras':>7} {'extraction':10} {'seed':>4} " + _heads(names)
    for row in told["rows"]:
        start = f"{row['situation']:10} {row['views']:7} {row['extraction']:10} {row['seed']:4} "
        yield start + (f" refused: {row['refused']}" if "refused" in row else _cells(row, names))
    yield ""
    yield f"{'means':12} {'cameras':>7} {'extraction':10} {'rows':>4} {'refused':>7} " + _heads(COMPARED)
    for one in told["groups"]:
        start = f"{one['group']:12} {one['views']:7} {one['extraction']:10} {one['rows']:4} {one['refused']:7} "
        yield start + _cells(one, COMPARED)


def _heads(names: Sequence[str]) -> str:
    return " ".join(f"{COLUMNS[name][0]:>11}" for name in names)


def _cells(row: Row, names: Sequence[str]) -> str:
    return " ".join(f"{_shown(row.get(name), *COLUMNS[name][1:]):>11}" for name in names)


def _shown(value: float | None, digits: int, factor: float) -> str:
    return "-" if value is None else f"{factor * value:.{digits}f}"


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


GIVEN = "mean"  # the extraction that is given pictures without anybody
QUICK = (("through", 1), ("stands", 1))  # situations and numbers of cameras of a quick look


class Shot(NamedTuple):
    """One row: what happens, before how many cameras, how the person is taken out, and which people it is.

    `extraction` is a segmenter's name, with settings of it behind.
    """

    situation: str
    views: int
    extraction: str
    seed: int


def composites(
    video: str,
    situations: Sequence[str],
    views: Sequence[int],
    extractions: Sequence[str],
    seeds: int,
    quick: bool,
    rows: str | None,
    workers: int | None,
) -> dict[str, Any]:
    """Return a row of figures for each situation, number of cameras, extraction and seed.

    `rows` is a file for a row a line as they come; what it holds already is not measured again.
    """
    shots = asked(situations, views, extractions, seeds, quick)
    check_video(video)
    done = earlier(rows, shot_of)
    jobs = {shot: partial(measured, video, shot) for shot in shots if shot not in done}
    done |= each(jobs, workers, partial(kept, rows)) if jobs else {}
    found = [done[shot] for shot in shots]
    return {"rows": found, "groups": by_presence(found)}


def asked(
    situations: Sequence[str], views: Sequence[int], extractions: Sequence[str], seeds: int, quick: bool
) -> list[Shot]:
    """Return the rows that are asked for; nothing named is all. Raises ValueError where a name or number is none."""
    grid = list(product(situations or SHOWS, views or PLACES))
    for place in grid:
        check_situation(*place)
    for method in extractions:
        extraction_named(method)
    places = [place for place in grid if not quick or place in QUICK]
    shots = [Shot(*place, method, seed) for seed in range(seeds) for method in extractions for place in places]
    return list(dict.fromkeys(shots))


def shot_of(row: Mapping[str, Any]) -> Shot:
    """Return whose row it is."""
    return Shot(*(row[name] for name in Shot._fields))


def measured(video: str, shot: Shot) -> dict[str, Any]:
    """Return the row of a shot: it is filmed, taken out and tracked; what was refused is said in the tool's words."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scene = situation(shot.situation, shot.views, shot.seed)
        plates = [plate(video, number, SIZE) for number in range(shot.views)]
        how = extraction_named(shot.extraction)
        made = film(scene, plates, shot.seed, how.name == GIVEN, folder)
        frames = (made.first, None)
        row: dict[str, Any] = {**shot._asdict(), "people": scene.people, "frames": len(scene)}
        try:
            masks, usable = _taken_out(made.videos, how, frames, folder)
            row |= extraction_figures(masks, usable, made.masks)
        except ValueError as error:
            return row | {"refused": str(error).replace(f"{folder}/", "")}
        began, said = time.perf_counter(), list[str]()
        try:
            result = track(
                made.videos,
                camera=made.calibration,
                up="y",
                extraction=how,
                frames=frames,
                height=scene.actors[0].body.stature,
                train=[recorded.leaving_out(recorded.LIBRARY, scene.people)],
                out=folder / "track",
                say=said.append,
            )
        except ValueError as error:
            return row | {"refused": str(error).replace(f"{folder}/", "")}
        row["minutes"] = (time.perf_counter() - began) / 60.0
        with np.load(folder / "track" / "poses.npz") as stored:
            radii = stored["radii"]
        row |= track_figures(result, radii, scene, made.masks)
        row["warnings"] = [one.replace(f"{folder}/", "") for one in said if one.startswith("warning")]
        return row


def extraction_named(text: str) -> Extraction:
    """Return how people are taken out: a segmenter's name, and settings behind such as `mixture history=90`.

    Raises ValueError where there is no segmenter of that name, or a setting does not fit it.
    """
    name, *given = text.split() or [""]
    if not name:
        raise ValueError(f"extraction must name a segmenter such as mixture, got {text!r}")
    offer = registry().offer("segmenter", name)
    settings = parse_texts(offer.name, offer.factory, given)
    if name == GIVEN:
        settings = {"background": f"0:{BEFORE}", **settings}
    return Extraction(name, settings=settings)


def _taken_out(videos: Sequence[Path], how: Extraction, frames: Any, folder: Path) -> tuple[Any, Any]:
    """Return masks (views, T, height, width) that are taken out of videos, and whether they are usable (views, T)."""
    masks, usable = [], []
    for number, video in enumerate(videos):
        extract(video, folder / f"masks-{number}", how, frames=frames)
        with np.load(folder / f"masks-{number}" / "masks.npz") as stored:
            masks.append(stored["masks"] > 0)
            usable.append(stored["usable"])
    return np.stack(masks), np.stack(usable)


@click.command(help=__doc__)
@click.argument("video")
@click.option("--situation", "situations", multiple=True, help="One alone, such as stands. Again for more.")
@click.option("--views", type=int, multiple=True, help="Cameras, 1, 2 or 4. Again for more.")
@click.option(
    "--extraction",
    "extractions",
    multiple=True,
    default=("mixture", "median", "mean"),
    show_default=True,
    help="A segmenter and settings, 'mixture history=90'.",
)
@click.option("--seeds", type=click.IntRange(1), default=1, show_default=True, help="Of other people in other clothes.")
@click.option("--quick", is_flag=True, help="One camera, a person who passes and one who stands: a look.")
@click.option("--rows", metavar="FILE", help="A file for a row a line: the same command continues there.")
@WORKERS
def main(**asked: Any) -> None:
    for line in composites_lines(composites(**asked)):
        click.echo(line)


if __name__ == "__main__":
    main()
