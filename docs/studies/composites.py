"""Videos made from the truth, tracked as any footage: each row is kept as it comes."""

import importlib.util
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

from angles import SAGITTAL, angle_errors, landmark_angles
from composites_scene import (
    BEFORE,
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
from posefit import clinical_angles
from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.errors import InputError
from posefit.evaluation.errors import LOST
from posefit.fitting import metrics
from posefit.fitting.landmarks import GROUPS, MIRRORED
from posefit.fitting.metrics import LOST_MM
from posefit.footage.scene import Scene
from posefit.footage.segmentation import Extraction
from posefit.geometry.body import Body
from posefit.geometry.skeleton import BONES
from posefit.motion import recorded
from posefit.motion.motion import Motion
from posefit.progress import Progress
from posefit.registry import registry
from posefit.settings import parse_texts
from posefit.silhouette.cost import project
from posefit.sweep.engine import Limits
from posefit.tracking.front import track
from posefit.tracking.result import Track
from posefit.uncertainty.modes import nearer_mirrored
from posefit_reproduce.jobs import each
from table import WORKERS, earlier, kept, markdown

Masks = NDArray[np.bool_]  # (views, T, height, width)


def uncut(masks: Masks) -> NDArray[np.bool_]:
    """Return in which frames of each view (views, T) a person is seen and nowhere cut by the picture's border."""
    edges = (masks[:, :, 0], masks[:, :, -1], masks[..., 0], masks[..., -1])
    return np.asarray(masks.any(axis=(2, 3)) & ~np.any([edge.any(axis=2) for edge in edges], axis=0))


def extraction_figures(scene: Scene, truth: Masks) -> dict[str, Any]:
    """Return how well the masks of a tracked scene agree with the true ones, where a person is whole."""
    seen = uncut(truth)
    views = zip(*(observation.silhouettes for observation in scene.observations), strict=True)
    overlaps = _overlaps(np.array([[silhouette.mask for silhouette in view] for view in views]), truth)
    usable = np.array([observation.usable for observation in scene.observations])
    return {
        "mask_iou": float(overlaps[seen].mean()),
        "mask_iou_worst_view": float(min(one[ok].mean() for one, ok in zip(overlaps, seen, strict=True) if ok.any())),
        "mask_half": float((overlaps[seen] < 0.5).mean()),
        "usable": float(usable[seen.any(axis=0)].mean()),
    }


def track_figures(track: Track, radii: Array, situation: Situation, truth: Masks) -> dict[str, Any]:
    """Return what a track is worth in the frames in which a camera sees all of the person."""
    actor = situation.actors[0]
    seen, everywhere = np.asarray(uncut(truth).any(axis=0)), np.asarray(uncut(truth).all(axis=0))
    estimate, body = track.motion, Body(track.motion.skeleton, radii)
    true_joints = actor.motion.skeleton.joints(actor.motion.poses, actor.motion.translations)
    joints = estimate.skeleton.joints(estimate.poses, estimate.translations)
    mpjpe = metrics.mpjpe_mm(true_joints, joints)
    away = 1e3 * np.linalg.norm(joints[:, 0] - true_joints[:, 0], axis=1)
    facing = np.cos(estimate.poses[:, 0] - actor.motion.poses[:, 0]) > 0.0
    said = {name: track.table[name] for name in ("lost", "unknown_sides")}
    swapped = nearer_mirrored(true_joints, joints)
    known = seen & (said["unknown_sides"] == 0.0)
    lengths = [np.linalg.norm(motion.skeleton.offsets, axis=1) for motion in (actor.motion, estimate)]
    off = np.abs(lengths[1] / lengths[0] - 1.0)
    borders = [true_joints[seen, :, 1] + sign * actor.body.joint_radii() for sign in (1.0, -1.0)]
    tall = borders[0].max(axis=1) - borders[1].min(axis=1)
    return {
        "seen": int(seen.sum()),
        "body_iou": _body_iou(estimate, body, situation, truth),
        "claimed_iou": track.measures.iou,
        "mpjpe_mm": float(mpjpe[seen].mean()),
        "mpjpe_everywhere_mm": float(mpjpe[everywhere].mean()) if everywhere.any() else None,
        "place_mm": float(np.median(away[seen])),
        "facing_right": float(facing[seen].mean()),
        "lost": float((mpjpe[seen] > LOST_MM).mean()),
        "swapped": float(swapped[seen].mean()),
        "said_lost": _share(said["lost"][seen] >= LOST, said["lost"][seen]),
        "said_unknown": _share(said["unknown_sides"][seen] == 1.0, said["unknown_sides"][seen]),
        "held": float(1.0 - track.table["usable"][seen].mean()),
        "known_wrong": float(swapped[known].mean()) if known.any() else None,
        "upright": float(np.median(tall)) / actor.body.stature,
        "stature_cm": 100.0 * (body.stature - actor.body.stature),
        **{name: float(off[[k for k, bone in enumerate(BONES) if bone[1:] in bones]].mean()) for name, bones in PARTS},
        **angle_errors(actor.motion, clinical_angles(estimate.skeleton, estimate.poses), seen),
    }


def landmark_figures(scene: Scene, actor: Motion, seen: NDArray[np.bool_]) -> dict[str, float]:
    """Return how far a segmenter's landmarks are off, and the shares of pictures with sides exchanged, by limbs.

    Of the pictures (views, T) that are `seen`; empty where no segmenter gives landmarks.
    """
    joints, off, exchanged = actor.joints, list[float](), dict[str, list[bool]]()
    for camera, view, rows in zip(scene.cameras, range(len(scene.cameras)), seen, strict=True):
        for k in np.flatnonzero(rows):
            landmarks = scene.observations[k].landmarks
            if landmarks is None or not landmarks[view, :, 2].any():
                continue
            pixels, depths = camera.project(joints[k])
            metres = depths / np.sqrt(camera.focal.prod())
            for name, group in zip(("legs", "arms", "trunk"), GROUPS, strict=True):
                sides = [
                    np.linalg.norm(pixels[group] - landmarks[view, same, :2], axis=1) * metres[group]
                    for same in (group, MIRRORED[group])
                ]
                off += np.min(sides, axis=0).tolist()
                exchanged.setdefault(f"{name}_exchanged", []).append(bool(sides[1].sum() < sides[0].sum()))
    median = {"landmarks_off_mm": 1e3 * float(np.median(off))} if off else {}
    return median | {name: float(np.mean(flags)) for name, flags in exchanged.items()}


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
PARTS = (("arms", ("clavicle", "humerus", "radius")), ("legs", ("femur", "tibia")))  # bones whose lengths are compared

# What a table shows of a row: its head, digits, and what a value is multiplied by.
COLUMNS: Mapping[str, tuple[str, int, float]] = {
    "mask_iou": ("mask IoU", 2, 1.0),
    "body_iou": ("body IoU", 2, 1.0),
    "claimed_iou": ("own IoU", 2, 1.0),
    "mpjpe_mm": ("MPJPE mm", 0, 1.0),
    "mpjpe_everywhere_mm": ("where all see mm", 0, 1.0),
    "place_mm": ("place mm", 0, 1.0),
    "upright": ("stands upright %", 0, 100.0),
    "facing_right": ("facing %", 0, 100.0),
    "lost": ("lost %", 0, 100.0),
    "said_lost": ("said lost %", 0, 100.0),
    "swapped": ("swapped %", 0, 100.0),
    "said_unknown": ("unknown %", 0, 100.0),
    "known_wrong": ("known and wrong %", 0, 100.0),
    **{name: (f"{name} off %", 0, 100.0) for name, _ in PARTS},
    **{name: (f"{name.replace('_', ' ')} off, degrees", 1, 1.0) for name in SAGITTAL},
    "cpu_ms": ("CPU ms a frame", 0, 1.0),
}


LIMITS = Limits(gigabytes=8.0)  # four cameras, and MediaPipe's libraries
DEFAULT = "default"  # as `posefit track` takes people out by itself
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
) -> list[Row]:
    """Return a row of figures for each situation, number of cameras, extraction and seed.

    `rows` is a file for a row a line as they come; what it holds already is not measured again.
    """
    shots = asked(situations, views, extractions, seeds, quick)
    check_video(video)
    done = earlier(rows, shot_of)
    jobs = {shot: partial(measured, video, shot) for shot in shots if shot not in done}
    done |= each(jobs, workers, partial(kept, rows), LIMITS) if jobs else {}
    found = [done[shot] for shot in shots]
    return found


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
        made = film(scene, plates, shot.seed, shot.extraction.startswith(GIVEN), folder)
        frames = (made.first, None)
        row: dict[str, Any] = {**shot._asdict(), "people": scene.people, "frames": len(scene)}
        began, spent, said = time.perf_counter(), time.process_time(), list[str]()
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
                progress=Progress(said.append),
            )
        except ValueError as error:
            return row | {"refused": str(error).replace(f"{folder}/", "")}
        row["minutes"] = (time.perf_counter() - began) / 60.0
        row["cpu_ms"] = 1e3 * (time.process_time() - spent) / len(scene)
        with np.load(folder / "track" / "poses.npz") as stored:
            radii = stored["radii"]
        row |= extraction_figures(result.scene, made.masks) | track_figures(result, radii, scene, made.masks)
        row |= landmark_figures(result.scene, scene.actors[0].motion, uncut(made.masks))
        if importlib.util.find_spec("mediapipe"):
            angles = landmark_angles(made.videos[0], made.first, SIZE)
            row["landmarks"] = angle_errors(scene.actors[0].motion, angles, uncut(made.masks)[0])
        row["trust"] = str(result.trust)
        row["warnings"] = [one.replace(f"{folder}/", "") for one in said if one.startswith("warning")]
        return row


