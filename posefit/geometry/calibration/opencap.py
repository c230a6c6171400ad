"""OpenCap's cameraIntrinsicsExtrinsics, converted to JSON; lengths are millimetres.

OpenCap writes a pickle. Reading a pickle may run any code, so posefit refuses it with a
message that says how to convert it.
"""

import numpy as np

from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.keys import check_others, unread
from posefit.geometry.calibration.lens import Calibration, Place, numbers_of, stated
from posefit.geometry.calibration.values import Stored, matrix_of

PICKLES = (".pickle", ".pkl")
# part of the message that refuses a pickle
HOW = (
    "a pickle, which may run any code: if you trust it, convert it to JSON: "
    "json.dump({key: numpy.asarray(value).tolist() "
    "for key, value in pickle.load(file).items()}, ...)"
)
REQUIRED = {"intrinsicMat", "imageSize"}
KEYS = {
    *("distortion", "rotation", "translation", *REQUIRED),
    # this follows from the rotation
    "rotation_EulerAngles",
}


def _read(stored: Stored) -> list[Calibration]:
    values = stored.values
    name = stored.path.stem
    check_others(name, unread(values, KEYS))
    matrix = numbers_of(matrix_of(values["intrinsicMat"]), (3, 3))
    size = np.ravel(matrix_of(values["imageSize"]))
    # The height comes first if the pictures are tall. The principal point shows which
    # side is which.
    centre = matrix[:2, 2]
    if np.abs(centre / size - 0.5).max() > np.abs(centre / size[::-1] - 0.5).max():
        size = size[::-1]
    place: Place | None = None
    if "rotation" in values and "translation" in values:
        place = matrix_of(values["rotation"]), matrix_of(values["translation"])
    calibration = stated(
        name,
        size,
        matrix,
        matrix_of(values.get("distortion", [0.0] * 5)),
        place,
    )
    return [calibration.of_unit("mm")]


OPENCAP = Dialect("OpenCap", lambda stored: stored.values.keys() >= REQUIRED, _read)
