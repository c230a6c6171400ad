"""Composed videos with a known truth, tracked like any footage.

    python docs/studies/composites.py VIDEO --rows rows.jsonl
    python docs/studies/composites.py VIDEO --situation through --seeds 1

VIDEO is the demonstration video of Sports2D; composites_scene.py puts recorded people
in front of its background, in ten situations. The table has a line for each track: its
error, lost frames, exchanged sides, frames that the tracker flags as unknown or that it
should have flagged, frames on another person, errors of clinical angles, and the grade
of the tracker's own audit. Tracks that were refused follow, with the reason.
"""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from numpy.typing import NDArray

from angles import SAGITTAL, angle_errors
from composites_scene import (
    PLACES,
    SHOWS,
    SIZE,
    Situation,
    check_video,
    film,
    plate,
    situation,
)
from posefit import clinical_angles
from posefit.cli.output import Command
from posefit.fitting import metrics
from posefit.fitting.landmarks import GROUPS, MIRRORED
from posefit.fitting.metrics import LOST_MM
from posefit.footage.extraction import Extraction
from posefit.footage.scene import Scene
from posefit.motion import recorded
from posefit.motion.motion import Motion
from posefit.progress import QUIET
from posefit.registry import registry
from posefit.sweep.engine import Limits
from posefit.tracking.front import track
from posefit.tracking.result import Track
from posefit.uncertainty.modes import nearer_mirrored
from table import WORKERS, keyed, markdown, measured

Masks = NDArray[np.bool_]  # (views, T, height, width)


def uncut(masks: Masks) -> NDArray[np.bool_]:
    """Return the frames of each view (views, T) in which a person is wholly visible.

    That is, a person is seen, and the picture's border cuts nothing off.
    """
    edges = (masks[:, :, 0], masks[:, :, -1], masks[..., 0], masks[..., -1])
    cut = np.any([edge.any(axis=2) for edge in edges], axis=0)  # (views, T)
    return np.asarray(masks.any(axis=(2, 3)) & ~cut)


def track_figures(track: Track, situation: Situation, truth: Masks) -> dict[str, Any]:
    """Return the figures of a track.

    Only frames in which a camera sees the whole person count.
    """
    true = situation.actors[0].motion
    estimate = track.motion
    seen = np.asarray(uncut(truth).any(axis=0))
    mpjpe = metrics.mpjpe_mm(true.joints, estimate.joints)
    swapped = nearer_mirrored(true.joints, estimate.joints)
    unknown = track.table["unknown_sides"]
    known = seen & (unknown == 0.0)
    said_unknown = None
    if np.isfinite(unknown[seen]).any():
        said_unknown = float((unknown[seen] == 1.0).mean())
    return {
        "mpjpe_mm": float(mpjpe[seen].mean()),
        "lost": float((mpjpe[seen] > LOST_MM).mean()),
        "swapped": float(swapped[seen].mean()),
        "said_unknown": said_unknown,
        "known_wrong": float(swapped[known].mean()) if known.any() else None,
        **angle_errors(true, clinical_angles(estimate.skeleton, estimate.poses), seen),
    }


def legs_exchanged(
    scene: Scene, actor: Motion, seen: NDArray[np.bool_]
) -> float | None:
    """Return the share of pictures in which a segmenter's landmarks exchange the legs.

    Only pictures that are `seen` (views, T) count. None if no segmenter gives
    landmarks.
    """
    exchanged = list[bool]()
    legs = GROUPS[0]
    for camera, view, rows in zip(
        scene.cameras, range(len(scene.cameras)), seen, strict=True
    ):
        for k in np.flatnonzero(rows):
            landmarks = scene.observations[int(k)].landmarks
            if landmarks is not None and landmarks[view, :, 2].any():
                pixels, depths = camera.project(actor.joints[k])
                same, other = (
                    (
                        np.linalg.norm(
                            pixels[legs] - landmarks[view, group, :2], axis=1
                        )
                        * depths[legs]
                    ).sum()
                    for group in (legs, MIRRORED[legs])
                )
                exchanged.append(bool(other < same))
    return float(np.mean(exchanged)) if exchanged else None


def other_person_share(scene: Scene, masks: NDArray[np.bool_]) -> float | None:
    """Return the share of usable pictures that show more of another actor.

    None if there is only one actor. `masks` (actors, views, T, height, width) are the
    true ones.
    """
    if len(masks) == 1:
        return None
    others = list[bool]()
    for k, observation in enumerate(scene.observations):
        for view, silhouette in enumerate(observation.silhouettes):
            first, *rest = (
                int((silhouette.mask & actor[view, k]).sum()) for actor in masks
            )
            if observation.usable and silhouette.mask.any():
                others.append(max(rest) > first)
    return float(np.mean(others))


