"""The likeliest path of a root and two legs, by least squares over all frames at once.

Each frame pulls the root to its estimate, weighted by how well that is known.
Accelerations have a cost, and so do the steps of standing feet; the legs give way a
little to keep the feet still.
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

SECOND_DIFFERENCE = np.array([1.0, -2.0, 1.0])


class Squares:
    """Half the Hessian and gradient of a sum of squares, in T frames of n numbers."""

    def __init__(self, frames: int, numbers: int) -> None:
        # second derivatives within a frame, and between it and the next one
        self.hessians = np.zeros((2, frames, numbers, numbers))
        # the same of a number and itself two frames later; second differences join no
        # others
        self.two_later = np.zeros((frames, numbers))
        self.gradients = np.zeros((frames, numbers))

    def add(self, which: slice, precise: Array, gradients: Array) -> None:
        """Add squares of some numbers of each frame.

        Args:
            which: The numbers.
            precise: (m, m) or (T, m, m) their precision.
            gradients: (T, m) the product of the precision and their values.
        """
        self.hessians[0, :, which, which] += precise
        self.gradients[:, which] += gradients

    def add_bends(self, which: slice, series: Array, weight: float) -> None:
        """Add the squares of weighted second differences of some numbers.

        Args:
            which: The numbers.
            series: (T, m) their values now.
            weight: The factor on the differences.
        """
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
                apart = second - first
                if apart == 2:
                    self.two_later[frames, which] += square
                else:
                    self.hessians[apart, frames, diagonal, diagonal] += square

    def add_steps(
        self,
        frames: NDArray[np.int64],
        series: Array,
        derivatives: Array,
        weight: float,
    ) -> None:
        """Add the squares of weighted changes of a series from frames to the next ones.

        Args:
            frames: The frames from which the changes count.
            series: (T, m) the values now.
            derivatives: (T, m, n) of the values by the numbers of the same frame.
            weight: The factor on the changes.
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
        """Return the step (T, n) to subtract from the numbers for the least sum."""
        return self.steps_for(self.gradients[..., None])[..., 0]

    def steps_for(self, gradients: Array) -> Array:
        """Return the steps (T, n, m) for each of m other gradients (T, n, m)."""
        from scipy.linalg import solveh_banded

        _, count, numbers, _ = self.hessians.shape
        band = 2 * numbers + 1
        # SciPy's upper form, by columns, as LAPACK takes it: another layout would be
        # copied twice. A column ends with its diagonal, and begins `band` rows before.
        lines = np.zeros((count, numbers, band))
        for column in range(numbers):
            line = lines[:, column]  # (T, band)
            own = 2 * numbers - column  # where the rows of the same frame begin
            line[:, own:] = self.hessians[0, :, : column + 1, column]
            line[1:, own - numbers : own] = self.hessians[1, :-1, :, column]
            line[2:, 0] = self.two_later[:-2, column]
        steps = solveh_banded(
            lines.reshape(-1, band).T,
            gradients.reshape(count * numbers, -1),
            overwrite_ab=True,
            check_finite=False,
        )
        return np.asarray(steps).reshape(gradients.shape)


# A standing foot may seem to move at this speed, metres a second, or at this share of
# the speed of the root, if that is more.
STANDING_SPEED = 0.25
STANDING_SPEED_SHARE = 0.45
# Metres above the lowest place of either foot within a stride, at most.
STANDING_HEIGHT = 0.07
STRIDE_SECONDS = 1.2
MIN_STANCE_SECONDS = 0.12
MAX_STANCE_GAP_SECONDS = 0.07  # shorter gaps in a stance are closed


def standing_feet(joints: Array, fps: float, viewpoints: Array) -> NDArray[np.bool_]:
    """Return whether the left and the right foot are on the ground (T, 2).

    A standing foot is low, and slow compared with the root, which a walk moves ahead.

    Args:
        joints: (T, 27, 3) metres, y up. The root must move smoothly.
        fps: Frames a second.
        viewpoints: (T, 3) metres, the position of the single camera that shows a frame,
            NaN if several show it. A single camera shows speeds only across the line of
            sight.
    """
    feet = joints[:, BALLS]
    sights = (joints[:, 0] - viewpoints)[:, [0, 2]]
    speed, root = (_speeds(places, sights, fps) for places in (feet, joints[:, :1]))
    slow = speed < np.maximum(STANDING_SPEED, STANDING_SPEED_SHARE * root)
    standing = slow & low(feet, fps, STRIDE_SECONDS, STANDING_HEIGHT)
    for side in range(2):
        bridged = ~_without_short(~standing[:, side], MAX_STANCE_GAP_SECONDS * fps)
        standing[:, side] = _without_short(bridged, MIN_STANCE_SECONDS * fps)
    return np.asarray(standing)


