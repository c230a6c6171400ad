"""A problem of a suite as one of pymoo's, evaluated a population at a time.

J. Blank, K. Deb, pymoo: multi-objective optimization in Python, IEEE Access 8, 2020.
"""

from typing import Any, final

from pymoo.core.problem import Problem as PymooProblem

from posefit.arrays import Array
from posefit.suites.problem import Problem as SuiteProblem


@final
class Problem(PymooProblem):
    """A problem with one objective, no constraint and the bounds -1 and 1.

    What is not feasible costs what `problem` makes of it, by default what its repair costs. `problem` has the trace;
    a budget of it is not the termination of `minimize`, which would end by an error.
    """

    def __init__(self, problem: SuiteProblem) -> None:
        super().__init__(n_var=problem.dimension, n_obj=1, xl=-1.0, xu=1.0, vtype=float)
        self.problem = problem

    def _evaluate(self, x: Array, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        out["F"] = self.problem.evaluate(x)

    def _calc_pareto_front(self, *args: Any, **kwargs: Any) -> "list[float] | None":
        return None if self.problem.optimum is None else [self.problem.optimum]
