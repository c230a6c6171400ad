"""A slow, obvious twin of the kernel: exact distances of pixel centres from hulls of two discs, in float64."""

import numpy as np

from posefit import Body, Camera
from posefit.arrays import Array
from posefit.geometry.skeleton import ANGLES, PARENTS
from posefit.silhouette.outlines import FAR, NEAR

TIE = 1e-3  # pixels, within which rounding may decide: the kernel's rows are float32


def random_poses(rng: np.random.Generator, count: int) -> Array:
    """Return poses (n, 66) that face every way."""
    poses = rng.normal(0.0, 0.4, (count, ANGLES))
    poses[:, 0] = rng.uniform(-np.pi, np.pi, count)
    return poses


def hull_distance(
    x: Array, y: Array, first: Array, second: Array, r0: float, r1: float
) -> Array:
    """Return the signed distance of points from the hull of two discs, negative inside.

    It is the least distance from any disc between the two, centres and radii taken linearly: sqrt(a^2 + b^2) - r at
    the foot that lies back along the axis by the cone's slope, and at either end where that foot is beyond it.
    """
    axis = second - first
    length = np.hypot(*axis)
    ends = np.minimum(
        np.hypot(x - first[0], y - first[1]) - r0,
        np.hypot(x - second[0], y - second[1]) - r1,
    )
    if length <= abs(r0 - r1):
        return ends
    e = axis / length
    along = (x - first[0]) * e[0] + (y - first[1]) * e[1]
    across = np.abs((x - first[0]) * e[1] - (y - first[1]) * e[0])
    sine = (r0 - r1) / length
    cosine = np.sqrt(1.0 - sine * sine)
    t = (along - across * sine / cosine) / length
    side = along * sine + across * cosine - r0
    return np.where((t > 0.0) & (t < 1.0), np.minimum(side, ends), ends)


def body_distance(body: Body, camera: Camera, pose: Array, translation: Array) -> Array:
    """Return the signed distance (height, width) of every pixel centre from the projected body."""
    joints = body.skeleton.joints(pose, translation)
    seen = joints @ camera.rotation.T + camera.translation
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    distance = np.full(x.shape, np.inf)
    scale = np.sqrt(camera.focal[0] * camera.focal[1])
    for bone, parent in enumerate(PARENTS[1:]):
        start = seen[parent]
        end = seen[bone + 1]
        if not (NEAR <= start[2] <= FAR and NEAR <= end[2] <= FAR):
            continue
        (u0, u1) = (p[:2] / p[2] * camera.focal + camera.centre for p in (start, end))
        (r0, r1) = (
            scale * r / p[2]
            for r, p in zip(body.radii[bone], (start, end), strict=True)
        )
        distance = np.minimum(distance, hull_distance(x, y, u0, u1, r0, r1))
    return distance
