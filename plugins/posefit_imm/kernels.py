"""States of a place and unit quaternions in numba: plain functions over arrays, shapes checked by the callers.

A state is (3 + 4 n,): a place, then w, x, y, z of n unit quaternions. Its error is (3 + 3 n,): a step, then a rotation
vector a quaternion, applied on its right.
"""

import numpy as np

from posefit.arrays import jit


@jit
def plus(state, error):
    """Return the state (3 + 4 n,) moved by an error (3 + 3 n,)."""
    moved = np.empty(state.size)
    for k in range(3):
        moved[k] = state[k] + error[k]
    for j in range((state.size - 3) // 4):
        x, y, z = error[3 + 3 * j], error[4 + 3 * j], error[5 + 3 * j]
        angle = np.sqrt(x * x + y * y + z * z)
        share = 0.5 - angle * angle / 48.0 if angle < 1e-4 else np.sin(0.5 * angle) / angle
        b0, b1, b2, b3 = np.cos(0.5 * angle), share * x, share * y, share * z
        at = 3 + 4 * j
        a0, a1, a2, a3 = state[at], state[at + 1], state[at + 2], state[at + 3]
        c0 = a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3
        c1 = a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2
        c2 = a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1
        c3 = a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0
        size = np.sqrt(c0 * c0 + c1 * c1 + c2 * c2 + c3 * c3)
        moved[at], moved[at + 1], moved[at + 2], moved[at + 3] = c0 / size, c1 / size, c2 / size, c3 / size
    return moved


@jit
def minus(first, second):
    """Return the error (3 + 3 n,) that leads from `second` to `first`, both (3 + 4 n,), the shorter way round."""
    error = np.empty(3 + 3 * ((first.size - 3) // 4))
    for k in range(3):
        error[k] = first[k] - second[k]
    for j in range((first.size - 3) // 4):
        at = 3 + 4 * j
        a0, a1, a2, a3 = second[at], -second[at + 1], -second[at + 2], -second[at + 3]
        b0, b1, b2, b3 = first[at], first[at + 1], first[at + 2], first[at + 3]
        c0 = a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3
        c1 = a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2
        c2 = a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1
        c3 = a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0
        if c0 < 0.0:
            c0, c1, c2, c3 = -c0, -c1, -c2, -c3
        size = np.sqrt(c1 * c1 + c2 * c2 + c3 * c3)
        share = 2.0 if size < 1e-8 else 2.0 * np.arctan2(size, c0) / size
        error[3 + 3 * j], error[4 + 3 * j], error[5 + 3 * j] = share * c1, share * c2, share * c3
    return error
