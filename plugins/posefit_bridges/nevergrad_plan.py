"""A plan for Nevergrad's benchmark: `python -m nevergrad.benchmark posefit_suite --imports=FILE`, this module's path.

It imports torchvision, pyproj and gym, too: `pip install posefit[bridges]`.
"""

from collections.abc import Iterator
from itertools import product

import numpy as np
from nevergrad.benchmark import registry
from nevergrad.benchmark.xpbase import Experiment

from posefit.suites.functions import FUNCTIONS, HELD_OUT
from posefit.suites.problem import EVALUATIONS
from posefit_bridges.nevergrad import Problem

OPTIMISERS = ("CMA", "OnePlusOne", "PSO", "RandomSearch", "TwoPointsDE")


@registry.register
def posefit_suite(seed: int | None = None) -> Iterator[Experiment]:
    """Yield experiments: each function, dimension and optimiser on three held-out instances, at the usual budget."""
    rng = np.random.default_rng(seed)
    for function, instance in product(FUNCTIONS, HELD_OUT[:3]):
        for dimension in function.dimensions:
            problem = Problem(function.number, instance, dimension)
            for optimiser in OPTIMISERS:
                yield Experiment(problem, optimiser, budget=EVALUATIONS * dimension, seed=int(rng.integers(2**32)))
