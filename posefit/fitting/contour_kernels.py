"""Gauss-Newton steps of bodies to the contours of masks, compiled by numba.

A step moves a body so that the distances between its border and a mask's shrink.
docs/background/contour-fit.md derives the method. Its equations are numbered, and
comments such as `# contour (3)` refer to them:

- `contour_residuals`: the distances of one bone's border in a picture (1) to (6).
- `contour_twists`: their derivatives by the place and the pose of a body, and by its
  build (7) to (14).
- This module: steps of one frame with a prior (15), (16), and the sums of many frames
  for a solver elsewhere.

The callers check shapes.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, inlined, jit
from posefit.fitting.contour_residuals import Contour
from posefit.fitting.contour_twists import (
    FREEDOMS,
    Growth,
    Sums,
    add_view,
    composite_hessian,
    write_twists,
)
from posefit.geometry.kernels import place_frames
from posefit.geometry.skeleton import ANGLES


class Contours(NamedTuple):
    """The borders of the masks of T frames, or a single border that all frames share.

    The fields are the same as in `MaskContours`.
    """

    fields: NDArray[np.float32]  # (T, h, w)
    corners: NDArray[np.int64]  # (T, 2)
    sizes: NDArray[np.int64]  # (T, 2)
    points: Array  # (n, 2) frame after frame
    starts: NDArray[np.int64]  # (T + 1,)
    spacing: float


class Views(NamedTuple):
    """The borders of one frame's masks in V views, and the cameras."""

    rotations: Array  # (V, 3, 3) camera_from_world
    translations: Array  # (V, 3)
    focals: Array  # (V, 2) pixels
    centres: Array  # (V, 2) pixels
    fields: NDArray[np.float32]  # (V, h, w)
    corners: NDArray[np.int64]  # (V, 2)
    sizes: NDArray[np.int64]  # (V, 2)
    points: Array  # (n, 2) view after view
    starts: NDArray[np.int64]  # (V + 1,)
    spacings: Array  # (V,) pixels of the border that a point represents


class PosePrior(NamedTuple):
    """A Gaussian prior of n places and poses, by degree of freedom.

    A frame has 69 degrees of freedom, of which m may change.
    """

    free: NDArray[np.int64]  # (m,) indices of those that may change
    means: Array  # (n, m)
    precisions: Array  # (m,)


@jit
def fit_poses(chain, radii, views, prior, scales, max_turn, poses, places):
    """Move poses (n, 66) and places (n, 3) to the contours of one frame.

    One Gauss-Newton step with a `prior` is made for each of `scales`, in metres. In a
    step no angle turns by more than `max_turn`, in radians.
    """
    free = prior.free
    count = poses.shape[0]
    joints = chain.parents.size + 1
    frames = np.empty((count, joints, 4, 3))
    sines = np.empty((count, ANGLES))
    cosines = np.empty((count, ANGLES))
    owners = np.full((count, len(views.points)), -1)
    sums = Sums(np.empty((joints, 6, 6)), np.empty((joints, 6, 1)), np.zeros((1, 1)))
    all_twists = np.empty((FREEDOMS, 6))
    twists = np.zeros((FREEDOMS, 6))
    hessian = np.empty((FREEDOMS, FREEDOMS))
    gradient = np.empty((FREEDOMS, 1))
    matrix = np.empty((free.size, free.size))
    step = np.empty(free.size)
    for scale in scales:
        place_frames(chain, poses, places, sines, cosines, frames)
        for i in range(count):
            _write_view_sums(
                chain.parents, radii, views, frames[i], owners[i], scale, sums
            )
            write_twists(chain, frames[i], sines[i], cosines[i], all_twists)
            # the twists of those that are held remain 0, so that they add nothing
            for a in free:
                twists[a] = all_twists[a]
            composite_hessian(
                chain, twists, sums.hessians, sums.forces, hessian, gradient
            )
            # the elimination turns the right side into the step
            _write_equations(
                places[i], poses[i], prior, i, hessian, gradient, matrix, step
            )
            solve_symmetric(matrix, step)
            _subtract(places[i], poses[i], free, step, max_turn)


@inlined
def _write_view_sums(parents, radii, views, frames, owners, scale, sums):
    """Overwrite the `sums` of the bones with those over one frame's views.

    `owners` (n,) has the nearest bone of each point, view after view. See `add_view`.
    """
    sums.hessians[:] = 0.0
    sums.forces[:] = 0.0
    # no factors: the build is held
    growth = Growth(np.empty((0, parents.size + 1, 3)), np.empty((0, parents.size, 2)))
    for v in range(len(views.spacings)):
        first = views.starts[v]
        stop = views.starts[v + 1]
        if first < stop:
            camera = (
                views.rotations[v],
                views.translations[v],
                views.focals[v],
                views.centres[v],
            )
            contour = Contour(
                views.fields[v],
                views.corners[v],
                views.sizes[v],
                views.points[first:stop],
                views.spacings[v],
                owners[first:stop],
            )
            add_view(parents, radii, camera, frames, contour, scale, growth, sums)


