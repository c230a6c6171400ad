"""Calibration files of other programs, read into cameras.

| from | file |
|---|---|
| OpenCV, as FileStorage writes it, or any names that its users give | YAML, JSON, XML |
| ROS | camera_info, YAML |
| EasyMocap | intri.yml, with extri.yml beside it |
| Pose2Sim, Anipose, Caliscope | TOML |
| Qualisys | XML |
| posefit, `Camera.to_json` | JSON |

A file holds one camera or several; `cameras.toml:left` is one of them by its name. All give camera_from_world in
OpenCV's frame; which way is up in their world differs, and is turned to +y here: the axis that the images of all
cameras see pointing up, unless `up` names one. Lengths are in the file's own unit, see `footage/cameras.py`.

Each file but Qualisys' and our own becomes texts, numbers, lists and dictionaries. OpenCV's own reader is not used, as
it trusts the file: here nothing is expanded, and a matrix is as large as the numbers that are there. One reader looks
for cameras in these values and in their tables, whatever the format. A key that seems to describe a lens in an unknown
way is an error, not a straight lens. Messages of errors in here complete `expected a calibration of ..., got ...`.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.camera import Camera, check_focal, is_focal
from posefit.reading import cut, parsed_json, parsed_toml, quoted, read_text

Up = Literal["x", "y", "z"]
LARGEST_FILE = 500_000  # bytes: PyYAML reads some 100,000 a second
MESSAGE = 300  # characters of what is wrong
MOST_TABLES = 10_000
DISTORTIONS = (4, 5, 8, 12, 14)  # how many numbers OpenCV describes a lens by
BLOCK = 16  # pixels: codecs fill pictures up to a multiple of it
# the letters of OpenCV's element types whose numbers are rounded when they are read
_ROUNDED = {"f": np.float32, "h": np.float16}
_TYPE = re.compile(r"([1-9]?)([ucwsifdh])")
SUBPIXELS = 64.0  # Qualisys counts lengths on the sensor in 64ths of a pixel
# Kalibr's key: the matrix (4, 4) to a camera from the one before it in the file
CHAINED = "T_cn_cnm1"
HALF = 0.5  # pixels: files count the centre of the first pixel as 0, we as 0.5
# The rotation of the world that turns an axis to +y.
TURNS = {
    "x": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    "y": np.eye(3),
    "z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
}
# of the images' up direction: where less of it is along the axis that a file says is
# up, it is doubted
LEVEL = 0.5

# Names of what describes a camera, in small letters and without signs between: Camera_Matrix is cameramatrix
MATRIX = (
    "cameramatrix",
    "matrix",
    "k",
    "m",
    "mtx",
    "intrinsic",
    "intrinsics",
    "intrinsicmatrix",
)
LENS = (
    *(
        "distortioncoefficients",
        "distortioncoeffs",
        "distortions",
        "distortion",
        "distcoefficients",
        "distcoeffs",
    ),
    *("distcoefs", "distcoef", "distcoeff", "dist", "d", "kc"),
)
MODEL = (
    "distortionmodel",
    "fisheyemodel",
    "fisheye",
    "isfisheye",
    "lensmodel",
    "cameramodel",
    "model",
)
SIZE = ("imagesize", "size", "resolution", "imgsize", "imsize")
SIDES = (("imagewidth", "width", "w"), ("imageheight", "height", "h"))
ROTATION = ("r", "rotation", "rvec", "rot", "rmat", "rotationmatrix", "rotationvector")
TRANSLATION = ("t", "translation", "tvec", "translationvector")
_FISHEYES = (
    "1",
    "true",
    "yes",
    "fisheye",
    "equidistant",
    "kannalabrandt",
    "kannalabrandt4",
    "opencvfisheye",
    "kb4",
)
_POLYNOMIALS = (
    *(
        "0",
        "false",
        "no",
        "none",
        "null",
        "",
        "plumbbob",
        "brown",
        "brownconrady",
        "pinhole",
        "perspective",
    ),
    *(
        "opencv",
        "fullopencv",
        "polynomial",
        "rationalpolynomial",
        "radtan",
        "radialtangential",
        "standard",
    ),
)
# models not read
_OTHERS = re.compile(
    "omni|mei|unified|ucm|sphere|spherical|fov|prism|ocam|division|rectangular"
)
# keys that seem to describe a lens, such as radial_distortion, kappa1, k7, p3, s1, skew or xi; not distance, lens_mm or
# lens_serial
_OF_LENS = re.compile(
    r".*(dist(?!an)|coef|lens(?!.*(focal|mm|serial))|fish|radial|tangential|omni|prism|skew|shear).*"
    r"|(k|kappa|p|b)[0-9]+|k|kappa|s[1-9]|tau[0-9xy]*|alphac?|xi"
)
# keys that seem to say where a camera stands, in a way that is not read: axes and directions differ between programs
_OF_PLACE = re.compile(
    r"(camera|cam|c|world|w)(to|2|from)(camera|cam|c|world|w)(matrix)?|matrixworld|tcw|twc"
    r"|(camera)?(transform|extrinsics?|pose)(matrix)?|rt|q|qvec|quat|quaternion"
    r"|(camera)?(position|location|orientation|euler|eulerangles)"
)
FULL_TURN = 2.0 * math.pi  # radians, and no rotation vector is longer
SKEWED = 2e-3  # of the focal length: pixels whose sides lean by less change nothing
# of a picture's sides: a principal point is in the middle half
MIDDLE = 0.25, 0.75
# by how much of a picture's sides it may be off the centre by equal shares of both, as a picture that was scaled has it
SCALED = 0.1
EQUAL = 0.03


@dataclass(frozen=True, eq=False)
class Calibration:
    """One camera's entry in a calibration file. Lengths are metres, or the file's unit, and pixels."""

    name: str
    # width, height; None where the file does not state it: that of its pictures
    size: tuple[int, int] | None
    # (3, 3) of the pinhole, a skew of next to nothing ignored; pixel centres at 0, as OpenCV counts them
    matrix: Array = field(repr=False)
    # (4,) to (14,): OpenCV's k1, k2, p1, p2, k3, ...; none is all 0
    distortion: Array = field(repr=False)
    # (3, 3) camera_from_world; None where the file does not place it
    rotation: Array | None = field(repr=False)
    translation: Array | None = field(repr=False)  # (3,)
    fisheye: bool = False
    # whether +y is known to be up in its world, as in our own files
    upright: bool = False

    @property
    def distorted(self) -> bool:
        """Whether the lens bends straight lines; a fisheye does so by itself."""
        return self.fisheye or bool(np.any(self.distortion))

    def in_metres(self, metres: float) -> "Calibration":
        """Return the calibration of a file whose unit is so many metres."""
        return (
            self
            if self.translation is None
            else replace(self, translation=metres * self.translation)
        )

    def camera(self, size: tuple[int, int], world: Array) -> Camera:
        """Return the camera of pictures scaled to `size` without their distortion; `world` (3, 3) turns its up to +y.

        A camera that the file does not place stands at the origin and looks level along -z.
        """
        scale = np.array(size) / (self.size or size)
        rotation = (
            np.diag([1.0, -1.0, -1.0])
            if self.rotation is None
            else self.rotation @ world.T
        )
        translation = np.zeros(3) if self.translation is None else self.translation
        focal = np.diag(self.matrix)[:2] * scale
        centre = (self.matrix[:2, 2] + HALF) * scale
        return Camera(*size, focal, centre, _orthonormal(rotation), translation)

    def padded(self, size: tuple[int, int]) -> "Calibration | None":
        """Return the calibration of pictures of another size that only have rows or columns more or less at their end.

        Codecs fill up a picture to blocks of 16 pixels, so that 1080 rows become 1088, and some programs leave them
        there. None where the sizes differ otherwise; a calibration of no size fits where its centre is in the middle
        half of the picture.
        """
        if self.size is None:
            fits = _is_central(self.matrix, size) and is_focal(
                np.diag(self.matrix)[:2], size
            )
            return replace(self, size=size) if fits else None
        for side, other in zip(self.size, size, strict=True):
            if side != other and (
                abs(side - other) >= BLOCK or max(side, other) % BLOCK
            ):
                return None
        return replace(self, size=size)

    def maps(self, size: tuple[int, int]) -> tuple[Any, Any]:
        """Return the two maps with which cv2.remap undoes the distortion of pictures scaled to `size`."""
        matrix = self._scaled_matrix(size)
        lens = self.distortion[: 4 if self.fisheye else None]
        maps = (
            cv2.fisheye.initUndistortRectifyMap
            if self.fisheye
            else cv2.initUndistortRectifyMap
        )
        return maps(matrix, lens, np.eye(3), matrix, size, cv2.CV_32FC1)

    def _scaled_matrix(self, size: tuple[int, int]) -> Array:
        camera = self.camera(size, np.eye(3))
        return pinhole_matrix(camera.focal, camera.centre - HALF)

    def straightened(self, points: Array, size: tuple[int, int]) -> Array:
        """Return points (..., 3), columns and rows of pictures scaled to `size` and a third number, undistorted."""
        matrix = self._scaled_matrix(size)
        bent = points[..., :2].reshape(-1, 1, 2).astype(np.float64) - HALF
        undistort = cv2.fisheye.undistortPoints if self.fisheye else cv2.undistortPoints
        straight = (
            undistort(
                bent, matrix, self.distortion[: 4 if self.fisheye else None], P=matrix
            )
            + HALF
        )
        return np.concatenate(
            [straight.reshape(*points.shape[:-1], 2), points[..., 2:]], axis=-1
        )


def _is_central(matrix: Array, size: Sequence[float]) -> bool:
    """Return whether a principal point may be that of pictures of a size, and not of larger or smaller ones."""
    across, down = matrix[:2, 2] / size
    low, high = MIDDLE
    if not (low < across < high and low < down < high):
        return False
    scaled = (
        abs(across - down) < EQUAL and min(abs(across - 0.5), abs(down - 0.5)) > SCALED
    )
    return not scaled


def upright(calibrations: Sequence[Calibration], up: Up | None = None) -> Array:
    """Return the rotation (3, 3) that turns the world of calibrations so that +y is up.

    It is `up`, or else +y where the file states it; otherwise the axis, in either direction, that points up in the
    images most. Raises InputError where `up` is none.
    """
    if up is not None and up not in TURNS:
        raise InputError(f"up must be one of x, y, z, got {quoted(up)}")
    image_up = _image_up(calibrations)
    if image_up is None or (
        up is None and any(camera.upright for camera in calibrations)
    ):
        return np.eye(3)
    axis = up or _axis(image_up)
    turn = np.array(TURNS[axis], dtype=np.float64)
    return (
        turn
        if up is not None or (turn @ image_up)[1] > 0.0
        else np.diag([1.0, -1.0, -1.0]) @ turn
    )


def guessed_up(calibrations: Sequence[Calibration]) -> str:
    """Return what `upright` assumes of calibrations without `up`, as a message says it; "" where nothing is."""
    image_up = _image_up(calibrations)
    if image_up is None:
        return ""
    axis = _axis(image_up)
    if not any(camera.upright for camera in calibrations):
        return f"{'+' if image_up['xyz'.index(axis)] > 0.0 else '-'}{axis} is up in the cameras' world"
    if image_up[1] < LEVEL * np.linalg.norm(image_up):
        return f"+y is up in the cameras' world, as posefit's own files have it, though {axis} is in their images"
    return ""


def _image_up(calibrations: Sequence[Calibration]) -> Array | None:
    """Return the images' up direction in the world (3,); None where no camera is placed."""
    placed = [camera.rotation for camera in calibrations if camera.rotation is not None]
    return -np.sum([rotation[1] for rotation in placed], axis=0) if placed else None


