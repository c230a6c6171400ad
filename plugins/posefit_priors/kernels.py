"""From latents to joint angles, and how far latents are from clusters, in numba: plain functions over arrays.

One row is computed after the other, so that a row has the same bits whatever stands beside it.
"""

import numpy as np

from posefit.arrays import inlined, jit

ROUNDING = 1e-9  # radians by which a joint may pass its limit


@jit
def recover(latents, components, mean, angles):
    """Write the joint angles (n, 63) of latents (n, m or more), from components (m, 63) and a mean (63,).

    A pass over the angles adds three components: it is loads and stores that cost, and not sums.
    """
    m = components.shape[0]
    for i in range(latents.shape[0]):
        for j in range(mean.size):
            angles[i, j] = mean[j]
        for k in range(0, m - 2, 3):
            a, b, c = latents[i, k], latents[i, k + 1], latents[i, k + 2]
            for j in range(mean.size):
                # SAPSO 2.1.3 recovery
                angles[i, j] = angles[i, j] + a * components[k, j] + b * components[k + 1, j] + c * components[k + 2, j]
        for k in range(m - m % 3, m):
            for j in range(mean.size):
                angles[i, j] += latents[i, k] * components[k, j]


@inlined
def close(centres, latents, i, reach):
    """Return whether the row i of latents (n, m or more) is nearer to a centre (K, m) than `reach`.

    By distance D: the mean absolute difference, the L1 distance over m.
    """
    for c in range(centres.shape[0]):
        total = 0.0
        for j in range(centres.shape[1]):
            total += abs(centres[c, j] - latents[i, j])
        if total / centres.shape[1] < reach:  # SAPSO 2.2 constraint 2
            return True
    return False


@jit
def near(latents, centres, reach, allowed):
    """Write which latents (n, m) are nearer to a centre (K, m) than `reach` ()."""
    for i in range(latents.shape[0]):
        allowed[i] = close(centres, latents, i, reach[()])


@jit
def recover_loose(latents, components, mean, loose, angles):
    """Write the joint angles (n, 63) of latents (n, m + k): m components, k loose angles."""
    recover(latents, components, mean, angles)
    for i in range(latents.shape[0]):
        for k in range(loose.size):
            angles[i, loose[k]] += latents[i, components.shape[0] + k]


@jit
def near_within_limits(latents, components, mean, loose, low, high, centres, reach):
    """Return which latents (n, m + k) are near a cluster with loose joints within low and high, but for rounding."""
    m, allowed = components.shape[0], np.empty(latents.shape[0], dtype=np.bool_)
    bends = np.empty((loose.size, m))
    for k in range(loose.size):
        for c in range(m):
            bends[k, c] = components[c, loose[k]]
    for i in range(latents.shape[0]):
        allowed[i] = close(centres, latents, i, reach[()])
        k = 0
        while allowed[i] and k < loose.size:
            angle = mean[loose[k]] + latents[i, m + k]
            for c in range(m):
                angle += latents[i, c] * bends[k, c]
            allowed[i] = low[k] - ROUNDING <= angle <= high[k] + ROUNDING
            k += 1
    return allowed
