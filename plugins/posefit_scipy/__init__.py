"""Optimisers of SciPy for posefit: `scipy:differential_evolution` and `scipy:dual_annealing`.

R. Storn, K. Price, Differential evolution, Journal of Global Optimization 11, 1997; Y. Xiang et al., Generalized
simulated annealing for global optimization, The R Journal 5(1), 2013.

>>> import posefit
>>> track = posefit.track("walk", method="scipy:differential_evolution", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

from functools import partial
from typing import Any, Literal

import numpy as np

from posefit.plugin import RegisterOptimiser, Space, at_least, choices, draw_population, hookimpl
from posefit_scipy.bridge import Bridged, Objective

Variant = Literal["differential_evolution", "dual_annealing"]


def scipy(
    space: Space, rng: np.random.Generator, *, variant: Variant = "differential_evolution", population_size: int = 40
) -> Bridged:
    """SciPy's differential evolution, or its dual annealing, which proposes one at a time.

    A search that has converged starts again. Dual annealing goes without its local search, which needs gradients.

    Settings:
        variant: "differential_evolution" or "dual_annealing"; `scipy:NAME` sets it.
        population_size: size of differential evolution's population, 5 or more; dual annealing has none.
    """
    at_least("population_size", population_size, 5)
    choices(scipy, locals())
    return Bridged(space, rng, partial(_evolve, population_size) if variant == "differential_evolution" else _anneal)


def _evolve(population_size: int, space: Space, rng: np.random.Generator, objective: Objective) -> None:
    from scipy.optimize import differential_evolution

    box: Any = [(-1.0, 1.0)] * space.dimensions
    settings: Any = {"vectorized": True, "updating": "deferred", "polish": False, "maxiter": 10**9, "tol": 0.0}

    def columns(proposals: Any) -> Any:
        return objective(proposals.T)

    while True:
        first: Any = draw_population(space, rng, population_size)
        differential_evolution(columns, box, init=first, rng=rng, **settings)


def _anneal(space: Space, rng: np.random.Generator, objective: Objective) -> None:
    from scipy.optimize import dual_annealing

    box: Any = [(-1.0, 1.0)] * space.dimensions

    def row(proposal: Any) -> Any:
        return float(objective(proposal[None])[0])

    while True:
        first = draw_population(space, rng, 1)[0]
        dual_annealing(row, box, x0=first, rng=rng, no_local_search=True)


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Register `scipy:NAME`."""
    register("scipy", scipy)
