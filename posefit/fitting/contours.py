"""Moves poses until the contours of a body match the contours of masks.

The fit is by least squares. `contour_fit` fits one frame. `contour_squares` returns the
sums for a fit of many frames.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.fitting import contour_kernels as kernels
from posefit.fitting.contour_twists import Growth, Sums
from posefit.fitting.tracker import Observation, Task
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera, stacked
from posefit.geometry.skeleton import ANGLES, BONES, JOINTS, Skeleton
from posefit.silhouette.drawn import count_poses
from posefit.silhouette.mask import (
    Mask,
    coarser_camera,
    padded_box,
    without_small_pieces,
)
from posefit.silhouette.sharing import shares_of, work_through

# pixels per metre; a finer mask is read at every second, third, ... pixel only
FINE_PIXELS = 80.0
FIELD_MARGIN = 48  # pixels: distances are known up to this margin around a mask
# metres, step by step: larger distances count less, because that border may belong to
# another person, or to a bag
ROBUST_SCALES = (0.09, 0.09, 0.065, 0.065, 0.045, 0.045, *[0.033] * 6)
MAX_ANGLE_STEP = np.radians(20.0)  # in one step
# metres between two points of a mask's border, roughly, in the fit of one frame
POINT_SPACING = 0.04
# the evaluations that a step of one frame counts as, measured by docs/studies/follow.py
STEP_EVALUATIONS = 27.0
# for each round of a race, the scales of its steps and the share of the poses that take
# part: the cheapest ones
RACE_ROUNDS: Sequence[tuple[Sequence[float], float]] = (
    ((0.09, 0.065), 1.0),
    ((0.065, 0.045, 0.045), 0.33),
    ((0.033,) * 8, 0.1),
)

Distances = NDArray[np.float32]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class MaskContours:
    """The border of a person in T frames of one camera.

    A frame that shows too little has no points.
    """

    # pixels below are this camera's; it has fewer of them than a fine mask has
    camera: Camera
    spacing: float  # pixels of the border that a point represents
    # (T, h, w) pixels outside the mask, negative within, and 0 if unknown
    fields: Distances = field(repr=False)
    # (T, 2) column and row of each field's first pixel
    corners: Integers = field(repr=False)
    sizes: Integers = field(repr=False)  # (T, 2) rows and columns of each field
    # (n, 2) pixels of the borders, frame after frame
    points: Array = field(repr=False)
    # (T + 1,) where the points of each frame begin
    starts: Integers = field(repr=False)

    @classmethod
    def of(
        cls,
        camera: Camera,
        view: int,
        observations: Sequence[Observation],
        places: Array,
        spacing: float = 0.0,
    ) -> Self:
        """Return the borders of a person from the masks of one camera.

        Args:
            camera: The camera.
            view: Its number.
            observations: The frames.
            places: Places (T, 3) of the person's root, roughly.
            spacing: Metres between two points of a border, roughly. Points are at least
                a pixel apart.
        """
        per_metre, factor = coarseness(camera, places)
        camera = coarser_camera(camera, factor)
        interval = max(round(float(np.median(per_metre / factor)) * spacing), 1)
        traced = [
            _border(observation, view, factor, interval) for observation in observations
        ]
        points = [border for border, _, _ in traced]
        corners = [corner for _, corner, _ in traced]
        sizes = np.array([distances.shape for _, _, distances in traced])
        fields = np.zeros((len(traced), *sizes.max(axis=0)), dtype=np.float32)
        # each frame's distances are freed once copied: together they are as large as
        # `fields`
        while traced:
            _, _, distances = traced.pop()
            rows, columns = distances.shape
            fields[len(traced), :rows, :columns] = distances
        starts = np.cumsum([0, *map(len, points)])
        return cls(
            camera,
            float(interval),
            fields,
            np.array(corners),
            sizes,
            np.concatenate(points),
            starts,
        )

    def __len__(self) -> int:
        return len(self.sizes)

    def part(self, rows: slice) -> Self:
        """Return the borders of successive frames, which share the arrays of all."""
        first = self.starts[rows.start]
        last = self.starts[rows.stop]
        return replace(
            self,
            fields=self.fields[rows],
            corners=self.corners[rows],
            sizes=self.sizes[rows],
            points=self.points[first:last],
            starts=self.starts[rows.start : rows.stop + 1] - first,
        )

    def seen_by(self, camera: Camera) -> Self:
        """Return the same borders, seen with the position and rotation of `camera`."""
        return replace(
            self,
            camera=replace(
                self.camera, rotation=camera.rotation, translation=camera.translation
            ),
        )

    def add(
        self,
        body: Body,
        frames: Array,
        scale: float,
        growth: Growth,
        sums: Sums,
    ) -> None:
        """Add the squared distances between these borders and the borders of bodies.

        See `kernels.add_frames`.
        """
        camera = tuple(
            writeable(getattr(self.camera, name))
            for name in ("rotation", "translation", "focal", "centre")
        )
        contours = kernels.Contours(
            self.fields,
            self.corners,
            self.sizes,
            self.points,
            self.starts,
            self.spacing,
        )
        kernels.add_frames(
            body.skeleton.chain.parents,
            body.radii,
            camera,
            frames,
            contours,
            scale,
            growth,
            sums,
        )


def coarseness(camera: Camera, places: Array) -> tuple[Array, int]:
    """Return pixels per metre (T,) at places (T, 3), and which of the pixels are used.

    A mask that is finer than needed is read at every second, third, ... pixel only.
    """
    far = np.maximum(camera.project(places)[1], 0.1)
    per_metre = np.sqrt(camera.focal.prod()) / far
    factor = max(int(np.median(per_metre) / FINE_PIXELS), 1)
    return per_metre, min(factor, camera.width, camera.height)


def _border(
    observation: Observation, view: int, factor: int, interval: int
) -> tuple[Array, tuple[int, int], Distances]:
    """Return points of a mask's border (n, 2), a corner, and distances.

    Of the mask's pixels every `factor`th is used, and of the points of the border every
    `interval`th. The corner is the column and row of the first pixel of the distances.
    """
    nothing = np.empty((0, 2)), (0, 0), np.zeros((1, 1), dtype=np.float32)
    if not observation.usable:
        return nothing
    silhouette = observation.silhouettes[view]
    # the pixels of `coarser_camera`
    every = slice(factor // 2, None, factor)
    valid = np.ascontiguousarray(silhouette.valid[every, every])
    person = without_small_pieces(np.ascontiguousarray(silhouette.mask[every, every]))
    box = padded_box(person, FIELD_MARGIN)
    mask = person[box]
    around = valid[box] & ~mask  # the known background
    if not mask.any() or not around.any():
        return nothing
    upright = _between(mask, around)
    level = _between(mask.T, around.T)[:, ::-1]
    pixels = np.concatenate([upright, level])
    rows, columns = box
    corner = columns.start, rows.start
    return (
        pixels[::interval] + np.array(corner),
        corner,
        distances_outside(mask, around),
    )


def distances_outside(mask: Mask, around: Mask) -> Distances:
    """Return how far pixels (h, w) are outside a mask's border.

    Distances are negative within the mask, and 0 where neither `mask` nor `around` is
    true.
    """
    # pixels' centres are half a pixel from the border between them
    outside = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5) - 0.5
    within = cv2.distanceTransform((~around).astype(np.uint8), cv2.DIST_L2, 5) - 0.5
    return np.asarray(
        np.where(mask, -within, np.where(around, outside, 0.0)), dtype=np.float32
    )


def _between(mask: Mask, around: Mask) -> Array:
    """Return the middles (n, 2) of the upright edges between the mask and `around`."""
    meet = (mask[:, 1:] & around[:, :-1]) | (mask[:, :-1] & around[:, 1:])
    rows, columns = np.nonzero(meet)
    return np.column_stack([columns + 1.0, rows + 0.5])


def _free_indices(skeleton: Skeleton) -> Integers:
    """Return the indices of the degrees of freedom of a frame that may change."""
    return np.flatnonzero(np.append([True] * 3, skeleton.free))


class ContourSquares(NamedTuple):
    """Half the Hessians and gradients of the squared distances between borders.

    The derivatives are with respect to the n free degrees of freedom of each frame, the
    root's place and angles, and to F factors that all frames share.
    """

    hessians: Array  # (T, n, n)
    gradients: Array  # (T, n)
    mixed: Array  # (T, n, F) second derivatives by both
    factor_hessian: Array  # (F, F) over all frames
    factor_gradient: Array  # (F,)


def contour_squares(
    body: Body,
    views: Sequence[MaskContours],
    poses: Array,
    places: Array,
    scale: float,
    growth: Sequence[Growth] = (),
) -> ContourSquares:
    """Return the squared distances between the borders of masks and of a body.

    Args:
        body: The person's.
        views: The contours that each camera shows, of T frames, or of a single frame
            that all poses share.
        poses: Poses (T, 66).
        places: Places (T, 3).
        scale: metres. Larger distances count less.
        growth: For each view, the derivatives of joints and radii by the factors. If it
            is empty, there are no factors.

    Returns:
        The halved Hessians and gradients of the squares.
    """
    skeleton = body.skeleton
    count = len(poses)
    if not growth:
        no_joints = np.empty((count, 0, len(JOINTS), 3))
        no_radii = np.empty((0, len(BONES), 2))
        growth = [Growth(no_joints, no_radii)] * len(views)
    factors = len(growth[0].radii)
    sums = Sums(
        hessians=np.zeros((count, len(JOINTS), 6, 6)),
        forces=np.zeros((count, len(JOINTS), 6, 1 + factors)),
        factors=np.zeros((1 + factors, 1 + factors)),
    )
    frames, sines, cosines = skeleton.frames(poses, places)
    for view, by_factor in zip(views, growth, strict=True):
        view.add(body, frames, scale, by_factor, sums)
    free = _free_indices(skeleton)
    hessians = np.empty((count, len(free), len(free)))
    gradients = np.empty((count, len(free), 1 + factors))
    kernels.composite_hessians(
        skeleton.chain, frames, sines, cosines, sums, free, hessians, gradients
    )
    return ContourSquares(
        hessians,
        gradients[..., 0],
        gradients[..., 1:],
        sums.factors[1:, 1:],
        sums.factors[1:, 0],
    )


def fitted(
    body: Body,
    views: Sequence[MaskContours],
    start: tuple[Array, Array],
    means: Array,
    precisions: Array,
    scales: Sequence[float],
    threads: int = 1,
) -> tuple[Array, Array]:
    """Return poses (n, 66) and places (n, 3) fitted to the contours of one frame.

    Args:
        body: The person's.
        views: The contours that each camera shows in this frame.
        start: The poses and the places to begin with. The prior pulls the places to
            these.
        means: The poses (n, 66) to which the prior pulls the angles.
        precisions: The prior's precisions (69,) of places and angles.
        scales: Metres, one for each step. Larger distances count less.
        threads: Number of threads. Does not change the result.
    """
    free = _free_indices(body.skeleton)
    poses = writeable(start[0].copy())
    places = writeable(start[1].copy())
    count_poses(STEP_EVALUATIONS * len(views) * len(poses) * len(scales))
    # in C order for any number of poses: others would be compiled separately
    targets = np.take(np.concatenate([start[1], means], axis=1), free, axis=1)
    borders = _of_one_frame(views)
    scale_array = np.array(scales, dtype=np.float64)

    def fit(part: slice) -> None:
        kernels.fit_poses(
            body.skeleton.chain,
            body.radii,
            borders,
            kernels.PosePrior(free, targets[part], precisions[free]),
            scale_array,
            MAX_ANGLE_STEP,
            poses[part],
            places[part],
        )

    work_through(shares_of(len(poses), threads), threads, lambda _: (), fit)
    return poses, places


def _of_one_frame(views: Sequence[MaskContours]) -> kernels.Views:
    """Return the borders of one frame's masks in the form that `fit_poses` takes."""
    size = np.max([view.fields.shape[1:] for view in views], axis=0)
    fields = np.zeros((len(views), *size), dtype=np.float32)
    for whole, view in zip(fields, views, strict=True):
        part = view.fields[0]
        whole[: part.shape[0], : part.shape[1]] = part
    return kernels.Views(
        *stacked([view.camera for view in views]),
        fields,
        np.concatenate([view.corners for view in views]),
        np.concatenate([view.sizes for view in views]),
        np.concatenate([view.points for view in views]),
        np.cumsum([0, *(len(view.points) for view in views)]),
        np.array([view.spacing for view in views]),
    )


