"""Errors of clinical angles of recorded walks, whose people are left out of the library.

Hip and knee flexion and ankle dorsiflexion of both sides against the truth: the root mean square error, and the one
that is left when the mean difference is taken off. composites.py has the same of made footage.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from clips import FOUR, GROUPS, PAIRS, SIDES, WALKS, Clip, Views, cell_fields, track_of
from posefit import clinical_angles
from posefit.arrays import Array
from posefit.footage.video import Video
from posefit.motion.motion import Motion
from posefit.sweep.cell import TrackCell, cell_scene
from posefit.sweep.check import cell_of
from posefit.uncertainty.modes import nearer_mirrored
from posefit_reproduce.jobs import each
from table import WORKERS, Row, bar, markdown

SAGITTAL = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")


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
    return {"clip": clip.name, "views": list(views), "swapped": float(nearer_mirrored(*places).mean()), **errors}


def landmark_angles(video: Path, first: int, size: tuple[int, int]) -> dict[str, Array]:
    """Return the angles (T,) in degrees of MediaPipe's 3D landmarks in the frames of a video from `first` on.

    The hip is counted between the trunk and the thigh, the ankle between the foot's heel and toes and the shank. NaN
    where the model detects nobody.
    """
    from mediapipe.python.solutions.pose import Pose

    model, frames = Pose(static_image_mode=False, model_complexity=1), []
    for image in Video.of(video).frames(first, None, size):
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


def walk_lines(workers: int | None) -> Iterator[str]:
    """Yield the table of recorded walks by view."""
    jobs = {}
    for clip, views in product(GROUPS[WALKS], (*SIDES, *PAIRS, FOUR)):
        cell = cell_of(cell_fields(clip, views, clip.frames))
        jobs[clip.name, clip.instance, views] = partial(walk_row, cell, clip, views)
    groups: dict[str, list[Row]] = {}
    for (*_, views), row in each(jobs, workers, bar).items():
        groups.setdefault(" + ".join(f"{view:g}" for view in views), []).append(row)
    yield from lines_of(groups)


@click.command(help=__doc__)
@WORKERS
def main(workers: int | None) -> None:
    for line in walk_lines(workers):
        click.echo(line)


if __name__ == "__main__":
    main()
