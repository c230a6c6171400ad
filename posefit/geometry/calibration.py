"""Calibration files of other programs, read into cameras: OpenCV's YAML and JSON, Qualisys' XML, and TOML.

A file holds one camera or several. All give camera_from_world in OpenCV's frame; which way is up in their world
differs, and is turned to +y here: the axis that the images of all cameras see pointing up, unless `up` names one.

What OpenCV's FileStorage writes, as YAML, JSON or XML, is read without OpenCV, whose reader trusts the file: values
become numbers, texts, lists and dictionaries, nothing is expanded, and a matrix is as large as the numbers that are
there.
"""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.camera import Camera
from posefit.reading import cut, parsed_json, parsed_toml, quoted, read_text

Up = Literal["x", "y", "z"]
LARGEST_FILE = 500_000  # bytes: PyYAML reads some 100,000 a second
MESSAGE = 300  # characters of what is wrong
DISTORTIONS = (4, 5, 8, 12, 14)  # how many numbers OpenCV describes a lens by
BLOCK = 16  # pixels: codecs fill pictures up to a multiple of it
# the letters of OpenCV's element types whose numbers are rounded when they are read
_ROUNDED = {"f": np.float32, "h": np.float16}
_TYPE = re.compile(r"([1-9]?)([ucwsifdh])")
SUBPIXELS = 64.0  # Qualisys counts lengths on the sensor in 64ths of a pixel
HALF = 0.5  # pixels: files count the centre of the first pixel as 0, we as 0.5
# The rotation of the world that turns an axis to +y.
TURNS = {"x": [[0, -1, 0], [1, 0, 0], [0, 0, 1]], "y": np.eye(3), "z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]]}


@dataclass(frozen=True, eq=False)
class Calibration:
    """One camera's entry in a calibration file. Lengths are metres and pixels."""

    name: str
    size: tuple[int, int]  # width, height
    matrix: Array = field(repr=False)  # (3, 3) of the pinhole, skew ignored; pixel centres at 0, as OpenCV counts them
    distortion: Array = field(repr=False)  # (4,) to (14,): OpenCV's k1, k2, p1, p2, k3, ...; none is all 0
    rotation: Array | None = field(repr=False)  # (3, 3) camera_from_world; None where the file does not place it
    translation: Array | None = field(repr=False)  # (3,)
    fisheye: bool = False
    upright: bool = False  # whether +y is known to be up in its world, as in our own files

    @property
    def distorted(self) -> bool:
        """Whether the lens bends straight lines."""
        return bool(np.any(self.distortion))

    def camera(self, size: tuple[int, int], world: Array) -> Camera:
        """Return the camera of pictures scaled to `size` without their distortion; `world` (3, 3) turns its up to +y.

        A camera that the file does not place stands at the origin and looks level along -z.
        """
        scale = np.array(size) / self.size
        rotation = np.diag([1.0, -1.0, -1.0]) if self.rotation is None else self.rotation @ world.T
        translation = np.zeros(3) if self.translation is None else self.translation
        focal = np.diag(self.matrix)[:2] * scale
        centre = (self.matrix[:2, 2] + HALF) * scale
        return Camera(*size, focal, centre, _orthonormal(rotation), translation)

    def padded(self, size: tuple[int, int]) -> "Calibration | None":
        """Return the calibration of pictures of another size that only have rows or columns more or less at their end.

        Codecs fill up a picture to blocks of 16 pixels, so that 1080 rows become 1088, and some programs leave them
        there. None where the sizes differ otherwise.
        """
        for mine, other in zip(self.size, size, strict=True):
            if mine != other and (abs(mine - other) >= BLOCK or max(mine, other) % BLOCK):
                return None
        return replace(self, size=size)

    def maps(self, size: tuple[int, int]) -> tuple[Any, Any]:
        """Return the two maps with which cv2.remap undoes the distortion of pictures scaled to `size`."""
        matrix = self._matrix(size)
        if self.fisheye:
            return cv2.fisheye.initUndistortRectifyMap(
                matrix, self.distortion[:4], np.eye(3), matrix, size, cv2.CV_32FC1
            )
        return cv2.initUndistortRectifyMap(matrix, self.distortion, np.eye(3), matrix, size, cv2.CV_32FC1)

    def _matrix(self, size: tuple[int, int]) -> Array:
        camera = self.camera(size, np.eye(3))
        return _pinhole(camera.focal, camera.centre - HALF)

    def straightened(self, points: Array, size: tuple[int, int]) -> Array:
        """Return points (..., 3), columns and rows of pictures scaled to `size` and a third number, undistorted."""
        matrix = self._matrix(size)
        bent = points[..., :2].reshape(-1, 1, 2).astype(np.float64) - HALF
        undistort = cv2.fisheye.undistortPoints if self.fisheye else cv2.undistortPoints
        straight = undistort(bent, matrix, self.distortion[: 4 if self.fisheye else None], P=matrix) + HALF
        return np.concatenate([straight.reshape(*points.shape[:-1], 2), points[..., 2:]], axis=-1)


def upright(calibrations: Sequence[Calibration], up: Up | None = None) -> Array:
    """Return the rotation (3, 3) that turns the world of calibrations so that +y is up.

    It is +y where the file states it; otherwise, without `up`, the axis, in either direction, that points up in the
    images most. Raises ValueError where `up` is none.
    """
    if up is not None and up not in TURNS:
        raise InputError(f"up must be one of x, y, z, got {quoted(up)}")
    placed = [camera.rotation for camera in calibrations if camera.rotation is not None]
    if not placed or any(camera.upright for camera in calibrations):
        return np.eye(3)
    image_up = -np.sum([rotation[1] for rotation in placed], axis=0)  # images' up, in the world
    axis: Up = up or ("x", "y", "z")[int(np.abs(image_up).argmax())]
    turn = np.array(TURNS[axis], dtype=np.float64)
    return turn if up is not None or (turn @ image_up)[1] > 0.0 else np.diag([1.0, -1.0, -1.0]) @ turn


def read_calibrations(path: str | Path) -> list[Calibration]:
    """Return the cameras of a calibration file, in its order. Raises ValueError naming the file and what is wrong."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: expected a calibration file, got nothing of that name")
    text = read_text(path, LARGEST_FILE)
    try:
        calibrations = _reader(path, text)(path, text)
        for calibration in calibrations:
            calibration.camera(calibration.size, np.eye(3))
    except (ValueError, TypeError, KeyError, OverflowError, AttributeError, RecursionError, cv2.error) as error:
        cause = " ".join(str(error).split()) or type(error).__name__
        reason = cut(f"no {cause}" if isinstance(error, KeyError) else cause, MESSAGE)
        raise InputError(f"{path}: expected a calibration of OpenCV, Qualisys, TOML or posefit, got {reason}") from None
    if not calibrations:
        raise InputError(f"{path}: expected a calibration with a camera, got none")
    return calibrations


def _reader(path: Path, text: str) -> Callable[[Path, str], list[Calibration]]:
    start = text.lstrip()[:100]
    if start.startswith("<") and "opencv_storage" not in start:
        return _qualisys
    if start.startswith("{") and "camera_from_world" in text:
        return _own
    if start.startswith(("{", "%YAML", "<")):
        return _opencv
    if path.suffix.lower() == ".toml":
        return _toml
    raise InputError(
        f"a file that is none of them, {path.suffix or 'without a suffix'}; OpenCV's YAML begins with %YAML"
    )


def _own(path: Path, _: str) -> list[Calibration]:
    camera = Camera.from_json(path)
    matrix, size = _pinhole(camera.focal, camera.centre - HALF), (camera.width, camera.height)
    return [Calibration(path.stem, size, matrix, np.zeros(4), camera.rotation, camera.translation, upright=True)]


def _toml(_: Path, text: str) -> list[Calibration]:
    return [
        _stated(
            str(camera.get("name", name)),
            camera["size"],
            camera["matrix"],
            camera.get("distortions", []),
            camera.get("rotation"),
            camera.get("translation"),
            bool(camera.get("fisheye", False)),
        )
        for name, camera in parsed_toml(text).items()
        if name != "metadata" and isinstance(camera, dict)
    ]


def _qualisys(_: Path, text: str) -> list[Calibration]:
    calibrations: list[Calibration] = []
    for number, camera in enumerate(_xml_of(text).iter("camera")):
        view, lens, place = (_tag(camera, name) for name in ("fov_video", "intrinsic", "transform"))
        left, top, right, bottom = (float(view.get(side, "")) for side in ("left", "top", "right", "bottom"))
        focal, centre = (
            np.array([float(lens.get(f"{name}{axis}", "")) / SUBPIXELS for axis in "UV"])
            for name in ("focalLength", "centerPoint")
        )
        names = ("radialDistortion1", "radialDistortion2", "tangentalDistortion1", "tangentalDistortion2")
        distortion = [float(lens.get(name, "0")) for name in (*names, "radialDistortion3")]
        turned = np.array([[float(place.get(f"r{i}{j}", "")) for j in "123"] for i in "123"])
        rotation = np.diag([1.0, -1.0, -1.0]) @ turned  # its camera looks along -z with y up
        position = np.array([float(place.get(axis, "")) for axis in "xyz"]) / 1000.0
        size, matrix = (right - left + 1, bottom - top + 1), _pinhole(focal, centre - (left, top))
        name = camera.get("serial", f"camera {number}")
        calibrations.append(_stated(name, size, matrix, distortion, rotation, -rotation @ position))
    return calibrations


def _tag(camera: Any, name: str) -> Any:
    tag = camera.find(name)
    if tag is None:
        raise InputError(f"a camera without {name}")
    return tag


def _opencv(path: Path, text: str) -> list[Calibration]:
    values = _stored_values(text)

    def matrix(*names: str) -> Array | None:
        return next((_matrix_of(values[name]) for name in names if name in values), None)

    own = matrix("camera_matrix", "cameraMatrix", "K", "M")
    size = [values.get(f"image_{name.lower()}", values.get(f"image{name}")) for name in ("Width", "Height")]
    if own is None or None in size:
        raise InputError("one without camera_matrix, image_width and image_height")
    distortion = matrix("distortion_coefficients", "dist_coeffs", "distCoeffs", "distortion", "D")
    rotation, translation = matrix("R", "rotation", "rvec"), matrix("T", "translation", "tvec")
    if (rotation is None) != (translation is None):
        raise InputError("one with a rotation or a translation, but not both")
    if rotation is not None and rotation.size == 3:
        rotation = rotation.reshape(3)
    if translation is not None:
        translation = translation.reshape(-1)
    sides = [_number_of(side) for side in size]
    return [_stated(path.stem, sides, own, [] if distortion is None else distortion, rotation, translation)]


def _stated(
    name: str, size: Any, matrix: Any, distortion: Any, rotation: Any, translation: Any, fisheye: bool = False
) -> Calibration:
    """Return what a file states, checked; a rotation (3,) is its axis, as long as its angle."""
    width, height = size
    if not (float(width).is_integer() and float(height).is_integer() and width >= 1 and height >= 1):
        raise InputError(f"an image size of {width} x {height}")
    lens = np.array(distortion, dtype=np.float64).reshape(-1)
    if not np.isfinite(lens).all():
        raise InputError("a distortion that is not finite")
    if not lens.any():
        lens = np.zeros(4)
    elif lens.size not in DISTORTIONS:
        raise InputError(f"a distortion of {lens.size} numbers")
    if np.shape(rotation) == (3,):
        rotation = cv2.Rodrigues(_numbers(rotation, (3,)))[0]
    return Calibration(
        name,
        (int(width), int(height)),
        _numbers(matrix, (3, 3)),
        lens,
        None if rotation is None else _numbers(rotation, (3, 3)),
        None if translation is None else _numbers(translation, (3,)),
        fisheye,
    )


def _pinhole(focal: Array, centre: Array) -> Array:
    return np.array([[focal[0], 0.0, centre[0]], [0.0, focal[1], centre[1]], [0.0, 0.0, 1.0]])


def _numbers(values: Any, shape: tuple[int, ...]) -> Array:
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.shape != shape or not np.isfinite(numbers).all():
        raise InputError(f"{quoted(numbers.tolist())} where finite numbers of shape {shape} should be")
    return numbers


def _orthonormal(rotation: Array) -> Array:
    """Return the rotation nearest to a matrix that was rounded when it was written."""
    left, _, right = np.linalg.svd(rotation)
    nearest = left @ right
    if np.linalg.det(nearest) < 0.0 or np.abs(nearest - rotation).max() > 1e-2:
        raise InputError(f"a rotation that is none: {quoted(rotation.tolist())}")
    return np.asarray(nearest)


def _stored_values(text: str) -> dict[str, Any]:
    """Return the values of a file by name. Raises ValueError where it is none of the three formats."""
    start = text.lstrip()[:1]
    values = _xml(text) if start == "<" else parsed_json(text) if start == "{" else _yaml(text)
    if not isinstance(values, dict):
        raise InputError(f"a file without names, {quoted(values)}")
    return values


def _matrix_of(value: Any) -> Array:
    """Return a matrix, or numbers in one row. Raises ValueError where there are none, too many, or another number."""
    stated = value if isinstance(value, dict) and "data" in value else {"data": value}
    cells = np.array(stated["data"].split() if isinstance(stated["data"], str) else stated["data"], dtype=object)
    numbers = np.array([_number_of(cell) for cell in cells.flat], dtype=np.float64)
    match = _TYPE.fullmatch(str(stated.get("dt", "d")))
    if match is None:
        raise InputError(f"a matrix of the type {quoted(stated['dt'])}")
    if match[2] in _ROUNDED:
        numbers = numbers.astype(_ROUNDED[match[2]]).astype(np.float64)
    sides = [stated["rows"], stated["cols"]] if {"rows", "cols"} <= stated.keys() else stated.get("sizes")
    if sides is None:
        return numbers.reshape(cells.shape)
    shape = [*map(_number_of, sides if isinstance(sides, list) else [sides]), *map(float, filter(None, [match[1]]))]
    if not all(side.is_integer() and side > 0 for side in shape) or numbers.size != math.prod(shape):
        raise InputError(f"a matrix of {' x '.join(f'{side:g}' for side in shape)} with {numbers.size} numbers")
    return numbers.reshape([int(side) for side in shape])


def _number_of(value: Any) -> float:
    """Return a number, which may be text. Raises ValueError where it is none."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{quoted(value)} where a number should be") from None


