"""Aligning and decoding proposals, compiled by Numba.

The functions take plain arrays and rely on the callers for their shapes.
"""

import numpy as np

from posefit.arrays import inlined, jit

# The outermost joint depends a little on the place of the body, so the system is solved
# several times.
ROUNDS = 3
DAMPING = 1e-9  # keeps the 3 x 3 system solvable if a silhouette has too few borders
# Metres. A joint nearer than this, or behind the camera, counts as this far away.
NEAREST = 1e-3


@inlined
def _write_directions(rotations, focals, centres, borders, directions, inverse):
    """Write r (views, 4, 3) of each known border, and the inverse (3, 3) of A.

    All poses share them, see `move_to_borders`.
    """
    xx = yy = zz = DAMPING
    xy = xz = yz = 0.0
    for v in range(borders.shape[0]):
        R = rotations[v]
        scale = np.sqrt(focals[v, 0] * focals[v, 1])
        for side in range(4):
            if np.isnan(borders[v, side]):
                continue
            axis = side % 2
            f = focals[v, axis]
            b = borders[v, side] - centres[v, axis]
            x = (f * R[axis, 0] - b * R[2, 0]) / scale
            y = (f * R[axis, 1] - b * R[2, 1]) / scale
            z = (f * R[axis, 2] - b * R[2, 2]) / scale
            xx += x * x
            xy += x * y
            xz += x * z
            yy += y * y
            yz += y * z
            zz += z * z
            directions[v, side, 0] = x
            directions[v, side, 1] = y
            directions[v, side, 2] = z
    # by cofactors, of a symmetric matrix
    inverse[0, 0] = yy * zz - yz * yz
    inverse[0, 1] = inverse[1, 0] = xz * yz - xy * zz
    inverse[0, 2] = inverse[2, 0] = xy * yz - xz * yy
    inverse[1, 1] = xx * zz - xz * xz
    inverse[1, 2] = inverse[2, 1] = xy * xz - xx * yz
    inverse[2, 2] = xx * yy - xy * xy
    inverse /= xx * inverse[0, 0] + xy * inverse[0, 1] + xz * inverse[0, 2]


@inlined
def _find_outermost(focal, scale, radii, relative, root, discs, outermost):
    """Write which joints (4,) are outermost in a picture: left, top, right, bottom.

    Args:
        focal: (2,) focal lengths, pixels.
        scale: Their geometric mean.
        radii: (27,) metres.
        relative: (3, 27) metres, the joints from the root, in the camera's axes.
        root: The place of the root, in the camera's axes.
        discs: A buffer (3, 27).
        outermost: The array to write.
    """
    x, y, z = root
    for j in range(radii.size):
        depth = 1.0 / max(relative[2, j] + z, NEAREST)
        discs[0, j] = focal[0] * (relative[0, j] + x) * depth
        discs[1, j] = focal[1] * (relative[1, j] + y) * depth
        discs[2, j] = scale * radii[j] * depth
    left = top = right = bottom = -np.inf
    leftmost = topmost = rightmost = lowest = 0
    # Values are chosen without branches: a processor cannot predict which joint is
    # outermost, and its wrong guesses took longer than the rest of the comparison.
    for j in range(radii.size):
        across = discs[0, j]
        down = discs[1, j]
        wide = discs[2, j]
        leftmost = j if wide - across > left else leftmost
        left = wide - across if wide - across > left else left
        topmost = j if wide - down > top else topmost
        top = wide - down if wide - down > top else top
        rightmost = j if wide + across > right else rightmost
        right = wide + across if wide + across > right else right
        lowest = j if wide + down > bottom else lowest
        bottom = wide + down if wide + down > bottom else bottom
    outermost[0] = leftmost
    outermost[1] = topmost
    outermost[2] = rightmost
    outermost[3] = lowest


@jit
def move_to_borders(
    joints, radii, rotations, offsets, focals, centres, borders, translations
):
    """Move translations (n, 3) to where joints (n, 27, 3) fill the borders (views, 4).

    The borders are left, top, right, bottom. Each known border is one linear equation,
    r . t = gap. The least-squares solution over all of them satisfies A t = b, where A
    is the sum of r r' (xx to zz in the code), and b is the sum of gap r. The damping
    pulls t towards its former value.
    """
    views = borders.shape[0]
    count = joints.shape[1]
    relative = np.empty((views, 3, count))  # joints in the camera's axes, from the root
    discs = np.empty((3, count))
    outermost = np.empty(4, np.int64)
    directions = np.empty((views, 4, 3))
    inverse = np.empty((3, 3))
    _write_directions(rotations, focals, centres, borders, directions, inverse)
    for i in range(joints.shape[0]):
        for v in range(views):
            for j in range(count):
                for a in range(3):
                    relative[v, a, j] = (
                        rotations[v, a, 0] * joints[i, j, 0]
                        + rotations[v, a, 1] * joints[i, j, 1]
                        + rotations[v, a, 2] * joints[i, j, 2]
                    )
        t = translations[i]
        for _ in range(ROUNDS):
            bx = DAMPING * t[0]
            by = DAMPING * t[1]
            bz = DAMPING * t[2]
            for v in range(views):
                R = rotations[v]
                o = offsets[v]
                scale = np.sqrt(focals[v, 0] * focals[v, 1])
                root = (
                    R[0, 0] * t[0] + R[0, 1] * t[1] + R[0, 2] * t[2] + o[0],
                    R[1, 0] * t[0] + R[1, 1] * t[1] + R[1, 2] * t[2] + o[1],
                    R[2, 0] * t[0] + R[2, 1] * t[1] + R[2, 2] * t[2] + o[2],
                )
                _find_outermost(
                    focals[v], scale, radii, relative[v], root, discs, outermost
                )
                for side in range(4):
                    if np.isnan(borders[v, side]):
                        continue
                    axis = side % 2
                    sign = -1.0 if side < 2 else 1.0
                    j = outermost[side]
                    f = focals[v, axis]
                    b = borders[v, side] - centres[v, axis]
                    gap = (
                        b * (relative[v, 2, j] + o[2])
                        - f * (relative[v, axis, j] + o[axis])
                        - sign * scale * radii[j]
                    )
                    gap /= scale
                    bx += gap * directions[v, side, 0]
                    by += gap * directions[v, side, 1]
                    bz += gap * directions[v, side, 2]
            for a in range(3):
                t[a] = inverse[a, 0] * bx + inverse[a, 1] * by + inverse[a, 2] * bz


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
    of a `Tilt`. If proposals have no coordinates for the translation, it is the anchor.

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
