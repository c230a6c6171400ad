"""A measured motion as tables: clinical angles, the steps of a walk, and joints as a .trc file."""

import csv
import importlib
from collections.abc import Collection
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

import numpy as np

from posefit.measuring.angles import clinical_angles
from posefit.measuring.centres import PLACES
from posefit.measuring.gait import Gait, Step
from posefit.motion.motion import Motion

STEP_COLUMNS = tuple(field.name for field in fields(Step))


def import_pandas() -> Any:
    """Return the module pandas. Raises ImportError that says how to install it."""
    try:
        return importlib.import_module("pandas")
    except ImportError as error:
        raise ImportError(
            "tables need the library pandas: python -m pip install 'posefit[sweep]'"
        ) from error


def write_angles(path: str | Path, motion: Motion, blank: Collection[int] = ()) -> None:
    """Write one row a frame of the clinical angles in degrees; of those numbered in `blank` only the time."""
    angles = clinical_angles(motion.skeleton, motion.poses)
    with Path(path).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["frame", "seconds", *angles])
        for k, row in enumerate(np.column_stack(list(angles.values()))):
            number = motion.first + k
            cells = [
                "" if number in blank or np.isnan(value) else f"{value:.3f}"
                for value in row
            ]
            writer.writerow([number, f"{number / motion.fps:.6f}", *cells])


def write_gait(path: str | Path, gait: Gait) -> None:
    """Write one row for each strike of a foot, in the order of time; none where the motion is no walk."""
    with Path(path).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(STEP_COLUMNS)
        for step in [] if gait.why else gait.steps:
            writer.writerow(
                [
                    "" if v is None else v if isinstance(v, str) else f"{v:.6f}"
                    for v in astuple(step)
                ]
            )


def write_trc(path: str | Path, motion: Motion, blank: Collection[int] = ()) -> None:
    """Write the 27 joints of every frame as markers, in metres and y up; of those numbered in `blank` only the time.

    Markers are named by `PLACES`. OpenSim and similar programs take an empty field for an unobserved marker.
    """
    path = Path(path)
    count = len(motion)
    fps = f"{motion.fps:g}"
    head = (
        "DataRate",
        "CameraRate",
        "NumFrames",
        "NumMarkers",
        "Units",
        "OrigDataRate",
        "OrigDataStartFrame",
    )
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "\t".join([*head, "OrigNumFrames"]),
        "\t".join(
            [
                fps,
                fps,
                str(count),
                str(len(PLACES)),
                "m",
                fps,
                str(motion.first + 1),
                str(count),
            ]
        ),
        "Frame#\tTime\t" + "\t".join(f"{place}\t\t" for place in PLACES),
        "\t\t"
        + "\t".join(f"{axis}{k}" for k in range(1, len(PLACES) + 1) for axis in "XYZ"),
        "",
    ]
    for k, points in enumerate(motion.joints):
        number = motion.first + k
        values = "\t".join(
            "" if number in blank else f"{value:.6f}" for value in points.reshape(-1)
        )
        lines.append(f"{number + 1}\t{number / motion.fps:.6f}\t{values}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
