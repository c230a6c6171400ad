"""Anipose's TOML, which Pose2Sim, FreeMoCap and Caliscope write too.

The AIST database has the same keys in JSON. Each camera is a table, at the top or in
another table, with a rotation about an axis and a translation, both from the world to
the camera.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.keys import check_others, unread
from posefit.geometry.calibration.lens import (
    Calibration,
    Place,
    check_both,
    numbers_of,
    stated,
)
from posefit.geometry.calibration.values import Stored, counts, matrix_of

KEYS = {
    *("name", "size", "matrix", "distortions", "rotation", "translation", "fisheye"),
    # FreeMoCap: they follow from the rotation and the translation
    *("world_position", "world_orientation"),
    # Caliscope: how the pictures were taken
    *("ignore", "cam_id", "port", "error", "grid_count", "rotation_count"),
    *("exposure", "verified_resolutions", "nickname"),
}
REQUIRED = {"matrix", "size", "distortions"}


def _recognises(stored: Stored) -> bool:
    return next(_tables(stored.values), None) is not None


def _tables(
    values: Mapping[str, Any], levels: int = 2
) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the names and tables of cameras, also in lists and in other tables."""
    for key, value in values.items():
        entries = value if isinstance(value, list) else [value]
        for number, table in enumerate(entries):
            if not isinstance(table, dict):
                continue
            name = f"{key}{number}" if isinstance(value, list) else key
            if table.keys() >= REQUIRED:
                yield str(table.get("name", name)), table
            elif levels > 1:
                yield from _tables(table, levels - 1)


def _read(stored: Stored) -> list[Calibration]:
    # values that are in no table, such as the place of the whole rig
    around = dict[str, Any]()
    for key, value in stored.values.items():
        if not isinstance(value, dict | list) or counts(value):
            around[key] = value
    check_others(stored.path.stem, around)
    calibrations = list[Calibration]()
    for name, table in _tables(stored.values):
        # Caliscope keeps cameras in the file that the user has left out
        if str(table.get("ignore")).lower() != "true":
            calibrations.append(_camera(name, table))
    return calibrations


def _camera(name: str, table: Mapping[str, Any]) -> Calibration:
    check_others(name, unread(table, KEYS))
    # Caliscope writes null for the place of a camera that it has not placed yet
    table = {key: value for key, value in table.items() if value != "null"}
    place: Place | None = None
    if "rotation" in table and "translation" in table:
        place = matrix_of(table["rotation"]), matrix_of(table["translation"])
    check_both(table.get("rotation"), table.get("translation"))
    return stated(
        name,
        matrix_of(table["size"]).tolist(),
        numbers_of(matrix_of(table["matrix"]), (3, 3)),
        matrix_of(table["distortions"]),
        place,
        fisheye=str(table.get("fisheye", False)).lower() == "true",
    )


ANIPOSE = Dialect("Anipose", _recognises, _read)
