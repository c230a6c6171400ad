"""CMA-ES as the library pycma implements it, for posefit: `pycma`.

N. Hansen, Y. Akimoto, P. Baudis, CMA-ES/pycma on GitHub, 2019. `pip install posefit[pycma]`.

>>> import posefit
>>> track = posefit.track("walk", optimiser="pycma", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

from functools import partial

import numpy as np

from posefit import hookimpl
from posefit.fitting.box import Space, draw_population
from posefit.fitting.bridge import Bridged, Objective
from posefit.fitting.check import at_least, positive
from posefit.hooks import RegisterOptimiser


def pycma(space: Space, rng: np.random.Generator, *, population_size: int = 0, spread: float = 0.5) -> Bridged:
    """pycma's evolution strategy with its own handling of the box; `population_size` of 0 is its own choice.

    It starts around the prediction with its spread, or anywhere with `spread`, and again where it has stopped.

    Settings:
        population_size (lambda): 5 or more, or 0 for the library's own choice.
        spread (sigma): the first step size where no prediction is, in half-ranges of the box, above 0. Ours.
    """
    if population_size != 0:
        at_least("population_size", population_size, 5)
    positive("spread", spread)
    return Bridged(space, rng, partial(_evolve, population_size, spread))


def _evolve(population_size: int, spread: float, space: Space, rng: np.random.Generator, objective: Objective) -> None:
    from cma import CMAEvolutionStrategy

    spare = np.zeros(1 if space.dimensions == 1 else 0)  # it cannot search a single dimension
    stds = np.full(space.dimensions, spread) if space.start is None else np.maximum(space.start.spread, 1e-6)
    stds = np.append(stds, spare + spread)
    options = {"bounds": [-1, 1], "CMA_stds": stds, "verbose": -9} | (
        {"popsize": population_size} if population_size else {}
    )
    # without a seed, and with our generator, it leaves numpy's global one alone
    options |= {"seed": np.nan, "randn": lambda *shape: rng.standard_normal(shape)}
    while True:
        strategy = CMAEvolutionStrategy(np.append(draw_population(space, rng, 1)[0], spare), 1.0, options)
        while not strategy.stop():
            asked = strategy.ask()
            strategy.tell(asked, objective(np.array(asked)[:, : space.dimensions]).tolist())


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Offer `pycma`."""
    register("pycma", pycma, needs=("cma", "posefit[pycma]"))
