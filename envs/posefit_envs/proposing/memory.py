"""What Fit-v1 remembers of a search, what it shows of it, and what its actions propose."""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit_envs.scales import gained, priced, scaled

State = NDArray[np.float32]

SHOWN = 4  # the best proposals, and the last ones
LOG_REACH = (-2.0, 0.0)  # powers of ten that the last number of an action stands for
PATIENCE = 50.0  # proposals without a gain that show as 1


class ProposalMemory:
    """The proposals of one search and their costs; it begins with the middle of the box, which was evaluated.

    `best` and `last` hold four proposals each and begin as four copies of the middle. A copy among the best gives way
    only to what costs less than the middle; one among the last gives way to any proposal.
    """

    def __init__(self, dimensions: int, cost: float, evaluations: int) -> None:
        self.best = np.zeros((SHOWN, dimensions))
        self.best_costs = np.full(SHOWN, cost)
        self.last, self.last_costs = self.best.copy(), self.best_costs.copy()
        self.used, self.stale, self.most = 1, 0, evaluations

    def proposal(self, action: Array) -> Array:
        """Return what an action (d + 1,) proposes (d,): a part of the way from the best so far to its first numbers.

        The last number says which part: all of it at 1, where the proposal is the first numbers, bit for bit.
        """
        target, power = action[:-1], float(action[-1])
        if power >= 1.0:
            return np.array(target)
        proposed: Array = self.best[0] + 10.0 ** scaled(LOG_REACH, power) * (target - self.best[0])
        return proposed

    def take(self, proposal: Array, cost: float) -> float:
        """Remember what a proposal (d,) cost, and return what the best cost gained."""
        before = float(self.best_costs[0])
        self.used += 1
        self.stale = 0 if cost < before else self.stale + 1
        self.last = np.concatenate([proposal[None], self.last[:-1]])
        self.last_costs = np.concatenate([[cost], self.last_costs[:-1]])
        place = int(np.searchsorted(self.best_costs, cost, side="right"))
        if place < SHOWN:
            self.best = np.insert(self.best, place, proposal, axis=0)[:SHOWN]
            self.best_costs = np.insert(self.best_costs, place, cost)[:SHOWN]
        return gained(before, float(self.best_costs[0]))

    def state(self) -> State:
        """Return what is shown (8 d + 10,): the best proposals, the last ones, their costs, and the budget left."""
        costs = 2.0 * priced(np.concatenate([self.best_costs, self.last_costs])) - 1.0
        ends = [2.0 * (1.0 - self.used / self.most) - 1.0, 2.0 * min(self.stale / PATIENCE, 1.0) - 1.0]
        shown = np.concatenate([self.best.ravel(), self.last.ravel(), costs, ends])
        state: State = np.clip(shown, -1.0, 1.0).astype(np.float32)
        return state


def space_of_memory(dimensions: int) -> spaces.Box:
    """Return the space of what is shown of searches in so many dimensions."""
    return spaces.Box(-1.0, 1.0, (2 * SHOWN * (dimensions + 1) + 2,), np.float32)


def seen_with(state: Any, picture: Any, image: bool) -> Any:
    """Return an observation: what is shown of the search, alone or beside the picture."""
    return {"search": state, "image": picture} if image else state
