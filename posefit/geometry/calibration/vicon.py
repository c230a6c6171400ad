"""Vicon's calibration, .xcp; lengths in millimetres.

The cameras look along z with y down. The lens' numbers lead from the distorted picture
to the straight one: a pixel at a distance r from the centre belongs at
r (1 + k1 r^2 + k2 r^4 + k3 r^6), with lengths in pixels. OpenCV's numbers lead the
other way, by a quotient of two such polynomials. They are fitted.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.keys import check_others, unread
from posefit.geometry.calibration.lens import (
    Calibration,
    numbers_of,
    pinhole_matrix,
    placed_at,
    stated,
)
from posefit.geometry.calibration.values import Stored, number_of
from posefit.geometry.calibration.xml_tags import numbers_in
from posefit.reading import quoted

MILLIMETRES = 0.001
# cameras of this system take videos; the others only see markers
VIDEO = "DV"
CAMERA = {
    *("DEVICEID", "SENSOR_SIZE", "PIXEL_ASPECT_RATIO", "SYSTEM"),
    *("ACTIVE_THRESHOLD", "DISPLAY_TYPE", "ISDV", "LABEL", "MODEL", "NAME"),
    *("SENSOR", "TYPE", "USERID"),
}
FRAME = {
    *("FOCAL_LENGTH", "ORIENTATION", "POSITION", "PRINCIPAL_POINT"),
    *("VICON_RADIAL", "VICON_RADIAL2", "FRAME", "IMAGE_ERROR", "WORLD_ERROR"),
}
# pixels: largest error of the fitted lens, and largest distance of the lens' centre
# from the principal point
TOLERANCE = 0.25
SAMPLES = 50


def _read(stored: Stored) -> list[Calibration]:
    cameras = list(stored.root.findall("Camera"))
    filming = [camera for camera in cameras if camera.get("SYSTEM") == VIDEO]
    calibrations = list[Calibration]()
    for camera in filming or cameras:
        frames = camera.findall("KeyFrames/KeyFrame")
        # a camera that saw nothing during the calibration has no key frame
        if frames:
            calibrations.append(_camera(camera, frames[0]))
    return calibrations


def _camera(camera: Any, frame: Any) -> Calibration:
    name = str(camera.get("DEVICEID"))
    check_others(name, unread(camera.attrib, CAMERA))
    check_others(name, unread(frame.attrib, FRAME))
    needed = {"SENSOR_SIZE": camera.get("SENSOR_SIZE")}
    for key in ("PRINCIPAL_POINT", "FOCAL_LENGTH", "ORIENTATION", "POSITION"):
        needed[key] = frame.get(key)
    for key, value in needed.items():
        if value is None:
            raise InputError(f"the camera {quoted(name)} without {key}")
    size = numbers_of(numbers_in(camera.get("SENSOR_SIZE")), (2,))
    centre = numbers_of(numbers_in(frame.get("PRINCIPAL_POINT")), (2,))
    focal = number_of(frame.get("FOCAL_LENGTH"))
    aspect = number_of(camera.get("PIXEL_ASPECT_RATIO", "1"))
    turn = numbers_of(numbers_in(frame.get("ORIENTATION")), (4,))
    position = MILLIMETRES * numbers_of(numbers_in(frame.get("POSITION")), (3,))
    return stated(
        name,
        size,
        pinhole_matrix([focal, focal / aspect], centre),
        _lens(frame, centre, focal, size),
        placed_at(_of_quaternion(turn), position),
        scale="metres",
    )


def _of_quaternion(numbers: Array) -> Array:
    """Return the rotation (3, 3) of a quaternion x, y, z, w."""
    length = float(np.linalg.norm(numbers))
    if abs(length - 1.0) > 1e-2:
        raise InputError(
            f"a quaternion whose length is not 1: {quoted(numbers.tolist())}"
        )
    x, y, z, w = numbers / length
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + 2.0 * w * across + 2.0 * across @ across)


def _lens(frame: Any, centre: Array, focal: float, size: Array) -> Array:
    """Return OpenCV's k1, k2, p1, p2, k3 to k6 of a frame's lens."""
    if frame.get("VICON_RADIAL2") is not None:
        _, *words = frame.get("VICON_RADIAL2").split()
        numbers = numbers_of(numbers_in(" ".join(words)), (5,))
        middle = numbers[:2]
        radial = numbers[2:]
        if radial.any() and np.abs(middle - centre).max() > TOLERANCE:
            raise InputError(
                f"the key 'VICON_RADIAL2', whose centre {quoted(middle.tolist())} is "
                "not the principal point"
            )
    else:
        radial = numbers_in(frame.get("VICON_RADIAL", "0 0"))
    return _turned_around(radial, focal, float(np.linalg.norm(size)) / 2.0)


def _turned_around(radial: ArrayLike, focal: float, reach: float) -> Array:
    """Return OpenCV's eight numbers of a lens.

    `radial` leads from the distorted picture to the straight one. `reach` is the
    largest distance from the centre, in pixels, at which the numbers are fitted.
    """
    radial = np.asarray(radial, dtype=np.float64)
    if not radial.any():
        return np.zeros(8)
    bent = np.linspace(0.0, reach, SAMPLES + 1)[1:]
    powers = bent[:, None] ** (2.0 * np.arange(1, radial.size + 1))
    straight = bent * (1.0 + powers @ radial)
    if not (np.diff(straight) > 0.0).all():
        raise InputError("a lens that folds the picture over")
    # Least squares for k1 to k6, with s = straight / focal:
    # bent (1 + k4 s^2 + k5 s^4 + k6 s^6) = straight (1 + k1 s^2 + k2 s^4 + k3 s^6)
    form = (straight / focal)[:, None] ** [2.0, 4.0, 6.0]
    columns = np.hstack([straight[:, None] * form, -bent[:, None] * form])
    k1, k2, k3, *below = np.linalg.lstsq(columns, bent - straight, rcond=None)[0]
    ratio = (1.0 + form @ [k1, k2, k3]) / (1.0 + form @ below)
    off = float(np.abs(straight * ratio - bent).max())
    if not off <= TOLERANCE:
        raise InputError(
            f"a lens that OpenCV's model does not fit: it is {off:.2g} pixels off, "
            f"{quoted(radial.tolist())}"
        )
    return np.array([k1, k2, 0.0, 0.0, k3, *below])


def _recognises(stored: Stored) -> bool:
    return stored.root is not None and stored.root.tag == "Cameras"


VICON = Dialect("Vicon", _recognises, _read)
