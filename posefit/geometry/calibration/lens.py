"""One camera's calibration, and how to remove the distortion from its pictures."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.camera import Camera, check_focal, is_focal
from posefit.geometry.units import METRES, Unit
from posefit.reading import quoted

# The unit of the lengths in a file. "metres": metres. "open": a unit that is recognised
# by how large people are. "free": any multiple of a metre, for a scene that was
# reconstructed from pictures alone.
Scale = Literal["metres", "open", "free"]
# rotation and translation, camera_from_world
Place = tuple[Any, Any]
# turns the axes of cameras that look along -z with y up (OpenGL, Qualisys) to ours
OPENGL = np.diag([1.0, -1.0, -1.0])
DISTORTIONS = (4, 5, 8, 12, 14)  # how many numbers OpenCV's lens models have
BLOCK = 16  # pixels: codecs pad a picture's sides to a multiple of this
HALF = 0.5  # pixels: files count the centre of the first pixel as 0, we as 0.5
FULL_TURN = 2.0 * math.pi  # radians, and no rotation vector is longer
MAX_SKEW = 2e-3  # share of the focal length: a smaller skew changes nothing
# shares of a picture's sides: a principal point lies in the middle half
MIDDLE = 0.25, 0.75
# Shares of a picture's sides. A principal point that is off the centre by more than
# SCALED along both sides, at shares that differ by less than EQUAL, belongs to pictures
# of another scale.
SCALED = 0.1
EQUAL = 0.03


@dataclass(frozen=True, eq=False)
class Calibration:
    """One camera's entry in a calibration file.

    Lengths in pictures are pixels; other lengths are metres, or the file's unit.
    """

    name: str
    # width, height; None if the file does not state them: then the pictures' own
    size: tuple[int, int] | None
    # (3, 3) of the pinhole; a negligible skew is ignored, and the centre of the first
    # pixel is 0, as in OpenCV
    matrix: Array = field(repr=False)
    # (4,) to (14,): OpenCV's k1, k2, p1, p2, k3, ...; all 0 for no distortion
    distortion: Array = field(repr=False)
    # (3, 3) camera_from_world; None if the file does not place the camera
    rotation: Array | None = field(repr=False)
    translation: Array | None = field(repr=False)  # (3,)
    fisheye: bool = False
    # whether +y is known to be up in the file's world, as in our own files
    upright: bool = False
    # how well the unit of the translation is known
    scale: Scale = "open"

    @property
    def distorted(self) -> bool:
        """Whether the lens bends straight lines; a fisheye always does."""
        return self.fisheye or bool(np.any(self.distortion))

    @property
    def position(self) -> Array | None:
        """The position (3,) in the file's world, or None if it is not known."""
        if self.rotation is None or self.translation is None:
            return None
        return np.asarray(-self.rotation.T @ self.translation)

    @classmethod
    def of(cls, camera: Camera, name: str = "camera") -> "Calibration":
        """Return the calibration of a camera, which has no distortion."""
        matrix = pinhole_matrix(camera.focal, camera.centre - HALF)
        return cls(
            name,
            (camera.width, camera.height),
            matrix,
            np.zeros(4),
            camera.rotation,
            camera.translation,
            upright=True,
            scale="metres",
        )

    def of_unit(self, unit: Unit) -> "Calibration":
        """Return the calibration of a file whose lengths are known to be in a unit."""
        return replace(self.in_metres(METRES[unit]), scale="metres")

    def in_metres(self, metres: float) -> "Calibration":
        """Return the calibration in metres.

        `metres` is the length of the file's unit. A calibration that is in metres
        already, or that has no place, is returned unchanged.
        """
        if self.translation is None or self.scale == "metres":
            return self
        return replace(self, translation=metres * self.translation)

    def camera(self, size: tuple[int, int], world: Array) -> Camera:
        """Return the camera of pictures scaled to `size`, without distortion.

        `world` (3, 3) turns the up direction of the file's world to +y. A camera that
        the file does not place is at the origin and looks level along -z.
        """
        scale = np.array(size) / (self.size or size)
        rotation = OPENGL if self.rotation is None else self.rotation @ world.T
        translation = np.zeros(3) if self.translation is None else self.translation
        focal = np.diag(self.matrix)[:2] * scale
        centre = (self.matrix[:2, 2] + HALF) * scale
        return Camera(*size, focal, centre, orthonormal(rotation), translation)

    def padded(self, size: tuple[int, int]) -> "Calibration | None":
        """Return the calibration for pictures with a few more or fewer rows or columns.

        Codecs pad a picture to blocks of 16 pixels, so that 1080 rows become 1088, and
        some programs keep the padding. The difference is at the end of the rows or
        columns, so that only the size changes. Return None if the sizes differ by
        anything else. A calibration without a size fits if its principal point is in
        the middle half of the picture and its focal length is possible.
        """
        if self.size is None:
            fits = is_central(self.matrix, size) and is_focal(
                np.diag(self.matrix)[:2], size
            )
            return replace(self, size=size) if fits else None
        for side, other in zip(self.size, size, strict=True):
            if side != other and (
                abs(side - other) >= BLOCK or max(side, other) % BLOCK
            ):
                return None
        return replace(self, size=size)

    def maps(
        self, size: tuple[int, int], straight: Camera | None = None
    ) -> tuple[Any, Any]:
        """Return the maps with which cv2.remap removes the distortion from pictures.

        Args:
            size: Width and height of the distorted pictures.
            straight: The camera of the straight pictures, which has this calibration's
                view; by default the camera for `size`. It may have square pixels even
                if the distorted pictures do not.

        Returns:
            Columns and rows in the distorted pictures, each (height, width) of
            `straight`.
        """
        lens = self.distortion[: 4 if self.fisheye else None]
        straight = straight or self.camera(size, np.eye(3))
        maps = (
            cv2.fisheye.initUndistortRectifyMap
            if self.fisheye
            else cv2.initUndistortRectifyMap
        )
        return maps(
            self._scaled_matrix(size),
            lens,
            np.eye(3),
            pinhole_matrix(straight.focal, straight.centre - HALF),
            (straight.width, straight.height),
            cv2.CV_32FC1,
        )

    def _scaled_matrix(self, size: tuple[int, int]) -> Array:
        camera = self.camera(size, np.eye(3))
        return pinhole_matrix(camera.focal, camera.centre - HALF)

    def straightened(
        self, points: Array, size: tuple[int, int], straight: Camera | None = None
    ) -> Array:
        """Return points without distortion, as `maps` moves pictures.

        Args:
            points: Columns, rows and a third number (..., 3) in pictures of `size`.
            size: Width and height of the pictures.
            straight: The camera whose columns and rows are returned; by default the
                camera for `size`.

        Returns:
            Points (..., 3).
        """
        matrix = self._scaled_matrix(size)
        straight = straight or self.camera(size, np.eye(3))
        to = pinhole_matrix(straight.focal, straight.centre - HALF)
        bent = points[..., :2].reshape(-1, 1, 2).astype(np.float64) - HALF
        undistort = cv2.fisheye.undistortPoints if self.fisheye else cv2.undistortPoints
        lens = self.distortion[: 4 if self.fisheye else None]
        moved = undistort(bent, matrix, lens, P=to) + HALF
        return np.concatenate(
            [moved.reshape(*points.shape[:-1], 2), points[..., 2:]], axis=-1
        )


