"""Optimisers of pymoo for posefit: `pymoo:NAME`, one of its single-objective algorithms with a population.

J. Blank, K. Deb, pymoo: multi-objective optimization in Python, IEEE Access 8, 2020. `pip install posefit[pymoo]`.

>>> import posefit
>>> track = posefit.track("walk", method="pymoo:DE", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

from importlib import import_module
from typing import Any, Literal, final, get_args

import numpy as np

from posefit.errors import InputError
from posefit.plugin import (
    Array,
    RegisterOptimiser,
    Space,
    at_least,
    draw_population,
    finite_costs,
    hookimpl,
    one_of,
    repair,
)

Variant = Literal["DE", "PSO", "GA", "ES", "SRES", "ISRES"]


@final
class Pymoo:
    """An algorithm of pymoo, whose first population is drawn from the start.

    Settings:
        variant: a single-objective algorithm with a population; `pymoo:NAME` sets it.
        population_size: size of its population, 5 or more.
    """

    def __init__(
        self, space: Space, rng: np.random.Generator, *, variant: Variant = "DE", population_size: int = 40
    ) -> None:
        at_least("population_size", population_size, 5)
        one_of("variant", variant, get_args(Variant))
        self._asked: Any = None
        self._space, self._home = space, draw_population(space, rng, 1)[0]
        self._variant, self._population_size, self._seed = variant, population_size, int(rng.integers(2**63))
        self._begin()

    def ask(self) -> Array:
        """Return the algorithm's next population (n, d)."""
        if self._asked is None:
            self._asked = self._algorithm.ask()
        return repair(self._space, self._asked.get("X").astype(np.float64), self._home)

    def tell(self, proposals: Array, costs: Array) -> None:
        """Let the algorithm learn the costs (n,)."""
        if self._asked is None:
            raise InputError("tell must follow ask, got costs before proposals")
        self._learn(finite_costs(costs))

    def _begin(self) -> None:
        from pymoo.config import Config
        from pymoo.core.problem import Problem
        from pymoo.core.termination import NoTermination

        rng, size = np.random.default_rng(self._seed), self._population_size
        Config.warnings["not_compiled"] = False
        kind = getattr(import_module(f"pymoo.algorithms.soo.nonconvex.{self._variant.lower()}"), self._variant)
        self._algorithm: Any = kind(pop_size=size, sampling=draw_population(self._space, rng, size))
        self._problem: Any = Problem(n_var=self._space.dimensions, n_obj=1, xl=-1.0, xu=1.0)
        self._algorithm.setup(self._problem, termination=NoTermination(), seed=int(rng.integers(2**31)))
        self._asked = None
        self._costs: list[Array] = []  # of all populations so far

    def _learn(self, costs: Array) -> None:
        from pymoo.problems.static import StaticProblem

        self._algorithm.evaluator.eval(StaticProblem(self._problem, F=costs[:, None]), self._asked)
        self._algorithm.tell(infills=self._asked)
        self._costs.append(costs)
        self._asked = None

    def __getstate__(self) -> dict[str, Any]:
        # some of pymoo's algorithms cannot be pickled: a copy is built again and learns the same costs
        return {**self.__dict__, "_algorithm": None, "_problem": None, "_asked": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        costs = self._costs
        self._begin()
        for earlier in costs:
            self.ask()
            self._learn(earlier)


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Register `pymoo:NAME`."""
    register("pymoo", Pymoo, needs=("pymoo", "posefit[pymoo]"))