@inlined
def _write_equations(place, pose, prior, i, hessian, gradient, matrix, right):
    """Write the normal equations of a step of the i-th pose. contour (15).

    Of the matrix (m, m) only the lower half is written. The right side is (m,).
    """
    free = prior.free
    for a in range(free.size):
        freedom = free[a]
        value = place[freedom] if freedom < 3 else pose[freedom - 3]
        precision = prior.precisions[a]
        right[a] = gradient[freedom, 0] + precision * (value - prior.means[i, a])
        for b in range(a + 1):
            matrix[a, b] = hessian[freedom, free[b]]
        matrix[a, a] += precision


@inlined
def _subtract(place, pose, free, step, max_turn):
    """Subtract a step (m,) from the free coordinates of a place and angles of a pose.

    No angle changes by more than `max_turn`.
    """
    for a in range(free.size):
        freedom = free[a]
        if freedom < 3:
            place[freedom] -= step[a]
        else:
            pose[freedom - 3] -= min(max(step[a], -max_turn), max_turn)


@jit
def solve_symmetric(matrix, right):
    """Solve a positive definite system by elimination, in place. contour (16).

    Only the lower half of the matrix (m, m) is read. The matrix is overwritten, and the
    right side (m,) becomes the solution.

    Unknowns are eliminated from the last to the first, that is from the ends of the
    limbs inwards. An angle shares second derivatives only with the angles between it
    and the root, and in this order all other zeros remain zero (Featherstone, Rigid
    body dynamics algorithms, 2008, section 6.5).
    """
    m = right.size
    for k in range(m - 1, -1, -1):
        for i in range(k):
            if matrix[k, i] == 0.0:
                continue
            factor = matrix[k, i] / matrix[k, k]
            for j in range(i + 1):
                matrix[i, j] -= factor * matrix[k, j]
            right[i] -= factor * right[k]
    for k in range(m):
        total = right[k]
        for j in range(k):
            total -= matrix[k, j] * right[j]
        right[k] = total / matrix[k, k]


@jit
def add_frames(parents, radii, camera, frames, contours, scale, growth, sums):
    """Add the squared distances in one view of T frames to the `sums` of the bones.

    `frames` (T, 27, 4, 3) are the joints' coordinate frames. See `add_view`.
    """
    starts = contours.starts
    for i in range(len(frames)):
        k = min(i, len(starts) - 2)  # 0 for all frames if they share a border
        if starts[k] < starts[k + 1]:
            points = contours.points[starts[k] : starts[k + 1]]
            contour = Contour(
                contours.fields[k],
                contours.corners[k],
                contours.sizes[k],
                points,
                contours.spacing,
                np.full(len(points), -1),
            )
            grows = Growth(growth.joints[i], growth.radii)
            bones = Sums(sums.hessians[i], sums.forces[i], sums.factors)
            add_view(parents, radii, camera, frames[i], contour, scale, grows, bones)


@jit
def composite_hessians(chain, frames, sines, cosines, sums, free, matrices, gradients):
    """Write the results of `composite_hessian` for T frames.

    Args:
        chain: The skeleton's.
        frames: The joints' coordinate frames (T, 27, 4, 3), from `place_frames`.
        sines: The sines (T, 66) of the angles, from the same.
        cosines: Their cosines.
        sums: The spatial Hessians and forces of the bones, which are overwritten.
        free: Indices (m,) of the degrees of freedom that may change.
        matrices: Second derivatives (T, m, m), written.
        gradients: Gradients and their derivatives by factors (T, m, 1 + F), written.
    """
    all_twists = np.empty((FREEDOMS, 6))
    twists = np.zeros((FREEDOMS, 6))
    matrix = np.empty((FREEDOMS, FREEDOMS))
    gradient = np.empty((FREEDOMS, gradients.shape[2]))
    for k in range(len(frames)):
        write_twists(chain, frames[k], sines[k], cosines[k], all_twists)
        for a in free:
            twists[a] = all_twists[a]
        composite_hessian(
            chain, twists, sums.hessians[k], sums.forces[k], matrix, gradient
        )
        for i in range(len(free)):
            gradients[k, i] = gradient[free[i]]
            for j in range(i + 1):
                matrices[k, i, j] = matrix[free[i], free[j]]
                matrices[k, j, i] = matrix[free[i], free[j]]
