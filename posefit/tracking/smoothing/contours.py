"""Poses, path and build whose contours are those of the masks, by least squares over all frames at once.

A tracker's estimate is a pose among those that it knows, and a search of each frame shakes. Here every angle gives way
a little, and smoothly, to where the contours of the masks are, and the build, the same in all frames, with them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.shape import NAMES, REACH, SPREAD, Shape, shaped
from posefit.fitting.tracker import Observation
from posefit.footage.scene import Scene
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import ANGLES, BONES, JOINTS, PARENTS
from posefit.motion.motion import Motion
from posefit.silhouette.cost import BETA, pose_costs
from posefit.silhouette.mask import PIECE, Mask
from posefit.silhouette.pyramid import coarser_camera, coarser_silhouette
from posefit.silhouette.rasteriser import NEAR
from posefit.tracking.smoothing import kernels
from posefit.tracking.smoothing.path import Squares, Visibility, add_root, add_standing, standing_feet, windows_over

FINE = 80.0  # pixels of a metre; of finer masks every second pixel, third, ... is looked at
MARGIN = 48  # pixels around a mask that know how far they are from it
SPAN = 12.0  # millimetres, about, of the border between two points of it

Distances = NDArray[np.float32]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class MaskContours:
    """What one camera knows of the border in T frames; a frame that shows too little has no points."""

    camera: Camera  # whose pixels these are: of fine masks a coarser one than theirs
    metres: Array  # (T,) pixels of a metre where the person is
    step: float  # pixels of the border that a point stands for
    fields: Distances = field(repr=False)  # (T, h, w) pixels outside the mask, below 0 within; 0 where it is unknown
    corners: Integers = field(repr=False)  # (T, 2) column and row of each field's first pixel
    sizes: Integers = field(repr=False)  # (T, 2) rows and columns of each field
    points: Array = field(repr=False)  # (n, 2) pixels: of the borders, frame after frame
    starts: Integers = field(repr=False)  # (T + 1,) where the points of each frame begin

    @classmethod
    def of(cls, camera: Camera, view: int, observations: Sequence[Observation], places: Array) -> Self:
        """Return the borders that a camera, number `view`, saw of a person whose root is about at `places` (T, 3)."""
        far = np.maximum(camera.project(places)[1], 0.1)
        metres = np.sqrt(camera.focal.prod()) / far
        factor = max(int(np.median(metres) / FINE), 1)
        factor = min(factor, camera.width, camera.height)
        camera, metres = coarser_camera(camera, factor), metres / factor
        step = max(int(np.median(metres) * SPAN / 1e3), 1)
        traced = [_border(observation, view, factor, step) for observation in observations]
        sizes = np.array([one.shape for _, _, one in traced])
        fields = np.zeros((len(traced), *sizes.max(axis=0)), dtype=np.float32)
        for whole, (_, _, one) in zip(fields, traced, strict=True):
            whole[: one.shape[0], : one.shape[1]] = one
        points = [points for points, _, _ in traced]
        starts = np.cumsum([0, *(len(one) for one in points)])
        corners = np.array([corner for _, corner, _ in traced])
        return cls(camera, metres, float(step), fields, corners, sizes, np.concatenate(points), starts)


def _border(observation: Observation, view: int, factor: int, step: int) -> tuple[Array, tuple[int, int], Distances]:
    """Return every `step`th point of a mask's border (n, 2), and the corner and the distances about it."""
    nothing = np.empty((0, 2)), (0, 0), np.zeros((1, 1), dtype=np.float32)
    if not observation.usable:
        return nothing
    silhouette = coarser_silhouette(observation.silhouettes[view], factor)
    mask = _large(silhouette.mask)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return nothing
    top, left = max(int(rows[0]) - MARGIN, 0), max(int(columns[0]) - MARGIN, 0)
    part = np.s_[top : rows[-1] + 1 + MARGIN, left : columns[-1] + 1 + MARGIN]
    mask = mask[part]
    around = silhouette.valid[part] & ~mask  # the background there is known
    if not around.any():
        return nothing
    pixels = np.concatenate([_between(mask, around), _between(mask.T, around.T)[:, ::-1]])
    return pixels[::step] + np.array([left, top]), (left, top), distances_outside(mask, around)


