"""Intrinsics of a RealSense camera, named as in `pyrealsense2.intrinsics`.

They do not place the camera.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from posefit.errors import InputError
from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.keys import check_others, unread
from posefit.geometry.calibration.lens import Calibration, pinhole_matrix, stated
from posefit.geometry.calibration.values import (
    Stored,
    matrix_of,
    numbers_at,
    plain,
)
from posefit.reading import quoted

REQUIRED = {"ppx", "ppy", "fx", "fy"}
# `depth_scale` is for depth pictures
KEYS = REQUIRED | {"width", "height", "model", "coeffs", "depth_scale"}
# OpenCV's lens models, and whether each is a fisheye. RealSense's other models distort
# in another way, or describe how to remove the distortion.
LENSES = {"none": False, "brownconrady": False, "kannalabrandt4": True}


def _tables(stored: Stored) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield a file's camera, and the cameras in its tables, such as color and depth."""
    if stored.values.keys() >= REQUIRED:
        yield stored.path.stem, stored.values
    for name, table in stored.values.items():
        if isinstance(table, dict) and table.keys() >= REQUIRED:
            yield str(name), table


def _read(stored: Stored) -> list[Calibration]:
    tables = dict(_tables(stored))
    if not stored.values.keys() >= REQUIRED:
        # beside the cameras, a file may say where they are
        check_others(stored.path.stem, unread(stored.values, tables))
    return [_camera(name, table) for name, table in tables.items()]


def _camera(name: str, table: Mapping[str, Any]) -> Calibration:
    check_others(name, unread(table, KEYS))
    lens = matrix_of(table.get("coeffs", [0.0] * 5))
    stated_model = table.get("model", "none")
    model = plain(str(stated_model).rpartition(".")[2])
    if lens.any() and model not in LENSES:
        raise InputError(f"the lens model {quoted(stated_model)}, which is not read")
    size = None
    if "width" in table and "height" in table:
        size = numbers_at(table, "width", "height")
    return stated(
        name,
        size,
        pinhole_matrix(numbers_at(table, "fx", "fy"), numbers_at(table, "ppx", "ppy")),
        np.ravel(lens),
        None,
        fisheye=bool(lens.any()) and LENSES[model],
    )


def _recognises(stored: Stored) -> bool:
    return next(_tables(stored), None) is not None


REALSENSE = Dialect("RealSense", _recognises, _read)
