"""Pinhole cameras: x right, y down, z forward; pixel centres at +0.5."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array, frozen
from posefit.errors import InputError
from posefit.reading import parsed_json, quoted, read_text

LARGEST_SIDE = 16_384  # pixels
LARGEST_FILE = 1_000_000  # bytes
# across the larger side of the image; our guess for an unknown camera
FIELD_OF_VIEW = math.radians(40.0)
# Pixels count as square if the focal lengths differ by at most this share. On a limb
# that is 40 pixels wide the difference is then a tenth of a pixel.
SQUARE = 0.005
FOCALS = 0.05, 100.0  # times the larger side: lenses from 170 down to 0.6 degrees
MARGIN = 0.06  # share of the image that `framing` leaves free around the points
_KEYS = ("width", "height", "focal", "centre", "camera_from_world")


@dataclass(frozen=True, eq=False)
class Camera:
    """A calibrated view.

    `points_camera = rotation @ points_world + translation`, in metres.

    Attributes:
        width: Pixels of the image's width.
        height: Pixels of the image's height.
        focal: Focal lengths (2,) in pixels, across and down.
        centre: The principal point (2,) in pixels.
        rotation: The rotation (3, 3) from the world to the camera.
        translation: The translation (3,) in metres.

    Raises:
        InputError: A size, focal length or shape is wrong, or `rotation` is not a
            rotation.

    Example:
        >>> from posefit import Camera
        >>> camera = Camera.pinhole(640, 480, fx=700)
        >>> camera.width, camera.height
        (640, 480)
        >>> Camera.from_json(camera.to_json()).focal.tolist()
        [700.0, 700.0]
    """

    width: int
    height: int
    focal: Array  # (2,)
    centre: Array  # (2,)
    rotation: Array = field(repr=False)  # (3, 3)
    translation: Array = field(repr=False)  # (3,)

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            side = getattr(self, name)
            is_whole = isinstance(side, int | np.integer) and not isinstance(side, bool)
            if not (is_whole and 1 <= side <= LARGEST_SIDE):
                raise InputError(
                    f"{name} must be a whole number from 1 to {LARGEST_SIDE}, "
                    f"got {quoted(side)}"
                )
            object.__setattr__(self, name, int(side))
        shapes = {
            "focal": (2,),
            "centre": (2,),
            "rotation": (3, 3),
            "translation": (3,),
        }
        for name, shape in shapes.items():
            object.__setattr__(self, name, frozen(name, getattr(self, name), shape))
        if (self.focal <= 0.0).any():
            raise InputError(f"focal must be positive, got {self.focal.tolist()}")
        check_focal(self.focal, (self.width, self.height))
        skew = np.abs(self.rotation @ self.rotation.T - np.eye(3)).max()
        if skew > 1e-5 or np.linalg.det(self.rotation) < 0.0:
            raise InputError(
                "rotation must be orthonormal and right-handed, "
                f"got {self.rotation.tolist()}"
            )

    @property
    def position(self) -> Array:
        """The optical centre (3,) in the world."""
        return np.asarray(-self.rotation.T @ self.translation)

    @classmethod
    def around(
        cls,
        target: Array,
        azimuth: float,
        distance: float,
        size: tuple[int, int],
        field_of_view: float = FIELD_OF_VIEW,
    ) -> "Camera":
        """Return an upright, level camera that looks at a target.

        Args:
            target: The point (3,) in the middle of the image.
            azimuth: The direction from the target to the camera, in radians about the
                vertical: 0 is world +z, and pi/2 is world +x.
            distance: Metres from the target to the camera.
            size: Width and height in pixels.
            field_of_view: The angle in radians across the image's larger side.

        Returns:
            The camera.

        Raises:
            InputError: The distance or the field of view is out of range.
        """
        if not (math.isfinite(distance) and distance >= 0.0):
            raise InputError(f"distance must be 0 or more metres, got {distance}")
        if not 0.0 < field_of_view < math.pi:
            raise InputError(
                f"field_of_view must lie between 0 and pi radians, got {field_of_view}"
            )
        sine = math.sin(azimuth)
        cosine = math.cos(azimuth)
        rotation = np.array(
            [[cosine, 0.0, -sine], [0.0, -1.0, 0.0], [-sine, 0.0, -cosine]]
        )
        focal = 0.5 * max(size) / math.tan(0.5 * field_of_view)
        back = np.array([0.0, 0.0, distance])
        return cls(
            *size,
            np.full(2, focal),
            np.array(size) / 2.0,
            rotation,
            back - rotation @ np.asarray(target),
        )

    @classmethod
    def pinhole(
        cls,
        width: int,
        height: int,
        fx: float,
        fy: float | None = None,
        cx: float | None = None,
        cy: float | None = None,
    ) -> "Camera":
        """Return a level camera at the world's origin that looks along -z.

        Args:
            width: Pixels of the image's width.
            height: Pixels of the image's height.
            fx: The focal length across, in pixels.
            fy: The focal length down, in pixels; by default `fx`.
            cx: The principal point across, in pixels; by default the image's centre.
            cy: The principal point down, in pixels; by default the image's centre.

        Returns:
            The camera.

        Raises:
            InputError: `fx` is less than a tenth of the width, so that it is probably
                in millimetres.
        """
        if 0.0 < fx < 0.1 * width:
            raise InputError(
                f"fx must be in pixels: at least {0.1 * width:g} "
                f"for a width of {width}, got {fx:g}"
            )
        focal = np.array([fx, fx if fy is None else fy])
        if cx is None:
            cx = width / 2.0
        if cy is None:
            cy = height / 2.0
        level = np.diag([1.0, -1.0, -1.0])
        return cls(width, height, focal, np.array([cx, cy]), level, np.zeros(3))

    @classmethod
    def framing(
        cls, points: Array, radii: Array, azimuth: float, size: tuple[int, int]
    ) -> "Camera":
        """Return the nearest camera that sees all of some balls, with a margin.

        It aims at the middle of the bounding box of the balls' centres.

        Args:
            points: The centres (n, 3) of the balls.
            radii: The radii (n,) of the balls in metres.
            azimuth: The direction of the camera, as in `around`.
            size: Width and height in pixels.

        Returns:
            The camera.
        """
        points = np.asarray(points, dtype=np.float64)
        radii = np.asarray(radii, dtype=np.float64)
        target = 0.5 * (points.min(axis=0) + points.max(axis=0))
        near = cls.around(target, azimuth, 0.0, size)
        x, y, z = (points @ near.rotation.T + near.translation).T
        free = (1.0 - MARGIN) * 0.5 * np.array(size) / near.focal
        across = (np.abs(x) + radii) / free[0]  # (n,) metres of depth that are needed
        down = (np.abs(y) + radii) / free[1]
        needed = np.maximum(across, down) - z
        # every ball is at least half a metre in front of the camera
        clear = (radii - z).max() + 0.5
        return cls.around(target, azimuth, float(max(needed.max(), clear)), size)

    def project(self, points: Array) -> tuple[Array, Array]:
        """Return pixels (..., 2) and depths (...) in metres of points (..., 3)."""
        in_camera = np.asarray(points) @ self.rotation.T + self.translation
        depths = in_camera[..., 2]
        return in_camera[..., :2] / depths[..., None] * self.focal + self.centre, depths

    @cached_property
    def square(self) -> bool:
        """Whether the pixels are square, so that a ball is a circle in the picture.

        Bodies are rasterised under this assumption.
        """
        longest = float(self.focal.max())
        return longest - float(self.focal.min()) <= SQUARE * longest

    def squared(self) -> "Camera":
        """Return a camera of the same view with square pixels: this one if it has them.

        Both directions get the longer focal length, so that pictures have more columns
        or more rows.
        """
        if self.square:
            return self
        focal = float(self.focal.max())
        finer = focal / self.focal
        width, height = np.rint(finer * (self.width, self.height)).astype(int)
        return replace(
            self,
            width=max(int(width), 1),
            height=max(int(height), 1),
            focal=np.full(2, focal),
            centre=finer * self.centre,
        )

    def to_json(self) -> str:
        """Return the camera as JSON, which `from_json` reads."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = self.translation
        values = {
            "width": self.width,
            "height": self.height,
            "focal": self.focal.tolist(),
            "centre": self.centre.tolist(),
            "camera_from_world": matrix.tolist(),
        }
        return json.dumps(values, indent=1)

    @classmethod
    def from_json(cls, path: str | Path) -> "Camera":
        """Return the camera that `to_json` wrote.

        Args:
            path: A file, or the JSON text itself.

        Returns:
            The camera.

        Raises:
            InputError: The text is not valid; the message names the key.
        """
        if isinstance(path, str) and path.lstrip().startswith("{"):
            text = path
        else:
            text = ""
        path = "camera" if text else path
        expected = f"{path}: expected a JSON object with {', '.join(_KEYS)}"
        text = text or read_text(path, LARGEST_FILE)
        try:
            values = parsed_json(text)
        except ValueError as error:
            raise InputError(f"{expected}, got {error}") from None
        if not isinstance(values, dict):
            raise InputError(f"{expected}, got {type(values).__name__}")
        if set(values) != set(_KEYS):
            raise InputError(f"{expected}, got {sorted(values)}")
        try:
            matrix = frozen(
                "camera_from_world", values.pop("camera_from_world"), (4, 4)
            )
            if matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
                raise InputError(
                    "camera_from_world must have the last row 0 0 0 1, "
                    f"got {matrix[3].tolist()}"
                )
            return cls(**values, rotation=matrix[:3, :3], translation=matrix[:3, 3])
        except ValueError as error:
            raise InputError(f"{path}: {error}") from None


