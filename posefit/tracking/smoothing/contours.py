"""Poses, path and build whose contours are those of the masks, by least squares over all frames at once.

A tracker's estimate is one of the poses that it knows, and a search in each frame makes it shake. Here every angle
gives way a little, and smoothly, to the contours of the masks; so does the build, which is the same in all frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.fitting.shape import MODEL_SPREAD, NAMES, PRECISION, REACH, SPREAD, Shape, shaped
from posefit.fitting.tracker import Observation, Task
from posefit.footage.scene import Scene
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import ANGLES, BONES, JOINTS
from posefit.motion.motion import Motion
from posefit.silhouette.cost import BETA, pose_costs
from posefit.silhouette.mask import Mask, coarser_camera, without_small_pieces
from posefit.tracking.smoothing import kernels
from posefit.tracking.smoothing.path import Squares, Visibility, add_root, add_standing, standing_feet, windows_over

FINE_PIXELS = 80.0  # pixels of a metre; of finer masks only every second pixel, third, ... is used
FIELD_MARGIN = 48  # pixels around a mask whose distance from it is known

Distances = NDArray[np.float32]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class MaskContours:
    """What one camera shows of the border in T frames; a frame that shows too little has no points."""

    camera: Camera  # whose pixels these are: of fine masks a coarser one than theirs
    metres: Array  # (T,) pixels of a metre where the person is
    step: float  # pixels of the border that a point stands for
    fields: Distances = field(repr=False)  # (T, h, w) pixels outside the mask, below 0 within; 0 where it is unknown
    corners: Integers = field(repr=False)  # (T, 2) column and row of each field's first pixel
    sizes: Integers = field(repr=False)  # (T, 2) rows and columns of each field
    points: Array = field(repr=False)  # (n, 2) pixels: of the borders, frame after frame
    starts: Integers = field(repr=False)  # (T + 1,) where the points of each frame begin

    @classmethod
    def of(
        cls, camera: Camera, view: int, observations: Sequence[Observation], places: Array, spacing: float = 0.0
    ) -> Self:
        """Return the borders of a person whose root is about at `places` (T, 3), from a camera, number `view`.

        Points are about `spacing` metres apart, but at least a pixel.
        """
        far = np.maximum(camera.project(places)[1], 0.1)
        metres = np.sqrt(camera.focal.prod()) / far
        factor = max(int(np.median(metres) / FINE_PIXELS), 1)
        factor = min(factor, camera.width, camera.height)
        camera, metres = coarser_camera(camera, factor), metres / factor
        step = max(round(float(np.median(metres)) * spacing), 1)
        traced = [_border(observation, view, factor, step) for observation in observations]
        points, corners, distances = zip(*traced, strict=True)
        sizes = np.array([part.shape for part in distances])
        fields = np.zeros((len(traced), *sizes.max(axis=0)), dtype=np.float32)
        for whole, part in zip(fields, distances, strict=True):
            whole[: part.shape[0], : part.shape[1]] = part
        starts = np.cumsum([0, *map(len, points)])
        return cls(camera, metres, float(step), fields, np.array(corners), sizes, np.concatenate(points), starts)

    def add(self, body: Body, frames: Array, scale: float, grown: kernels.Growth, sums: kernels.BoneSquares) -> None:
        """Add the squares of the distances between these borders and those of bodies, see `kernels.add_frames`."""
        camera = tuple(writeable(getattr(self.camera, name)) for name in ("rotation", "translation", "focal", "centre"))
        contours = kernels.Contours(self.fields, self.corners, self.sizes, self.points, self.starts, self.step)
        kernels.add_frames(body.skeleton.chain.parents, body.radii, camera, frames, contours, scale, grown, sums)


def _border(observation: Observation, view: int, factor: int, step: int) -> tuple[Array, tuple[int, int], Distances]:
    """Return every `step`th point of a mask's border (n, 2), and the corner and the distances about it."""
    nothing = np.empty((0, 2)), (0, 0), np.zeros((1, 1), dtype=np.float32)
    if not observation.usable:
        return nothing
    silhouette, first = observation.silhouettes[view], factor // 2
    pictures = silhouette.mask, silhouette.valid
    mask, valid = (np.ascontiguousarray(picture[first::factor, first::factor]) for picture in pictures)
    mask = without_small_pieces(mask)
    left, top, width, height = cv2.boundingRect(mask.astype(np.uint8))
    right, bottom = left + width + FIELD_MARGIN, top + height + FIELD_MARGIN
    left, top = max(left - FIELD_MARGIN, 0), max(top - FIELD_MARGIN, 0)
    mask, valid = mask[top:bottom, left:right], valid[top:bottom, left:right]
    around = valid & ~mask  # the background there is known
    if not width or not around.any():
        return nothing
    pixels = np.concatenate([_between(mask, around), _between(mask.T, around.T)[:, ::-1]])
    return pixels[::step] + np.array([left, top]), (left, top), distances_outside(mask, around)