def _axis(direction: Array) -> Up:
    axes: Sequence[Up] = ("x", "y", "z")
    return axes[int(np.abs(direction).argmax())]


def read_calibrations(path: str | Path) -> list[Calibration]:
    """Return the cameras of a calibration file, in its order; of `FILE:NAME` that of this name.

    Raises InputError naming the file and what is wrong.
    """
    path = Path(path)
    chosen = ""
    file, colon, name = str(path).rpartition(":")
    if colon and not path.is_file():
        path = Path(file)
        chosen = name
    if not path.is_file():
        raise InputError(
            f"{path}: expected a calibration file, got nothing of that name"
        )
    text = read_text(path, LARGEST_FILE)
    try:
        calibrations = _cameras(path, text)
        for calibration in calibrations:
            calibration.camera(calibration.size or (1000, 1000), np.eye(3))
    except (
        ValueError,
        TypeError,
        KeyError,
        OverflowError,
        AttributeError,
        RecursionError,
        cv2.error,
    ) as error:
        cause = " ".join(str(error).split()) or type(error).__name__
        reason = cut(f"no {cause}" if isinstance(error, KeyError) else cause, MESSAGE)
        raise InputError(
            f"{path}: expected a calibration of OpenCV, Qualisys, TOML or posefit, got {reason}"
        ) from None
    if not calibrations:
        raise InputError(f"{path}: expected a calibration with a camera, got none")
    names = [calibration.name for calibration in calibrations]
    if chosen and chosen not in names:
        raise InputError(
            f"{path}: expected the name of a camera, {cut(', '.join(names))}, got {quoted(chosen)}"
        )
    return [
        calibration for calibration in calibrations if chosen in ("", calibration.name)
    ]