class StackedCameras(NamedTuple):
    """The arrays of several cameras (c), as compiled code takes them."""

    rotations: Array  # (c, 3, 3)
    translations: Array  # (c, 3)
    focals: Array  # (c, 2)
    centres: Array  # (c, 2)


def stacked(cameras: Sequence[Camera]) -> StackedCameras:
    """Return the arrays of several cameras."""
    rotations = []
    translations = []
    focals = []
    centres = []
    for camera in cameras:
        rotations.append(camera.rotation)
        translations.append(camera.translation)
        focals.append(camera.focal)
        centres.append(camera.centre)
    return StackedCameras(
        np.array(rotations),
        np.array(translations),
        np.array(focals),
        np.array(centres),
    )


def is_focal(focal: Array, size: Sequence[float] | Array) -> bool:
    """Return whether a lens may have these focal lengths (2,) for some size."""
    shortest = FOCALS[0] * max(size)
    longest = FOCALS[1] * max(size)
    return bool(shortest <= np.min(focal) and np.max(focal) <= longest)


def check_focal(focal: Array, size: Sequence[float] | Array) -> None:
    """Raise InputError if no lens has these focal lengths (2,) for a size."""
    if not is_focal(focal, size):
        low = FOCALS[0] * max(size)
        high = FOCALS[1] * max(size)
        found = " and ".join(f"{length:g}" for length in focal)
        raise InputError(
            f"focal must be in pixels: {low:g} to {high:g} for pictures of this size, "
            f"got {found}"
        )
