"""How long optimisers take to propose and to learn, without the costs."""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
from threadpoolctl import threadpool_limits

from posefit.fitting.optimiser import Filter, Optimiser
from posefit.fitting.space import SearchSpace
from posefit.registry import Offer, registry
from posefit.settings import planned
from posefit_priors.loose import Loose
from posefit_reproduce.bench.kernel import walking_angles

PARTICLES = 40
POPULATIONS, SEARCHES = 30, 10  # of each optimiser
PATIENCE = 3.0  # seconds for one optimiser; a slow one has fewer searches
OURS = ("sapso", "pso", "random", "particle", "annealed", "cma")
COMPONENTS = 9  # of the prior `loose`, which makes 28 dimensions with the root's 3 angles and 16 of the limbs


def wide_space(space: SearchSpace) -> SearchSpace:
    """Return a space with the prior `loose` instead of its own, of 28 dimensions."""
    return replace(space, prior=Loose(components=COMPONENTS).fit(walking_angles()))


def optimiser_us(space: SearchSpace, names: Sequence[str] = ()) -> dict[str, float]:
    """Return what ask and tell take a proposal, in microseconds, of the optimisers named, or of all installed.

    Populations of 40 (for `scipy:dual_annealing` 1), as the cost a distance that takes no time to speak of; of a
    filter, with the step to the next frame. The best of several searches, on one thread.
    """
    offers = registry().offers["optimiser"]
    names = names or [*(name for name, offer in offers.items() if not offer.missing), "scipy:dual_annealing"]
    with threadpool_limits(1):  # as a track has it: BLAS is slower with more threads where matrices are small
        return {name: 1e6 * _ask_and_tell(space, registry().offer("optimiser", name)) for name in names}


def _ask_and_tell(space: SearchSpace, offer: Offer) -> float:
    known = {setting.name for setting in offer.settings}
    carries = offer.next_frame == "carry"
    turns = POPULATIONS if "layers" not in known else POPULATIONS // 10  # populations, or a filter's frames
    sizes: dict[str, Any] = {"population_size": PARTICLES} if "population_size" in known else {}
    budget = PARTICLES * (10 if "layers" in known else 1 if carries else POPULATIONS + 1)
    fastest = np.inf
    began = time.perf_counter()
    for seed in range(SEARCHES):
        optimiser = offer.factory(space, np.random.default_rng(seed), **planned(offer.factory, sizes, budget))
        fastest = min(fastest, timed_search(optimiser, turns, space if carries else None))
        if time.perf_counter() - began > PATIENCE:
            break
    return fastest


def timed_search(optimiser: Optimiser, turns: int, space: SearchSpace | None = None) -> float:
    """Return the seconds that an optimiser takes for a proposal, over so many populations.

    With a space it is a filter, and goes on to so many next frames of that space. Costs take no time to speak of.
    """
    clock, seconds, count = time.perf_counter, 0.0, 0
    while turns:
        began = clock()
        proposals = optimiser.ask()
        seconds += clock() - began
        count += len(proposals)
        if len(proposals):
            costs = 50.0 * (proposals**2).mean(axis=1)
            began = clock()
            optimiser.tell(proposals, costs)
            turns -= space is None
        elif space is not None:
            began = clock()
            cast(Filter, optimiser).advance(space)
            turns -= 1
        else:
            break
        seconds += clock() - began
    return seconds / count
