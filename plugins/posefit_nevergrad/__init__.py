"""Optimisers of Nevergrad for posefit: `nevergrad:NAME`, a name of `nevergrad.optimizers.registry`.

J. Rapin, O. Teytaud, Nevergrad, a gradient-free optimization platform, 2018. `pip install posefit[nevergrad]`.

>>> import posefit
>>> track = posefit.track("walk", optimiser="nevergrad:OnePlusOne", frames=(0, 3))
>>> track.summary["iou"] > 0.3
True
"""

from functools import partial

import numpy as np

from posefit import hookimpl
from posefit.fitting.box import Space, draw_population
from posefit.fitting.bridge import Bridged, GlobalRandom, Objective
from posefit.fitting.check import at_least
from posefit.hooks import RegisterOptimiser


def nevergrad(
    space: Space,
    rng: np.random.Generator,
    *,
    variant: str = "TwoPointsDE",
    population_size: int = 40,
    evaluations: int = 2440,
) -> Bridged:
    """An optimiser of Nevergrad, asked for `population_size` proposals at a time, within a budget of `evaluations`.

    Settings:
        variant: a name of `nevergrad.optimizers.registry`; `nevergrad:NAME` sets it.
        population_size: proposals asked for at a time, its `num_workers`, 1 or more.
        evaluations: of a frame, its `budget`, 1 or more; by default that of the search.
    """
    from nevergrad import optimizers

    at_least("population_size", population_size, 1)
    at_least("evaluations", evaluations, 1)
    if variant not in optimizers.registry:
        known = len(optimizers.registry)
        raise ValueError(f"variant must be one of {known} names such as TwoPointsDE, CMA, PSO, got {variant!r}")
    return Bridged(space, rng, partial(_run, variant, population_size, evaluations))


def _run(
    variant: str, population_size: int, evaluations: int, space: Space, rng: np.random.Generator, objective: Objective
) -> None:
    import nevergrad as ng

    borrowed = GlobalRandom(int(rng.integers(2**31)))  # some of its optimisers draw from numpy's global generator
    with borrowed:
        spread = 0.5 if space.start is None else np.clip(space.start.spread, 1e-6, 0.5)
        box = (
            ng.p.Array(init=draw_population(space, rng, 1)[0])
            .set_mutation(sigma=spread)
            .set_bounds(-1.0, 1.0, method="clipping")
        )
        box.random_state = np.random.RandomState(int(rng.integers(2**31)))
        optimiser = ng.optimizers.registry[variant](box, budget=evaluations, num_workers=population_size)
        for proposal in draw_population(space, rng, population_size):
            optimiser.suggest(proposal)
    while True:
        with borrowed:
            asked = [optimiser.ask() for _ in range(population_size)]
        costs = objective(np.array([one.value for one in asked]))
        with borrowed:
            for one, cost in zip(asked, costs.tolist(), strict=True):
                optimiser.tell(one, cost)


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Offer `nevergrad:NAME`."""
    register("nevergrad", nevergrad, needs=("nevergrad", "posefit[nevergrad]"))
