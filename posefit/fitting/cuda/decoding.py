"""Poses of proposals on a device: what `posefit.fitting.kernels` and an affine prior do, a thread an angle."""

from numba import cuda

from posefit.geometry.skeleton import ANGLES

THREADS = 256  # of a block
_ANGLES = ANGLES


@cuda.jit(device=True)
def coordinate(proposals, i, k, centre, half):
    """Return coordinate k of proposal i."""
    return centre[k] + half[k] * proposals[i, k]


@cuda.jit(device=True)
def sum_over_latents(proposals, i, centre, half, first, weights, column, total):
    """Return `total` and the latents of proposal i, each times its weight in a column."""
    for k in range(first, centre.size):
        total += coordinate(proposals, i, k, centre, half) * weights[k - first, column]
    return total


@cuda.jit(device=True)
def tilt_of(proposals, i, centre, half, first, tilt, slopes, side):
    """Return the mean pitch or roll that goes with the latents of proposal i, within what training poses have."""
    mean = sum_over_latents(proposals, i, centre, half, first, slopes, side, tilt[2, side])
    return min(max(mean, tilt[0, side]), tilt[1, side])


@cuda.jit
def decode_on_device(proposals, centre, half, anchor, first, tilt, slopes, weights, offset, poses, translations):
    """Write poses (n, 66) and translations (n, 3) of proposals (n, d), whose latents begin at coordinate `first`.

    Joint angles are `offset` (63,) and the latents by `weights` (m, 63); the mean tilt is the rows least, most and base
    of `tilt` (3, 2) and the latents by `slopes` (m, 2), and all of that is 0 where nothing is known of it.
    """
    at = cuda.grid(1)
    i, j = at // _ANGLES, at % _ANGLES
    if i >= poses.shape[0]:
        return
    if j >= 3:
        poses[i, j] = sum_over_latents(proposals, i, centre, half, first, weights, j - 3, offset[j - 3])
        return
    angle = coordinate(proposals, i, j, centre, half)
    if j > 0:
        angle += tilt_of(proposals, i, centre, half, first, tilt, slopes, j - 1)
    poses[i, j] = angle
    translations[i, j] = coordinate(proposals, i, 3 + j, centre, half) if first > 3 else anchor[j]
