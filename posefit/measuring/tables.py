"""The tables of a measured motion: clinical angles, and the steps of a walk."""

import csv
from collections.abc import Collection
from dataclasses import astuple, fields
from pathlib import Path

import numpy as np

from posefit.measuring.angles import clinical_angles
from posefit.measuring.gait import Gait, Step
from posefit.motion.motion import Motion

STEP_COLUMNS = tuple(one.name for one in fields(Step))


def write_angles(path: str | Path, motion: Motion, blank: Collection[int] = ()) -> None:
    """Write one row a frame of the clinical angles in degrees; of `blank` frames nothing but the time."""
    angles = clinical_angles(motion.skeleton, motion.poses)
    with Path(path).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["frame", "seconds", *angles])
        for k, row in enumerate(np.column_stack(list(angles.values()))):
            cells = ["" if k in blank or np.isnan(value) else f"{value:.3f}" for value in row]
            writer.writerow([k, f"{k / motion.fps:.6f}", *cells])


def write_gait(path: str | Path, gait: Gait) -> None:
    """Write one row for each strike of a foot, in the order of time; none where the motion is no walk."""
    with Path(path).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(STEP_COLUMNS)
        for step in [] if gait.why else gait.steps:
            writer.writerow(["" if v is None else v if isinstance(v, str) else f"{v:.6f}" for v in astuple(step)])