def distances_outside(mask: Mask, around: Mask) -> Distances:
    """Return how far pixels (h, w) are outside a mask's border, below 0 within, and 0 where neither is true."""
    out, within = (cv2.distanceTransform((~one).astype(np.uint8), cv2.DIST_L2, 5) - 0.5 for one in (mask, around))
    return np.asarray(np.where(mask, -within, np.where(around, out, 0.0)), dtype=np.float32)


def _between(mask: Mask, around: Mask) -> Array:
    """Return the middles (n, 2) of edges between a pixel of the mask and its neighbour to the side."""
    meet = (mask[:, 1:] & around[:, :-1]) | (mask[:, :-1] & around[:, 1:])
    rows, columns = np.nonzero(meet)
    return np.column_stack([columns + 1.0, rows + 0.5])


def _large(mask: Mask) -> Mask:
    """Return a mask without its small pieces, which are not the person."""
    count, numbers, pieces, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    if count <= 2:
        return mask
    sizes = pieces[1:, cv2.CC_STAT_AREA]
    return np.asarray(np.append(False, sizes >= PIECE * sizes.max())[numbers])


STARTS = np.array(PARENTS[1:])  # the joint that each bone starts from
NUMBERS = 2 * len(JOINTS) + 2 * len(BONES)  # of a drawn body: pixels of joints, then radii of bones
DIFFERENCE = 1e-4  # radians, metres, or of the logarithm of a factor: of a difference quotient


def projected_body(body: Body, camera: Camera, poses: Array, places: Array) -> Array:
    """Return where the joints (T, 106) of poses (T, 66) are in the picture, and how wide the bones' ends, in pixels.

    A joint that is nearer than 5 cm, or behind the camera, counts as that far.
    """
    points = body.skeleton.joints(poses, places) @ camera.rotation.T + camera.translation
    far = np.maximum(points[..., 2:], NEAR)
    pixels = points[..., :2] / far * camera.focal + camera.centre
    metres = np.sqrt(camera.focal.prod()) / far[..., 0]
    radii = np.stack([metres[:, STARTS] * body.radii[:, 0], metres[:, 1:] * body.radii[:, 1]], axis=-1)
    return np.concatenate([pixels.reshape(len(poses), -1), radii.reshape(len(poses), -1)], axis=1)


def pose_jacobian(body: Body, camera: Camera, poses: Array, places: Array, angles: Sequence[int]) -> Array:
    """Return how those numbers change with the root's place and some angles (T, 106, 3 + angles)."""
    count = 3 + len(angles)
    turned, moved = np.repeat(poses[None], count, axis=0), np.repeat(places[None], count, axis=0)
    for k in range(3):
        moved[k, :, k] += DIFFERENCE
    for k, angle in enumerate(angles, 3):
        turned[k, :, angle] += DIFFERENCE
    there = projected_body(body, camera, turned.reshape(-1, ANGLES), moved.reshape(-1, 3))
    changes = there.reshape(count, len(poses), NUMBERS) - projected_body(body, camera, poses, places)
    return np.ascontiguousarray(np.moveaxis(changes, 0, 2)) / DIFFERENCE


def build_jacobian(body: Body, camera: Camera, poses: Array, places: Array, height: float | None) -> Array:
    """Return how those numbers change with the logarithms of the factors of the build (T, 106, 17)."""
    here = projected_body(body, camera, poses, places)
    bodies = [shaped(body, np.exp(DIFFERENCE * row), height) for row in np.eye(len(NAMES))]
    there = [projected_body(other, camera, poses, places) for other in bodies]
    return (np.stack(there, axis=2) - here[:, :, None]) / DIFFERENCE


OFF = 0.01  # metres that a point of the border may be off: standard deviation, as all that follow
ROUGH = 0.5  # pixels, besides
TOGETHER = 0.09  # metres of the border that are off together, so that they are one measurement
SCALES = (0.09, 0.09, 0.065, 0.065, 0.045, 0.045, *[0.033] * 6)  # metres, step by step: what is
LEAST_SCALE = 3.0  # pixels           farther off counts less, and at last is another person's, or a bag's
GIVING = np.radians(8.0)  # that an angle may be off the estimate
SHAKING = np.radians(450.0)  # a second squared, of that difference
AWAY = 0.03  # metres that the root may be off the estimate, across the line of sight
FARTHEST, WIDEST = np.radians(20.0), 0.2  # that a step may turn an angle, and change the logarithm of a factor
BUILD_FRAMES = (
    3.0  # frames for each of which the build is held once more: the errors of contours are correlated, and add up
)
WINDOW, OVERLAP = 300, 30  # frames that are solved for at once, and those that two windows share


