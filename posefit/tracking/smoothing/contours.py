"""Poses, path and build whose contours are those of the masks, by least squares over all frames at once.

A tracker's estimate is one of the poses that it knows, and a search in each frame makes it shake. Here every angle
gives way a little, and smoothly, to the contours of the masks; so do the build and the turns of several cameras,
which are the same in all frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.bodies import ObservedFrames
from posefit.fitting.contours import (
    MAX_ANGLE_STEP,
    ROBUST_SCALES,
    MaskContours,
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

FACTOR_DIFFERENCE = 1e-4  # of the logarithm of a factor: of a difference quotient
# that an angle may be off the estimate: standard deviation, as all that follow
ANGLE_DEVIATION = np.radians(8.0)
ANGLE_ACCELERATION = np.radians(450.0)  # a second squared, of that difference
# metres that the root may be off the estimate, across the line of sight
CONTOUR_ROOT_DEVIATION = 0.03
MAX_FACTOR_STEP = 0.2  # of a step: of the logarithm of a factor, or of a camera's turn
# that a calibrated camera may be turned: standard deviation about each axis; ours
CAMERA_DEVIATION = np.radians(0.03)
# that weigh as much as what is known of people: errors of successive contours are
# correlated
BUILD_FRAMES = 2.0
# frames that are solved for at once, and those that two windows share
CONTOUR_WINDOW = 300
CONTOUR_OVERLAP = 30


def growth(body: Body, height: float | None, motion: Motion) -> tuple[Array, Array]:
    """Return how joints (T, 17, 27, 3) and radii (17, 26, 2), metres, change with the logarithms of factors."""
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
    return np.stack(joints, axis=1) / FACTOR_DIFFERENCE, np.stack(
        radii
    ) / FACTOR_DIFFERENCE


@dataclass(frozen=True, eq=False)
class _Part:
    estimate: Motion  # before it is fitted
    fitted: Motion
    body: Body
    # (17,) logarithms of what the body was fitted by before; (0,) where the build is
    # known
    factors: Array
    height: float | None
    visibility: Visibility
    spread: Array  # (17,) standard deviations of these logarithms
    cameras: Sequence[Camera]
    # (V, 3) radians that each camera's world was turned by; (0, 3) where calibrations
    # are held
    turns: Array


def fit_contours(
    scene: Scene,
    motion: Motion,
    visibility: Visibility,
    shape: Shape | None,
    beta: float = BETA,
    scales: Sequence[float] = ROBUST_SCALES,
) -> tuple[Scene, Motion, Shape | None]:
    """Return a steady motion fitted to the borders of a scene's masks, with the scene's cameras and the build.

    The build stays as it is where it was not fitted before (`shape` is None): it is then known. Several cameras are
    turned a little from their calibrations. Both are fitted in the window of a long track with most usable frames.
    `scales` has the reach of each step in metres. A result that costs more than its start is discarded. A motion of
    fewer than 3 frames is returned as it is.
    """
    if len(motion) < 3 or not visibility.usable.any():
        return scene, motion, shape
    parts = windows_over(len(motion), CONTOUR_WINDOW, CONTOUR_OVERLAP)
    fitted: dict[int, _Part] = {}
    if shape is not None or scene.cameras_turn:
        best = int(np.argmax([visibility.usable[rows].sum() for rows, _ in parts]))
        part = fitted[best] = _fitted(
            scene, motion, visibility, parts[best][0], shape, beta, scales, turned=True
        )
        # else no build fits better, and only poses are fitted
        if shape is not None and part.body is not scene.body:
            spread = np.minimum(np.hypot(part.spread, MODEL_SPREAD), SPREAD)
            shape = replace(
                shape, body=part.body, factors=np.exp(part.factors), spread=spread
            )
        scene = replace(scene, body=part.body, cameras=part.cameras)
    poses = motion.poses.copy()
    places = motion.translations.copy()
    for k, (rows, inner) in enumerate(parts):
        part = fitted.get(k) or _fitted(
            scene, motion, visibility, rows, None, beta, scales
        )
        poses[rows[inner]], places[rows[inner]] = (
            part.fitted.poses[inner],
            part.fitted.translations[inner],
        )
    return (
        scene,
        replace(motion, skeleton=scene.body.skeleton, poses=poses, translations=places),
        shape,
    )


def _fitted(
    scene: Scene,
    motion: Motion,
    visibility: Visibility,
    rows: NDArray[np.int64],
    shape: Shape | None,
    beta: float,
    scales: Sequence[float],
    turned: bool = False,
) -> _Part:
    """Return some frames of a motion as the best step fits them, with the build where there is a shape to fit."""
    body = scene.body
    cameras = scene.cameras
    estimate = replace(
        motion,
        skeleton=body.skeleton,
        poses=motion.poses[rows],
        translations=motion.translations[rows],
    )
    observations = [scene.observations[k] for k in rows.tolist()]
    places = estimate.translations
    borders = [
        MaskContours.of(camera, view, observations, places)
        for view, camera in enumerate(cameras)
    ]
    factors, height = (
        (np.empty(0), None) if shape is None else (np.log(shape.factors), shape.height)
    )
    turns = np.zeros((len(cameras) if turned and scene.cameras_turn else 0, 3))
    spread = np.zeros(len(factors))
    part = _Part(
        estimate,
        estimate,
        body,
        factors,
        height,
        visibility.at(rows),
        spread,
        cameras,
        turns,
    )
    best = part
    usable = ObservedFrames.of(each for each in observations if each.usable)
    least = _mean_cost(part, usable, beta)
    for scale in scales:
        part = _stepped(part, borders, scale)
        if (cost := _mean_cost(part, usable, beta)) < least:
            best = part
            least = cost
    return best


def _mean_cost(part: _Part, usable: ObservedFrames, beta: float) -> float:
    """Return the mean cost of the frames that show enough of the person; infinite where there is none."""
    rows = part.visibility.usable
    if not rows.any():
        return np.inf
    fitted = part.fitted
    costs = usable.costs_of(
        part.body, part.cameras, fitted.poses[rows], fitted.translations[rows], beta
    )
    return float(np.mean(costs))


def _stepped(part: _Part, borders: Sequence[MaskContours], scale: float) -> _Part:
    """Return a window after a Gauss-Newton step to the borders of all views."""
    fitted = part.fitted
    count = len(part.factors)
    angles = np.flatnonzero(fitted.skeleton.free).tolist()
    poses = fitted.poses.copy()
    places = fitted.translations
    turned = [
        border.seen_by(camera)
        for border, camera in zip(borders, part.cameras, strict=True)
    ]
    hessians, gradients, mixed, hessian, gradient = contour_squares(
        part.body, turned, poses, places, scale, _changes(part)
    )
    squares = _frame_squares(part, hessians, gradients, angles)
    solved = squares.steps_for(
        np.concatenate([squares.gradients[..., None], mixed], axis=2)
    )
    steps = solved[..., 0]
    by_factor = solved[..., 1:]
    held = max(np.count_nonzero(part.visibility.usable) / BUILD_FRAMES, 1.0)
    values = np.append(part.factors, part.turns)
    known = np.eye(count + part.turns.size) / CAMERA_DEVIATION**2
    known[:count, :count] = PRECISION[:count, :count]
    hessian = hessian + held * known - np.einsum("tni,tnj->ij", mixed, by_factor)
    gradient = gradient + held * known @ values - np.einsum("tni,tn->i", mixed, steps)
    changes = np.clip(
        np.linalg.solve(hessian, gradient), -MAX_FACTOR_STEP, MAX_FACTOR_STEP
    )
    reach = REACH * SPREAD[:count]
    changes[:count] = part.factors - np.clip(
        part.factors - changes[:count], -reach, reach
    )
    steps = steps - by_factor @ changes
    poses[:, angles] -= np.clip(steps[:, 3:], -MAX_ANGLE_STEP, MAX_ANGLE_STEP)
    body = (
        shaped(part.body, np.exp(-changes[:count]), part.height) if count else part.body
    )
    turns = changes[count:].reshape(-1, 3)
    cameras = part.cameras
    if len(turns):
        cameras = [turned_camera(*each) for each in zip(cameras, -turns, strict=True)]
    return replace(
        part,
        fitted=replace(
            fitted,
            skeleton=body.skeleton,
            poses=poses,
            translations=places - steps[:, :3],
        ),
        body=body,
        factors=part.factors - changes[:count],
        spread=np.sqrt(held * np.diag(np.linalg.inv(hessian)))[:count],
        cameras=cameras,
        turns=part.turns - turns,
    )


def _frame_squares(
    part: _Part, hessians: Array, gradients: Array, angles: Sequence[int]
) -> Squares:
    """Return those of the borders, and of what is known of each frame's root, of its angles and of standing feet."""
    fitted = part.fitted
    estimate = part.estimate
    visibility = part.visibility
    squares = Squares(len(fitted), 3 + len(angles))
    of_angles = slice(3, 3 + len(angles))
    squares.add(slice(None), hessians, gradients)
    add_root(
        squares,
        estimate,
        visibility,
        CONTOUR_ROOT_DEVIATION,
        fitted.translations - estimate.translations,
    )
    change = wrapped(fitted.poses - estimate.poses)[:, angles]
    squares.add(
        of_angles, np.eye(len(angles)) / ANGLE_DEVIATION**2, change / ANGLE_DEVIATION**2
    )
    squares.add_bends(of_angles, change, fitted.fps**2 / ANGLE_ACCELERATION)
    add_standing(
        squares,
        fitted,
        standing_feet(fitted.joints, fitted.fps, visibility.viewpoints),
        angles,
    )
    return squares


def _changes(part: _Part) -> list[tuple[Array, Array]]:
    """Return how joints and radii change in each view with the factors of the build and the turns of the cameras."""
    joints = part.fitted.joints
    turns = part.turns.size
    wider = np.empty((len(joints), 0, *joints.shape[1:]))
    larger = np.empty((0, len(BONES), 2))
    if len(part.factors):
        wider, larger = growth(part.body, part.height, part.fitted)
    larger = np.concatenate([larger, np.zeros((turns, len(BONES), 2))])
    changes = []
    for view, camera in enumerate(part.cameras):
        turned = np.zeros((len(joints), turns, *joints.shape[1:]))
        if turns:  # in this view the world turns about its optical centre
            away = (joints - camera.position)[:, None]
            turned[:, 3 * view : 3 * view + 3] = np.cross(np.eye(3)[:, None], away)
        changes.append((np.concatenate([wider, turned], axis=1), larger))
    return changes


def turned_camera(camera: Camera, turn: Array) -> Camera:
    """Return a camera that sees the world turned about its optical centre, by a rotation vector (3,)."""
    rotation = camera.rotation @ cv2.Rodrigues(turn)[0]
    return replace(camera, rotation=rotation, translation=-rotation @ camera.position)
