"""What Configure-v1 shows: what kind of instance it is, and how far its search has come."""

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.box import displacement
from posefit_envs.configure import ALPHA
from posefit_envs.configuring.herd import Herd
from posefit_envs.scales import priced

State = NDArray[np.float32]

WIDEST = 1.0  # deviation of bests, in half-ranges, that shows as 1
NARROWEST = 1e-3  # and as 0
INSTANCE_FEATURES = 9
PROGRESS_FEATURES = 16
FEATURES = INSTANCE_FEATURES + PROGRESS_FEATURES


def instance_features(herd: Herd) -> Array:
    """Return what kind of instance it is (9,), in [0, 1]: its silhouettes, and the costs of the first population.

    The means over views of the silhouette's share of the picture, its height, its width, its share of the box around
    it, and of its pixels at an edge; the dimensions / 66; the median and the deviation of the first costs / 100; and
    how the first costs rise with the distance to the cheapest, as a correlation from -1 to 1 brought to 0 to 1.
    """
    seen = np.array([_shape(one.mask) for one in herd.episode.scenery.observation.silhouettes]).mean(axis=0)
    first, costs = herd.flock.best, herd.flock.best_cost
    away = np.sqrt((displacement(herd.space, first[costs.argmin()], first) ** 2).sum(axis=1))
    spread = costs.std() * away.std()
    slope = float(((costs - costs.mean()) * (away - away.mean())).mean() / spread) if spread > 0.0 else 0.0
    landscape = [herd.space.dimensions / 66.0, np.median(costs) / 100.0, costs.std() / 100.0, 0.5 + 0.5 * slope]
    return np.concatenate([seen, landscape])


def _shape(mask: NDArray[np.bool_]) -> list[float]:
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    count = int(np.count_nonzero(mask))
    if not count:
        return [0.0] * 5
    tall, wide = int(rows[-1] - rows[0]) + 1, int(columns[-1] - columns[0]) + 1
    within = np.zeros_like(mask)
    within[1:-1, 1:-1] = mask[1:-1, 1:-1] & mask[:-2, 1:-1] & mask[2:, 1:-1] & mask[1:-1, :-2] & mask[1:-1, 2:]
    edge = 1.0 - np.count_nonzero(within) / count
    return [count / mask.size, tall / mask.shape[0], wide / mask.shape[1], count / (tall * wide), edge]


def progress_features(herd: Herd) -> Array:
    """Return how far a search has come (16,), in [0, 1] but for rounding."""
    flock, costs = herd.flock, herd.costs
    spreads = flock.best.std(axis=0)
    layers = [_logged(float(spreads[layer].mean()), NARROWEST, WIDEST) for layer in herd.layers]
    speed = float(np.abs(flock.velocity).mean()) / ALPHA
    paid = [priced(one) for one in (herd.best, float(flock.best_cost.min()), costs.min(), costs.mean(), costs.std())]
    order = herd.order
    waits = [herd.left / herd.steps, min(herd.stale / 10.0, 1.0)]
    return np.array([*paid, *layers, speed, float(herd.accepted.mean()), *waits, *order.shares, order.population])


def observed_state(features: Array, herd: Herd) -> State:
    """Return the observation (25,) of an instance's features and a search."""
    state: State = np.clip(np.concatenate([features, progress_features(herd)]), 0.0, 1.0).astype(np.float32)
    return state


def _logged(value: float, low: float, high: float) -> float:
    return float(np.log(max(value, low) / low) / np.log(high / low))


def space_of_features() -> spaces.Box:
    """Return the observation space."""
    return spaces.Box(0.0, 1.0, (FEATURES,), np.float32)