@dataclass(frozen=True, eq=False)
class _Part:
    """A window of a track, as far as it is fitted."""

    motion: Motion  # as it was estimated
    body: Body
    factors: Array  # (17,) logarithms of what the body was fitted by before
    height: float | None
    usable: NDArray[np.bool_]
    eyes: Array  # (T, 3): see `Visibility`
    poses: Array
    places: Array

    @property
    def angles(self) -> list[int]:
        return np.flatnonzero(self.motion.skeleton.free).tolist()


@dataclass(frozen=True, eq=False)
class _Pulled:
    """What the masks' borders ask for: of poses and way (T, n), and of the build (17)."""

    poses: tuple[Array, Array]
    mixed: Array  # (T, n, 17)
    build: tuple[Array, Array]


def fit_contours(
    scene: Scene, motion: Motion, visibility: Visibility, shape: Shape | None, beta: float = BETA
) -> tuple[Motion, Shape | None]:
    """Return a steady motion fitted to the borders of a scene's masks, and the build fitted with it.

    The build stays as it is where it was not fitted before (`shape` is None): it is then known. That of a long
    track is fitted in the window with most usable frames. A result that costs more than its start is not kept. A
    motion of fewer than 3 frames is returned as it is.
    """
    if len(motion) < 3 or not visibility.usable.any():
        return motion, shape
    parts = windows_over(len(motion), WINDOW, OVERLAP)
    fitted: dict[int, _Part] = {}
    if shape is not None:
        best = int(np.argmax([visibility.usable[rows].sum() for rows, _ in parts]))
        part = _fitted(scene, motion, visibility, parts[best][0], scene.body, shape, beta)
        if part.body is not scene.body:  # else no build fits better, and only poses are fitted
            shape = replace(shape, body=part.body, factors=np.exp(part.factors))
            fitted[best] = part
    body = scene.body if shape is None else shape.body
    poses, places = motion.poses.copy(), motion.translations.copy()
    for k, (rows, kept) in enumerate(parts):
        part = fitted.get(k) or _fitted(scene, motion, visibility, rows, body, None, beta)
        poses[rows[kept]], places[rows[kept]] = part.poses[kept], part.places[kept]
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
    """Return some frames of a motion as the best step fits them; the build too where there is a shape to begin with."""
    poses, places = motion.poses[rows], motion.translations[rows]
    observations: Sequence[Observation] = [scene.observations[k] for k in rows.tolist()]
    borders = [MaskContours.of(camera, view, observations, places) for view, camera in enumerate(scene.cameras)]
    factors, height = (np.zeros(len(SPREAD)), None) if shape is None else (np.log(shape.factors), shape.height)
    estimate = Motion(motion.name, body.skeleton, poses, places, motion.fps)
    part = _Part(estimate, body, factors, height, visibility.usable[rows], visibility.eyes[rows], poses, places)
    best, least = part, _mean_cost(scene, part, observations, beta)
    for scale in SCALES:
        part = _stepped(part, _pulled(part, borders, scale, build=shape is not None), build=shape is not None)
        if (cost := _mean_cost(scene, part, observations, beta)) < least:
            best, least = part, cost
    return best


def _mean_cost(scene: Scene, part: _Part, observations: Sequence[Observation], beta: float) -> float:
    """Return the mean cost of the frames that show enough of the person; infinite where there is none."""
    costs = []
    for row in np.flatnonzero(part.usable).tolist():
        silhouettes, pose, place = observations[row].silhouettes, part.poses[row : row + 1], part.places[row : row + 1]
        costs.append(float(pose_costs(part.body, scene.cameras, silhouettes, pose, place, beta)[0][0]))
    return float(np.mean(costs)) if costs else np.inf


