"""What particle swarms share: how a particle flies."""

import math

from posefit.geometry.rotation import Array

INERTIA = 0.9  # A; Reading S5: the paper gives none, and it must be above 0.1
ACCELERATION = 2.0  # c1 = c2, section 3.1
ALPHA = 0.15  # section 2.2


def velocity(inertia: float, velocity: Array, to_personal_best: Array, to_swarm_best: Array) -> Array:
    """Return the next velocities (n, d) from the accelerated ways to the best points. SAPSO (1)."""
    return inertia * velocity + to_personal_best + to_swarm_best  # SAPSO (1)


def position(position: Array, velocity: Array) -> Array:
    """Return where particles (n, d) fly with velocities (n, d). SAPSO (2)."""
    return position + velocity  # SAPSO (2)


def inertia(step: int, steps: int, first: float = INERTIA) -> float:
    """Return omega = A / e^c at c = step ln(10 A) / steps: from A down to 0.1. SAPSO inertia."""
    return first / math.exp(step * math.log(10.0 * first) / steps)  # SAPSO inertia
