"""Problems of posefit's suites as those of other tools, where benchmarks are run.

| tool | function | what it returns |
|---|---|---|
| IOHexperimenter | ioh_problem | a problem for its loggers |
| OptunaHub | optunahub_problem | a benchmark for studies of Optuna |
| pymoo | pymoo_problem | a problem, evaluated a population at a time |
| Nevergrad | nevergrad_function | a function of its benchmarks |

What is not feasible costs what the problem's `infeasible` says. Each has `problem`, the suite's, with the trace; the
budget is the tool's, since that of a problem ends the tool's loop by an error.

>>> import posefit
>>> from posefit_bridges.problems import pymoo_problem
>>> pymoo_problem(posefit.suite("posefit-2026.3", function=1, instance=10_000, dimension=9)).n_var
9
"""

from typing import Any

from posefit.arrays import Array
from posefit.fitting.problem import Problem
from posefit.suites.functions import SUITE
from posefit.suites.problem import Infeasible, suite

# function 1 of posefit-2026.3 is 26301: none of IOHexperimenter's own has such a number
FIRST_IOH_ID = 26_300


def ioh_problem(problem: Problem) -> Any:
    """Return a problem of IOHexperimenter with the number, instance, bounds and, where known, the optimum.

    Its name begins with that of the suite: to a log's own field for it, `unknown_suite`, ioh 0.4 lets no problem from
    elsewhere write.

    Its count is the problem's, whose budget holds here too, and its `reset` resets both. J. de Nobel et al.,
    IOHexperimenter: benchmarking platform for iterative optimization heuristics, Evolutionary Computation 32(3), 2024.
    """
    from ioh import problem as problems
    from ioh.iohcpp import RealBounds, RealSolution

    d = problem.dimension
    name = f"{problem.suite}_{problem.function.name.replace(' ', '_')}"
    known = problem.optimum is not None
    optimum = (
        RealSolution(problem.made.truth, problem.truth_cost)
        if known
        else RealSolution([], float("nan"))
    )

    class IOHProblem(problems.RealSingleObjective):
        def __init__(self) -> None:
            super().__init__(
                name,
                d,
                problem.instance,
                bounds=RealBounds(d, -1.0, 1.0),
                optimum=optimum,
            )
            self.set_id(FIRST_IOH_ID + problem.id_function)
            self.problem = problem

        def evaluate(self, proposal: Array) -> float:
            return float(problem(proposal))

        def reset(self) -> None:
            super().reset()
            problem.reset()

    return IOHProblem()


def optunahub_problem(problem: Problem) -> Any:
    """Return a problem of OptunaHub whose parameters x0, x1, ... are floats of [-1, 1], to be minimised.

    A trial that is not feasible is no failure. Y. Ozaki et al., OptunaHub: a platform for black-box optimization, 2025,
    arXiv 2510.02798.
    """
    from optuna.distributions import FloatDistribution
    from optuna.study import StudyDirection
    from optunahub.benchmarks import BaseProblem

    box: Any = {f"x{k}": FloatDistribution(-1.0, 1.0) for k in range(problem.dimension)}

    class OptunaHubProblem(BaseProblem):
        search_space = box
        directions = [StudyDirection.MINIMIZE]  # noqa: RUF012, as OptunaHub has it

        def __init__(self) -> None:
            self.problem = problem

        def evaluate(self, params: dict[str, Any]) -> float:
            return float(problem([params[name] for name in box]))

    return OptunaHubProblem()


def pymoo_problem(problem: Problem) -> Any:
    """Return a problem of pymoo with one objective, no constraint and the bounds -1 and 1.

    Its Pareto front is the optimum, where that is known.
    """
    from pymoo.core.problem import Problem as PymooProblem

    class SilhouetteProblem(PymooProblem):
        def __init__(self) -> None:
            super().__init__(
                n_var=problem.dimension, n_obj=1, xl=-1.0, xu=1.0, vtype=float
            )
            self.problem = problem

        def _evaluate(
            self, x: Array, out: dict[str, Any], *args: Any, **kwargs: Any
        ) -> None:
            out["F"] = problem(x)

        def _calc_pareto_front(self, *args: Any, **kwargs: Any) -> list[float] | None:
            return None if problem.optimum is None else [problem.optimum]

    return SilhouetteProblem()


def nevergrad_function(
    function: int = 1,
    instance: int = 0,
    dimension: int = 9,
    infeasible: Infeasible = "repair",
) -> Any:
    """Return a problem of the suite, by its numbers, as a function of Nevergrad: each copy of it counts for itself.

    An experiment evaluates what the optimiser recommends once more at its end.
    """
    import nevergrad as ng
    from nevergrad.functions import ExperimentFunction

    class SilhouetteFunction(ExperimentFunction):
        def __init__(
            self, function: int, instance: int, dimension: int, infeasible: Infeasible
        ) -> None:
            self.problem = suite(
                SUITE, function, instance, dimension, infeasible=infeasible
            )
            box = ng.p.Array(init=self.problem.initial_solution, lower=-1.0, upper=1.0)
            super().__init__(self.problem, box.set_name(""))

    return SilhouetteFunction(function, instance, dimension, infeasible)