def is_central(matrix: Array, size: Sequence[float]) -> bool:
    """Return whether a principal point is plausible for pictures of a size.

    It is not if it seems to belong to larger or smaller pictures.
    """
    across, down = matrix[:2, 2] / size
    low, high = MIDDLE
    if not (low < across < high and low < down < high):
        return False
    scaled = (
        abs(across - down) < EQUAL and min(abs(across - 0.5), abs(down - 0.5)) > SCALED
    )
    return not scaled


def stated(
    name: str,
    size: Any,
    matrix: Any,
    distortion: Any,
    place: Place | None,
    *,
    fisheye: bool = False,
    cropped: bool = False,
    scale: Scale = "open",
) -> Calibration:
    """Check the values that a file states for a camera, and return its calibration.

    Args:
        name: The camera's name in the file.
        size: Width and height of its pictures; None if the file does not state them.
        matrix: Pinhole matrix (3, 3), with the centre of the first pixel at 0.
        distortion: OpenCV's k1, k2, p1, p2, k3, ..., or k1 to k4 of a fisheye.
        place: Rotation and translation from the world to the camera; None if the file
            does not state them. The rotation is a matrix, or an axis as long as its
            angle.
        fisheye: Whether the lens is OpenCV's fisheye.
        cropped: Whether the pictures show a part of the sensor, so that the principal
            point may be anywhere.
        scale: How well the unit of `place` is known.

    Returns:
        The calibration.

    Raises:
        InputError: No camera can have these values. The message completes `expected a
            calibration ..., got ...`.
    """
    if size is not None:
        size = _whole(size)
    if abs(matrix[1, 0]) > 1e-6 or np.abs(matrix[2] - [0.0, 0.0, 1.0]).max() > 1e-6:
        hint = ""
        if matrix[2, :2].any() and not matrix[:2, 2].any():
            hint = "; transpose it if MATLAB wrote it, and the rotation, too"
        raise InputError(
            "a camera matrix that is not of the form fx 0 cx, 0 fy cy, 0 0 1: "
            f"{quoted(matrix.tolist())}{hint}"
        )
    check_focal(np.diag(matrix)[:2], size or 2.0 * matrix[:2, 2])
    if abs(matrix[0, 1]) > MAX_SKEW * matrix[0, 0]:
        raise InputError(
            f"a skew of {matrix[0, 1]:g} pixels, which is not read: calibrate without "
            "skew"
        )
    if size is not None and not cropped and not is_central(matrix, size):
        centre = " and ".join(f"{value:g}" for value in matrix[:2, 2])
        raise InputError(
            f"a centre of {centre} in pictures of {size[0]}x{size[1]}: it belongs to "
            "pictures of another size"
        )
    rotation, translation = (None, None) if place is None else place
    return Calibration(
        name,
        size,
        matrix,
        _lens(distortion, fisheye),
        None if rotation is None else rotation_of(rotation),
        None if translation is None else numbers_of(np.ravel(translation), (3,)),
        fisheye,
        scale=scale,
    )


