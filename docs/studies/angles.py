"""Errors of clinical angles: of recorded walks of people left out of the library, and of made footage.

    python docs/studies/angles.py
    python docs/studies/angles.py --video demo.mp4 --rows angles.jsonl

Hip and knee flexion and ankle dorsiflexion of both sides against the truth, in the frames that show the whole person:
the root mean square error, and how far angles vary with their mean difference taken off. Where mediapipe is installed,
made footage also has the angles of its 3D landmarks, in the same frames of the first camera.
"""

import importlib.util
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from numpy.typing import NDArray

from clips import GROUPS, PAIRS, SIDES, WALKS, Clip, Views, cell_fields, track_of
from composites import extraction_named, uncut
from composites_scene import SIZE, check_video, film, plate, situation
from posefit import clinical_angles
from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.footage.video import Video
from posefit.motion import recorded
from posefit.motion.motion import Motion
from posefit.sweep.cell import TrackCell, cell_scene
from posefit.sweep.check import cell_of
from posefit.tracking.front import track
from posefit_reproduce.jobs import each
from table import WORKERS, Row, bar, earlier, kept, markdown

SAGITTAL = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")
FOUR: Views = (0.0, 90.0, 180.0, 270.0)
PEOPLE = 3  # of made footage, the people and clothes of so many seeds


class Film(NamedTuple):
    """One piece of made footage: who walks through, before how many cameras, and the segmenter."""

    seed: int
    views: int
    extraction: str


def angle_errors(true: Motion, angles: Mapping[str, Array], seen: NDArray[np.bool_]) -> dict[str, float]:
    """Return errors in degrees of angles (T,) of both sides in the frames `seen`, that an estimate has.

    The root mean square error of each angle, and under `_varies` the one that is left without the mean difference.
    """
    truth, found = clinical_angles(true.skeleton, true.poses), {}
    for name in SAGITTAL:
        off = np.array([(angles[f"{side}_{name}"] - truth[f"{side}_{name}"])[seen] for side in ("left", "right")])
        found[name] = float(np.sqrt(np.nanmean(off**2)))
        found[f"{name}_varies"] = float(np.sqrt(np.nanmean((off - np.nanmean(off, axis=1, keepdims=True)) ** 2)))
    return found


def walk_row(cell: TrackCell, clip: Clip, views: Views) -> dict[str, Any]:
    """Return the errors of a recorded walk, tracked with its translation aligned."""
    result = track_of(cell, cell_scene(cell), translation="aligned")
    true, estimate = result.truth, result.motion
    assert true is not None
    errors = angle_errors(true, clinical_angles(estimate.skeleton, estimate.poses), np.ones(len(true), dtype=bool))
    places = [motion.skeleton.joints(motion.poses, motion.translations) for motion in (true, estimate)]
    return {"clip": clip.name, "views": list(views), "swapped": float(metrics.swapped(*places).mean()), **errors}