def _yaml(text: str) -> Any:
    """Return what a YAML text holds: texts, lists and dictionaries alone, whatever tags it has."""
    import yaml

    # OpenCV writes %YAML:1.0 where the directive is %YAML 1.0
    text = re.sub(r"\A\s*%YAML[^\n]*\n", "", text)
    try:
        return yaml.load(text, Loader=yaml.BaseLoader)
    except (yaml.YAMLError, RecursionError) as error:
        reason = " ".join(str(error).split()) or "brackets that are nested too deeply"
        raise InputError(f"YAML that is broken: {reason}") from None


def _xml(text: str) -> dict[str, Any]:
    root = _xml_of(text)
    if root.tag != "opencv_storage":
        raise InputError(f"XML of {quoted(root.tag)}")
    return {one.tag: {part.tag: (part.text or "").strip() for part in one} or (one.text or "").strip() for one in root}


def _xml_of(text: str) -> Any:
    """Return the root of an XML text. Raises ValueError where it is broken or has a document type, which may expand."""
    from xml.etree.ElementTree import ParseError

    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import fromstring

    try:
        return fromstring(text, forbid_dtd=True)
    except DefusedXmlException:
        raise InputError("an XML file with a document type, which is not read") from None
    except (ParseError, ValueError, RecursionError) as error:  # ValueError: an encoding that contradicts the text's
        raise InputError(f"XML that is broken: {error}") from None
