"""An optimiser under test: how the checks build it and step it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Space
from posefit.fitting.optimiser import Filter, NextFrame, Optimiser, populations
from posefit.settings import planned, settings_of
from posefit.testing.results import Checklist, SkippedError, expect

EVALUATIONS = 400  # a search's budget where a check needs no special one
REFUSALS = (ValueError, RuntimeError)

Evaluate = Callable[[Array], Array]
checklist = Checklist()


@dataclass(frozen=True)
class OptimiserCase:
    """A factory with its settings, and what it is registered to do when the next frame comes."""

    factory: Callable[..., Any]
    next_frame: NextFrame = "start"
    settings: dict[str, Any] = field(default_factory=dict)

    @property
    def baseline(self) -> bool:
        """Whether it says of itself that it is the chance that others are held against."""
        return bool(getattr(getattr(self.factory, "func", self.factory), "baseline", False))

    def build(self, space: Space, seed: int = 0, evaluations: int = EVALUATIONS, **more: Any) -> Optimiser:
        """Return a new optimiser of the space."""
        filled = planned(self.factory, {**self.settings, **more}, evaluations)
        optimiser: Optimiser = self.factory(space, np.random.default_rng(seed), **filled)
        return optimiser

    def steps(
        self, optimiser: Optimiser, space: Space, evaluate: Evaluate, count: int
    ) -> Iterator[tuple[Array, Array]]:
        """Yield up to `count` populations with their costs; a filter that has none left goes on to a next frame."""
        for _ in range(count):
            proposals = optimiser.ask()
            if not len(proposals) and self.next_frame == "carry":
                cast(Filter, optimiser).advance(space)
                proposals = optimiser.ask()
            if not len(proposals):
                return
            costs = np.asarray(evaluate(proposals), dtype=np.float64)
            yield proposals.copy(), costs.copy()
            optimiser.tell(proposals, costs)

    def trace(self, space: Space, evaluate: Evaluate, seed: int = 0, count: int = 6) -> list[Array]:
        """Return the populations that a new optimiser proposes."""
        return [proposals for proposals, _ in self.steps(self.build(space, seed), space, evaluate, count)]

    def best(self, space: Space, evaluate: Evaluate, seed: int, evaluations: int) -> float:
        """Return the lowest cost that a search finds; of a filter, in the last of ten frames that look alike."""
        optimiser = self.build(space, seed, evaluations)
        lowest = np.inf
        for frame in range(10 if self.next_frame == "carry" else 1):
            if frame:
                cast(Filter, optimiser).advance(space)
            lowest = min(float(costs.min()) for _, costs in populations(optimiser, evaluate, evaluations))
        return lowest

    def valid(self, space: Space, evaluate: Evaluate, count: int = 6, seed: int = 0) -> str:
        """Check that every proposal of a search is allowed in the space; return how many there were."""
        seen = 0
        for proposals, _ in self.steps(self.build(space, seed), space, evaluate, count):
            check_population(proposals, space)
            seen += len(proposals)
        expect(seen, "ask must return a population, got an empty one at once")
        return f"{seen} proposals"


def check_population(proposals: Array, space: Space) -> None:
    """Return nothing. Raises BrokenError where a population is not one of finite, allowed proposals in the box."""
    shape = np.shape(proposals)
    expect(len(shape) == 2 and shape[1] == space.dimensions, f"ask must return (n, {space.dimensions}), got {shape}")
    expect(np.isfinite(proposals).all(), "ask must return finite proposals, got nan or infinity")
    far = float(np.abs(proposals).max(initial=0.0))
    expect(far <= 1.0, f"ask must stay in [-1, 1], got {far:.6g} from the middle")
    broken = int(np.count_nonzero(~space.feasible(proposals)))
    expect(not broken, f"ask must return feasible proposals, got {broken} of {len(proposals)} that are not")


def same(first: list[Array], second: list[Array]) -> bool:
    """Return whether two traces are bit for bit the same."""
    return len(first) == len(second) and all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))


def needs_settings(case: OptimiserCase) -> None:
    """Return nothing. Skips the check where the factory has no settings."""
    if not settings_of(case.factory):
        raise SkippedError("it has no settings")
