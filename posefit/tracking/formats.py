"""The files of a finished track: arrays, motion capture, tables and the camera."""

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.geometry.skeleton import ANGLES, JOINTS, Skeleton
from posefit.motion.motion import Motion
from posefit.tracking.evaluation import unseen
from posefit.uncertainty.calibration import LEVELS
from posefit.uncertainty.intervals import angle_intervals, joint_intervals

FILES = (
    "poses.npz",
    "track.amc",
    "skeleton.asf",
    "track.bvh",
    "track.trc",
    "camera.json",
    "track.c3d",
    "frames.csv",
    "angles.csv",
    "gait.csv",
    "summary.json",
    "overlay.mp4",
    "summary.png",
    "track.html",
)

Rows = Sequence[Mapping[str, float]]
State = dict[str, Any]


def intervals_of(skeleton: Skeleton, frames: Sequence[Frame]) -> dict[str, Array]:
    """Return how far joints and angles may be off, as poses.npz has it; empty where no frame has a posterior.

    `levels` (3,), `joint_radii` (T, 3, 27) metres, `angle_halves` (T, 3, 66) radians; NaN in frames without any.
    """
    if all(frame.posterior is None for frame in frames):
        return {}
    radii = np.full((len(frames), len(LEVELS), len(JOINTS)), np.nan)
    halves = np.full((len(frames), len(LEVELS), ANGLES), np.nan)
    for k, frame in enumerate(frames):
        if frame.posterior is not None:
            radii[k] = joint_intervals(skeleton, frame.posterior, frame.pose).radii
            halves[k] = angle_intervals(frame.posterior, frame.pose).halves
    return {"levels": np.array(LEVELS), "joint_radii": radii, "angle_halves": halves}


def write_formats(
    folder: Path,
    scene: Scene,
    estimate: Motion,
    frames: Sequence[Frame],
    rows: Rows,
    summary: State,
    sure: Mapping[str, Array],
) -> None:
    """Write every file of a track to a folder but for its pictures; see `FILES`. `sure` is what `intervals_of` gave."""
    from posefit.measuring.c3d import write_c3d
    from posefit.measuring.centres import PLACES
    from posefit.measuring.gait import gait_of
    from posefit.measuring.tables import write_angles, write_gait
    from posefit.measuring.trc import write_trc
    from posefit.motion.amc import write_amc
    from posefit.motion.asf import write_asf
    from posefit.motion.bvh import write_bvh

    np.savez_compressed(
        folder / "poses.npz",
        poses=estimate.poses,
        translations=estimate.translations,
        fps=np.array(estimate.fps),
        joints=np.array(JOINTS),
        places=np.array(PLACES),
        costs=np.array([frame.cost for frame in frames]),
        radii=scene.body.radii,
        **dict[str, Any](sure),
    )
    write_asf(folder / "skeleton.asf", estimate.skeleton)
    write_amc(folder / "track.amc", estimate)
    write_bvh(folder / "track.bvh", estimate)
    blank = unseen(rows)
    gait = gait_of(estimate, blank)
    write_trc(folder / "track.trc", estimate, blank)
    write_c3d(folder / "track.c3d", estimate, blank, gait)
    write_angles(folder / "angles.csv", estimate, blank)
    write_gait(folder / "gait.csv", gait)
    (folder / "camera.json").write_text(scene.cameras[0].to_json(), encoding="utf-8")
    joints = estimate.joints
    names = [f"{place}_{axis}" for place in PLACES for axis in "xyz"]
    with (folder / "frames.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*rows[0], *names])
        for k, (row, points) in enumerate(zip(rows, joints, strict=True)):
            values = ["" if np.isnan(value) else value for value in row.values()]
            writer.writerow([*values, *("" if k in blank else f"{value:.6f}" for value in points.reshape(-1))])
    (folder / "summary.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
