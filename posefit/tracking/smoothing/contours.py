"""Poses, path and build fitted to the contours of masks, over all frames at once.

A tracker's estimate is one of its known poses, and it jitters because each frame is
searched by itself. Here least squares adjust every angle a little, and smoothly, to the
contours of the masks. The build, and small turns of several cameras, are fitted too.
They are the same in all frames.
"""

import threading
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.bodies import ObservedFrames
from posefit.fitting.contour_twists import Growth
from posefit.fitting.contours import (
    MAX_ANGLE_STEP,
    ROBUST_SCALES,
    MaskContours,
    coarseness,
    contour_squares,
)
from posefit.fitting.shape import (
    MODEL_SPREAD,
    NAMES,
    PRECISION,
    REACH,
    SPREAD,
    Shape,
    shaped,
)
from posefit.fitting.tracker import Observation
from posefit.footage.scene import Scene
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import BONES
from posefit.motion.motion import Motion
from posefit.silhouette.cost import BETA
from posefit.tracking.smoothing.path import (
    Squares,
    Visibility,
    add_root,
    add_standing,
    standing_feet,
    windows_over,
)

# Step of a difference quotient by the logarithm of a factor.
FACTOR_DIFFERENCE = 1e-4
# Standard deviations of an angle from its estimate, and of the acceleration of this
# difference, in radians and radians a second squared.
ANGLE_DEVIATION = np.radians(8.0)
ANGLE_ACCELERATION = np.radians(450.0)
# Standard deviation of the root from its estimate, across the line of sight, metres.
CONTOUR_ROOT_DEVIATION = 0.03
# Standard deviation of the turn of a calibrated camera about each axis. Our choice.
CAMERA_DEVIATION = np.radians(0.03)
# The largest change in a step: of the logarithm of a factor, or of a camera's turn.
MAX_FACTOR_STEP = 0.2
# This many frames weigh as much as what is known about people. It is more than one
# because the errors of successive contours are correlated. So are those of the views of
# a frame, because people are not cones in any view. So more views weigh no more.
BUILD_FRAMES = 2.0
CONTOUR_WINDOW = 300  # frames that are solved together
CONTOUR_OVERLAP = 30  # frames that two neighbouring windows share


def growth(body: Body, height: float | None, motion: Motion) -> Growth:
    """Return how joints and radii change with the logarithms of the factors of a build.

    Args:
        body: The body.
        height: Its height in metres, or None if it may change.
        motion: The motion of the body, T frames.

    Returns:
        The derivatives of joints (T, 17, 27, 3) and of radii (17, 26, 2), metres.
    """
    bodies = [
        shaped(body, np.exp(FACTOR_DIFFERENCE * row), height)
        for row in np.eye(len(NAMES))
    ]
    here = motion.joints
    joints = [
        grown.skeleton.joints(motion.poses, motion.translations) - here
        for grown in bodies
    ]
    radii = [grown.radii - body.radii for grown in bodies]
    joint_changes = np.stack(joints, axis=1) / FACTOR_DIFFERENCE
    radius_changes = np.stack(radii) / FACTOR_DIFFERENCE
    return Growth(joint_changes, radius_changes)


class Borders:
    """The borders of a film's masks, which fits of the same frames share.

    Tracing them takes as long as several steps of a fit. Only those of one window are
    kept, so that a long film takes no more memory than a window does.
    """

    def __init__(self, observations: Sequence[Observation]) -> None:
        self._observations = observations
        self._start = 0  # the frame that is counted as 0
        # by view: the first frame, its borders and those of the next frames, and which
        # of the pixels are used
        self._kept: dict[int, tuple[int, MaskContours, int]] = {}
        # without it, two threads that need the same borders would both trace them
        self._tracing = threading.Lock()

    def starting_at(self, frame: int) -> Self:
        """Return the same borders, with frames counted from this one."""
        later = copy(self)
        later._start = self._start + frame
        return later

    def of(
        self, camera: Camera, view: int, rows: NDArray[np.int64], places: Array
    ) -> MaskContours:
        """Return the borders of successive frames in the masks of a camera.

        Args:
            camera: The camera.
            view: Its number.
            rows: (n,) the frames.
            places: (n, 3) places of the person's root, roughly.
        """
        first = self._start + int(rows[0])
        last = self._start + int(rows[-1])
        _, factor = coarseness(camera, places)
        with self._tracing:
            start, kept, used = self._kept.get(view, (0, None, 0))
            inside = kept is not None and start <= first and last < start + len(kept)
            if kept is None or used != factor or not inside:
                start = first
                shown = [self._observations[k] for k in range(first, last + 1)]
                kept = MaskContours.of(camera, view, shown, places)
                self._kept[view] = start, kept, factor
        part = kept.part(slice(first - start, last + 1 - start))
        return part.seen_by(camera)


