"""A problem of a suite as one of IOHexperimenter's, `problem.ioh()`, for its loggers and what else takes one.

J. de Nobel et al., IOHexperimenter: benchmarking platform for iterative optimization heuristics, Evolutionary
Computation 32(3), 2024. `pip install posefit[ioh]`.
"""

from typing import TYPE_CHECKING, final

import numpy as np
from ioh import problem as problems
from ioh.iohcpp import RealBounds, RealSolution

from posefit.arrays import Array

if TYPE_CHECKING:
    from posefit.suites.problem import Problem

FIRST_ID = 26_300  # function 1 of posefit-2026.3 is 26301: none of IOHexperimenter's own has such a number


@final
class IOHProblem(problems.RealSingleObjective):
    """A problem with the number, instance, bounds and, where it is known, the optimum of the suite's.

    Proposals that are not feasible cost what `problem` makes of them. A budget of `problem` holds here, too.
    """

    def __init__(self, problem: "Problem") -> None:
        d, name = problem.dimension, f"{problem.suite}_{problem.function.name.replace(' ', '_')}"
        unknown = problem.optimum is None
        optimum = RealSolution([], np.nan) if unknown else RealSolution(problem.made.truth, problem.truth_cost)
        super().__init__(name, d, problem.instance, bounds=RealBounds(d, -1.0, 1.0), optimum=optimum)
        self.set_id(FIRST_ID + problem.id_function)
        self.problem = problem

    def evaluate(self, proposal: Array) -> float:
        """Return the cost of a proposal (d,)."""
        return float(self.problem(proposal))

    def reset(self) -> None:
        """Forget all evaluations, here and of `problem`."""
        super().reset()
        self.problem.reset()
