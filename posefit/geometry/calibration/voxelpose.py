"""Calibrations of Shelf and Campus in the form of VoxelPose and mmpose.

T is the camera's position, in millimetres: a point x of the world is R (x - T) in the
camera. The keys `k` and `p` are the lens' radial and tangential numbers. They tell such
a file from other files with an R and a T, where T is a translation.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.lens import (
    Calibration,
    numbers_of,
    pinhole_matrix,
    placed_at,
    stated,
)
from posefit.geometry.calibration.values import (
    Stored,
    check_keys,
    has_table,
    matrix_of,
    numbers_at,
)

KEYS = {"R", "T", "fx", "fy", "cx", "cy", "k", "p"}


def _recognises(stored: Stored) -> bool:
    return has_table(stored.values.values(), KEYS)


def _read(stored: Stored) -> list[Calibration]:
    return [_camera(str(name), table) for name, table in stored.values.items()]


def _camera(name: str, table: Mapping[str, Any]) -> Calibration:
    check_keys(table, KEYS, name, "VoxelPose")
    focal = numbers_at(table, "fx", "fy")
    centre = numbers_at(table, "cx", "cy")
    radial = np.ravel(matrix_of(table["k"]))
    tangential = np.ravel(matrix_of(table["p"]))
    rotation = numbers_of(matrix_of(table["R"]), (3, 3))
    calibration = stated(
        name,
        None,
        pinhole_matrix(focal, centre),
        [*radial[:2], *tangential, *radial[2:]],
        placed_at(rotation, matrix_of(table["T"])),
    )
    return calibration.of_unit("mm")


VOXELPOSE = Dialect("VoxelPose", _recognises, _read)