def _cameras(path: Path, text: str) -> list[Calibration]:
    """Return the cameras of a file. Raises an error that says what it is instead."""
    start = text.lstrip()[:100]
    if start.startswith("<") and "opencv_storage" not in start:
        return _qualisys(text)
    if start.startswith("{") and "camera_from_world" in text:
        return _own(path)
    values = _stored_values(path, start, text)
    if any(_has_transforms(value) for value in values.values()):
        raise InputError(
            "transforms of NeRF's programs, whose key 'transform_matrix' is not read"
        )
    if any(isinstance(value, dict) and CHAINED in value for value in values.values()):
        return _chained(path.stem, values)
    if "names" in values and any(
        key.startswith("K_") or key.startswith("Rot_") for key in values
    ):
        return _easymocap(path, values)
    return _described(path.stem, values)


def _has_transforms(value: Any) -> bool:
    return isinstance(value, list) and any(
        isinstance(entry, dict) and "transform_matrix" in entry for entry in value
    )


def _chained(name: str, values: Mapping[str, Any]) -> list[Calibration]:
    """Return the cameras of Kalibr's chain, each of which states its place from the camera before it.

    The world is the first camera's.
    """
    place = np.eye(4)
    cameras = list[Calibration]()
    for camera in _described(name, values):
        table = values[camera.name]
        if CHAINED in table:
            place = _numbers(_matrix_of(table[CHAINED]), (4, 4)) @ place
        elif cameras:
            raise InputError(f"{quoted(camera.name)} without {CHAINED}")
        cameras.append(
            replace(camera, rotation=place[:3, :3], translation=place[:3, 3])
        )
    return cameras