def _pulled(part: _Part, borders: Sequence[MaskContours], scale: float, *, build: bool) -> _Pulled:
    """Return what the borders of all views ask for."""
    count, angles, factors = len(part.poses), part.angles, len(part.factors) if build else 0
    numbers = 3 + len(angles)
    curves, slopes = np.zeros((count, numbers, numbers)), np.zeros((count, numbers))
    mixed, curve, slope = np.zeros((count, numbers, factors)), np.zeros((factors, factors)), np.zeros(factors)
    joints = len(STARTS) + 1
    for view in borders:
        drawn = projected_body(part.body, view.camera, part.poses, part.places)
        centres, radii = drawn[:, : 2 * joints].reshape(count, -1, 2), drawn[:, 2 * joints :].reshape(count, -1, 2)
        out = np.zeros((count, NUMBERS, NUMBERS)), np.zeros((count, NUMBERS))
        scales = np.maximum(scale * view.metres, LEAST_SCALE)
        shown = view.fields, view.corners, view.sizes, view.points, view.starts, view.step
        kernels.pull_to_borders(STARTS, np.ascontiguousarray(centres), np.ascontiguousarray(radii), *shown, scales, out)
        worth = 1.0 / (view.metres**3 * TOGETHER * (OFF**2 + (ROUGH / view.metres) ** 2))
        curvature, gradient = out[0] * worth[:, None, None], out[1] * worth[:, None]
        ways = pose_jacobian(part.body, view.camera, part.poses, part.places, angles)
        across = ways.transpose(0, 2, 1)
        curves += across @ (curvature @ ways)
        slopes += (across @ gradient[..., None])[..., 0]
        if build:
            grown = build_jacobian(part.body, view.camera, part.poses, part.places, part.height)
            mixed += across @ (curvature @ grown)
            curve += np.einsum("tqi,tqj->ij", grown, curvature @ grown)
            slope += np.einsum("tqi,tq->i", grown, gradient)
    return _Pulled((curves, slopes), mixed, (curve, slope))


def _stepped(part: _Part, pulled: _Pulled, *, build: bool) -> _Part:
    """Return a window one step of Gauss and Newton farther."""
    steps, turns = _squares(part, pulled), np.zeros(len(part.factors))
    if not build:
        way = steps.least()
    else:
        solved = steps.steps_for(np.concatenate([steps.slopes[..., None], pulled.mixed], axis=2))
        way, answers = solved[..., 0], solved[..., 1:]
        known = max(np.count_nonzero(part.usable) / BUILD_FRAMES, 1.0) / SPREAD**2
        curve = pulled.build[0] + np.diag(known) - np.einsum("tni,tnj->ij", pulled.mixed, answers)
        slope = pulled.build[1] + known * part.factors - np.einsum("tni,tn->i", pulled.mixed, way)
        turns = np.clip(np.linalg.solve(curve, slope), -WIDEST, WIDEST)
        turns = part.factors - np.clip(part.factors - turns, -REACH * SPREAD, REACH * SPREAD)
        way = way - answers @ turns
    poses = part.poses.copy()
    poses[:, part.angles] -= np.clip(way[:, 3:], -FARTHEST, FARTHEST)
    body = shaped(part.body, np.exp(-turns), part.height) if build else part.body
    return replace(part, poses=poses, places=part.places - way[:, :3], body=body, factors=part.factors - turns)


def _squares(part: _Part, pulled: _Pulled) -> Squares:
    """Return what borders, smoothness and standing feet ask of poses and way together."""
    fps, angles = part.motion.fps, part.angles
    turned = slice(3, 3 + len(angles))
    squares = Squares.of(len(part.poses), 3 + len(angles))
    squares.add(slice(None), *pulled.poses)
    add_root(squares, part.motion, Visibility(part.usable, part.eyes), AWAY, part.places - part.motion.translations)
    change = wrapped(part.poses - part.motion.poses)[:, angles]
    squares.add(turned, np.eye(len(angles)) / GIVING**2, change / GIVING**2)
    squares.add_bends(turned, change, fps**2 / SHAKING)
    now = Motion(part.motion.name, part.body.skeleton, part.poses, part.places, fps)
    stands = standing_feet(now.joints, fps, part.eyes)
    add_standing(squares, now, stands, angles)
    return squares