@dataclass(frozen=True, eq=False)
class _Window:
    """The frames of a window, with what is fitted in them."""

    estimate: Motion  # before it is fitted
    motion: Motion
    body: Body
    factors: Array  # (17,) logarithms of the factors so far; (0,) if the build is known
    height: float | None
    visibility: Visibility
    spread: Array  # (17,) standard deviations of these logarithms
    cameras: Sequence[Camera]
    # (V, 3) radians, the turn of the world in each camera; (0, 3) if none is turned
    turns: Array


def fit_contours(
    scene: Scene,
    motion: Motion,
    visibility: Visibility,
    shape: Shape | None,
    beta: float = BETA,
    scales: Sequence[float] = ROBUST_SCALES,
    borders: Borders | None = None,
) -> tuple[Scene, Motion, Shape | None]:
    """Return a steady motion fitted to the borders of a scene's masks.

    Several cameras are turned a little from their calibrations. In a long track, the
    build and the cameras are fitted in the window with most usable frames. A result
    that costs more than its start is discarded. A motion of fewer than 3 frames is
    returned unchanged.

    Args:
        scene: The scene.
        motion: The motion, steadied.
        visibility: The visibility of its frames.
        shape: The build if it was fitted, or None if it is known; it is then held.
        beta: The weight in the cost, see `posefit.silhouette.cost`.
        scales: The reach of each step, metres.
        borders: The borders of the scene's masks, if other fits share them.

    Returns:
        The scene with the fitted body and cameras, the motion, and the build.
    """
    if len(motion) < 3 or not visibility.usable.any():
        return scene, motion, shape
    borders = borders or Borders(scene.observations)
    spans = windows_over(len(motion), CONTOUR_WINDOW, CONTOUR_OVERLAP)
    done: dict[int, _Window] = {}
    # first the window that shows most, whose build and cameras the others then keep
    if shape is not None or scene.cameras_turn:
        best = int(np.argmax([visibility.usable[rows].sum() for rows, _ in spans]))
        rows = spans[best][0]
        start = _window_of(scene, motion, visibility, rows, shape, turned=True)
        window = _fitted_window(start, scene, rows, borders, beta, scales)
        done[best] = window
        # else no build fits better, and only poses are fitted
        if shape is not None and window.body is not scene.body:
            spread = np.minimum(np.hypot(window.spread, MODEL_SPREAD), SPREAD)
            shape = replace(
                shape, body=window.body, factors=np.exp(window.factors), spread=spread
            )
        scene = replace(scene, body=window.body, cameras=window.cameras)
    poses = motion.poses.copy()
    places = motion.translations.copy()
    for k, (rows, inner) in enumerate(spans):
        if k not in done:
            start = _window_of(scene, motion, visibility, rows, None)
            done[k] = _fitted_window(start, scene, rows, borders, beta, scales)
        window = done.pop(k)
        poses[rows[inner]] = window.motion.poses[inner]
        places[rows[inner]] = window.motion.translations[inner]
    fitted = replace(
        motion, skeleton=scene.body.skeleton, poses=poses, translations=places
    )
    return scene, fitted, shape


def _window_of(
    scene: Scene,
    motion: Motion,
    visibility: Visibility,
    rows: NDArray[np.int64],
    shape: Shape | None,
    turned: bool = False,
) -> _Window:
    """Return some frames of a motion before they are fitted.

    The build will be fitted too unless `shape` is None, and the cameras if `turned`.
    """
    estimate = replace(
        motion,
        skeleton=scene.body.skeleton,
        poses=motion.poses[rows],
        translations=motion.translations[rows],
    )
    factors = np.empty(0) if shape is None else np.log(shape.factors)
    turning = turned and scene.cameras_turn
    return _Window(
        estimate,
        estimate,
        scene.body,
        factors,
        None if shape is None else shape.height,
        visibility.at(rows),
        np.zeros(len(factors)),
        scene.cameras,
        np.zeros((len(scene.cameras) if turning else 0, 3)),
    )