def distances_outside(mask: Mask, around: Mask) -> Distances:
    """Return how far pixels (h, w) are outside a mask's border, below 0 within, and 0 where neither is true."""
    out, within = (cv2.distanceTransform((~part).astype(np.uint8), cv2.DIST_L2, 5) - 0.5 for part in (mask, around))
    return np.asarray(np.where(mask, -within, np.where(around, out, 0.0)), dtype=np.float32)


def _between(mask: Mask, around: Mask) -> Array:
    """Return the middles (n, 2) of edges between a pixel of the mask and its neighbour to the side."""
    meet = (mask[:, 1:] & around[:, :-1]) | (mask[:, :-1] & around[:, 1:])
    rows, columns = np.nonzero(meet)
    return np.column_stack([columns + 1.0, rows + 0.5])


class ContourSquares(NamedTuple):
    """Half the second derivatives and half the gradients of the squared distances between borders.

    They are by n numbers of each frame, the root's place and the free angles, and by F factors of the build.
    """

    curves: Array  # (T, n, n)
    slopes: Array  # (T, n)
    mixed: Array  # (T, n, F) second derivatives by numbers and factors
    factor_curve: Array  # (F, F) over all frames
    factor_slope: Array  # (F,)


def contour_squares(
    body: Body,
    views: Sequence[MaskContours],
    poses: Array,
    places: Array,
    scale: float,
    grown: tuple[Array, Array] | None = None,
) -> ContourSquares:
    """Return the squares of the distances between the borders of masks and those of a body in T poses at places.

    Views have T frames, or one that all poses belong to. Distances beyond `scale` metres count less. `grown` is the
    `growth` of the body; without it there are no factors.
    """
    skeleton, count = body.skeleton, len(poses)
    wider, larger = grown or (np.empty((count, 0, len(JOINTS), 3)), np.empty((0, len(BONES), 2)))
    factors = len(larger)
    placed = skeleton.frames(poses, places)
    squares = np.zeros((1 + factors, 1 + factors))
    bones = [np.zeros((count, len(JOINTS), 6, columns)) for columns in (6, 1 + factors)]
    sums = kernels.BoneSquares(*bones)
    for view in views:
        view.add(body, placed[0], scale, kernels.Growth(wider, larger, squares), sums)
    free = np.flatnonzero(np.append([True] * 3, skeleton.free))
    curves, slopes = (np.empty((count, len(free), size)) for size in (len(free), 1 + factors))
    kernels.add_all_bones(skeleton.chain, placed, sums, free, (curves, slopes))
    return ContourSquares(curves, slopes[..., 0], slopes[..., 1:], squares[1:, 1:], squares[1:, 0])


FACTOR_DIFFERENCE = 1e-4  # of the logarithm of a factor: of a difference quotient


def growth(body: Body, height: float | None, motion: Motion) -> tuple[Array, Array]:
    """Return how joints (T, 17, 27, 3) and radii (17, 26, 2), metres, change with the logarithms of factors."""
    bodies = [shaped(body, np.exp(FACTOR_DIFFERENCE * row), height) for row in np.eye(len(NAMES))]
    here = motion.joints
    joints = [grown.skeleton.joints(motion.poses, motion.translations) - here for grown in bodies]
    radii = [grown.radii - body.radii for grown in bodies]
    return np.stack(joints, axis=1) / FACTOR_DIFFERENCE, np.stack(radii) / FACTOR_DIFFERENCE


# metres, step by step: what is farther off counts less, as it may be another person's, or a bag's
ROBUST_SCALES = (0.09, 0.09, 0.065, 0.065, 0.045, 0.045, *[0.033] * 6)
ANGLE_DEVIATION = np.radians(8.0)  # that an angle may be off the estimate: standard deviation, as all that follow
ANGLE_ACCELERATION = np.radians(450.0)  # a second squared, of that difference
CONTOUR_ROOT_DEVIATION = 0.03  # metres that the root may be off the estimate, across the line of sight
MAX_ANGLE_STEP, MAX_FACTOR_STEP = np.radians(20.0), 0.2  # of a step: of an angle, and of the logarithm of a factor
BUILD_FRAMES = 2.0  # that weigh as much as what is known of people: errors of successive contours are correlated
CONTOUR_WINDOW, CONTOUR_OVERLAP = 300, 30  # frames that are solved for at once, and those that two windows share


