"""What an action of Configure-v1 stands for, and which action stands for an order."""

from dataclasses import dataclass

import numpy as np
from gymnasium import spaces

from posefit.arrays import Array
from posefit_envs.configure import INERTIA, LOG_TEMPERATURE
from posefit_envs.scales import scaled, unscaled

SPREAD = 0.3  # the largest diffusion, in half-ranges
SHARPNESS = 5.0
LOG_POPULATION = (0.0, -2.0)  # powers of two, of all particles
NUMBERS = 10  # of an action: three optimisers, four of the population, three layers


@dataclass(frozen=True)
class Order:
    """What a population is told to do in one step of Configure-v1; as it is, all of it is a swarm."""

    shares: tuple[float, float, float] = (1.0, 0.0, 0.0)  # of the population, by optimiser; they sum to 1
    population: float = 1.0  # how much of the population moves at a time, the best first
    stride: float = 0.6
    temperature: float = 1.0
    restart: float = 0.0  # how much of the population begins anew, the worst first
    diffusion: tuple[float, float, float] = (0.0, 0.0, 0.0)  # standard deviations in half-ranges, by layer


def order_of(action: Array) -> Order:
    """Return the order that an action (10,) in [-1, 1] stands for."""
    _, _, _, power, stride, log_temperature, restart, *kicks = action.tolist()
    weights = np.exp(SHARPNESS * action[:3])
    shares = weights / weights.sum()
    first, second, third = (max(kick, 0.0) * SPREAD for kick in kicks)
    return Order(
        (float(shares[0]), float(shares[1]), float(shares[2])),
        2.0 ** scaled(LOG_POPULATION, min(max(2.0 * power, -1.0), 1.0)),
        scaled(INERTIA, stride),
        10.0 ** scaled(LOG_TEMPERATURE, log_temperature),
        max(restart, 0.0),
        (first, second, third),
    )


def action_of(order: Order) -> Array:
    """Return the action (10,), float64, that stands for an order, but for rounding; -1 stands for nothing.

    Raises ValueError where no action stands for it.
    """
    shares = np.maximum(1.0 + np.log(np.maximum(np.array(order.shares) / max(order.shares), 1e-9)) / SHARPNESS, -1.0)
    ranged = [
        0.5 * unscaled(LOG_POPULATION, np.log2(order.population)),
        unscaled(INERTIA, order.stride),
        unscaled(LOG_TEMPERATURE, np.log10(order.temperature)),
    ]
    amounts = [amount if amount > 0.0 else -1.0 for amount in (order.restart, *np.array(order.diffusion) / SPREAD)]
    action = np.array([*shares, *ranged, *amounts])
    if not (np.abs(action) <= 1.0).all():
        raise ValueError(f"an order must be within what actions stand for, got {order}")
    return action


def space_of_orders() -> spaces.Box:
    """Return the action space."""
    return spaces.Box(-1.0, 1.0, (NUMBERS,), np.float32)