def _fitted_window(
    window: _Window,
    scene: Scene,
    rows: NDArray[np.int64],
    borders: Borders,
    beta: float,
    scales: Sequence[float],
) -> _Window:
    """Return some frames of a scene after the best step from a start."""
    places = window.estimate.translations
    contours = [
        borders.of(camera, view, rows, places)
        for view, camera in enumerate(scene.cameras)
    ]
    observations = (scene.observations[k] for k in rows.tolist())
    usable = ObservedFrames.of(each for each in observations if each.usable)
    best = window
    least = _mean_cost(window, usable, beta)
    for scale in scales:
        window = _stepped(window, contours, scale)
        if (cost := _mean_cost(window, usable, beta)) < least:
            best = window
            least = cost
    return best


def _mean_cost(window: _Window, usable: ObservedFrames, beta: float) -> float:
    """Return the mean cost of the usable frames, or infinity if no frame is usable."""
    rows = window.visibility.usable
    if not rows.any():
        return np.inf
    poses = window.motion.poses[rows]
    places = window.motion.translations[rows]
    costs = usable.costs_of(window.body, window.cameras, poses, places, beta)
    return float(np.mean(costs))


def _stepped(window: _Window, borders: Sequence[MaskContours], scale: float) -> _Window:
    """Return a window after a Gauss-Newton step to the borders of all views.

    The unknowns are the degrees of freedom of each frame and, in all frames the same,
    the factors of the build and the turns of the cameras. The normal equations of three
    frames are

        [ A A A M ] [ frame 1 ]       A: bands of the paths over time, `_frame_squares`
        [ A A A M ] [ frame 2 ]       M: `mixed`, of frames and shared unknowns
        [ A A A M ] [ frame 3 ]       S: the shared unknowns'
        [ M M M S ] [ shared  ]

    The frames are eliminated first, because A is banded. That leaves a small system for
    the shared unknowns, the Schur complement S - M A^-1 M.
    """
    angles = np.flatnonzero(window.motion.skeleton.free).tolist()
    turned = [
        border.seen_by(camera)
        for border, camera in zip(borders, window.cameras, strict=True)
    ]
    hessians, gradients, mixed, hessian, gradient = contour_squares(
        window.body,
        turned,
        window.motion.poses,
        window.motion.translations,
        scale,
        _growth_by_view(window),
    )
    squares = _frame_squares(window, hessians, gradients, angles)
    solved = squares.steps_for(
        np.concatenate([squares.gradients[..., None], mixed], axis=2)
    )
    # the steps if the shared unknowns were held, and their change by each of these
    steps = solved[..., 0]  # (T, n)
    by_shared = solved[..., 1:]  # (T, n, s)
    weight, known = _known_of_shared(window)
    values = np.append(window.factors, window.turns)
    schur = hessian + weight * known - np.einsum("tni,tnj->ij", mixed, by_shared)
    right = gradient + weight * known @ values - np.einsum("tni,tn->i", mixed, steps)
    shared = _limited(window, np.linalg.solve(schur, right))
    # of the factors, if `BUILD_FRAMES` frames and one view count
    variances = np.diag(np.linalg.inv(schur))[: len(window.factors)]
    spread = np.sqrt(len(window.cameras) * weight * variances)
    return _moved(window, angles, steps - by_shared @ shared, shared, spread)


def _known_of_shared(window: _Window) -> tuple[float, Array]:
    """Return what is known about the s shared unknowns without masks.

    Returns:
        How many times it counts, and its precision (s, s): of the factors, as they vary
        among people, and of the cameras' turns.
    """
    count = len(window.factors)
    precision = np.eye(count + window.turns.size) / CAMERA_DEVIATION**2
    # against several views as much as against one; a camera turns in its own view alone
    precision[:count, :count] = len(window.cameras) * PRECISION[:count, :count]
    # as much as `BUILD_FRAMES` frames, however many frames there are
    frames = np.count_nonzero(window.visibility.usable)
    return max(frames / BUILD_FRAMES, 1.0), precision


