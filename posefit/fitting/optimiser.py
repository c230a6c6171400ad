"""What an optimiser is, and the base of optimisers made from another library's ask and tell."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Literal, Protocol

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.box import Space, repair

WORST = 1e15  # few libraries work with nan, infinity or the square of 1e300


class Optimiser(Protocol):
    """Proposes populations and learns their costs; nothing to inherit."""

    def ask(self) -> Array:
        """Return the next population (n, d) in [-1, 1]^d; an empty one, (0, d), ends the search."""
        ...

    def tell(self, proposals: Array, costs: Array) -> None:
        """Take the costs (n,) of exactly what `ask` returned; lower is better."""
        ...


class Filter(Optimiser, Protocol):
    """An optimiser that carries its particles from frame to frame."""

    def advance(self, space: Space) -> None:
        """Go on to the next frame, whose box is `space`; its `start` holds the tracker's prediction."""
        ...


# Builds an optimiser for one search, as `factory(space, rng, **settings)`: a Space, a numpy Generator that is the
# only source of randomness, and keyword-only settings. The driver fills in the settings `evaluations`, the budget of
# one search, and `iterations`, the populations after the first that this budget holds, for a factory that takes them.
# A factory whose attribute `baseline` is true is the chance that others are held against: the kit of checks does not
# ask it to beat chance.
OptimiserFactory = Callable[..., Optimiser]

# What becomes of an optimiser in the next frame: a new one starts around the prediction, SAPSO (6), (7); the same
# one, a `Filter`, carries its particles on; or a new one starts anywhere.
NextFrame = Literal["start", "carry", "forget"]


def finite_costs(costs: Array) -> Array:
    """Return costs (n,) that any library can work with: at most 1e15 to either side, nan the worst of all."""
    return np.asarray(np.fmax(np.fmin(costs, WORST), -WORST))


def check_tell(waiting: int, proposals: Array, costs: Array) -> None:
    """Raise InputError where `tell` gets anything else than a cost for each proposal of `ask`.

    So many proposals wait for their costs; 0 before `ask` and after `tell`.
    """
    if not waiting:
        raise InputError("tell must follow ask, got costs before proposals")
    for name, values, dimensions in (("costs", costs, 1), ("proposals", proposals, 2)):
        shape = np.shape(values)
        if len(shape) != dimensions or shape[0] != waiting:
            came = (
                "one number"
                if not shape
                else shape[0]
                if len(shape) == dimensions
                else f"an array of shape {shape}"
            )
            raise InputError(f"tell must get {waiting} {name}, got {came}")


class Adapter(ABC):
    """Asks a library for proposals and tells it costs: infeasible proposals are repaired, and costs are finite.

    `home` (d,) is a feasible proposal, towards which the others are moved until they are feasible.
    """

    def __init__(self, space: Space, home: Array) -> None:
        self._space = space
        self._home = home
        self._asked: Array | None = None  # as the library proposed them

    @abstractmethod
    def propose(self) -> Array:
        """Return the library's next proposals (n, d), whatever is feasible; (0, d) once it has ended."""

    @abstractmethod
    def learn(self, proposals: Array, costs: Array) -> None:
        """Tell the library the finite costs (n,) of what it proposed; `proposals` (n, d) are the repaired ones."""

    def ask(self) -> Array:
        """Return the next population (n, d), the same one until its costs are told."""
        if self._asked is None:
            self._asked = self.propose()
        return repair(self._space, self._asked, self._home)

    def tell(self, proposals: Array, costs: Array) -> None:
        """Let the library learn the costs (n,). Raises InputError where they are not those of what was asked for."""
        check_tell(0 if self._asked is None else len(self._asked), proposals, costs)
        self.learn(np.asarray(proposals), finite_costs(costs))
        self._asked = None