def film_row(video: str, shot: Film) -> dict[str, Any]:
    """Return the errors of somebody who walks through made footage, by posefit and by landmarks."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scene = situation("through", shot.views, shot.seed)
        plates = [plate(video, number, SIZE) for number in range(shot.views)]
        made = film(scene, plates, shot.seed, False, folder)
        result = track(
            made.videos,
            camera=made.calibration,
            up="y",
            extraction=extraction_named(shot.extraction),
            frames=(made.first, None),
            height=scene.actors[0].body.stature,
            train=[recorded.leaving_out(recorded.LIBRARY, scene.people)],
        )
        true, estimate, seen = scene.actors[0].motion, result.motion, uncut(made.masks)
        places = [motion.skeleton.joints(motion.poses, motion.translations) for motion in (true, estimate)]
        some = seen.any(axis=0)
        row = {**shot._asdict(), "swapped": float(metrics.swapped(*places)[some].mean())}
        row |= angle_errors(true, clinical_angles(estimate.skeleton, estimate.poses), some)
        if importlib.util.find_spec("mediapipe"):
            angles = landmark_angles(made.videos[0], made.first)
            row["landmarks"] = angle_errors(true, angles, seen[0])
        return row


def landmark_angles(video: Path, first: int) -> dict[str, Array]:
    """Return the angles (T,) in degrees of MediaPipe's 3D landmarks in the frames of a video from `first` on.

    The hip is counted between the trunk and the thigh, the ankle between the foot's heel and toes and the shank. NaN
    where the model detects nobody.
    """
    from mediapipe.python.solutions.pose import Pose

    model, frames = Pose(static_image_mode=False, model_complexity=1), []
    for image in Video.of(video).frames(first, None, SIZE):
        found = model.process(np.ascontiguousarray(image[..., ::-1])).pose_world_landmarks
        frames.append([(one.x, one.y, one.z) for one in found.landmark] if found else np.full((33, 3), np.nan))
    points = np.array(frames, dtype=np.float64)
    up = points[:, 11:13].mean(axis=1) - points[:, 23:25].mean(axis=1)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    ahead = np.cross(up, points[:, 24] - points[:, 23])
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    angles = {}
    for side, hip in (("left", 23), ("right", 24)):
        knee, ankle, heel, toe = (points[:, hip + k] for k in (2, 4, 6, 8))
        thigh, shank = knee - points[:, hip], ankle - knee
        angles[f"{side}_hip_flexion"] = np.degrees(np.arctan2((thigh * ahead).sum(1), -(thigh * up).sum(1)))
        angles[f"{side}_knee_flexion"] = _between(thigh, shank)
        angles[f"{side}_ankle_dorsiflexion"] = _between(toe - heel, shank) - 90.0
    return angles


def _between(first: Array, second: Array) -> Array:
    """Return the angles (T,) in degrees between vectors (T, 3)."""
    cosines = (first * second).sum(1) / np.linalg.norm(first, axis=1) / np.linalg.norm(second, axis=1)
    return np.asarray(np.degrees(np.arccos(cosines)))


def lines_of(groups: Mapping[str, Sequence[Row]]) -> Iterator[str]:
    """Yield the table of groups of rows: medians of errors, and the mean share of swapped sides."""
    heads = [f"{name.replace('_', ' ')}{more}" for more in ("", ", varies") for name in SAGITTAL]
    table = []
    for name, rows in groups.items():
        errors = [np.median([row[f"{angle}{more}"] for row in rows]) for more in ("", "_varies") for angle in SAGITTAL]
        swapped = [row["swapped"] for row in rows if "swapped" in row]
        share = f"{100.0 * np.mean(swapped):.0f}" if swapped else "-"
        table.append([name, str(len(rows)), *(f"{error:.1f}" for error in errors), share])
    yield from markdown(["", "tracks", *heads, "swapped %"], table)


def walk_lines(quick: bool, workers: int | None) -> Iterator[str]:
    """Yield the table of recorded walks by view."""
    jobs = {}
    for clip, views in product(GROUPS[WALKS][: 2 if quick else None], (*SIDES, *PAIRS, FOUR)):
        cell = cell_of(cell_fields(clip, views, clip.frames))
        jobs[clip.name, clip.instance, views] = partial(walk_row, cell, clip, views)
    groups: dict[str, list[Row]] = {}
    for (*_, views), row in each(jobs, workers, bar).items():
        groups.setdefault(" + ".join(f"{view:g}" for view in views), []).append(row)
    yield from lines_of(groups)


def film_lines(video: str, quick: bool, rows: str | None, workers: int | None) -> Iterator[str]:
    """Yield the table of made footage by the number of cameras, with the landmarks' errors."""
    check_video(video)
    shots = [Film(*one, "mixture") for one in product(range(1 if quick else PEOPLE), (1,) if quick else (1, 2, 4))]
    done = earlier(rows, lambda row: Film(*(row[name] for name in Film._fields)))
    jobs = {shot: partial(film_row, video, shot) for shot in shots if shot not in done}
    done |= each(jobs, workers, partial(kept, rows)) if jobs else {}
    groups: dict[str, list[Row]] = {}
    for shot in shots:
        groups.setdefault(f"{shot.views} camera{'s' * (shot.views > 1)}", []).append(done[shot])
    landmarks = [done[shot]["landmarks"] for shot in shots if shot.views == 1 and "landmarks" in done[shot]]
    yield from lines_of(groups | ({"landmarks of MediaPipe, 1 camera": landmarks} if landmarks else {}))


@click.command(help=__doc__)
@click.option("--video", metavar="FILE", help="The demonstration video: made footage instead of recorded walks.")
@click.option("--quick", is_flag=True, help="A few tracks: a look, not a measurement.")
@click.option("--rows", metavar="FILE", help="A file for a row a line: the same command continues there.")
@WORKERS
def main(video: str | None, quick: bool, rows: str | None, workers: int | None) -> None:
    for line in film_lines(video, quick, rows, workers) if video else walk_lines(quick, workers):
        click.echo(line)


if __name__ == "__main__":
    main()
