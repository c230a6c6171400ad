"""Pinhole cameras: x right, y down, z forward; pixel centres at +0.5."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from posefit.arrays import Array, frozen
from posefit.errors import InputError
from posefit.reading import parsed_json, quoted, read_text

LARGEST_SIDE = 16_384  # pixels
LARGEST_FILE = 1_000_000  # bytes
# across the larger side; our guess for an unknown camera
FIELD_OF_VIEW = math.radians(40.0)
# by how much of themselves the focal lengths of square pixels may differ: of a limb that
# is 40 pixels wide, a tenth of a pixel
SQUARE = 0.005
FOCALS = 0.05, 100.0  # times the larger side: lenses of 170 degrees to 0.6
MARGIN = 0.06  # share of the image left free around what `framing` shows
_KEYS = ("width", "height", "focal", "centre", "camera_from_world")


@dataclass(frozen=True, eq=False)
class Camera:
    """A calibrated view: `points_camera = rotation @ points_world + translation`, in metres."""

    width: int
    height: int
    focal: Array  # (2,) pixels
    centre: Array  # (2,) pixels
    rotation: Array = field(repr=False)  # (3, 3) camera_from_world
    translation: Array = field(repr=False)  # (3,) metres

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            side = getattr(self, name)
            if (
                isinstance(side, bool)
                or not isinstance(side, int | np.integer)
                or not 1 <= side <= LARGEST_SIDE
            ):
                raise InputError(
                    f"{name} must be a whole number from 1 to {LARGEST_SIDE}, got {quoted(side)}"
                )
            object.__setattr__(self, name, int(side))
        for name, shape in (
            ("focal", (2,)),
            ("centre", (2,)),
            ("rotation", (3, 3)),
            ("translation", (3,)),
        ):
            object.__setattr__(self, name, frozen(name, getattr(self, name), shape))
        if (self.focal <= 0.0).any():
            raise InputError(f"focal must be positive, got {self.focal.tolist()}")
        check_focal(self.focal, (self.width, self.height))
        if (
            np.abs(self.rotation @ self.rotation.T - np.eye(3)).max() > 1e-5
            or np.linalg.det(self.rotation) < 0.0
        ):
            raise InputError(
                f"rotation must be orthonormal and right-handed, got {self.rotation.tolist()}"
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
        """Return an upright camera of `size` (width, height) that looks level at `target` (3,).

        It stands `distance` metres away in the direction `azimuth` radians about the vertical: 0 is world +z, and
        pi/2 is world +x. `field_of_view` is the angle across the image's larger side.
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
        """Return a level camera at the world's origin that looks along -z, of focal lengths and centre in pixels.

        By default `fy` is `fx`, and the centre is that of the image. Raises InputError where a focal length is less
        than a tenth of the width: it is in millimetres.
        """
        if 0.0 < fx < 0.1 * width:
            raise InputError(
                f"fx must be in pixels, for {width} of them at least {0.1 * width:g}, got {fx:g}"
            )
        focal = np.array([fx, fx if fy is None else fy])
        centre = np.array(
            [width / 2.0 if cx is None else cx, height / 2.0 if cy is None else cy]
        )
        return cls(
            width, height, focal, centre, np.diag([1.0, -1.0, -1.0]), np.zeros(3)
        )

    @classmethod
    def framing(
        cls, points: Array, radii: Array, azimuth: float, size: tuple[int, int]
    ) -> "Camera":
        """Return the nearest camera at `azimuth` that sees all balls, points (n, 3) with radii (n,), with a margin.

        It aims at the middle of the points' bounding box. `azimuth` and `size` as in `around`.
        """
        points = np.asarray(points, dtype=np.float64)
        radii = np.asarray(radii, dtype=np.float64)
        target = 0.5 * (points.min(axis=0) + points.max(axis=0))
        near = cls.around(target, azimuth, 0.0, size)
        x, y, z = (points @ near.rotation.T + near.translation).T
        free = (1.0 - MARGIN) * 0.5 * np.array(size) / near.focal
        needed = (
            np.maximum((np.abs(x) + radii) / free[0], (np.abs(y) + radii) / free[1]) - z
        )
        return cls.around(
            target, azimuth, float(max(needed.max(), (radii - z).max() + 0.5)), size
        )

    def project(self, points: Array) -> tuple[Array, Array]:
        """Return pixels (..., 2) and depths (...) in metres of world points (..., 3)."""
        in_camera = np.asarray(points) @ self.rotation.T + self.translation
        depths = in_camera[..., 2]
        return in_camera[..., :2] / depths[..., None] * self.focal + self.centre, depths

    @cached_property
    def square(self) -> bool:
        """Whether its pixels are square, so that a ball is a circle in its pictures; bodies are drawn by that."""
        longest = float(self.focal.max())
        return longest - float(self.focal.min()) <= SQUARE * longest

    def squared(self) -> "Camera":
        """Return the camera of the same view whose pixels are square; it is this one where its own are.

        The longer focal length holds in both directions, so that pictures get more columns or more rows.
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
        """Return the text that `from_json` reads: sizes and pixels, and the 4 x 4 matrix camera_from_world."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.rotation, self.translation
        values = (
            self.width,
            self.height,
            self.focal.tolist(),
            self.centre.tolist(),
            matrix.tolist(),
        )
        return json.dumps(dict(zip(_KEYS, values, strict=True)), indent=1)

    @classmethod
    def from_json(cls, path: str | Path) -> "Camera":
        """Return the camera of what `to_json` wrote: a file or the text. Raises InputError naming the key."""
        text = path if isinstance(path, str) and path.lstrip().startswith("{") else ""
        path = "camera" if text else path
        expected = f"{path}: expected a JSON object with {', '.join(_KEYS)}"
        text = text or read_text(path, LARGEST_FILE)
        try:
            values = parsed_json(text)
        except ValueError as error:
            raise InputError(f"{expected}, got {error}") from None
        if not isinstance(values, dict) or set(values) != set(_KEYS):
            raise InputError(
                f"{expected}, got {sorted(values) if isinstance(values, dict) else type(values).__name__}"
            )
        try:
            matrix = frozen(
                "camera_from_world", values.pop("camera_from_world"), (4, 4)
            )
            if matrix[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
                raise InputError(
                    f"camera_from_world must have the last row 0 0 0 1, got {matrix[3].tolist()}"
                )
            return cls(**values, rotation=matrix[:3, :3], translation=matrix[:3, 3])
        except ValueError as error:
            raise InputError(f"{path}: {error}") from None


def is_focal(focal: Array, size: Sequence[float] | Array) -> bool:
    """Return whether a lens may have such focal lengths (2,) for pictures of a size."""
    return bool(
        FOCALS[0] * max(size) <= np.min(focal)
        and np.max(focal) <= FOCALS[1] * max(size)
    )


def check_focal(focal: Array, size: Sequence[float] | Array) -> None:
    """Raise InputError where no lens has such focal lengths (2,) for pictures of a size."""
    if not is_focal(focal, size):
        low, high = (share * max(size) for share in FOCALS)
        came = " and ".join(f"{length:g}" for length in focal)
        raise InputError(
            f"focal must be in pixels, for such pictures {low:g} to {high:g}, got {came}"
        )