def race_count(evaluations: float) -> int:
    """Return how many poses can race within a number of evaluations.

    The evaluations include the poses' costs at the end. The count is 0 if they do not
    suffice for one pose.
    """
    count = 0
    while _race_evaluations(count + 1) <= evaluations:
        count += 1
    return count


def _race_evaluations(count: int) -> float:
    """Return the evaluations of a race, with the costs of its `count` poses."""
    total = float(count)
    for scales, share in RACE_ROUNDS:
        remaining = max(int(share * count), 1)
        total += remaining * len(scales) * STEP_EVALUATIONS
        # the costs that choose the cheapest poses
        if remaining < count:
            total += count
    return total


def contour_race(
    body: Body,
    views: Sequence[MaskContours],
    start: tuple[Array, Array],
    weights: Array,
    cost: Callable[[Array, Array], Array],
    threads: int = 1,
) -> tuple[Array, Array, int]:
    """Return poses (n, 66) and places (n, 3) fitted to a frame's contours in rounds.

    The cheapest poses are fitted longest. The right pose is seldom the cheapest before
    it is fitted, and a wrong one seldom becomes as cheap as the right one.

    Args:
        body: The person's.
        views: The contours that each camera shows.
        start: The poses and the places to begin with.
        weights: The precisions (69,) of places and angles, see `precisions`.
        cost: Returns the costs (n,) of poses at places. Each counts as an evaluation.
        threads: Number of threads. Does not change the result.

    Returns:
        All poses and places, and the number of evaluations. A step counts as 27.
    """
    poses = start[0].copy()
    places = start[1].copy()
    evaluations = 0
    for scales, share in RACE_ROUNDS:
        rows = np.arange(len(poses))
        remaining = max(int(share * len(poses)), 1)
        if remaining < len(poses):
            costs = cost(poses, places)
            evaluations += len(poses)
            rows = np.argsort(costs, kind="stable")[:remaining]
        here = poses[rows], places[rows]
        poses[rows], places[rows] = fitted(
            body, views, here, here[0], weights, scales, threads
        )
        evaluations += int(remaining * len(scales) * STEP_EVALUATIONS)
    return poses, places, evaluations


