"""The world of several cameras: its up direction, and a check of their places."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.calibration.lens import Calibration
from posefit.reading import quoted

Up = Literal["x", "y", "z"]
# rotations of the world that turn an axis to +y
TURNS = {
    "x": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    "y": np.eye(3),
    "z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
}
# share of the images' up direction: if less of it is along the axis that a file says is
# up, the file is doubted
LEVEL = 0.5
# share of a point's distance: it may be this far off the cameras' axes to be the point
# that they look at
AIMED = 0.5


def upright(calibrations: Sequence[Calibration], up: Up | None = None) -> Array:
    """Return the rotation (3, 3) that turns the world of calibrations so that +y is up.

    The up direction is `up` if it is given, or +y if the file states it. Otherwise it
    is the axis, in either direction, that is nearest to the up direction of the images.
    Raises InputError if `up` is not an axis.
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
    """Return what `upright` assumes without `up`, as a sentence for a message.

    Return "" if it assumes nothing.
    """
    image_up = _image_up(calibrations)
    if image_up is None:
        return ""
    axis = _axis(image_up)
    if not any(camera.upright for camera in calibrations):
        return (
            f"{'+' if image_up['xyz'.index(axis)] > 0.0 else '-'}{axis} is up in the "
            "cameras' world"
        )
    if image_up[1] < LEVEL * np.linalg.norm(image_up):
        return (
            "+y is up in the cameras' world, as in posefit's own files, although "
            f"{axis} is up in their images"
        )
    return ""


def _image_up(calibrations: Sequence[Calibration]) -> Array | None:
    """Return the images' up direction (3,) in the world, or None without places."""
    downs = list[Array]()
    for camera in calibrations:
        if camera.rotation is not None:
            downs.append(camera.rotation[1])  # the image's y, which points down
    if not downs:
        return None
    return np.asarray(-np.sum(downs, axis=0))


def _axis(direction: Array) -> Up:
    axes: Sequence[Up] = ("x", "y", "z")
    return axes[int(np.abs(direction).argmax())]


def check_places(cameras: Sequence[Calibration]) -> None:
    """Raise InputError if the translations seem to be the cameras' positions.

    The names of keys do not tell which of the two a file has. Cameras of one scene look
    at one point in front of them. The translations are taken for positions if the
    cameras look at no such point, but would if the translations were positions, all
    above the floor.

    Of random rigs of two cameras, one in 500 is refused wrongly. Of such rigs with
    positions in the file, four in five are recognised if the origin is on the floor.
    """
    turns = list[Array]()
    moves = list[Array]()
    for camera in cameras:
        if camera.rotation is not None and camera.translation is not None:
            turns.append(camera.rotation)
            moves.append(camera.translation)
    # a single camera looks at every point of its axis, which proves nothing
    if len(turns) < 2:
        return
    rotations = np.array(turns)
    translations = np.array(moves)
    positions = -np.einsum("nji,nj->ni", rotations, translations)
    up = -rotations[:, 1].sum(axis=0)
    if (
        not _see_one_point(rotations, positions, AIMED)
        and _see_one_point(rotations, translations, AIMED / 2.0)
        and (translations @ up > 0.0).all()
    ):
        raise InputError(
            "translations that seem to be the cameras' positions: T must be -R times "
            "the position, from the world to the camera"
        )


def _see_one_point(rotations: Array, positions: Array, aimed: float) -> bool:
    """Return whether all cameras look at one point.

    The point is ahead of every camera. It is off a camera's axis by less than `aimed`
    times its distance from the camera.
    """
    ahead = rotations[:, 2]
    across = np.eye(3) - np.einsum("ni,nj->nij", ahead, ahead)
    point, _, rank, _ = np.linalg.lstsq(
        across.sum(axis=0), np.einsum("nij,nj->i", across, positions), rcond=1e-6
    )
    depths = np.einsum("ni,ni->n", ahead, point - positions)
    misses = np.linalg.norm(np.einsum("nij,nj->ni", across, point - positions), axis=1)
    # parallel axes determine no point
    return bool(rank == 3 and (depths > 0.0).all() and (misses < aimed * depths).all())
