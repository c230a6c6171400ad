"""Kalibr's camchain.yaml.

Each camera's place is relative to the previous camera, or to the IMU, in metres. A
place that a user added as rvec and tvec may be in any unit.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from posefit.errors import InputError
from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.keys import check_others, unread
from posefit.geometry.calibration.lens import (
    Calibration,
    Place,
    numbers_of,
    pinhole_matrix,
    stated,
)
from posefit.geometry.calibration.values import Stored, check_keys, matrix_of, plain

# keys of matrices (4, 4): from the previous camera, or from the IMU, to this camera
CHAINED = "T_cn_cnm1"
FROM_IMU = "T_cam_imu"
LENSES = {"radtan": False, "none": False, "equidistant": True}
KEYS = {
    *("camera_model", "intrinsics", "distortion_model", "distortion_coeffs"),
    *("resolution", CHAINED, FROM_IMU),
    # the pictures' topic, overlap and timing
    *("rostopic", "cam_overlaps", "timeshift_cam_imu", "line_delay"),
    # Kalibr does not write these; users add them
    *("rvec", "tvec"),
}


def _recognises(stored: Stored) -> bool:
    for table in stored.values.values():
        if not isinstance(table, dict):
            continue
        if CHAINED not in table and "camera_model" not in table:
            continue
        # users of OpenCV name a matrix `intrinsics`; Kalibr has four numbers of a
        # pinhole, and up to six of the models that are not read
        intrinsics = table.get("intrinsics")
        if isinstance(intrinsics, list) and 4 <= len(intrinsics) <= 6:
            return True
    return False


def _read(stored: Stored) -> list[Calibration]:
    tables = dict[str, Mapping[str, Any]]()
    for name, table in stored.values.items():
        if isinstance(table, dict):
            tables[name] = table
    # such as the place of the whole rig
    check_others(stored.path.stem, unread(stored.values, tables))
    calibrations = list[Calibration]()
    # a user added these, in a unit that Kalibr does not state
    if all({"rvec", "tvec"} <= table.keys() for table in tables.values()):
        for name, table in tables.items():
            place = matrix_of(table["rvec"]), matrix_of(table["tvec"])
            calibrations.append(_camera(name, table, place))
        return calibrations
    places = _chained(tables)
    for (name, table), chained in zip(tables.items(), places, strict=True):
        calibrations.append(_camera(name, table, chained).of_unit("m"))
    return calibrations


def _chained(tables: Mapping[str, Any]) -> list[Place | None]:
    """Return the cameras' places, or None for each if the file has none.

    They are relative to the first camera of a chain, or to the IMU if every camera
    states its place from there.
    """
    if not any(CHAINED in table for table in tables.values()):
        if not all(FROM_IMU in table for table in tables.values()):
            return [None] * len(tables)
        matrices = [_matrix(table[FROM_IMU]) for table in tables.values()]
    else:
        matrices = [np.eye(4)]
        for name, table in list(tables.items())[1:]:
            if CHAINED not in table:
                raise InputError(f"{name!r} without {CHAINED}")
            matrices.append(_matrix(table[CHAINED]) @ matrices[-1])
    return [(matrix[:3, :3], matrix[:3, 3]) for matrix in matrices]


def _matrix(value: Any) -> Any:
    return numbers_of(matrix_of(value), (4, 4))


def _camera(name: str, table: Mapping[str, Any], place: Place | None) -> Calibration:
    check_keys(table, KEYS, name, "Kalibr")
    model = table.get("camera_model", "pinhole")
    lens = table.get("distortion_model", "none")
    if plain(model) != "pinhole":
        raise InputError(f"the camera model {model!r}, which is not known")
    if plain(lens) not in LENSES:
        raise InputError(f"the lens model {lens!r}, which is not known")
    intrinsics = numbers_of(matrix_of(table["intrinsics"]), (4,))
    return stated(
        name,
        matrix_of(table["resolution"]).tolist(),
        pinhole_matrix(intrinsics[:2], intrinsics[2:]),
        matrix_of(table.get("distortion_coeffs", [0.0] * 4)),
        place,
        fisheye=LENSES[plain(lens)],
    )


KALIBR = Dialect("Kalibr", _recognises, _read)
