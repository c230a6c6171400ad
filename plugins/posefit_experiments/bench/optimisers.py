"""How long optimisers take to propose and to learn, without the costs."""

import time
from typing import Any

import numpy as np

from posefit.fitting.space import SearchSpace
from posefit.registry import Offer, registry
from posefit.settings import planned

PARTICLES = 40
POPULATIONS, SEARCHES = 30, 10  # of each optimiser
PATIENCE = 3.0  # seconds for one optimiser; a slow one has fewer searches


def optimiser_us(space: SearchSpace) -> dict[str, float]:
    """Return what ask and tell take a proposal, in microseconds, of each optimiser that is installed.

    Populations of 40 (for `scipy:dual_annealing` 1), as the cost a distance that takes no time to speak of; of a
    filter, with the step to the next frame. The best of several searches, on one thread.
    """
    found = registry().offers["optimiser"]
    names = [name for name, offer in found.items() if not offer.missing] + ["scipy:dual_annealing"]
    return {name: 1e6 * _ask_and_tell(space, registry().offer("optimiser", name)) for name in names}


def _ask_and_tell(space: SearchSpace, offer: Offer) -> float:
    known = {setting.name for setting in offer.settings}
    populations = POPULATIONS if "layers" not in known else POPULATIONS // 10
    sizes: dict[str, Any] = {name: PARTICLES for name in ("particles", "population") if name in known}
    budget = PARTICLES * (10 if "layers" in known else 1 if offer.next_frame == "carry" else POPULATIONS + 1)
    fastest = np.inf
    began = time.perf_counter()
    for seed in range(SEARCHES):
        optimiser = offer.factory(space, np.random.default_rng(seed), **planned(offer.factory, sizes, budget))
        spent, count = 0.0, 0
        for _ in range(populations):
            spent -= time.perf_counter()
            while len(proposals := optimiser.ask()):
                spent += time.perf_counter()
                costs = 50.0 * (proposals**2).mean(axis=1)
                count += len(proposals)
                spent -= time.perf_counter()
                optimiser.tell(proposals, costs)
                if offer.next_frame != "carry":
                    break
            if offer.next_frame == "carry":
                optimiser.advance(space)
            spent += time.perf_counter()
        fastest = min(fastest, spent / max(count, 1))
        if time.perf_counter() - began > PATIENCE:
            break
    return float(fastest)
