"""An optimiser of a plugin on a problem of a suite."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from posefit import settings
from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.optimiser import BudgetError, minimise
from posefit.fitting.validation import CheckedOptimiser, plugin_errors
from posefit.registry import registry
from posefit.suites.problem import EVALUATIONS, Problem

RNG_STREAM = 2027  # part of the seed of every search


@dataclass(frozen=True, eq=False)
class SuiteRun:
    """The run of a method on a problem."""

    method: str
    settings: Mapping[str, Any]
    function: int
    dimension: int
    instance: int
    seed: int
    budget: int  # of evaluations
    infeasible: str  # the way with infeasible proposals: see `Problem`
    best_known: float
    targets: Array = field(repr=False)  # (t,) costs, falling
    evaluations: Array = field(repr=False)  # (k,) of the trace, the last of the run at its end
    costs: Array = field(repr=False)  # (k,)

    @property
    def cost(self) -> float:
        """The best cost."""
        return float(self.costs[-1])


def run_on(
    problem: Problem,
    method: str,
    chosen: Mapping[str, Any] | None = None,
    *,
    evaluations: int | None = None,
    seed: int = 0,
) -> SuiteRun:
    """Return the run of an optimiser, by its name, on a problem within a budget; the same for the same seed.

    Raises ValueError where there is no such optimiser or setting, where the budget does not hold one population, and
    where the plugin breaks a rule of optimisers; ImportError where a library it needs is not installed.
    """
    evaluations = EVALUATIONS * problem.dimension if evaluations is None else evaluations
    chosen, space = dict(chosen or {}), problem.space
    rng = np.random.default_rng([RNG_STREAM, seed, problem.id_function, problem.instance, problem.dimension])
    factory = registry().optimiser(method)
    settings.check(method, factory, chosen)
    with plugin_errors(f"optimiser {method}", "construction", None, (BudgetError, ImportError)):
        optimiser = factory(space, rng, **settings.planned(factory, chosen, evaluations))
    guarded = CheckedOptimiser(optimiser, space, f"optimiser {method}", None, evaluations)
    minimise(problem.evaluate, guarded, evaluations, budget_known=True)
    if not len(problem.trace[0]):
        raise InputError(f"{problem.id}: {method} must propose something feasible, got {problem.evaluations} rejected")
    return SuiteRun(
        method,
        chosen,
        problem.id_function,
        problem.dimension,
        problem.instance,
        seed,
        evaluations,
        problem.infeasible,
        problem.best_known,
        problem.targets,
        *problem.trace,
    )