def entry_point(masks: NDArray[np.bool_]) -> tuple[float, float]:
    """Return column and row of an actor's first visible mask (T, height, width)."""
    first = int(masks.any(axis=(1, 2)).argmax())
    row, column = np.argwhere(masks[first]).mean(axis=0)
    return float(column), float(row)


Row = Mapping[str, Any]

# Columns of a table: head, digits, and factor on the value.
COLUMNS: Mapping[str, tuple[str, int, float]] = {
    "mpjpe_mm": ("MPJPE mm", 0, 1.0),
    "lost": ("lost %", 0, 100.0),
    "swapped": ("swapped %", 0, 100.0),
    "said_unknown": ("unknown %", 0, 100.0),
    "known_wrong": ("known and wrong %", 0, 100.0),
    "other_person": ("on another person %", 0, 100.0),
    "legs_exchanged": ("landmarks exchange the legs %", 0, 100.0),
    **{name: (f"{name.replace('_', ' ')} off, degrees", 1, 1.0) for name in SAGITTAL},
}
LIMITS = Limits(gigabytes=8.0)  # four cameras, and MediaPipe's libraries
DEFAULT = "default"  # segments as `posefit track` does by itself


class Shot(NamedTuple):
    """One row: a situation, the number of cameras, the segmenter, and the people."""

    situation: str
    views: int
    extraction: str
    seed: int


def row_of(video: str, shot: Shot) -> dict[str, Any]:
    """Return the row of a shot, which is filmed, segmented and tracked.

    If the tool refuses the film, the row has its message.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scene = situation(shot.situation, shot.views, shot.seed)
        plates = [plate(video, number, SIZE) for number in range(shot.views)]
        videos, masks = film(scene, plates, shot.seed, folder)
        row: dict[str, Any] = {
            **shot._asdict(),
            "people": scene.people,
            "frames": len(scene),
        }
        chosen = None
        if shot.extraction != DEFAULT:
            chosen = Extraction(shot.extraction)
        try:
            result = track(
                videos,
                camera=scene.cameras,
                extraction=chosen,
                height=scene.actors[0].body.stature,
                # of several people, point at the one with the given height
                person=entry_point(masks[0, 0]) if len(masks) > 1 else None,
                train=[recorded.leaving_out(recorded.LIBRARY, scene.people)],
                progress=QUIET,
            )
        except ValueError as error:
            return row | {"refused": str(error).replace(f"{folder}/", "")}
        assert result.trust is not None
        exchanged = legs_exchanged(
            result.scene, scene.actors[0].motion, uncut(masks[0])
        )
        row |= track_figures(result, scene, masks[0]) | {
            "other_person": other_person_share(result.scene, masks)
        }
        return row | {"legs_exchanged": exchanged, "trust": result.trust.grade}


def composites_lines(rows: Sequence[Row]) -> Iterator[str]:
    table = []
    for row in rows:
        cells = [
            row["situation"],
            str(row["views"]),
            row["extraction"],
            str(row["seed"]),
        ]
        for name, (_, digits, factor) in COLUMNS.items():
            cells.append(
                "-" if row.get(name) is None else f"{factor * row[name]:.{digits}f}"
            )
        table.append([*cells, row.get("trust", "-")])
    heads = [
        "situation",
        "cameras",
        "extraction",
        "seed",
        *(head for head, _, _ in COLUMNS.values()),
        "trust",
    ]
    yield from markdown(heads, table, 3)
    yield from (
        f"{row['situation']}, {row['extraction']}: {row['refused']}"
        for row in rows
        if "refused" in row
    )


@click.command(cls=Command, help=__doc__)
@click.argument("video")
@click.option(
    "--situation",
    "situations",
    multiple=True,
    type=click.Choice(list(SHOWS)),
    help="By default all.",
)
@click.option(
    "--extraction",
    "extractions",
    multiple=True,
    default=(DEFAULT, "mixture"),
    help="A segmenter's name. Repeatable.",
)
@click.option(
    "--seeds",
    type=click.IntRange(1),
    default=1,
    show_default=True,
    help="Number of different people and clothes.",
)
@click.option(
    "--rows",
    metavar="FILE",
    help="File with one row a line. An earlier run there is continued.",
)
@WORKERS
def main(
    video: str,
    situations: Sequence[str],
    extractions: Sequence[str],
    seeds: int,
    rows: str | None,
    workers: int | None,
) -> None:
    for name in set(extractions) - {DEFAULT}:
        registry().offer("segmenter", name)
    check_video(video)
    grid = product(range(seeds), situations or SHOWS, PLACES, extractions)
    shots = [
        Shot(shown, views, extraction, seed) for seed, shown, views, extraction in grid
    ]
    done = measured(
        {shot: partial(row_of, video, shot) for shot in shots},
        rows,
        keyed(Shot),
        workers,
        LIMITS,
    )
    for line in composites_lines([*done.values()]):
        click.echo(line)


if __name__ == "__main__":
    main()