def _own(path: Path) -> list[Calibration]:
    camera = Camera.from_json(path)
    matrix = pinhole_matrix(camera.focal, camera.centre - HALF)
    size = (camera.width, camera.height)
    return [
        Calibration(
            path.stem,
            size,
            matrix,
            np.zeros(4),
            camera.rotation,
            camera.translation,
            upright=True,
        )
    ]


def _described(name: str, values: Mapping[str, Any]) -> list[Calibration]:
    """Return the camera that values describe by their keys, or those of their tables, and of the tables in these."""
    cameras = list[Calibration]()
    tables = [(name, values)]
    for _ in range(3):
        inner: list[tuple[str, Mapping[str, Any]]] = []
        for name, table in tables:
            # a camera may be called K or D
            known = {
                _plain(key): value
                for key, value in table.items()
                if not _is_camera(key, value)
            }
            # a camera that Caliscope left out
            if str(known.get("ignore")).lower() == "true":
                continue
            if {"fx", "fy", "cx", "cy"} <= known.keys():
                axes = (
                    [_number_of(known[kind + axis]) for axis in "xy"] for kind in "fc"
                )
                known["matrix"] = pinhole_matrix(*axes).tolist()
            if _first(known, MATRIX) is not None:
                cameras.append(_camera(name, table, known))
            elif _first(known, (*LENS, *ROTATION, *SIZE, *SIDES[0][:1])) is not None:
                raise InputError(
                    f"{quoted(name)} without camera_matrix, image_width and image_height"
                )
            else:
                inner += _tables(table)
        # as an alias of YAML may give the same one again and again
        if len(inner) > MOST_TABLES:
            raise InputError(f"a file of more than {MOST_TABLES:,} tables")
        tables = inner
    return cameras