def _speeds(places: Array, sights: Array, fps: float) -> Array:
    """Return the speeds (T, n) of places (T, n, 3) along the ground.

    The part along the lines of sight (T, 2) is left out, unless the line is NaN.
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
    """Return flags (T,) without runs shorter than `least`, except at either end."""
    longer = flags.copy()
    for start, stop in runs(flags):
        if stop - start < least and start > 0 and stop < len(flags):
            longer[start:stop] = False
    return longer


# Standard deviation of the root from its estimate, metres.
PATH_ROOT_DEVIATION = 0.006
# The same along the line of sight of a single camera, as a share of the distance.
DEPTH_DEVIATION = 0.004
UNUSABLE_DEVIATION = 1.0  # the same in unusable frames, metres
ROOT_ACCELERATION = 3.0  # standard deviation on each axis, metres a second squared
# Standard deviations of a leg's angle from its estimate, and of the acceleration of
# this difference, in radians and radians a second squared.
LEG_DEVIATION = np.radians(3.0)
LEG_ACCELERATION = np.radians(400.0)
STANDING_SLIDE = 0.004  # deviation of a standing foot in 1/30 s, metres
# Places farther from the estimate than this many standard deviations get less weight.
OUTLIER_DEVIATIONS = 4.0
GAUSS_NEWTON_STEPS = 4
ANGLE_DIFFERENCE = 1e-4  # radians, the step of a difference quotient
PATH_WINDOW = 900  # frames that are solved together
PATH_OVERLAP = 60  # frames that two neighbouring windows share

# Indices of the angles of both legs in a pose.
LEGS = tuple(
    angles_of(
        [side + bone for side in "lr" for bone in ("femur", "tibia", "foot")]
    ).tolist()
)


@dataclass(frozen=True, eq=False)
class Visibility:
    """Which frames of a motion are usable, and by which camera."""

    usable: NDArray[np.bool_]  # (T,)
    # (T, 3) metres, the position of the only camera that shows it, NaN if several do
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
    """Return a motion with a smooth path of the root and planted feet.

    Only the root's path and the angles of the legs change. A motion of fewer than 3
    frames is returned unchanged.
    """
    if len(motion) < 3:
        return motion
    frames = np.arange(len(motion))
    known = np.flatnonzero(visibility.usable)
    # the root moves straight through frames that show too little
    if len(known):
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
        standing = np.zeros((len(part), 2), dtype=bool)
        visible = visibility.at(rows)
        # first without standing feet: a smooth root shows which feet stand still
        smooth = _solved(part, visible, standing)
        standing = standing_feet(smooth.joints, smooth.fps, visible.viewpoints)
        smooth = _solved(part, visible, standing)
        poses[rows[inner]] = smooth.poses[inner]
        places[rows[inner]] = smooth.translations[inner]
    return replace(motion, poses=poses, translations=places)


def windows_over(
    count: int, size: int, overlap: int
) -> list[tuple[NDArray[np.int64], NDArray[np.bool_]]]:
    """Return the frames (n,) of windows over `count` frames, and which are inner (n,).

    Each window has `size` inner frames, the last one the rest. Around them it has up to
    `overlap` inner frames of each neighbour.
    """
    parts = []
    for start in range(0, count, size):
        rows = np.arange(max(start - overlap, 0), min(start + size + overlap, count))
        parts.append((rows, (rows >= start) & (rows < start + size)))
    return parts


def _solved(
    motion: Motion, visibility: Visibility, standing: NDArray[np.bool_]
) -> Motion:
    """Return the motion with the least sum of squares, given standing feet."""
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
            squares, replace(motion, poses=poses, translations=places), standing, angles
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
    """Add the squares of the root's distance from its estimate, and its accelerations.

    The place of the root is the first three numbers of each frame.

    Args:
        squares: Gets the squares.
        motion: The estimate.
        visibility: The visibility of its frames.
        deviation: Standard deviation of the root from its estimate, metres. Along the
            line of sight of a single camera it is `DEPTH_DEVIATION` of the distance, if
            that is more.
        moved: (T, 3) metres, the root relative to its estimate.
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
    squares: Squares, motion: Motion, standing: NDArray[np.bool_], angles: Sequence[int]
) -> None:
    """Add the squares of the steps of standing feet (T, 2) in a motion.

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
        both = np.flatnonzero(standing[:-1, side] & standing[1:, side])
        squares.add_steps(both, feet, derivatives, motion.fps / (30.0 * STANDING_SLIDE))
