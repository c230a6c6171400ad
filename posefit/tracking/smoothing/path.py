"""The likeliest path of a root and two legs, by least squares over all frames at once.

Each frame pulls the root to its estimate, weighted by how well that is known; accelerations cost; and standing feet
should not move, for which the legs give way a little.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.footage.scene import Scene
from posefit.geometry.skeleton import angles_of
from posefit.motion.motion import Motion
from posefit.motion.steadiness import BALLS, low, runs
from posefit.silhouette.cost import only_camera

BAND_REACH = 2  # frames to either side that a frame has terms with
SECOND_DIFFERENCE = np.array([1.0, -2.0, 1.0])


class Squares:
    """Half the Hessian and half the gradient of a sum of squares, in T frames of n numbers each."""

    def __init__(self, frames: int, numbers: int) -> None:
        # a frame with itself, with the next one, and with the one after that
        self.hessians = np.zeros((BAND_REACH + 1, frames, numbers, numbers))
        self.gradients = np.zeros((frames, numbers))

    def add(self, which: slice, precise: Array, gradients: Array) -> None:
        """Add squares of some numbers of each frame: their precision (m, m) or (T, m, m), and its product (T, m)."""
        self.hessians[0, :, which, which] += precise
        self.gradients[:, which] += gradients

    def add_bends(self, which: slice, series: Array, weight: float) -> None:
        """Add the squares of `weight` times the second differences of some numbers, which are now `series` (T, m)."""
        bends = weight**2 * np.diff(series, 2, axis=0)
        count = len(series)
        diagonal = np.arange(which.start, which.stop)
        for first in range(3):
            frames = slice(first, count - 2 + first)
            self.gradients[frames, which] += SECOND_DIFFERENCE[first] * bends
            for second in range(first, 3):
                square = (
                    weight**2 * SECOND_DIFFERENCE[first] * SECOND_DIFFERENCE[second]
                )
                self.hessians[second - first, frames, diagonal, diagonal] += square

    def add_steps(
        self,
        frames: NDArray[np.int64],
        series: Array,
        derivatives: Array,
        weight: float,
    ) -> None:
        """Add the squares of `weight` times the changes of `series` (T, m) from some frames to the next ones.

        `derivatives` (T, m, n) are those of the series by the numbers of the same frame.
        """
        steps = weight**2 * (series[frames + 1] - series[frames])
        here = derivatives[frames]
        there = derivatives[frames + 1]
        self.gradients[frames] -= np.einsum("kmn,km->kn", here, steps)
        self.gradients[frames + 1] += np.einsum("kmn,km->kn", there, steps)
        self.hessians[0, frames] += weight**2 * np.einsum("kmi,kmj->kij", here, here)
        self.hessians[0, frames + 1] += weight**2 * np.einsum(
            "kmi,kmj->kij", there, there
        )
        self.hessians[1, frames] -= weight**2 * np.einsum("kmi,kmj->kij", here, there)

    def least(self) -> Array:
        """Return the step (T, n) to subtract from the numbers, so that the sum is least."""
        return self.steps_for(self.gradients[..., None])[..., 0]

    def steps_for(self, gradients: Array) -> Array:
        """Return the steps (T, n, m) for each of m other gradients (T, n, m)."""
        from scipy.linalg import solveh_banded

        _, count, numbers, _ = self.hessians.shape
        band = (BAND_REACH + 1) * numbers
        # scipy's upper form: lines[band - 1 + row - column, column]
        lines = np.zeros((band, count, numbers))
        rows, columns = np.indices((numbers, numbers)).reshape(2, -1)
        for apart in range(BAND_REACH + 1):
            off = apart * numbers + columns - rows
            upper = off >= 0
            row = rows[upper]
            column = columns[upper]
            values = self.hessians[apart, : count - apart, row, column]
            lines[band - 1 - off[upper], apart:, column] = values
        steps = solveh_banded(
            lines.reshape(band, -1),
            gradients.reshape(count * numbers, -1),
            check_finite=False,
        )
        return np.asarray(steps).reshape(gradients.shape)


STANDING_SPEED = 0.25  # metres a second that a standing foot may seem to move
# of the root's speed, which it may seem to move where that is more
STANDING_SPEED_SHARE = 0.45
STANDING_HEIGHT = 0.07  # metres above the lowest place of either foot within a stride
STRIDE_SECONDS = 1.2
MIN_STANCE_SECONDS = 0.12
MAX_STANCE_GAP_SECONDS = 0.07  # in which a foot seems not to stand


def standing_feet(joints: Array, fps: float, viewpoints: Array) -> NDArray[np.bool_]:
    """Return whether the left and the right foot stand (T, 2), of joints (T, 27, 3) whose root moves smoothly.

    A foot that stands is low, and slow compared with the root, which a walk moves on. y is up. A single camera, at
    `viewpoints` (T, 3), shows how slow it is only across the line of sight; these are NaN where several show it.
    """
    feet = joints[:, BALLS]
    sights = (joints[:, 0] - viewpoints)[:, [0, 2]]
    speed, root = (_speeds(places, sights, fps) for places in (feet, joints[:, :1]))
    slow = speed < np.maximum(STANDING_SPEED, STANDING_SPEED_SHARE * root)
    stands = slow & low(feet, fps, STRIDE_SECONDS, STANDING_HEIGHT)
    for side in range(2):
        bridged = ~_without_short(~stands[:, side], MAX_STANCE_GAP_SECONDS * fps)
        stands[:, side] = _without_short(bridged, MIN_STANCE_SECONDS * fps)
    return np.asarray(stands)


def _speeds(places: Array, sights: Array, fps: float) -> Array:
    """Return how fast places (T, n, 3) move along the ground (T, n), except along the lines of sight (T, 2).

    A line of NaN excludes nothing.
    """
    velocities = np.gradient(places[..., [0, 2]], 1.0 / fps, axis=0)
    sights = np.nan_to_num(
        sights / np.maximum(np.linalg.norm(sights, axis=1, keepdims=True), 1e-9)
    )
    velocities = (
        velocities
        - np.einsum("tni,ti->tn", velocities, sights)[..., None] * sights[:, None]
    )
    return np.asarray(np.linalg.norm(velocities, axis=2))


def _without_short(flags: NDArray[np.bool_], least: float) -> NDArray[np.bool_]:
    """Return flags (T,) without runs of fewer than `least` frames, except at either end."""
    longer = flags.copy()
    for start, stop in runs(flags):
        if stop - start < least and start > 0 and stop < len(flags):
            longer[start:stop] = False
    return longer


# metres that a root may be off from its estimate: standard deviation, as all that
# follow
PATH_ROOT_DEVIATION = 0.006
DEPTH_DEVIATION = 0.004  # of the distance, towards or away from a single camera
UNUSABLE_DEVIATION = 1.0  # metres, in frames that show too little
ROOT_ACCELERATION = 3.0  # metres a second squared, of the root on each axis
LEG_DEVIATION = np.radians(3.0)  # that an angle of a leg may be off the estimate
LEG_ACCELERATION = np.radians(400.0)  # a second squared, of that difference
# metres that a foot which stands may move in a thirtieth of a second
STANDING_SLIDE = 0.004
# standard deviations from the estimate beyond which a place is weighted down
OUTLIER_DEVIATIONS = 4.0
GAUSS_NEWTON_STEPS = 4
ANGLE_DIFFERENCE = 1e-4  # radians: of a difference quotient
# frames that are solved for at once, and those that two windows share
PATH_WINDOW = 900
PATH_OVERLAP = 60

# places in a pose of the angles of both legs
LEGS = tuple(
    angles_of(
        [side + bone for side in "lr" for bone in ("femur", "tibia", "foot")]
    ).tolist()
)


@dataclass(frozen=True, eq=False)
class Visibility:
    """Which frames of a motion are usable, and by which camera."""

    usable: NDArray[np.bool_]  # (T,)
    # (T, 3) metres: of the only camera that shows it; NaN where several do
    viewpoints: Array = field(repr=False)

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """Return the visibility of the frames of a scene."""
        usable = []
        viewpoints = []
        for observation in scene.observations:
            only = only_camera(scene.cameras, observation.silhouettes)
            usable.append(observation.usable)
            viewpoints.append(np.full(3, np.nan) if only is None else only.position)
        return cls(np.array(usable), np.array(viewpoints))

    def at(self, rows: NDArray[np.int64]) -> Self:
        """Return the visibility of some frames."""
        return replace(self, usable=self.usable[rows], viewpoints=self.viewpoints[rows])


def smooth_path(motion: Motion, visibility: Visibility) -> Motion:
    """Return a motion whose root moves smoothly and whose feet do not slide where they stand.

    Only the root's path and the angles of the legs change. A motion of fewer than 3 frames is returned as it is.
    """
    if len(motion) < 3:
        return motion
    frames = np.arange(len(motion))
    known = np.flatnonzero(visibility.usable)
    if len(known):  # the root moves straight on where frames show too little
        lines = [
            np.interp(frames, known, line) for line in motion.translations[known].T
        ]
        motion = replace(motion, translations=np.column_stack(lines))
    poses = motion.poses.copy()
    places = motion.translations.copy()
    for rows, inner in windows_over(len(motion), PATH_WINDOW, PATH_OVERLAP):
        part = replace(
            motion, poses=motion.poses[rows], translations=motion.translations[rows]
        )
        stands = np.zeros((len(part), 2), dtype=bool)
        visible = visibility.at(rows)
        # of the root alone, which shows which foot stands
        smooth = _solved(part, visible, stands)
        smooth = _solved(
            part, visible, standing_feet(smooth.joints, smooth.fps, visible.viewpoints)
        )
        poses[rows[inner]], places[rows[inner]] = (
            smooth.poses[inner],
            smooth.translations[inner],
        )
    return replace(motion, poses=poses, translations=places)


def windows_over(
    count: int, size: int, overlap: int
) -> list[tuple[NDArray[np.int64], NDArray[np.bool_]]]:
    """Return the frames (n,) of windows over `count` frames, and which of them (n,) are no neighbour's.

    Each has `size` such frames, the last one the rest, and up to `overlap` of its neighbours' before and after them.
    """
    parts = []
    for start in range(0, count, size):
        rows = np.arange(max(start - overlap, 0), min(start + size + overlap, count))
        parts.append((rows, (rows >= start) & (rows < start + size)))
    return parts


def _solved(
    motion: Motion, visibility: Visibility, stands: NDArray[np.bool_]
) -> Motion:
    """Return the motion of the least sum of squares, given which feet stand."""
    angles = [angle for angle in LEGS if motion.skeleton.free[angle]]
    root = slice(0, 3)
    legs = slice(3, 3 + len(angles))
    change = np.zeros((len(motion), 3 + len(angles)))  # of the root, and of the angles
    poses = motion.poses.copy()
    places = motion.translations.copy()
    for _ in range(GAUSS_NEWTON_STEPS):
        squares = Squares(*change.shape)
        add_root(squares, motion, visibility, PATH_ROOT_DEVIATION, change[:, root])
        squares.add(
            legs,
            np.eye(len(angles)) / LEG_DEVIATION**2,
            change[:, legs] / LEG_DEVIATION**2,
        )
        squares.add_bends(legs, change[:, legs], motion.fps**2 / LEG_ACCELERATION)
        add_standing(
            squares, replace(motion, poses=poses, translations=places), stands, angles
        )
        change = change - squares.least()
        poses[:, angles] = motion.poses[:, angles] + change[:, 3:]
        places = motion.translations + change[:, root]
    return replace(motion, poses=poses, translations=places)


def add_root(
    squares: Squares,
    motion: Motion,
    visibility: Visibility,
    deviation: float,
    moved: Array,
) -> None:
    """Add the squares of a root `moved` (T, 3) from its places in a motion, and of its accelerations.

    `deviation` is how many metres it may be off across the line of sight, and in depth where there are several cameras.
    The root's place is the first three numbers of each frame.
    """
    root = slice(0, 3)
    across = np.where(visibility.usable, deviation, UNUSABLE_DEVIATION)
    # (T, 3, 3) the inverse of the covariance
    precision = np.eye(3) / across[:, None, None] ** 2
    alone = np.isfinite(visibility.viewpoints).all(axis=1)
    sights = motion.translations[alone] - visibility.viewpoints[alone]
    far = np.maximum(np.linalg.norm(sights, axis=1), 1e-9)
    sights = sights / far[:, None]
    less = (
        1.0 / np.maximum(DEPTH_DEVIATION * far, across[alone]) ** 2
        - 1.0 / across[alone] ** 2
    )
    precision[alone] += less[:, None, None] * sights[:, :, None] * sights[:, None, :]
    off = np.einsum("ti,tij,tj->t", moved, precision, moved)
    precision /= (1.0 + off / OUTLIER_DEVIATIONS**2)[:, None, None]
    squares.add(root, precision, np.einsum("tij,tj->ti", precision, moved))
    squares.add_bends(
        root, motion.translations + moved, motion.fps**2 / ROOT_ACCELERATION
    )


def add_standing(
    squares: Squares, motion: Motion, stands: NDArray[np.bool_], angles: Sequence[int]
) -> None:
    """Add the squares of the steps of feet that stand (T, 2) in a motion.

    The numbers of each frame are the root's place and some `angles`.
    """
    legs = [angle for angle in LEGS if angle in angles]
    columns = [3 + angles.index(angle) for angle in legs]
    turned = np.repeat(motion.poses[None], len(legs), axis=0)
    for row, angle in enumerate(legs):
        turned[row, :, angle] += ANGLE_DIFFERENCE
    there = motion.skeleton.joints(
        turned, np.repeat(motion.translations[None], len(legs), axis=0)
    )
    joints = motion.joints
    for side, ball in enumerate(BALLS):
        feet = joints[:, ball]
        derivatives = np.zeros((*feet.shape, 3 + len(angles)))
        derivatives[..., :3] = np.eye(3)
        derivatives[..., columns] = np.moveaxis(
            (there[:, :, ball] - feet) / ANGLE_DIFFERENCE, 0, 2
        )
        both = np.flatnonzero(stands[:-1, side] & stands[1:, side])
        squares.add_steps(both, feet, derivatives, motion.fps / (30.0 * STANDING_SLIDE))
