"""A problem of a suite as a benchmark of OptunaHub, for studies of Optuna.

Y. Ozaki et al., OptunaHub: a platform for black-box optimization, 2025, arXiv 2510.02798.
"""

from typing import Any, final

import optuna
import optunahub

from posefit.suites.problem import Problem as SuiteProblem


@final
class Problem(optunahub.benchmarks.BaseProblem):
    """A problem whose parameters x0, x1, ... are floats of [-1, 1], to be minimised.

    A trial that is not feasible is no failure: it costs what `problem` makes of it, by default what its repair costs.
    `problem` has the trace. Its budget, if it has one, ends a study by an error: `n_trials` is the way to end it.
    """

    def __init__(self, problem: SuiteProblem) -> None:
        self.problem = problem
        box = optuna.distributions.FloatDistribution(-1.0, 1.0)
        self._space: dict[str, optuna.distributions.BaseDistribution] = {f"x{k}": box for k in range(problem.dimension)}

    @property
    def search_space(self) -> dict[str, optuna.distributions.BaseDistribution]:
        """The distribution of each parameter."""
        return self._space.copy()

    @property
    def directions(self) -> list[optuna.study.StudyDirection]:
        """To minimise, once."""
        return [optuna.study.StudyDirection.MINIMIZE]

    def evaluate(self, params: dict[str, Any]) -> float:
        """Return the cost of parameters."""
        return float(self.problem([params[name] for name in self._space]))
