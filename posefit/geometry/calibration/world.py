"""The world of several cameras: its up direction, and a check of their places."""

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.calibration.lens import OPENGL, Calibration
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
# agreement of the cameras' up directions, from 0 to 1: below TILTED, rotations may be
# transposed; above UPRIGHT, they are right
TILTED = 0.6
UPRIGHT = 0.8


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


def misreading(cameras: Sequence[Calibration]) -> str:
    """Return how poses seem to be written, if it is not how they are read, or "".

    The names of keys do not tell whether a rotation and a translation lead from the
    world to the camera, or whether the translation is the camera's position. Cameras of
    one scene look at one point in front of them. If they look at no such point as they
    are read, but would if their poses were written in another way, all of them above
    the floor, then the file is doubted. The cameras' up directions nearly agree, and
    transposed rotations tilt them against each other.

    Of random rigs of two cameras, one in 500 is refused wrongly. Positions in place of
    translations are recognised in three of four such rigs, cameras that look along -z
    in nine of ten, and transposed rotations in every second one.
    """
    turns = list[Array]()
    moves = list[Array]()
    for camera in cameras:
        if camera.rotation is not None and camera.translation is not None:
            turns.append(camera.rotation)
            moves.append(camera.translation)
    # a single camera looks at every point of its axis, which proves nothing
    if len(turns) < 2:
        return ""
    rotations = np.array(turns)
    translations = np.array(moves)
    are_tilted = _agreement(rotations) < TILTED
    if not are_tilted and _see_one_point(
        rotations, _positions(rotations, translations), AIMED
    ):
        return ""
    for other in _READINGS:
        turned, positions = other.read(rotations, translations)
        # only a transposed rotation tilts cameras against each other
        if other.transposed and not (are_tilted and _agreement(turned) > UPRIGHT):
            continue
        up = -turned[:, 1].sum(axis=0)
        if (
            _see_one_point(turned, positions, AIMED / 2.0)
            and (positions @ up > 0.0).all()
        ):
            return other.message
    return ""


def _positions(rotations: Array, translations: Array) -> Array:
    """Return the positions (n, 3) of cameras from their poses, camera_from_world."""
    return np.asarray(-np.einsum("nji,nj->ni", rotations, translations))


def _agreement(rotations: Array) -> float:
    """Return how well the cameras' up directions agree: 1 if they are equal."""
    return float(np.linalg.norm(rotations[:, 1].mean(axis=0)))


def _transposed(rotations: Array) -> Array:
    return rotations.swapaxes(1, 2)


class _Reading(NamedTuple):
    """Another way in which poses may be written."""

    # takes rotations (n, 3, 3) and translations (n, 3) as they were read; returns the
    # rotations, camera_from_world, and the positions
    read: Callable[[Array, Array], tuple[Array, Array]]
    transposed: bool  # whether rotations lead from the camera to the world
    message: str


_READINGS = (
    _Reading(
        lambda turns, moves: (turns, moves),
        False,
        "translations that seem to be the cameras' positions: T must be -R times the "
        "position, from the world to the camera",
    ),
    _Reading(
        lambda turns, moves: (_transposed(turns), moves),
        True,
        "poses that seem to lead from the camera to the world: invert them",
    ),
    _Reading(
        lambda turns, moves: (
            _transposed(turns),
            _positions(_transposed(turns), moves),
        ),
        True,
        "rotations that seem to lead from the camera to the world: transpose them",
    ),
    _Reading(
        lambda turns, moves: (OPENGL @ turns, _positions(turns, moves)),
        False,
        "cameras that seem to look along -z with y up, as in OpenGL: change the signs "
        "of the last two rows of R and of T",
    ),
    _Reading(
        lambda turns, moves: (OPENGL @ _transposed(turns), moves),
        True,
        "poses that seem to lead to the world from cameras that look along -z with y "
        "up, as in OpenGL: invert them, and then change the signs of the last two rows "
        "of R and of T",
    ),
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