def _whole(size: Sequence[float]) -> tuple[int, int]:
    width, height = size
    for side in (float(width), float(height)):
        if not side.is_integer() or side < 1:
            raise InputError(f"an image size of {width} x {height}")
    return int(width), int(height)


def _lens(distortion: Any, fisheye: bool) -> Array:
    lens = np.array(distortion, dtype=np.float64).reshape(-1)
    if not np.isfinite(lens).all():
        raise InputError("a distortion that is not finite")
    if not lens.any():
        return np.zeros(4)
    if lens.size not in DISTORTIONS or (fisheye and lens[4:].any()):
        raise InputError(
            f"a distortion of {lens.size} numbers{' of a fisheye' if fisheye else ''}"
        )
    return lens


def rotation_of(rotation: Any) -> Array:
    """Return the matrix (3, 3) of a rotation.

    `rotation` has nine numbers, or three: its axis, as long as its angle in radians.
    """
    if np.size(rotation) == 3:
        vector = numbers_of(np.ravel(rotation), (3,))
        angle = float(np.linalg.norm(vector))
        if angle > FULL_TURN:
            raise InputError(
                f"a rotation of {angle:g} radians about an axis, more than a full "
                f"turn: are {quoted(vector.tolist())} degrees, or angles about three "
                "axes?"
            )
        return np.asarray(cv2.Rodrigues(vector)[0])
    if np.size(rotation) == 4:
        raise InputError(
            f"a quaternion {quoted(np.ravel(rotation).tolist())}, whose order is not "
            "known: give a rotation vector or a matrix (3, 3)"
        )
    if np.shape(rotation) == (9,):
        rotation = np.reshape(rotation, (3, 3))
    return numbers_of(rotation, (3, 3))


def check_both(rotation: Any, translation: Any) -> None:
    """Raise InputError if only one of a rotation and a translation is not None."""
    if (rotation is None) == (translation is None):
        return
    has, lacks = "a rotation", "a translation"
    if rotation is None:
        has, lacks = lacks, has
    raise InputError(
        f"{has} without {lacks}, such as rvec and tvec, from the world to the camera"
    )


def placed_at(rotation: Array, position: Any) -> Place:
    """Return the place of a camera with a rotation (3, 3) and a position (3,).

    The rotation is from the world to the camera; the position is in the world.
    """
    return rotation, -rotation @ numbers_of(np.ravel(position), (3,))


def seen_from(matrix: Any, axes: Array | None = None) -> Place:
    """Return the place of a camera from its matrix (4, 4) to the world.

    `axes` (3, 3) turns the axes of the file's cameras to ours, x right, y down and z
    forward.
    """
    to_world = numbers_of(matrix, (4, 4))
    if np.abs(to_world[3] - [0.0, 0.0, 0.0, 1.0]).max() > 1e-6:
        raise InputError(
            "a matrix to the world whose last row is not 0 0 0 1: "
            f"{quoted(to_world.tolist())}"
        )
    rotation = to_world[:3, :3].T if axes is None else axes @ to_world[:3, :3].T
    return placed_at(rotation, to_world[:3, 3])


def pinhole_matrix(
    focal: Sequence[float] | Array, centre: Sequence[float] | Array
) -> Array:
    """Return the matrix (3, 3) of a camera without skew."""
    return np.array(
        [[focal[0], 0.0, centre[0]], [0.0, focal[1], centre[1]], [0.0, 0.0, 1.0]]
    )


def numbers_of(values: Any, shape: tuple[int, ...]) -> Array:
    """Return finite numbers of a shape. Raises InputError for any others."""
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.shape != shape or not np.isfinite(numbers).all():
        raise InputError(
            f"{quoted(numbers.tolist())} where finite numbers of shape {shape} should "
            "be"
        )
    return numbers


def orthonormal(rotation: Array) -> Array:
    """Return the rotation nearest to a matrix that was rounded when it was written."""
    left, _, right = np.linalg.svd(rotation)
    nearest = left @ right
    if np.linalg.det(nearest) < 0.0 or np.abs(nearest - rotation).max() > 1e-2:
        raise InputError(
            f"a matrix that is not a rotation: {quoted(rotation.tolist())}"
        )
    return np.asarray(nearest)
