"""Aligning and decoding proposals, compiled by Numba.

The functions take plain arrays and rely on the callers for their shapes.
"""

import numpy as np

from posefit.arrays import jit

# The outermost joint depends a little on the place of the body, so the system is solved
# several times.
ROUNDS = 3
DAMPING = 1e-9  # keeps the 3 x 3 system solvable if a silhouette has too few borders
# Metres. A joint nearer than this, or behind the camera, counts as this far away.
NEAREST = 1e-3


@jit
def move_to_borders(
    joints, radii, rotations, offsets, focals, centres, borders, translations
):
    """Move translations (n, 3) to where joints (n, 27, 3) fill the borders (views, 4).

    The borders are left, top, right, bottom. Each known border is one linear equation,
    r . t = gap. The least squares over all of them solve A t = b, where A, here xx to
    zz, is the sum of r r', and b is the sum of gap r. The damping pulls t towards its
    former value.
    """
    views = borders.shape[0]
    count = joints.shape[1]
    relative = np.empty((views, count, 3))  # joints in the camera's axes, from the root
    reach = np.empty(4)
    outermost = np.empty(4, np.int64)
    for i in range(joints.shape[0]):
        for v in range(views):
            for j in range(count):
                for a in range(3):
                    relative[v, j, a] = (
                        rotations[v, a, 0] * joints[i, j, 0]
                        + rotations[v, a, 1] * joints[i, j, 1]
                        + rotations[v, a, 2] * joints[i, j, 2]
                    )
        t = translations[i]
        for _ in range(ROUNDS):
            xx = yy = zz = DAMPING
            xy = xz = yz = 0.0
            bx = DAMPING * t[0]
            by = DAMPING * t[1]
            bz = DAMPING * t[2]
            for v in range(views):
                R = rotations[v]
                o = offsets[v]
                scale = np.sqrt(focals[v, 0] * focals[v, 1])
                x = R[0, 0] * t[0] + R[0, 1] * t[1] + R[0, 2] * t[2] + o[0]
                y = R[1, 0] * t[0] + R[1, 1] * t[1] + R[1, 2] * t[2] + o[1]
                z = R[2, 0] * t[0] + R[2, 1] * t[1] + R[2, 2] * t[2] + o[2]
                reach[:] = -np.inf
                outermost[:] = 0
                for j in range(count):
                    depth = 1.0 / max(relative[v, j, 2] + z, NEAREST)
                    across = focals[v, 0] * (relative[v, j, 0] + x) * depth
                    down = focals[v, 1] * (relative[v, j, 1] + y) * depth
                    wide = scale * radii[j] * depth
                    for side, value in enumerate(
                        (wide - across, wide - down, wide + across, wide + down)
                    ):
                        if value > reach[side]:
                            reach[side], outermost[side] = value, j
                for side in range(4):
                    if np.isnan(borders[v, side]):
                        continue
                    axis = side % 2
                    sign = -1.0 if side < 2 else 1.0
                    j = outermost[side]
                    f = focals[v, axis]
                    b = borders[v, side] - centres[v, axis]
                    rx = (f * R[axis, 0] - b * R[2, 0]) / scale
                    ry = (f * R[axis, 1] - b * R[2, 1]) / scale
                    rz = (f * R[axis, 2] - b * R[2, 2]) / scale
                    gap = (
                        b * (relative[v, j, 2] + o[2])
                        - f * (relative[v, j, axis] + o[axis])
                        - sign * scale * radii[j]
                    )
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
            cx = yy * zz - yz * yz
            cy = xz * yz - xy * zz
            cz = xy * yz - xz * yy
            determinant = xx * cx + xy * cy + xz * cz
            dy = xx * zz - xz * xz
            dz = xy * xz - xx * yz
            ez = xx * yy - xy * xy
            t[0] = (cx * bx + cy * by + cz * bz) / determinant
            t[1] = (cy * bx + dy * by + dz * bz) / determinant
            t[2] = (cz * bx + dz * by + ez * bz) / determinant


@jit
def add_components(latents, components, angles):
    """Add components (m, k) times latents (n, m) to angles (n, k).

    The order of the sums is fixed, so that a row always has the same bits.
    """
    for i in range(latents.shape[0]):
        for m in range(latents.shape[1]):
            latent = latents[i, m]
            for k in range(angles.shape[1]):
                angles[i, k] += latent * components[m, k]


@jit
def unpack_proposals(
    proposals, centre, half, anchor, mean, poses, translations, latents
):
    """Write root angles, translations and latents of proposals (n, d).

    Pitch and roll are added to the tilt expected for the latents, by `mean` (3 + m, 2)
    of a `Tilt`. Without coordinates for it, the translation is the anchor.

    Returns:
        Whether all values are finite.

    """
    first = proposals.shape[1] - latents.shape[1]
    total = 0.0
    for i in range(proposals.shape[0]):
        for j in range(3):
            poses[i, j] = centre[j] + half[j] * proposals[i, j]
            translations[i, j] = (
                centre[3 + j] + half[3 + j] * proposals[i, 3 + j]
                if first > 3
                else anchor[j]
            )
            total += poses[i, j] + translations[i, j]
        pitch = mean[2, 0]
        roll = mean[2, 1]
        for j in range(latents.shape[1]):
            latents[i, j] = (
                centre[first + j] + half[first + j] * proposals[i, first + j]
            )
            total += latents[i, j]
            pitch += mean[3 + j, 0] * latents[i, j]
            roll += mean[3 + j, 1] * latents[i, j]
        poses[i, 1] += min(max(pitch, mean[0, 0]), mean[1, 0])
        poses[i, 2] += min(max(roll, mean[0, 1]), mean[1, 1])
    return np.isfinite(total)