@dataclass(frozen=True, eq=False)
class _Part:
    estimate: Motion  # before it is fitted
    fitted: Motion
    body: Body
    factors: Array  # (17,) logarithms of what the body was fitted by before; (0,) where the build is known
    height: float | None
    visibility: Visibility
    spread: Array  # (17,) standard deviations of these logarithms


def fit_contours(
    scene: Scene, motion: Motion, visibility: Visibility, shape: Shape | None, beta: float = BETA
) -> tuple[Motion, Shape | None]:
    """Return a steady motion fitted to the borders of a scene's masks, and the build fitted with it.

    The build stays as it is where it was not fitted before (`shape` is None): it is then known. That of a long
    track is fitted in the window with most usable frames. A result that costs more than its start is discarded. A
    motion of fewer than 3 frames is returned as it is.
    """
    if len(motion) < 3 or not visibility.usable.any():
        return motion, shape
    parts = windows_over(len(motion), CONTOUR_WINDOW, CONTOUR_OVERLAP)
    fitted: dict[int, _Part] = {}
    if shape is not None:
        best = int(np.argmax([visibility.usable[rows].sum() for rows, _ in parts]))
        part = _fitted(scene, motion, visibility, parts[best][0], scene.body, shape, beta)
        if part.body is not scene.body:  # else no build fits better, and only poses are fitted
            spread = np.minimum(np.hypot(part.spread, MODEL_SPREAD), SPREAD)
            shape = replace(shape, body=part.body, factors=np.exp(part.factors), spread=spread)
            fitted[best] = part
    body = scene.body if shape is None else shape.body
    poses, places = motion.poses.copy(), motion.translations.copy()
    for k, (rows, inner) in enumerate(parts):
        part = fitted.get(k) or _fitted(scene, motion, visibility, rows, body, None, beta)
        poses[rows[inner]], places[rows[inner]] = part.fitted.poses[inner], part.fitted.translations[inner]
    return replace(motion, skeleton=body.skeleton, poses=poses, translations=places), shape


def _fitted(
    scene: Scene,
    motion: Motion,
    visibility: Visibility,
    rows: NDArray[np.int64],
    body: Body,
    shape: Shape | None,
    beta: float,
) -> _Part:
    """Return some frames of a motion as the best step fits them, with the build where there is a shape to fit."""
    estimate = replace(motion, skeleton=body.skeleton, poses=motion.poses[rows], translations=motion.translations[rows])
    observations = [scene.observations[k] for k in rows.tolist()]
    places = estimate.translations
    borders = [MaskContours.of(camera, view, observations, places) for view, camera in enumerate(scene.cameras)]
    factors, height = (np.empty(0), None) if shape is None else (np.log(shape.factors), shape.height)
    part = _Part(estimate, estimate, body, factors, height, visibility.at(rows), np.zeros(len(factors)))
    best, least = part, _mean_cost(scene, part, observations, beta)
    for scale in ROBUST_SCALES:
        part = _stepped(part, borders, scale)
        if (cost := _mean_cost(scene, part, observations, beta)) < least:
            best, least = part, cost
    return best


def _mean_cost(scene: Scene, part: _Part, observations: Sequence[Observation], beta: float) -> float:
    """Return the mean cost of the frames that show enough of the person; infinite where there is none."""
    costs = []
    for k in np.flatnonzero(part.visibility.usable).tolist():
        pose, place = part.fitted.poses[k : k + 1], part.fitted.translations[k : k + 1]
        costs.append(pose_costs(part.body, scene.cameras, observations[k].silhouettes, pose, place, beta)[0][0])
    return float(np.mean(costs)) if costs else np.inf