def _is_camera(key: str, value: Any) -> bool:
    """Return whether a value is a table that describes a camera, whatever this is called."""
    if not isinstance(value, dict):
        return False
    names = {_plain(name) for name in value}
    # a table of focal lengths may also be the `intrinsics` of the camera around it
    stated = {"fx", "fy"} <= names and (_plain(key) not in MATRIX or len(key) == 1)
    return stated or not names.isdisjoint(MATRIX)


def _tables(values: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the tables among values, and those in lists, with their names."""
    for key, value in values.items():
        if isinstance(value, dict) and key != "metadata":
            yield str(value.get("name", key)), value
        elif isinstance(value, list):
            tables = (entry for entry in value if isinstance(entry, dict))
            yield from (
                (str(table.get("name", f"{key}{number}")), table)
                for number, table in enumerate(tables)
            )


def _camera(
    name: str, values: Mapping[str, Any], known: Mapping[str, Any]
) -> Calibration:
    """Return the camera that values describe, whose keys in small letters and digits are those of `known`."""
    matrix = _matrix_of(_first(known, MATRIX))
    if matrix.shape == (4,):  # as Kalibr has it
        matrix = pinhole_matrix(matrix[:2], matrix[2:])
    fisheye = _is_fisheye(known)
    # in OpenCV's order
    numbered = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3")
    lens = _first(known, LENS)
    stated = dict(values)
    if lens is None or (isinstance(lens, dict) and "k1" in lens):
        stated |= lens or {}
        lens = [(known if lens is None else lens).get(key, 0.0) for key in numbered]
    others = *LENS, *MODEL, *numbered, next(key for key in MATRIX if key in known)
    for key, value in stated.items():
        if (
            _OF_LENS.fullmatch(plain := _plain(key))
            and plain not in others
            and _counts(value)
        ):
            raise InputError(
                f"the lens key {quoted(key)} of {quoted(name)}, which is not known"
            )
    size = _first(known, SIZE) or [_first(known, names) for names in SIDES]
    sides = None if None in size else [_number_of(side) for side in size]
    matrix = _numbers(
        np.reshape(matrix, (3, 3)) if np.shape(matrix) == (9,) else matrix, (3, 3)
    )
    matrix, part = _region(known, matrix, sides)
    rotation, translation = _place(name, values, known)
    return _stated(
        name,
        part,
        matrix,
        _matrix_of(lens),
        rotation,
        translation,
        fisheye,
        cropped=part != sides,
    )


def _place(
    name: str, values: Mapping[str, Any], known: Mapping[str, Any]
) -> tuple[Array | None, Array | None]:
    """Return the rotation and the translation that values state, None of a camera that they do not place.

    Raises InputError where they seem to place it in a way that is not read.
    """
    # a message of ROS, whose R rectifies and does not place
    if "distortionmodel" in known and "p" in known:
        return None, None
    rotation = _first(known, ROTATION)
    translation = _first(known, TRANSLATION)
    if rotation is None and translation is None:
        # of a chessboard there are many; a single one is the camera's place
        single = [_matrix_of(known[key]) for key in ("rvecs", "tvecs") if key in known]
        if len(single) == 2 and all(numbers.size == 3 for numbers in single):
            return single[0].reshape(-1), single[1].reshape(-1)
        for key, value in values.items():
            if _OF_PLACE.fullmatch(_plain(key)) and (
                isinstance(value, dict) or _counts(value)
            ):
                raise InputError(
                    f"the key {quoted(key)} of {quoted(name)}, which is not read: where a camera stands is its "
                    "rotation and translation, from the world to the camera"
                )
        return None, None
    if rotation is None or translation is None:
        raise InputError("one with a rotation or a translation, but not both")
    return _matrix_of(rotation), _matrix_of(translation).reshape(-1)


def _region(
    known: Mapping[str, Any], matrix: Array, size: list[float] | None
) -> tuple[Array, list[float] | None]:
    """Return the matrix and the size of the pictures that a camera sends, which may be a part of the sensor's, binned.

    They are `roi` and `binning_x` and `binning_y` of ROS' CameraInfo, whose K and size are those of the whole sensor.
    """
    region = known.get("roi")
    part = {}
    if isinstance(region, dict):
        part = {_plain(key): value for key, value in region.items()}
    elif region is not None and _counts(region):
        raise InputError(
            "the key 'roi', which is not read: x_offset, y_offset, width and height are"
        )
    offset = np.array([_number_of(part.get(f"{axis}offset", 0)) for axis in "xy"])
    sides = [_number_of(part.get(side, 0)) for side in ("width", "height")]
    # 0 stands for 1, and for the whole sensor
    bins = np.array(
        [_number_of(known.get(f"binning{axis}", 0)) or 1.0 for axis in "xy"]
    )
    if all(sides):
        size = sides
    elif offset.any() or any(sides):
        raise InputError(f"a region of interest without a size, {quoted(region)}")
    if (bins == 1.0).all() and not offset.any():
        return matrix, size
    focal = np.diag(matrix)[:2] / bins
    centre = (matrix[:2, 2] + HALF - offset) / bins - HALF
    if size is not None:
        size = [float(side // by) for side, by in zip(size, bins, strict=True)]
    return pinhole_matrix(focal, centre), size


def _plain(key: object) -> str:
    return re.sub(r"[^a-z0-9]", "", str(key).lower())


def _first(known: Mapping[str, Any], names: Sequence[str]) -> Any:
    """Return the value of the first name that is known; None where none is."""
    return next((known[name] for name in names if name in known), None)


def _counts(value: Any) -> bool:
    """Return whether a value is a number, or numbers, that are not all 0."""
    try:
        return bool(_matrix_of(value).any())
    except (ValueError, TypeError, KeyError):
        return False


def _is_fisheye(known: Mapping[str, Any]) -> bool:
    """Return whether the lens is OpenCV's fisheye. Raises InputError for a model that OpenCV has not."""
    for key in (name for name in MODEL if name in known):
        model = _plain(known[key])
        if model in _FISHEYES:
            return True
        if model not in _POLYNOMIALS and (
            key not in ("cameramodel", "model") or _OTHERS.search(model)
        ):
            raise InputError(f"the lens model {quoted(known[key])}, which is not known")
    return False


def _easymocap(path: Path, values: dict[str, Any]) -> list[Calibration]:
    """Return the cameras of EasyMocap's intri.yml and extri.yml; either is the file, the other stands beside it."""
    for kind, other_kind in (("intri", "extri"), ("extri", "intri")):
        other = path.with_name(path.name.replace(kind, other_kind, 1))
        if other != path and other.is_file():
            values = {
                **_stored_values(other, "%", read_text(other, LARGEST_FILE)),
                **values,
            }
    keys = {
        "K": "K",
        "dist": "dist",
        "R": "Rot",
        "rvec": "R",
        "T": "T",
        "width": "W",
        "height": "H",
    }
    calibrations: list[Calibration] = []
    for name in values["names"]:
        entry = {
            key: values[f"{kind}_{name}"]
            for key, kind in keys.items()
            if f"{kind}_{name}" in values
        }
        if not (_counts(entry.get("width")) and _counts(entry.get("height"))):
            entry.pop("width", None)
        calibrations += _described(str(name), entry) if entry else []
    return calibrations


def _qualisys(text: str) -> list[Calibration]:
    root = _xml_of(text)
    if root.find(".//fov_video") is None:
        raise InputError(
            f"{_XML_OF.get(root.tag, 'XML of ' + quoted(root.tag))}, which is not read: XML of OpenCV and Qualisys is"
        )
    calibrations: list[Calibration] = []
    for number, camera in enumerate(root.iter("camera")):
        view, lens, place = (
            _tag(camera, name) for name in ("fov_video", "intrinsic", "transform")
        )
        left, top, right, bottom = (
            float(view.get(side, "")) for side in ("left", "top", "right", "bottom")
        )
        focal, centre = (
            np.array(
                [float(lens.get(f"{name}{axis}", "")) / SUBPIXELS for axis in "UV"]
            )
            for name in ("focalLength", "centerPoint")
        )
        names = (
            "radialDistortion1",
            "radialDistortion2",
            "tangentalDistortion1",
            "tangentalDistortion2",
        )
        distortion = [
            float(lens.get(name, "0")) for name in (*names, "radialDistortion3")
        ]
        for key, value in lens.items():
            if (
                _OF_LENS.fullmatch(_plain(key))
                and key not in (*names, "radialDistortion3")
                and _counts(value)
            ):
                raise InputError(f"the lens key {quoted(key)}, which is not known")
        turned = np.array(
            [[float(place.get(f"r{i}{j}", "")) for j in "123"] for i in "123"]
        )
        # its camera looks along -z with y up
        rotation = np.diag([1.0, -1.0, -1.0]) @ turned
        position = np.array([float(place.get(axis, "")) for axis in "xyz"]) / 1000.0
        size = (right - left + 1, bottom - top + 1)
        matrix = pinhole_matrix(focal, centre - (left, top))
        name = camera.get("serial", f"camera {number}")
        calibrations.append(
            _stated(
                name,
                size,
                matrix,
                distortion,
                rotation,
                -rotation @ position,
                # the field of view may be any part of the sensor
                cropped=True,
            )
        )
    return calibrations


def _tag(camera: Any, name: str) -> Any:
    tag = camera.find(name)
    if tag is None:
        raise InputError(f"a camera without {name}")
    return tag


def _stated(
    name: str,
    size: Any,
    matrix: Any,
    distortion: Any,
    rotation: Any,
    translation: Any,
    fisheye: bool = False,
    *,
    cropped: bool = False,
) -> Calibration:
    """Return what a file states, checked; a rotation of three numbers is its axis, as long as its angle.

    The centre of `cropped` pictures may be anywhere in them.
    """
    if size is not None:
        width, height = size
        if not (
            float(width).is_integer()
            and float(height).is_integer()
            and width >= 1
            and height >= 1
        ):
            raise InputError(f"an image size of {width} x {height}")
        size = int(width), int(height)
    if abs(matrix[1, 0]) > 1e-6 or np.abs(matrix[2] - [0.0, 0.0, 1.0]).max() > 1e-6:
        raise InputError(
            f"a camera matrix that is not of the form fx 0 cx, 0 fy cy, 0 0 1: {quoted(matrix.tolist())}"
        )
    check_focal(np.diag(matrix)[:2], size or 2.0 * matrix[:2, 2])
    if abs(matrix[0, 1]) > SKEWED * matrix[0, 0]:
        raise InputError(
            f"a skew of {matrix[0, 1]:g} pixels, which is not read: pictures must have upright pixels"
        )
    if size is not None and not cropped and not _is_central(matrix, size):
        centre = " and ".join(f"{value:g}" for value in matrix[:2, 2])
        raise InputError(
            f"a centre of {centre} in pictures of {size[0]}x{size[1]}: it is of pictures of another size"
        )
    lens = np.array(distortion, dtype=np.float64).reshape(-1)
    if not np.isfinite(lens).all():
        raise InputError("a distortion that is not finite")
    if not lens.any():
        lens = np.zeros(4)
    elif lens.size not in DISTORTIONS or (fisheye and lens[4:].any()):
        raise InputError(
            f"a distortion of {lens.size} numbers{' of a fisheye' if fisheye else ''}"
        )
    if rotation is not None and np.size(rotation) == 3:
        vector = _numbers(np.reshape(rotation, 3), (3,))
        angle = float(np.linalg.norm(vector))
        if angle > FULL_TURN:
            raise InputError(
                f"a rotation of {angle:g} radians about an axis, more than a full turn: are {quoted(vector.tolist())} "
                "degrees, or angles about three axes?"
            )
        rotation = cv2.Rodrigues(vector)[0]
    elif np.shape(rotation) == (9,):
        rotation = np.reshape(rotation, (3, 3))
    return Calibration(
        name,
        size,
        matrix,
        lens,
        None if rotation is None else _numbers(rotation, (3, 3)),
        None if translation is None else _numbers(translation, (3,)),
        fisheye,
    )


# programs whose XML is well known, by its root
_XML_OF = {"document": "Metashape's XML", "Cameras": "Vicon's XML"}


def pinhole_matrix(
    focal: Sequence[float] | Array, centre: Sequence[float] | Array
) -> Array:
    """Return the matrix (3, 3) of a camera without skew."""
    return np.array(
        [[focal[0], 0.0, centre[0]], [0.0, focal[1], centre[1]], [0.0, 0.0, 1.0]]
    )


def _numbers(values: Any, shape: tuple[int, ...]) -> Array:
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.shape != shape or not np.isfinite(numbers).all():
        raise InputError(
            f"{quoted(numbers.tolist())} where finite numbers of shape {shape} should be"
        )
    return numbers


def _orthonormal(rotation: Array) -> Array:
    """Return the rotation nearest to a matrix that was rounded when it was written."""
    left, _, right = np.linalg.svd(rotation)
    nearest = left @ right
    if np.linalg.det(nearest) < 0.0 or np.abs(nearest - rotation).max() > 1e-2:
        raise InputError(f"a rotation that is none: {quoted(rotation.tolist())}")
    return np.asarray(nearest)


def _stored_values(path: Path, start: str, text: str) -> dict[str, Any]:
    """Return the values of a file by name. Raises InputError where it is none of the four formats."""
    if path.suffix.lower() == ".toml":
        return parsed_toml(text)
    if not (
        start.startswith(("<", "{", "[", "%"))
        or path.suffix.lower() in (".yml", ".yaml")
    ):
        raise InputError(
            f"a file that is none of them, {path.suffix or 'without a suffix'}; YAML is .yml or .yaml"
        )
    values = (
        _xml(text)
        if start.startswith("<")
        else parsed_json(text)
        if start.startswith(("{", "["))
        else _yaml(text)
    )
    if isinstance(values, list):  # of cameras, as those of the AIST database
        values = {"camera": values}
    if not isinstance(values, dict):
        raise InputError(f"a file without names, {quoted(values)}")
    return values


def _matrix_of(value: Any) -> Array:
    """Return a matrix, or numbers in one row. Raises InputError where there are none, too many, or another number."""
    stated = value if isinstance(value, dict) and "data" in value else {"data": value}
    cells = np.array(
        stated["data"].split() if isinstance(stated["data"], str) else stated["data"],
        dtype=object,
    )
    numbers = np.array([_number_of(cell) for cell in cells.flat], dtype=np.float64)
    match = _TYPE.fullmatch(str(stated.get("dt", "d")))
    if match is None:
        raise InputError(f"a matrix of the type {quoted(stated['dt'])}")
    if match[2] in _ROUNDED:
        numbers = numbers.astype(_ROUNDED[match[2]]).astype(np.float64)
    sides = (
        [stated["rows"], stated["cols"]]
        if {"rows", "cols"} <= stated.keys()
        else stated.get("sizes")
    )
    if sides is None:
        return numbers.reshape(cells.shape)
    shape = [
        *map(_number_of, sides if isinstance(sides, list) else [sides]),
        *map(float, filter(None, [match[1]])),
    ]
    if not all(
        side.is_integer() and side > 0 for side in shape
    ) or numbers.size != math.prod(shape):
        raise InputError(
            f"a matrix of {' x '.join(f'{side:g}' for side in shape)} with {numbers.size} numbers"
        )
    return numbers.reshape([int(side) for side in shape])


def _number_of(value: Any) -> float:
    """Return a number, which may be text. Raises InputError where it is none."""
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
    return {
        entry.tag: {part.tag: (part.text or "").strip() for part in entry}
        or (entry.text or "").strip()
        for entry in root
    }


def _xml_of(text: str) -> Any:
    """Return the root of an XML text. Raises InputError where it is broken or has a document type, which may expand."""
    from xml.etree.ElementTree import ParseError

    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import fromstring

    try:
        return fromstring(text, forbid_dtd=True)
    except DefusedXmlException:
        raise InputError(
            "an XML file with a document type, which is not read"
        ) from None
    # ValueError: an encoding that contradicts the text's
    except (ParseError, ValueError, RecursionError) as error:
        raise InputError(f"XML that is broken: {error}") from None
