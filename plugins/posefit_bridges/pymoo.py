"""Optimisers of pymoo for posefit: `pymoo:NAME`, one of its single-objective algorithms with a population.

J. Blank, K. Deb, pymoo: multi-objective optimization in Python, IEEE Access 8, 2020. `pip install posefit[pymoo]`.

>>> import posefit
>>> track = posefit.track("walk", method="pymoo:DE", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

from importlib import import_module
from typing import Any, Literal, final

import numpy as np

from posefit.plugin import Adapter, Array, Space, at_least, choices, draw_population

Variant = Literal["DE", "PSO", "GA", "ES", "SRES", "ISRES"]


@final
class Pymoo(Adapter):
    """An algorithm of pymoo, whose first population is drawn from the start.

    Settings:
        variant: a single-objective algorithm with a population; `pymoo:NAME` sets it.
        population_size: size of its population, 5 or more.
    """

    def __init__(
        self, space: Space, rng: np.random.Generator, *, variant: Variant = "DE", population_size: int = 40
    ) -> None:
        at_least("population_size", population_size, 5)
        choices(Pymoo.__init__, locals())
        super().__init__(space, draw_population(space, rng, 1)[0])
        self._variant, self._population_size, self._seed = variant, population_size, int(rng.integers(2**63))
        self._begin()

    def propose(self) -> Array:
        """Return the algorithm's next population (n, d)."""
        self._individuals: Any = self._algorithm.ask()
        return np.asarray(self._individuals.get("X").astype(np.float64))

    def learn(self, proposals: Array, costs: Array) -> None:
        """Let the algorithm learn the costs (n,)."""
        from pymoo.problems.static import StaticProblem

        self._algorithm.evaluator.eval(StaticProblem(self._problem, F=costs[:, None]), self._individuals)
        self._algorithm.tell(infills=self._individuals)
        self._costs.append(costs)

    def _begin(self) -> None:
        from pymoo.config import Config
        from pymoo.core.problem import Problem
        from pymoo.core.termination import NoTermination
        from pymoo.functions import FunctionLoader

        rng, size = np.random.default_rng(self._seed), self._population_size
        hinted = Config.warnings["not_compiled"]
        Config.warnings["not_compiled"] = False  # a hint that is printed when functions are loaded, once
        try:
            FunctionLoader.get_instance()
        finally:
            Config.warnings["not_compiled"] = hinted
        kind = getattr(import_module(f"pymoo.algorithms.soo.nonconvex.{self._variant.lower()}"), self._variant)
        self._algorithm: Any = kind(pop_size=size, sampling=draw_population(self._space, rng, size))
        self._problem: Any = Problem(n_var=self._space.dimensions, n_obj=1, xl=-1.0, xu=1.0)
        self._algorithm.setup(self._problem, termination=NoTermination(), seed=int(rng.integers(2**31)))
        self._costs: list[Array] = []  # of all populations so far

    def __getstate__(self) -> dict[str, Any]:
        # some of pymoo's algorithms cannot be pickled: a copy is built again and learns the same costs
        return {**self.__dict__, "_algorithm": None, "_problem": None, "_individuals": None, "_asked": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        costs = self._costs
        self._begin()
        for earlier in costs:
            self.learn(self.propose(), earlier)
