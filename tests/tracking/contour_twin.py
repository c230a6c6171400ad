"""What borders pull a body to, by difference quotients of all numbers of a drawn body: a slow twin of the kernels."""

import numpy as np

from posefit.arrays import Array
from posefit.fitting import contour_kernels as kernels
from posefit.fitting.contours import MaskContours
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import BONES, JOINTS, PARENTS

STEP = 1e-5
BONE_STARTS = np.array(PARENTS[1:])
COUNT = 2 * len(JOINTS) + 2 * len(BONES)  # of a drawn body: pixels of joints, then radii of bones


def cone_distance(x: float, y: float, points: Array, radii: Array) -> tuple[float, float, float, float]:
    """Return how far a point is outside the cone of two discs, at which share of it, and its normal."""
    cones, discs = np.empty((1, 8)), np.empty((1, 3))
    kernels.write_cones(np.zeros(1, int), np.asarray(points), np.asarray(radii)[None], cones, discs)
    distance, *others = kernels.cone_distance(x, y, cones[0])
    return distance, *others


def drawn_body(body: Body, camera: Camera, joints: Array) -> Array:
    """Return where joints (27, 3) are in the picture, and how wide the bones' ends (106,), in pixels."""
    pixels, far = camera.project(joints)
    metres = np.sqrt(camera.focal.prod()) / far
    radii = np.column_stack([metres[BONE_STARTS] * body.radii[:, 0], metres[1:] * body.radii[:, 1]])
    return np.concatenate([pixels.ravel(), radii.ravel()])


def pulled(numbers: Array, mask: kernels.Contour, scale: float) -> tuple[Array, Array]:
    """Return half the second derivatives (106, 106) and half the gradient (106,) by the numbers of a drawn body."""
    centres, radii = numbers[: 2 * len(JOINTS)].reshape(-1, 2), numbers[2 * len(JOINTS) :].reshape(-1, 2)
    blocks, forces = np.zeros((len(BONES), 6, 6)), np.zeros((len(BONES), 6))
    kernels.add_pulls(
        BONE_STARTS, np.ascontiguousarray(centres), np.ascontiguousarray(radii), mask, scale, blocks, forces
    )
    curves, slopes = np.zeros((COUNT, COUNT)), np.zeros(COUNT)
    for b, parent in enumerate(BONE_STARTS):
        rows = [2 * parent, 2 * parent + 1, 2 * b + 2, 2 * b + 3, *(2 * (len(JOINTS) + b) + np.arange(2))]
        curves[np.ix_(rows, rows)] += blocks[b]
        slopes[rows] += forces[b]
    return curves, slopes


def pull_of_view(view: MaskContours, k: int, here: Array, there: Array, reach: float) -> tuple[Array, Array]:
    """Return half the second derivatives (n, n) and half the gradient (n,) by n parameters, in frame k.

    The drawn body's numbers are `here` (106,), and `there` (n, 106) where each parameter is off by `STEP`.
    """
    root = view.metres[k]
    points = view.points[view.starts[k] : view.starts[k + 1]]
    points = np.ascontiguousarray(points)
    mask = kernels.Contour(view.fields[k], view.corners[k], view.sizes[k], points, view.step)
    curves, slopes = pulled(here, mask, max(reach * root, kernels.MIN_ROBUST_SCALE))
    deviation = kernels.BORDER_DEVIATION**2 + (kernels.PIXEL_DEVIATION / root) ** 2
    worth = 1.0 / (root**3 * kernels.CORRELATION_LENGTH * deviation)
    ways = (there - here).T / STEP
    return worth * ways.T @ curves @ ways, worth * ways.T @ slopes


def moved_bodies(body: Body, camera: Camera, pose: Array, place: Array) -> tuple[Array, Array]:
    """Return a drawn body's numbers (106,), and those (69, 106) of bodies whose place or an angle is off by `STEP`."""
    steps = STEP * np.eye(3 + len(pose))
    numbers = [
        drawn_body(body, camera, body.skeleton.joints((pose + step[3:])[None], (place + step[:3])[None])[0])
        for step in (np.zeros(3 + len(pose)), *steps)
    ]
    return numbers[0], np.array(numbers[1:])
