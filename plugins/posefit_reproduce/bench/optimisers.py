"""How long optimisers take to propose and to learn, without the costs."""

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast, final

import numpy as np
from threadpoolctl import threadpool_limits

from posefit.arrays import Array
from posefit.fitting.optimiser import Filter, Optimiser, minimise
from posefit.fitting.space import SearchSpace
from posefit.motion import built_in
from posefit.registry import Offer, registry
from posefit.settings import planned
from posefit_priors.loose import Loose

PARTICLES = 40
POPULATIONS, SEARCHES = 30, 10  # of each optimiser
PATIENCE = 3.0  # seconds for one optimiser; a slow one has fewer searches
OURS = ("sapso", "pso", "random", "particle", "annealed", "cma")
COMPONENTS = 9  # of the prior `loose`, which makes 28 dimensions with the root's 3 angles and 16 of the limbs


def wide_space(space: SearchSpace) -> SearchSpace:
    """Return a space with the prior `loose` instead of its own, of 28 dimensions."""
    styles = [built_in.motion(name, frames=60, fps=30.0) for name in built_in.other_styles("walk")]
    return replace(space, prior=Loose(components=COMPONENTS).fit(np.concatenate([one.poses[:, 3:] for one in styles])))


def optimiser_us(space: SearchSpace, names: Sequence[str] = ()) -> dict[str, float]:
    """Return what ask and tell take a proposal, in microseconds, of the optimisers named, or of all installed.

    Populations of 40 (for `scipy:dual_annealing` 1), as the cost a distance that takes no time to speak of; of a
    filter, with the step to the next frame. The best of several searches, on one thread.
    """
    offers = registry().offers["optimiser"]
    names = names or [*(name for name, offer in offers.items() if not offer.missing), "scipy:dual_annealing"]
    with threadpool_limits(1):  # as a track has it: BLAS is slower with more threads where matrices are small
        return {name: 1e6 * _ask_and_tell(space, registry().offer("optimiser", name)) for name in names}


@final
class Stopwatch:
    """An optimiser that is timed, and that ends after so many populations; without a number, by itself."""

    def __init__(self, optimiser: Optimiser, populations: int | None = None) -> None:
        self._optimiser, self._left = optimiser, populations
        self.seconds, self.proposals = 0.0, 0

    def ask(self) -> Array:
        """Return what the optimiser proposes."""
        if self._left == 0:
            return np.empty((0, 0))
        began = time.perf_counter()
        proposals = self._optimiser.ask()
        self.seconds += time.perf_counter() - began
        self.proposals += len(proposals)
        return proposals

    def tell(self, proposals: Array, costs: Array) -> None:
        """Tell the optimiser what its proposals cost."""
        began = time.perf_counter()
        self._optimiser.tell(proposals, costs)
        self.seconds += time.perf_counter() - began
        if self._left is not None:
            self._left -= 1

    def advance(self, space: SearchSpace) -> None:
        """Go on to a filter's next frame."""
        began = time.perf_counter()
        cast(Filter, self._optimiser).advance(space)
        self.seconds += time.perf_counter() - began


def _ask_and_tell(space: SearchSpace, offer: Offer) -> float:
    """Return the seconds of a proposal."""
    known = {setting.name for setting in offer.settings}
    populations = POPULATIONS if "layers" not in known else POPULATIONS // 10
    sizes: dict[str, Any] = {"population_size": PARTICLES} if "population_size" in known else {}
    budget = PARTICLES * (10 if "layers" in known else 1 if offer.next_frame == "carry" else POPULATIONS + 1)
    fastest = np.inf
    began = time.perf_counter()
    for seed in range(SEARCHES):
        optimiser = offer.factory(space, np.random.default_rng(seed), **planned(offer.factory, sizes, budget))
        if offer.next_frame == "carry":
            watch = Stopwatch(optimiser)
            for _ in range(populations):
                minimise(_distance, watch, sys.maxsize, budget_known=True)
                watch.advance(space)
        else:
            watch = Stopwatch(optimiser, populations)
            minimise(_distance, watch, sys.maxsize, budget_known=True)
        fastest = min(fastest, watch.seconds / watch.proposals)
        if time.perf_counter() - began > PATIENCE:
            break
    return float(fastest)


def _distance(proposals: Array) -> Array:
    """Return costs (n,) of proposals (n, d) that take no time to speak of."""
    return np.asarray(50.0 * (proposals**2).mean(axis=1))
