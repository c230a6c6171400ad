"""openMVG's sfm_data.json.

Each view has a camera, with its position and its rotation. A point x of the world is
R (x - centre) in the camera. Lengths have no unit.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from posefit.errors import InputError
from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.lens import (
    Calibration,
    Place,
    numbers_of,
    pinhole_matrix,
    placed_at,
    stated,
)
from posefit.geometry.calibration.values import (
    Stored,
    check_keys,
    matrix_of,
    number_of,
    numbers_at,
)
from posefit.reading import quoted

REQUIRED = {"views", "intrinsics", "extrinsics"}
# For each lens model: the key of its numbers, and the position of each number in
# OpenCV's k1, k2, p1, p2, k3.
LENSES: Mapping[str, tuple[str, tuple[int, ...]]] = {
    "pinhole": ("", ()),
    "pinhole_radial_k1": ("disto_k1", (0,)),
    "pinhole_radial_k3": ("disto_k3", (0, 1, 4)),
    "pinhole_brown_t2": ("disto_t2", (0, 1, 4, 2, 3)),
    "fisheye": ("fisheye", (0, 1, 2, 3)),
}
KEYS = {"width", "height", "focal_length", "principal_point", "value0"}


def _by_key(entries: Any) -> dict[int, Mapping[str, Any]]:
    return {int(entry["key"]): entry["value"] for entry in entries}


def _read(stored: Stored) -> list[Calibration]:
    intrinsics = _by_key(stored.values["intrinsics"])
    extrinsics = _by_key(stored.values["extrinsics"])
    # the first camera of a model has the model's name and number, the others only the
    # number
    models = dict[int, str]()
    for value in intrinsics.values():
        if "polymorphic_name" in value:
            models[value["polymorphic_id"] & ~(1 << 31)] = value["polymorphic_name"]
    calibrations = list[Calibration]()
    for view in _by_key(stored.values["views"]).values():
        data = view["ptr_wrapper"]["data"]
        name = str(data["filename"])
        lens = intrinsics.get(int(data["id_intrinsic"]))
        if lens is None:
            continue
        pose = extrinsics.get(int(data["id_pose"]))
        place: Place | None = None
        if pose is not None:
            rotation = numbers_of(matrix_of(pose["rotation"]), (3, 3))
            place = placed_at(rotation, pose["center"])
        model = models.get(lens.get("polymorphic_id", 0) & ~(1 << 31), "pinhole")
        calibrations.append(_camera(name, model, lens["ptr_wrapper"]["data"], place))
    return calibrations


def _camera(
    name: str, model: str, data: Mapping[str, Any], place: Place | None
) -> Calibration:
    if model not in LENSES:
        raise InputError(f"the lens model {quoted(model)}, which is not known")
    key, order = LENSES[model]
    # newer versions have the keys that all models share in a table
    data = {**data, **data.get("value0", {})}
    check_keys(data, {*KEYS, key}, name, "openMVG")
    lens = np.zeros(4 if model == "fisheye" else 5)
    lens[list(order)] = matrix_of(data[key]) if key else ()
    focal = number_of(data["focal_length"])
    return stated(
        name.rpartition(".")[0] or name,
        numbers_at(data, "width", "height"),
        pinhole_matrix([focal, focal], matrix_of(data["principal_point"])),
        lens,
        place,
        fisheye=model == "fisheye",
        scale="free",
    )


OPENMVG = Dialect("openMVG", lambda stored: stored.values.keys() >= REQUIRED, _read)
