"""A product of matrices in numba: the same bits on every machine."""

from posefit.arrays import jit


@jit
def products(normal, offsets, steps):
    """Write the matrix product (n, d) of draws (n, m) and offsets (m, d)."""
    for k in range(normal.shape[0]):
        for j in range(offsets.shape[1]):
            steps[k, j] = 0.0
        for i in range(offsets.shape[0]):
            for j in range(offsets.shape[1]):
                steps[k, j] += normal[k, i] * offsets[i, j]
