"""Optimisers of pymoo for posefit: `pymoo:NAME`, one of its single-objective algorithms with a population.

J. Blank, K. Deb, pymoo: multi-objective optimization in Python, IEEE Access 8, 2020. `pip install posefit[pymoo]`.

>>> import posefit
>>> track = posefit.track("walk", optimiser="pymoo:DE", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

from functools import partial
from importlib import import_module
from typing import Literal

import numpy as np

from posefit import hookimpl
from posefit.fitting.box import Space, draw_population
from posefit.fitting.bridge import Bridged, Objective
from posefit.fitting.check import at_least, one_of
from posefit.hooks import RegisterOptimiser

Variant = Literal["DE", "PSO", "GA", "ES", "SRES", "ISRES"]


def pymoo(space: Space, rng: np.random.Generator, *, variant: Variant = "DE", population_size: int = 40) -> Bridged:
    """An algorithm of pymoo, whose first population is drawn from the start.

    Settings:
        variant: a single-objective algorithm with a population; `pymoo:NAME` sets it.
        population_size: size of its population, 5 or more.
    """
    at_least("population_size", population_size, 5)
    one_of("variant", variant, ("DE", "PSO", "GA", "ES", "SRES", "ISRES"))
    return Bridged(space, rng, partial(_run, variant, population_size))


def _run(variant: str, population_size: int, space: Space, rng: np.random.Generator, objective: Objective) -> None:
    from pymoo.config import Config
    from pymoo.core.problem import Problem
    from pymoo.core.termination import NoTermination
    from pymoo.problems.static import StaticProblem

    Config.warnings["not_compiled"] = False
    kind = getattr(import_module(f"pymoo.algorithms.soo.nonconvex.{variant.lower()}"), variant)
    algorithm = kind(pop_size=population_size, sampling=draw_population(space, rng, population_size))
    problem = Problem(n_var=space.dimensions, n_obj=1, xl=-1.0, xu=1.0)
    algorithm.setup(problem, termination=NoTermination(), seed=int(rng.integers(2**31)))
    while True:
        asked = algorithm.ask()
        costs = objective(asked.get("X").astype(np.float64))
        algorithm.evaluator.eval(StaticProblem(problem, F=costs[:, None]), asked)
        algorithm.tell(infills=asked)


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Offer `pymoo:NAME`."""
    register("pymoo", pymoo, needs=("pymoo", "posefit[pymoo]"))
