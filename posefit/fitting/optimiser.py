"""Optimisers, and the base of adapters of another library's ask and tell."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Literal, Protocol

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.box import Space, repair

WORST = 1e15  # few libraries work with nan, infinity or the square of 1e300


class Optimiser(Protocol):
    """Proposes populations and learns their costs.

    A class need not inherit from it: these two methods make it an optimiser.

    Example:
        >>> import numpy as np
        >>> import posefit
        >>> from posefit.testing.toy import Toy
        >>> search = posefit.optimiser("random")(Toy(2), np.random.default_rng(0))
        >>> proposals = search.ask()
        >>> search.tell(proposals, (proposals**2).sum(axis=1))
    """

    def ask(self) -> Array:
        """Return the next population (n, d) in [-1, 1]^d.

        An empty population, (0, d), ends the search.
        """
        ...

    def tell(self, proposals: Array, costs: Array) -> None:
        """Take the costs (n,) of exactly what `ask` returned; lower is better."""
        ...


class Filter(Optimiser, Protocol):
    """An optimiser that carries its particles from frame to frame.

    Example:
        >>> import numpy as np
        >>> import posefit
        >>> from posefit.testing.toy import Toy
        >>> search = posefit.optimiser("annealed")(Toy(2), np.random.default_rng(0))
        >>> proposals = search.ask()
        >>> search.tell(proposals, (proposals**2).sum(axis=1))
        >>> search.advance(Toy(2))  # the next frame
        >>> search.ask().shape[1]
        2
    """

    def advance(self, space: Space) -> None:
        """Continue with the next frame.

        Args:
            space: Its box. The `start` of the box is the tracker's prediction.
        """
        ...


# Builds an optimiser for one search, as `factory(space, rng, **settings)`: a Space, a
# NumPy Generator that is the only source of randomness, and keyword-only settings. The
# driver fills in two settings if the factory takes them: `evaluations`, the budget of
# one search, and `iterations`, the number of populations after the first for which this
# budget is enough. A factory with a true attribute `baseline` searches at random, as a
# baseline for the others: the checks do not require it to beat chance.
OptimiserFactory = Callable[..., Optimiser]

# The optimiser of the next frame. "start": a new one around the prediction, SAPSO (6),
# (7). "carry": the same `Filter` with its particles. "forget": a new one that starts
# anywhere.
NextFrame = Literal["start", "carry", "forget"]


def finite_costs(costs: Array) -> Array:
    """Return costs (n,) limited to +-1e15, nan as the worst, for any library.

    Args:
        costs: The costs (n,).

    Returns:
        The finite costs (n,).

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import finite_costs
        >>> finite_costs(np.array([1.0, np.nan, -np.inf])).tolist()
        [1.0, 1000000000000000.0, -1000000000000000.0]
    """
    return np.asarray(np.fmax(np.fmin(costs, WORST), -WORST))


def check_tell(waiting: int, proposals: Array, costs: Array) -> None:
    """Raise InputError unless `tell` gets one cost for each proposal of `ask`.

    Args:
        waiting: How many proposals wait for their costs, 0 before `ask` and after
            `tell`.
        proposals: The proposals that `tell` got.
        costs: The costs that `tell` got.

    Raises:
        InputError: The shapes do not match, or no proposals are waiting for costs.

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import check_tell
        >>> check_tell(2, np.zeros((2, 9)), np.zeros(2))
        >>> check_tell(2, np.zeros((2, 9)), np.zeros(3))
        Traceback (most recent call last):
        posefit.errors.InputError: ...
    """
    if not waiting:
        raise InputError("tell must follow ask, got costs before proposals")
    for name, values, dimensions in (("costs", costs, 1), ("proposals", proposals, 2)):
        shape = np.shape(values)
        if len(shape) != dimensions or shape[0] != waiting:
            came = f"an array of shape {shape}"
            if not shape:
                came = "one number"
            elif len(shape) == dimensions:
                came = str(shape[0])
            raise InputError(f"tell must get {waiting} {name}, got {came}")


class Adapter(ABC):
    """Asks a library for proposals, and tells it costs.

    Infeasible proposals are repaired, and costs are made finite.

    Args:
        space: The box.
        home: (d,) a feasible proposal. Infeasible ones are moved towards it until they
            are feasible.

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import Adapter
        >>> from posefit.testing.toy import Toy
        >>> class Same(Adapter):
        ...     def propose(self):
        ...         return np.zeros((3, 2))
        ...     def learn(self, proposals, costs):
        ...         self.best = costs.min()
        >>> adapter = Same(Toy(2), np.zeros(2))
        >>> adapter.tell(adapter.ask(), np.array([2.0, 1.0, 3.0]))
        >>> float(adapter.best)
        1.0
    """

    def __init__(self, space: Space, home: Array) -> None:
        self._space = space
        self._home = home
        self._asked: Array | None = None  # as the library proposed them

    @abstractmethod
    def propose(self) -> Array:
        """Return the library's next proposals (n, d), feasible or not.

        An empty array, (0, d), means that it has ended.
        """

    @abstractmethod
    def learn(self, proposals: Array, costs: Array) -> None:
        """Tell the library the finite costs (n,) of its repaired `proposals` (n, d)."""

    def ask(self) -> Array:
        """Return the next population (n, d), the same one until its costs are told."""
        if self._asked is None:
            self._asked = self.propose()
        return repair(self._space, self._asked, self._home)

    def tell(self, proposals: Array, costs: Array) -> None:
        """Let the library learn the costs (n,) of the latest population.

        Raises InputError if they do not belong to it.
        """
        check_tell(0 if self._asked is None else len(self._asked), proposals, costs)
        self.learn(np.asarray(proposals), finite_costs(costs))
        self._asked = None
