"""What particle swarms share: the paper's constants, and the inertia that falls."""

import math

INERTIA = 0.9  # A; Interpretation S5: the paper gives none, and it must be above 0.1
ACCELERATION = 2.0  # c1 = c2, section 3.1
ALPHA = 0.15  # section 2.2


def inertia(step: int, steps: int, first: float = INERTIA) -> float:
    """Return omega = A / e^c at c = step ln(10 A) / steps: from A down to 0.1. SAPSO inertia."""
    return first / math.exp(step * math.log(10.0 * first) / steps)  # SAPSO inertia
