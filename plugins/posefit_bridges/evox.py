"""A problem of a suite as one of EvoX, whose populations are tensors on any device.

B. Huang et al., EvoX: a distributed GPU-accelerated framework for scalable evolutionary computation, IEEE Transactions
on Evolutionary Computation, 2024.
"""

from typing import final

import torch
from evox.core import Problem as EvoxProblem

from posefit.suites.problem import Problem as SuiteProblem


@final
class Problem(EvoxProblem):
    """A problem to be minimised between `-torch.ones(d)` and `torch.ones(d)`, for workflows as they are or compiled.

    A population of single precision is evaluated as it is, in double precision; `problem` has the trace of these costs,
    and what EvoX gets is rounded to the population's precision. What is not feasible costs what `problem` makes of it,
    by default what its repair costs.
    """

    def __init__(self, problem: SuiteProblem) -> None:
        super().__init__()
        self.problem = problem

    @torch.compiler.disable
    def evaluate(self, pop: torch.Tensor) -> torch.Tensor:
        """Return the costs (n,) of a population (n, d), in its precision and on its device."""
        costs: torch.Tensor = self.problem.evaluate(pop.detach())
        return costs