def _stepped(part: _Part, borders: Sequence[MaskContours], scale: float) -> _Part:
    """Return a window after a step of Gauss and Newton to the borders of all views."""
    fitted, estimate, factors, spread = part.fitted, part.estimate, len(part.factors), part.spread
    angles = np.flatnonzero(fitted.skeleton.free).tolist()
    poses, places, numbers = fitted.poses, fitted.translations, 3 + len(angles)
    grown = growth(part.body, part.height, fitted) if factors else None
    curves, slopes, mixed, curve, slope = contour_squares(part.body, borders, poses, places, scale, grown)
    squares, some, changes = Squares(len(fitted), numbers), slice(3, numbers), np.zeros(factors)
    squares.add(slice(None), curves, slopes)
    add_root(squares, estimate, part.visibility, CONTOUR_ROOT_DEVIATION, places - estimate.translations)
    change = wrapped(poses - estimate.poses)[:, angles]
    squares.add(some, np.eye(len(angles)) / ANGLE_DEVIATION**2, change / ANGLE_DEVIATION**2)
    squares.add_bends(some, change, fitted.fps**2 / ANGLE_ACCELERATION)
    add_standing(squares, fitted, standing_feet(fitted.joints, fitted.fps, part.visibility.viewpoints), angles)
    if not factors:
        steps = squares.least()
    else:
        solved = squares.steps_for(np.concatenate([squares.slopes[..., None], mixed], axis=2))
        steps, by_factor = solved[..., 0], solved[..., 1:]
        held = max(np.count_nonzero(part.visibility.usable) / BUILD_FRAMES, 1.0)
        known = held * PRECISION
        curve = curve + known - np.einsum("tni,tnj->ij", mixed, by_factor)
        slope = slope + known @ part.factors - np.einsum("tni,tn->i", mixed, steps)
        changes = np.clip(np.linalg.solve(curve, slope), -MAX_FACTOR_STEP, MAX_FACTOR_STEP)
        changes = part.factors - np.clip(part.factors - changes, -REACH * SPREAD, REACH * SPREAD)
        steps = steps - by_factor @ changes
        spread = np.sqrt(held * np.diag(np.linalg.inv(curve)))
    poses = poses.copy()
    poses[:, angles] -= np.clip(steps[:, 3:], -MAX_ANGLE_STEP, MAX_ANGLE_STEP)
    body = shaped(part.body, np.exp(-changes), part.height) if factors else part.body
    fitted = replace(fitted, skeleton=body.skeleton, poses=poses, translations=places - steps[:, :3])
    return replace(part, fitted=fitted, body=body, factors=part.factors - changes, spread=spread)


POINT_SPACING = 0.04  # metres, about, between two points of a mask's border, where one frame is fitted
STEP_EVALUATIONS = 27.0  # effort of a step of one frame, in costs of poses, which docs/studies/follow.py measures


def fitted(
    body: Body,
    views: Sequence[MaskContours],
    start: tuple[Array, Array],
    means: Array,
    precisions: Array,
    scales: Sequence[float],
) -> tuple[Array, Array]:
    """Return poses (n, 66) and places (n, 3) after a step to the contours of one frame for each of `scales`.

    Angles are pulled to `means` (n, 66), places to where they `start`, with `precisions` (69,) of places and angles.
    Contours farther off than a scale, metres, count less.
    """
    angles = np.flatnonzero(body.skeleton.free)
    poses, places, weights = start[0].copy(), start[1].copy(), precisions[np.append([0, 1, 2], 3 + angles)]
    for scale in scales:
        curves, slopes, *_ = contour_squares(body, views, poses, places, scale)
        off = np.concatenate([places - start[1], (poses - means)[:, angles]], axis=1)
        np.einsum("nii->ni", curves)[:] += weights  # on the diagonals
        steps = np.linalg.solve(curves, (slopes + weights * off)[..., None])[..., 0]
        places -= steps[:, :3]
        poses[:, angles] -= np.clip(steps[:, 3:], -MAX_ANGLE_STEP, MAX_ANGLE_STEP)
    return poses, places


def precisions(turn: float, shift: float) -> Array:
    """Return the precisions (69,) of a place and of angles with standard deviations, metres and radians."""
    return np.concatenate([np.full(3, shift**-2.0), np.full(ANGLES, turn**-2.0)])


def contour_fit(
    task: Task, observation: Observation, start: tuple[Array, Array], deviations: tuple[float, float], evaluations: int
) -> tuple[Array, Array, int]:
    """Return a pose (66,) and a place (3,) moved until the body's contours are those of the masks, and what it costs.

    `start` is the pose and the place to begin with, which angles and place are off by about `deviations`, radians and
    metres. Up to twelve steps of Gauss and Newton are made, each of which costs as much as 27 evaluations.
    """
    pose, place = (np.array(part, dtype=np.float64)[None] for part in start)
    scales = ROBUST_SCALES[: max(int(evaluations // STEP_EVALUATIONS), 0)]
    cameras = enumerate(task.cameras)
    views = [MaskContours.of(camera, view, [observation], place, POINT_SPACING) for view, camera in cameras]
    poses, places = fitted(task.body, views, (pose, place), pose, precisions(*deviations), scales)
    return poses[0], places[0], int(len(scales) * STEP_EVALUATIONS)
