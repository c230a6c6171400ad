"""Qualisys' calibration in XML.

Lengths are millimetres, and 64ths of a pixel on the sensor. The cameras look along -z
with y up. `fov_video` is the part of the sensor that the video shows.
"""

from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.lens import (
    OPENGL,
    Calibration,
    pinhole_matrix,
    placed_at,
    stated,
)
from posefit.geometry.calibration.values import Stored, counts, plain
from posefit.geometry.calibration.xml_tags import tag_of
from posefit.reading import quoted

SUBPIXELS = 64.0
MILLIMETRES = 0.001
# in the order of OpenCV's k1, k2, p1, p2, k3
LENS = (
    *("radialDistortion1", "radialDistortion2"),
    *("tangentalDistortion1", "tangentalDistortion2", "radialDistortion3"),
)
INTRINSICS = {
    *("focalLengthU", "focalLengthV", "centerPointU", "centerPointV", *LENS),
    # the focal length in millimetres, and the sides of the whole sensor
    *("focallength", "sensorMinU", "sensorMaxU", "sensorMinV", "sensorMaxV"),
}


def _read(stored: Stored) -> list[Calibration]:
    calibrations = list[Calibration]()
    for number, camera in enumerate(stored.root.iter("camera")):
        name = camera.get("serial", f"camera {number}")
        calibrations.append(_camera(camera, name))
    return calibrations


def _camera(camera: Any, name: str) -> Calibration:
    view = tag_of(camera, "fov_video")
    lens = tag_of(camera, "intrinsic")
    place = tag_of(camera, "transform")
    for key, value in lens.items():
        if key not in INTRINSICS and counts(value):
            raise InputError(f"the lens key {quoted(key)}, which is not known")
    if counts(camera.get("viewrotation", "0")):
        raise InputError(
            f"the key 'viewrotation' of {quoted(name)}, which is not read: calibrate "
            "with views that are not rotated"
        )
    left, top, right, bottom = _floats(view, "left", "top", "right", "bottom")
    focal = _floats(lens, "focalLengthU", "focalLengthV") / SUBPIXELS
    centre = _floats(lens, "centerPointU", "centerPointV") / SUBPIXELS
    rows = [_floats(place, f"r{i}1", f"r{i}2", f"r{i}3") for i in "123"]
    turned = np.array(rows)
    position = MILLIMETRES * _floats(place, "x", "y", "z")
    return stated(
        name,
        (right - left + 1, bottom - top + 1),
        pinhole_matrix(focal, centre - (left, top)),
        [float(lens.get(key, "0")) for key in LENS],
        placed_at(OPENGL @ turned, position),
        # the video may show any part of the sensor
        cropped=True,
        scale="metres",
    )


def _floats(tag: Any, *names: str) -> Array:
    return np.array([float(tag.get(name, "")) for name in names])


def _recognises(stored: Stored) -> bool:
    return (
        stored.root is not None
        and plain(stored.root.tag) == "calibration"
        and stored.root.find(".//fov_video") is not None
    )


QUALISYS = Dialect("Qualisys", _recognises, _read)
