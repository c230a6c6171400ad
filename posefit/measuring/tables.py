"""Writes a measured motion: clinical angles, the steps of a walk, joints as .trc."""

import csv
import importlib
from collections.abc import Collection
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.measuring.angles import clinical_angles
from posefit.measuring.centres import PLACES
from posefit.measuring.gait import Gait, Step
from posefit.motion.motion import Motion

STEP_COLUMNS = tuple(field.name for field in fields(Step))


def import_pandas() -> Any:
    """Return the module pandas.

    Raises:
        ImportError: It is not installed; the message says how to install it.
    """
    try:
        return importlib.import_module("pandas")
    except ImportError as error:
        raise ImportError(
            "tables need the library pandas: python -m pip install 'posefit[sweep]'"
        ) from error


def angle_columns(motion: Motion, unseen: Collection[int] = ()) -> dict[str, Array]:
    """Return the clinical angles (T,) in degrees, by name.

    They are NaN in the frames with the numbers in `unseen`.
    """
    is_unseen = np.isin(motion.first + np.arange(len(motion)), list(unseen))
    angles = clinical_angles(motion.skeleton, motion.poses)
    return {
        name: np.where(is_unseen, np.nan, values) for name, values in angles.items()
    }


def write_angles(
    path: str | Path, motion: Motion, unseen: Collection[int] = ()
) -> None:
    """Write the clinical angles in degrees as a .csv file, one row per frame.

    Frames with the numbers in `unseen` have only the time.
    """
    angles = angle_columns(motion, unseen)
    with Path(path).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["frame", "seconds", *angles])
        for k, row in enumerate(np.column_stack(list(angles.values()))):
            number = motion.first + k
            cells = ["" if np.isnan(value) else f"{value:.3f}" for value in row]
            writer.writerow([number, f"{number / motion.fps:.6f}", *cells])


def write_gait(path: str | Path, gait: Gait) -> None:
    """Write a .csv file with one row for each strike of a foot, in order of time.

    There are no rows if the motion is not a walk.
    """
    with Path(path).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(STEP_COLUMNS)
        for step in [] if gait.why else gait.steps:
            cells = []
            for value in astuple(step):
                if value is None:
                    cells.append("")
                elif isinstance(value, str):
                    cells.append(value)
                else:
                    cells.append(f"{value:.6f}")
            writer.writerow(cells)


def write_trc(path: str | Path, motion: Motion, unseen: Collection[int] = ()) -> None:
    """Write the 27 joints of every frame as markers in a .trc file, in metres, y up.

    Markers have the names of `PLACES`. Frames with the numbers in `unseen` have no row,
    because OpenSim's inverse kinematics stops at a row without markers; it takes the
    others by their times. It needs at least one row: if every frame is unseen, each has
    a row of empty cells.
    """
    path = Path(path)
    count = len(motion)
    numbers = motion.first + np.arange(count)
    is_unseen = np.isin(numbers, list(unseen))
    if is_unseen.all():
        rows = np.arange(count)
    else:
        rows = np.flatnonzero(~is_unseen)
    fps = f"{motion.fps:.10g}"
    head = {
        "DataRate": fps,
        "CameraRate": fps,
        "NumFrames": len(rows),
        "NumMarkers": len(PLACES),
        "Units": "m",
        "OrigDataRate": fps,
        "OrigDataStartFrame": motion.first + 1,
        "OrigNumFrames": count,
    }
    axes = [f"{axis}{marker}" for marker in range(1, len(PLACES) + 1) for axis in "XYZ"]
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "\t".join(head),
        "\t".join(map(str, head.values())),
        "Frame#\tTime\t" + "\t".join(f"{place}\t\t" for place in PLACES),
        "\t\t" + "\t".join(axes),
        "",
    ]
    points = motion.joints.reshape(count, -1)
    for k in rows:
        cells = [f"{value:.6f}" for value in points[k]]
        if is_unseen[k]:
            # one cell more, because OpenSim does not count an empty last cell
            cells = [""] * (len(cells) + 1)
        time = f"{numbers[k] / motion.fps:.6f}"
        lines.append("\t".join([str(numbers[k] + 1), time, *cells]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