def precisions(turn: float, shift: float) -> Array:
    """Return the precisions (69,) of a place and of angles.

    The standard deviations are `shift`, in metres, and `turn`, in radians.
    """
    return np.concatenate([np.full(3, shift**-2.0), np.full(ANGLES, turn**-2.0)])


def contour_fit(
    task: Task,
    observation: Observation,
    start: tuple[Array, Array],
    deviations: tuple[float, float],
    evaluations: int,
) -> tuple[Array, Array, int]:
    """Return a pose and a place fitted to a frame's contours, and the evaluations.

    Up to twelve Gauss-Newton steps are made. Each takes as long as 27 evaluations, and
    counts as that many.

    Args:
        task: The body and the cameras.
        observation: The frame.
        start: The pose (66,) and the place (3,) to begin with.
        deviations: The expected errors of the start's angles, in radians, and of its
            place, in metres.
        evaluations: The most that the fit may take.

    Returns:
        The pose (66,), the place (3,), and the number of evaluations that the steps
        count as.

    Example:
        >>> from posefit.plugin import contour_fit
        >>> from posefit.testing.tracker_rules import scene
        >>> task, walk, observations = scene()
        >>> start = (walk.poses[0] + 0.05, walk.translations[0])
        >>> fit = contour_fit(task, observations[0], start, (0.2, 0.1), evaluations=270)
        >>> pose, place, evaluations = fit
        >>> pose.shape, place.shape, evaluations
        ((66,), (3,), 270)
    """
    pose = np.array(start[0], dtype=np.float64)[None]
    place = np.array(start[1], dtype=np.float64)[None]
    scales = ROBUST_SCALES[: max(int(evaluations // STEP_EVALUATIONS), 0)]
    views = [
        MaskContours.of(camera, view, [observation], place, POINT_SPACING)
        for view, camera in enumerate(task.cameras)
    ]
    poses, places = fitted(
        task.body, views, (pose, place), pose, precisions(*deviations), scales
    )
    return poses[0], places[0], int(len(scales) * STEP_EVALUATIONS)
