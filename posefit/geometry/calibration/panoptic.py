"""CMU Panoptic's calibration_*.json: lengths are centimetres, and -y is up."""

from collections.abc import Mapping
from typing import Any

from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.keys import check_others, unread
from posefit.geometry.calibration.lens import Calibration, numbers_of, stated
from posefit.geometry.calibration.values import (
    Stored,
    check_keys,
    has_table,
    matrix_of,
)

REQUIRED = {"K", "distCoef", "R", "t", "resolution"}
# the other keys say which of the dome's cameras it is
KEYS = REQUIRED | {"name", "type", "panel", "node"}


def _recognises(stored: Stored) -> bool:
    cameras = stored.values.get("cameras")
    return isinstance(cameras, list) and has_table(cameras, REQUIRED)


def _read(stored: Stored) -> list[Calibration]:
    around = unread(stored.values, {"cameras", "calibDataSource"})
    check_others(stored.path.stem, around)
    calibrations = list[Calibration]()
    for number, table in enumerate(stored.values["cameras"]):
        calibrations.append(_camera(str(table.get("name", number)), table))
    return calibrations


def _camera(name: str, table: Mapping[str, Any]) -> Calibration:
    check_keys(table, KEYS, name, "CMU Panoptic")
    calibration = stated(
        name,
        matrix_of(table["resolution"]).tolist(),
        numbers_of(matrix_of(table["K"]), (3, 3)),
        matrix_of(table["distCoef"]),
        (matrix_of(table["R"]), matrix_of(table["t"])),
    )
    return calibration.of_unit("cm")


PANOPTIC = Dialect("CMU Panoptic", _recognises, _read)
