"""Problems of posefit's suites, as problems of other benchmarking tools.

| tool | function | result |
|---|---|---|
| IOHexperimenter | ioh_problem, close_log | a problem for its loggers |
| OptunaHub | optunahub_problem | a benchmark for studies of Optuna |
| pymoo | pymoo_problem | a problem, evaluated a population at a time |
| Nevergrad | nevergrad_function | a function of its benchmarks |

The problem's `infeasible` decides the cost of an infeasible proposal. Each result has
an attribute `problem`, the suite's problem with its trace. Let the tool hold the
budget: a problem's budget ends the tool's loop with an error.

Example:
    >>> import posefit
    >>> from posefit_bridges.problems import pymoo_problem
    >>> problem = posefit.suite("posefit-2026.3", 1, 10_000, 9)
    >>> pymoo_problem(problem).n_var
    9
"""

from pathlib import Path
from typing import Any

from posefit.arrays import Array
from posefit.fitting.problem import Problem
from posefit.suites.functions import SUITE
from posefit.suites.problem import Infeasible, suite

# 26301 is function 1 of posefit-2026.3; IOHexperimenter's functions have other numbers
FIRST_IOH_ID = 26_300


def ioh_problem(problem: Problem) -> Any:
    """Return a problem of IOHexperimenter.

    It has the number, the instance, the bounds and, if known, the optimum. Its name
    begins with the suite's name. `close_log` writes that name into the log.

    Evaluations are counted by the suite's problem, whose budget holds here too; `reset`
    resets both. J. de Nobel et al., IOHexperimenter: benchmarking platform for
    iterative optimization heuristics, Evolutionary Computation 32(3), 2024.
    """
    from ioh import problem as problems
    from ioh.iohcpp import RealBounds, RealSolution

    d = problem.dimension
    name = f"{problem.suite}_{problem.function.name.replace(' ', '_')}"
    optimum = RealSolution([], float("nan"))
    if problem.optimum is not None:
        optimum = RealSolution(problem.made.truth, problem.truth_cost)

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


def close_log(logger: Any, suite: str = SUITE) -> None:
    """Close a logger of IOHexperimenter, and name the suite in its log.

    ioh 0.4 itself writes `unknown_suite` for problems of other packages.

    Args:
        logger: An `ioh.logger.Analyzer`.
        suite: The suite of its problems.
    """
    logger.close()
    for path in Path(logger.output_directory).glob("IOHprofiler_f*.json"):
        text = path.read_text("utf-8")
        # ioh writes nan, which is not JSON, so replace the text alone
        text = text.replace('"suite": "unknown_suite"', f'"suite": "{suite}"', 1)
        path.write_text(text, "utf-8")


def optunahub_problem(problem: Problem) -> Any:
    """Return a problem of OptunaHub, to be minimised.

    Its parameters x0, x1, ... are floats in [-1, 1]. An infeasible trial does not count
    as failed. Y. Ozaki et al., OptunaHub: a platform for black-box optimization, 2025,
    arXiv 2510.02798.
    """
    from optuna.distributions import FloatDistribution
    from optuna.study import StudyDirection
    from optunahub.benchmarks import BaseProblem

    box: Any = {f"x{k}": FloatDistribution(-1.0, 1.0) for k in range(problem.dimension)}

    class OptunaHubProblem(BaseProblem):
        search_space = box
        # a plain list, as OptunaHub declares it
        directions = [StudyDirection.MINIMIZE]  # noqa: RUF012

        def __init__(self) -> None:
            self.problem = problem

        def evaluate(self, params: dict[str, Any]) -> float:
            return float(problem([params[name] for name in box]))

    return OptunaHubProblem()


def pymoo_problem(problem: Problem) -> Any:
    """Return a problem of pymoo: one objective, no constraint, bounds -1 and 1.

    Its Pareto front is the optimum, if that is known.
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
            if problem.optimum is None:
                return None
            return [problem.optimum]

    return SilhouetteProblem()


def nevergrad_function(
    function: int = 1,
    instance: int = 0,
    dimension: int = 9,
    infeasible: Infeasible = "repair",
) -> Any:
    """Return a problem of the suite as a function of Nevergrad.

    Each copy of it counts separately. At its end, an experiment evaluates the
    optimiser's recommendation once more.
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
