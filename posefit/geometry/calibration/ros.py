"""ROS' camera_info, as a YAML file or as the message.

It describes one camera and does not place it. The matrix and the size are for the whole
sensor; `roi` and the binning say which part of it the pictures show.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.lens import (
    HALF,
    Calibration,
    numbers_of,
    pinhole_matrix,
    stated,
)
from posefit.geometry.calibration.values import (
    Stored,
    check_keys,
    counts,
    first_of,
    matrix_of,
    number_of,
    plain,
)
from posefit.reading import quoted

LENSES = {"plumbbob": False, "rationalpolynomial": False, "equidistant": True}
# each key's name in files, and in messages
MATRIX = "cameramatrix", "k"
LENS = "distortioncoefficients", "d"
KEYS = {
    *("distortionmodel", "roi", "binningx", "binningy", *MATRIX, *LENS),
    *("imagewidth", "width", "imageheight", "height"),
    # these are for pictures that are rectified
    *("rectificationmatrix", "r", "projectionmatrix", "p"),
    *("cameraname", "header"),
}


def _plain(stored: Stored) -> dict[str, Any]:
    return {plain(key): value for key, value in stored.values.items()}


def _recognises(stored: Stored) -> bool:
    names = _plain(stored).keys()
    return "distortionmodel" in names and (
        {"k", "p"} <= names or {"cameramatrix", "projectionmatrix"} <= names
    )


def _read(stored: Stored) -> list[Calibration]:
    known = _plain(stored)
    name = str(known.get("cameraname") or stored.path.stem)
    others = dict[str, Any]()
    for key, value in stored.values.items():
        if plain(key) not in KEYS:
            others[key] = value
    check_keys(others, (), name, "ROS")
    model = plain(known["distortionmodel"])
    if model and model not in LENSES:
        raise InputError(
            f"the lens model {quoted(known['distortionmodel'])}, which is not known"
        )
    matrix = matrix_of(first_of(known, MATRIX))
    lens = first_of(known, LENS)
    width = number_of(first_of(known, ("imagewidth", "width")))
    height = number_of(first_of(known, ("imageheight", "height")))
    sensor = [width, height]
    matrix, size = _region(known, numbers_of(matrix.reshape(3, 3), (3, 3)), sensor)
    return [
        stated(
            name,
            size,
            matrix,
            np.zeros(4) if lens is None else matrix_of(lens),
            None,
            fisheye=LENSES.get(model, False),
            cropped=size != sensor,
        )
    ]


def _region(
    known: Mapping[str, Any], matrix: Array, size: list[float]
) -> tuple[Array, list[float]]:
    """Return the matrix and the size of the pictures that a camera sends.

    `matrix` and `size` are for its whole sensor.
    """
    region = known.get("roi")
    part = {}
    if isinstance(region, dict):
        part = {plain(key): value for key, value in region.items()}
    elif region is not None and counts(region):
        raise InputError("the key 'roi' without x_offset, y_offset, width and height")
    offset = np.array([number_of(part.get(f"{axis}offset", 0)) for axis in "xy"])
    sides = [number_of(part.get(side, 0)) for side in ("width", "height")]
    bins = np.array([number_of(known.get(f"binning{axis}", 0)) for axis in "xy"])
    # a binning of 0 means 1, and sides of 0 mean the whole sensor
    bins[bins == 0.0] = 1.0
    if all(sides):
        size = sides
    elif offset.any() or any(sides):
        raise InputError(f"a region of interest without a size, {quoted(region)}")
    focal = np.diag(matrix)[:2] / bins
    centre = (matrix[:2, 2] + HALF - offset) / bins - HALF
    if not (bins == 1.0).all() or offset.any():
        matrix = pinhole_matrix(focal, centre)
    binned: list[float] = (np.array(size) // bins).tolist()
    return matrix, binned


ROS = Dialect("ROS", _recognises, _read)
