"""The manifold of a place and any number of unit quaternions, such as a body's and its limbs'."""

import numpy as np

from posefit.arrays import Array
from posefit_imm.filter import Manifold
from posefit_imm.kernels import minus, plus

# States (3 + 4 n,): a place, then n unit quaternions w, x, y, z. Errors (3 + 3 n,): a step, then n rotation vectors,
# each applied on its quaternion's right. Such a plus and minus are also written boxplus and boxminus.
PLACED = Manifold(plus, minus)


def product(first: Array, second: Array) -> Array:
    """Return the product (4,) of two quaternions (4,)."""
    a, b, c, d = first.tolist()
    e, f, g, h = second.tolist()
    return np.array(
        [
            a * e - b * f - c * g - d * h,
            a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f,
            a * h + b * g - c * f + d * e,
        ]
    )
