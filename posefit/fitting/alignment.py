"""Where must a posed body stand to fill the silhouette's bounding box? Reading S4, `aligned`."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array, jit, writeable
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.silhouette.mask import Silhouette

ROUNDS = 3  # which joint is outermost depends a little on where the body stands
_DAMPING = 1e-9  # keeps the 3 x 3 system solvable where a silhouette has too few borders
_NEAR = 1e-3  # metres; a joint that is nearer, or behind the camera, counts as that far


def align(
    body: Body, cameras: Sequence[Camera], silhouettes: Sequence[Silhouette], poses: Array, anchors: Array
) -> Array:
    """Return the translations (n, 3) that bring poses (n, 66) to the bounding boxes of the silhouettes.

    Each border of a box says where the outermost disc of the body must touch, and that is linear in the translation:
    `focal (x + t_x) +- focal radius = (border - centre) (z + t_z)`. All borders of all views are solved for together,
    by least squares, starting from anchors (n, 3). A border at the image's edge says nothing and is left out.
    """
    translations = writeable(anchors.copy())
    _align(
        writeable(body.skeleton.joints(poses)),
        body.joint_radii(),
        np.array([camera.rotation for camera in cameras]),
        np.array([camera.translation for camera in cameras]),
        np.array([camera.focal for camera in cameras]),
        np.array([camera.centre for camera in cameras]),
        np.array([silhouette.extent for silhouette in silhouettes]),
        translations,
    )
    return translations


@jit
def _align(joints, radii, rotations, offsets, focals, centres, borders, translations):
    """Move translations (n, 3) to where joints (n, 27, 3) fill the borders (views, 4): left, top, right, bottom."""
    views, count = borders.shape[0], joints.shape[1]
    own = np.empty((views, count, 3))  # in the camera's frame, as if the root were at the world's origin
    reach, outermost = np.empty(4), np.empty(4, np.int64)
    for i in range(joints.shape[0]):
        for v in range(views):
            for j in range(count):
                for a in range(3):
                    own[v, j, a] = (
                        rotations[v, a, 0] * joints[i, j, 0]
                        + rotations[v, a, 1] * joints[i, j, 1]
                        + rotations[v, a, 2] * joints[i, j, 2]
                    )
        t = translations[i]
        for _ in range(ROUNDS):
            xx = yy = zz = _DAMPING
            xy = xz = yz = 0.0
            bx, by, bz = _DAMPING * t[0], _DAMPING * t[1], _DAMPING * t[2]
            for v in range(views):
                R, o = rotations[v], offsets[v]
                scale = np.sqrt(focals[v, 0] * focals[v, 1])
                x = R[0, 0] * t[0] + R[0, 1] * t[1] + R[0, 2] * t[2] + o[0]
                y = R[1, 0] * t[0] + R[1, 1] * t[1] + R[1, 2] * t[2] + o[1]
                z = R[2, 0] * t[0] + R[2, 1] * t[1] + R[2, 2] * t[2] + o[2]
                reach[:] = -np.inf
                outermost[:] = 0
                for j in range(count):
                    depth = 1.0 / max(own[v, j, 2] + z, _NEAR)
                    across = focals[v, 0] * (own[v, j, 0] + x) * depth
                    down = focals[v, 1] * (own[v, j, 1] + y) * depth
                    wide = scale * radii[j] * depth
                    for side, value in enumerate((wide - across, wide - down, wide + across, wide + down)):
                        if value > reach[side]:
                            reach[side], outermost[side] = value, j
                for side in range(4):
                    if np.isnan(borders[v, side]):
                        continue
                    axis, sign = side % 2, -1.0 if side < 2 else 1.0
                    j, f = outermost[side], focals[v, axis]
                    b = borders[v, side] - centres[v, axis]
                    rx = (f * R[axis, 0] - b * R[2, 0]) / scale
                    ry = (f * R[axis, 1] - b * R[2, 1]) / scale
                    rz = (f * R[axis, 2] - b * R[2, 2]) / scale
                    gap = b * (own[v, j, 2] + o[2]) - f * (own[v, j, axis] + o[axis]) - sign * scale * radii[j]
                    gap /= scale
                    xx += rx * rx
                    xy += rx * ry
                    xz += rx * rz
                    yy += ry * ry
                    yz += ry * rz
                    zz += rz * rz
                    bx += gap * rx
                    by += gap * ry
                    bz += gap * rz
            # the inverse of a symmetric 3 x 3 matrix, by cofactors
            cx, cy, cz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
            determinant = xx * cx + xy * cy + xz * cz
            dy, dz, ez = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
            t[0] = (cx * bx + cy * by + cz * bz) / determinant
            t[1] = (cy * bx + dy * by + dz * bz) / determinant
            t[2] = (cz * bx + dz * by + ez * bz) / determinant