def extraction_named(text: str) -> Extraction | None:
    """Return how people are taken out: a segmenter's name, and settings behind such as `mixture history=90`.

    None for `default`. Raises ValueError where there is no segmenter of that name, or a setting does not fit it.
    """
    name, *given = text.split() or [""]
    if text == DEFAULT:
        return None
    if not name:
        raise InputError(f"extraction must name a segmenter such as mixture, got {text!r}")
    offer = registry().offer("segmenter", name)
    settings = parse_texts(offer.name, offer.factory, given)
    if name == GIVEN:
        settings = {"background": f"0:{BEFORE}", **settings}
    return Extraction(name, settings=settings)


def composites_lines(found: Sequence[Row]) -> Iterator[str]:
    """Yield the table of the rows."""
    table = []
    for row in found:
        cells = [row["situation"], str(row["views"]), row["extraction"], str(row["seed"])]
        for name, (_, digits, factor) in COLUMNS.items():
            cells.append("-" if row.get(name) is None else f"{factor * row[name]:.{digits}f}")
        table.append(cells)
    yield from markdown(
        ["situation", "cameras", "extraction", "seed", *(head for head, _, _ in COLUMNS.values())], table, 3
    )
    yield from (f"{row['situation']}, {row['extraction']}: {row['refused']}" for row in found if "refused" in row)
    landmarks = [row["landmarks"] for row in found if "landmarks" in row]
    if landmarks:
        medians = [f"{np.median([row[name] for row in landmarks]):.1f}" for name in SAGITTAL]
        yield f"MediaPipe's landmarks in the first camera, degrees off, medians: {', '.join(medians)}"


@click.command(cls=Command, help=__doc__)
@click.argument("video")
@click.option("--situation", "situations", multiple=True, help="One alone, such as stands. Again for more.")
@click.option("--views", type=int, multiple=True, help="Cameras, 1, 2 or 4. Again for more.")
@click.option(
    "--extraction",
    "extractions",
    multiple=True,
    default=(DEFAULT, "mixture", "mean"),
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
