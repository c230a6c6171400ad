"""The manifold of a place and any number of unit quaternions, such as a body's and its limbs'."""

from posefit_imm.filter import Manifold
from posefit_imm.kernels import minus, plus

# States (3 + 4 n,): a place, then n unit quaternions w, x, y, z. Errors (3 + 3 n,): a step, then n rotation vectors,
# each applied on its quaternion's right. Such a plus and minus are also written boxplus and boxminus.
PLACED = Manifold(plus, minus)
