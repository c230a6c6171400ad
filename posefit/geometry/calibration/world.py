"""The world of several calibrations: which way is up in it, and whether its cameras can stand as they do."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.calibration.lens import Calibration
from posefit.reading import quoted

Up = Literal["x", "y", "z"]
# The rotation of the world that turns an axis to +y.
TURNS = {
    "x": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    "y": np.eye(3),
    "z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
}
# of the images' up direction: where less of it is along the axis that a file says is
# up, it is doubted
LEVEL = 0.5
# of its distance: how far the point that cameras look at may be beside their axes
AIMED = 0.5


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


def check_places(cameras: Sequence[Calibration]) -> None:
    """Raise InputError where translations seem to be the cameras' places.

    Keys do not tell. Cameras of one scene see one point in front of them. Where they do not, but do so
    once translations are read as places, and these are above the floor, places are meant. Of random rigs
    of two cameras one of 500 is refused wrongly, and of those that have places four of five are
    recognised where the origin is on the floor.
    """
    placed = [
        (camera.rotation, camera.translation)
        for camera in cameras
        if camera.rotation is not None and camera.translation is not None
    ]
    if len(placed) < 2:
        return
    rotations = np.array([rotation for rotation, _ in placed])
    translations = np.array([translation for _, translation in placed])
    positions = -np.einsum("nji,nj->ni", rotations, translations)
    up = -rotations[:, 1].sum(axis=0)
    if (
        not _see_one_point(rotations, positions, AIMED)
        and _see_one_point(rotations, translations, AIMED / 2.0)
        and (translations @ up > 0.0).all()
    ):
        raise InputError(
            "translations that seem to be the places of cameras: T must be -R times the place, from the "
            "world to the camera"
        )


def _see_one_point(rotations: Array, positions: Array, aimed: float) -> bool:
    """Return whether the axes of cameras pass one point, ahead of all and nearer than a share of its distance."""
    ahead = rotations[:, 2]
    across = np.eye(3) - np.einsum("ni,nj->nij", ahead, ahead)
    point, _, rank, _ = np.linalg.lstsq(
        across.sum(axis=0), np.einsum("nij,nj->i", across, positions), rcond=1e-6
    )
    depths = np.einsum("ni,ni->n", ahead, point - positions)
    misses = np.linalg.norm(np.einsum("nij,nj->ni", across, point - positions), axis=1)
    # axes of one direction have no such point
    return bool(rank == 3 and (depths > 0.0).all() and (misses < aimed * depths).all())
