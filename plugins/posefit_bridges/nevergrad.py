"""A problem of the suite as a function of Nevergrad's benchmarks; `nevergrad_plan.py` has a plan of many.

J. Rapin, O. Teytaud, Nevergrad, a gradient-free optimization platform, 2018.
"""

from typing import final

import nevergrad
from nevergrad.functions import ExperimentFunction

from posefit.suites.functions import SUITE
from posefit.suites.problem import Infeasible, suite


@final
class Problem(ExperimentFunction):
    """A problem of the suite, by its numbers: experiments copy it, and each copy counts for itself.

    What is not feasible costs by default what its repair costs. `problem` has the trace; an experiment evaluates what
    the optimiser recommends once more at its end.
    """

    def __init__(
        self, function: int = 1, instance: int = 0, dimension: int = 9, infeasible: Infeasible = "repair"
    ) -> None:
        self.problem = suite(SUITE, function, instance, dimension, infeasible=infeasible)
        box = nevergrad.p.Array(init=self.problem.initial_solution, lower=-1.0, upper=1.0)
        super().__init__(self.problem, box.set_name(""))