def _limited(window: _Window, shared: Array) -> Array:
    """Return a step (s,) of the shared unknowns that is not too large.

    The factors stay within the range in which builds are searched.
    """
    count = len(window.factors)
    limited = np.clip(shared, -MAX_FACTOR_STEP, MAX_FACTOR_STEP)
    reach = REACH * SPREAD[:count]
    factors = np.clip(window.factors - limited[:count], -reach, reach)
    limited[:count] = window.factors - factors
    return limited


def _moved(
    window: _Window,
    angles: Sequence[int],
    steps: Array,
    shared: Array,
    spread: Array,
) -> _Window:
    """Return a window after steps are subtracted from all unknowns.

    Args:
        window: The window.
        angles: The n - 3 angles that may change.
        steps: (T, n) the steps of the frames.
        shared: (s,) the step of the shared unknowns: factors, then turns of cameras.
        spread: (17,) the standard deviations of the factors' logarithms.
    """
    count = len(window.factors)
    body = window.body
    if count:
        body = shaped(window.body, np.exp(-shared[:count]), window.height)
    turns = shared[count:].reshape(-1, 3)
    cameras = window.cameras
    if len(turns):
        cameras = [turned_camera(*each) for each in zip(cameras, -turns, strict=True)]
    poses = window.motion.poses.copy()
    poses[:, angles] -= np.clip(steps[:, 3:], -MAX_ANGLE_STEP, MAX_ANGLE_STEP)
    motion = replace(
        window.motion,
        skeleton=body.skeleton,
        poses=poses,
        translations=window.motion.translations - steps[:, :3],
    )
    return replace(
        window,
        motion=motion,
        body=body,
        factors=window.factors - shared[:count],
        spread=spread,
        cameras=cameras,
        turns=window.turns - turns,
    )


def _frame_squares(
    window: _Window, hessians: Array, gradients: Array, angles: Sequence[int]
) -> Squares:
    """Return the squares of a step: the borders, and what is known without them.

    What is known: the root and the angles of each frame, roughly, and that standing
    feet do not move.
    """
    motion = window.motion
    estimate = window.estimate
    visibility = window.visibility
    squares = Squares(len(motion), 3 + len(angles))
    of_angles = slice(3, 3 + len(angles))
    squares.add(slice(None), hessians, gradients)
    add_root(
        squares,
        estimate,
        visibility,
        CONTOUR_ROOT_DEVIATION,
        motion.translations - estimate.translations,
    )
    change = wrapped(motion.poses - estimate.poses)[:, angles]
    squares.add(
        of_angles, np.eye(len(angles)) / ANGLE_DEVIATION**2, change / ANGLE_DEVIATION**2
    )
    squares.add_bends(of_angles, change, motion.fps**2 / ANGLE_ACCELERATION)
    add_standing(
        squares,
        motion,
        standing_feet(motion.joints, motion.fps, visibility.viewpoints),
        angles,
    )
    return squares


def _growth_by_view(window: _Window) -> list[Growth]:
    """Return how joints and radii change in each view with build and camera turns.

    A camera's turn is a factor too. It moves the joints that this camera sees.
    """
    joints = window.motion.joints
    turns = window.turns.size
    build = Growth(
        np.empty((len(joints), 0, *joints.shape[1:])), np.empty((0, len(BONES), 2))
    )
    if len(window.factors):
        build = growth(window.body, window.height, window.motion)
    # turns change no radii
    radii = np.concatenate([build.radii, np.zeros((turns, len(BONES), 2))])
    views = []
    for view, camera in enumerate(window.cameras):
        turned = np.zeros((len(joints), turns, *joints.shape[1:]))
        # a turned camera sees the world turned about its optical centre
        if turns:
            away = (joints - camera.position)[:, None]
            turned[:, 3 * view : 3 * view + 3] = np.cross(np.eye(3)[:, None], away)
        views.append(Growth(np.concatenate([build.joints, turned], axis=1), radii))
    return views


def turned_camera(camera: Camera, turn: Array) -> Camera:
    """Return a camera that sees the world turned about its optical centre.

    `turn` (3,) is a rotation vector, radians.
    """
    rotation = camera.rotation @ cv2.Rodrigues(turn)[0]
    return replace(camera, rotation=rotation, translation=-rotation @ camera.position)
