"""Runs on problems of a suite, of a plugin's optimiser or any loop; scores of runs: targets reached, running times.

Only runs with the same method, function, dimension, budget and way with infeasible proposals are taken together.

Targets are an instance's own, from 32 to 0.25 above the cost of its true pose. Hansen et al., COCO: a platform for
comparing continuous optimizers in a black-box setting, 2021.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from posefit import settings
from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.problem import BudgetError, Problem, minimise
from posefit.fitting.validation import Checked, plugin_errors
from posefit.registry import registry
from posefit.statistics.profiles import expected_running_time, hits
from posefit.suites.functions import suite_function
from posefit.suites.problem import EVALUATIONS, TARGETS

RNG_STREAM = 2027  # part of the seed of every search


@dataclass(frozen=True, eq=False)
class SuiteRun:
    """The run of a method on a problem."""

    suite: str
    method: str
    settings: Mapping[str, Any]
    function: int
    dimension: int
    instance: int
    seed: int
    budget: int  # of evaluations
    infeasible: str  # the way with infeasible proposals: see `SuiteCost`
    truth_cost: float
    targets: Array = field(repr=False)  # (t,) costs, falling
    # (k,) of the trace, the last of the run at its end
    evaluations: Array = field(repr=False)
    costs: Array = field(repr=False)  # (k,)
    looked: bool = False  # whether the method read the silhouette, see `Problem.look`

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

    `evaluations` becomes the problem's budget; by default it keeps its own, or has 100 for each dimension.

    Raises ValueError where there is no such optimiser or setting, where the budget does not hold one population, and
    where the plugin breaks a rule of optimisers; ImportError where a library it needs is not installed.
    """
    if evaluations is None:
        evaluations = problem.budget or EVALUATIONS * problem.dimension
    problem.budget = evaluations
    space = problem.space
    rng = np.random.default_rng(
        [RNG_STREAM, seed, problem.id_function, problem.instance, problem.dimension]
    )
    factory = registry().optimiser(method)
    chosen = settings.check(method, factory, chosen or {})
    with plugin_errors(
        f"optimiser {method}", "construction", (BudgetError, ImportError)
    ):
        optimiser = factory(
            space, rng, **settings.planned(factory, chosen, evaluations)
        )
    guarded = Checked(optimiser, f"optimiser {method}", space, evaluations)
    minimise(problem, guarded, budget_known=True)
    return run_of(problem, method, chosen, seed=seed, budget=evaluations)


def run_of(
    problem: Problem,
    method: str,
    chosen: Mapping[str, Any] | None = None,
    *,
    seed: int = 0,
    budget: int | None = None,
) -> SuiteRun:
    """Return the run that any loop has made on a problem, by the name of its method and its settings.

    `budget` is the problem's where it has one. Raises ValueError where nothing feasible was evaluated, or more than the
    budget.
    """
    if not len(problem.points):
        raise InputError(
            f"{problem.id}: {method} must propose something feasible, got {problem.evaluations} rejected"
        )
    if (budget := problem.budget if budget is None else budget) is None:
        raise InputError(
            f"{problem.id}: budget must be known, here or of the problem, got none"
        )
    if problem.evaluations > budget:
        raise InputError(
            f"{problem.id}: evaluations must be at most {budget}, the budget, got {problem.evaluations}"
        )
    evaluations, costs = problem.trace
    return SuiteRun(
        suite=problem.suite,
        method=method,
        settings=dict(chosen or {}),
        function=problem.id_function,
        dimension=problem.dimension,
        instance=problem.instance,
        seed=seed,
        budget=budget,
        infeasible=problem.infeasible,
        truth_cost=problem.truth_cost,
        targets=problem.targets,
        evaluations=evaluations,
        costs=costs,
        looked=problem.looked,
    )


ALL = 0  # the number that stands for all functions together
# of the targets above the true pose's cost, those with an expected running time
SHOWN = (16.0, 4.0, 1.0, 0.25)


@dataclass(frozen=True)
class SuiteScore:
    """The score of runs of one method with one budget on one function in one dimension."""

    method: str
    function: int
    name: str
    dimension: int
    budget: int  # evaluations that a run could have had
    # the way with infeasible proposals: see `posefit.suites.problem.SuiteCost`
    infeasible: str
    looked: bool  # whether the method read silhouettes, where the others search blind
    runs: int
    # median of the best costs above the true poses'; below 0 where searches find lower
    # ones
    above: float
    reached: float  # share of runs and targets
    # expected evaluations to so much above the true pose's cost; None for never. Of all functions there are none: a
    # mean over them would be that of the hardest
    running_times: dict[float, float | None]


def suite_scores(runs: Iterable[SuiteRun]) -> list[SuiteScore]:
    """Return the scores of runs, by dimension, function and method, the best first, and after them those that look.

    In a dimension with several functions those of all together come first, as function 0. Methods with other settings
    are other methods; runs with another budget, or with another way with what is not feasible, have a score of their
    own. Raises ValueError where there is no run.
    """
    groups: dict[tuple[int, int, str, int, str], list[SuiteRun]] = {}
    for run in runs:
        for function in (run.function, ALL):
            key = run.dimension, function, method_name(run), run.budget, run.infeasible
            groups.setdefault(key, []).append(run)
    if not groups:
        raise InputError("runs must be at least one, got none")
    pairs = {(dimension, function) for dimension, function, *_ in groups}
    several = {
        dimension
        for dimension, _ in pairs
        if sum(other == dimension for other, _ in pairs) > 2
    }
    scores = [
        _score(method, function, group)
        for (dimension, function, method, *_), group in groups.items()
        if function != ALL or dimension in several
    ]
    return sorted(scores, key=_rank)


def _rank(score: SuiteScore) -> tuple[Any, ...]:
    best_first = -score.reached, score.above
    return (
        score.dimension,
        score.function,
        score.looked,
        *best_first,
        score.method,
        score.budget,
        score.infeasible,
    )


def method_name(run: SuiteRun) -> str:
    """Return a run's method with its settings, marked where it looks."""
    chosen = ", ".join(
        [f"{name}={value}" for name, value in sorted(run.settings.items())]
        + ["looks"] * run.looked
    )
    return f"{run.method} ({chosen})" if chosen else run.method


def _score(method: str, function: int, runs: Sequence[SuiteRun]) -> SuiteScore:
    """Return the score of runs that differ only in their instances, seeds and functions."""
    reached = np.array(
        [hits((run.evaluations, run.costs), run.targets) for run in runs]
    )
    used = np.array([run.evaluations[-1] for run in runs])
    times = expected_running_time(reached, used)
    shown = () if function == ALL else SHOWN
    places = [int(np.flatnonzero(above == TARGETS)[0]) for above in shown]
    return SuiteScore(
        method=method,
        function=function,
        name="all functions" if function == ALL else suite_function(function).name,
        dimension=runs[0].dimension,
        budget=runs[0].budget,
        infeasible=runs[0].infeasible,
        looked=runs[0].looked,
        runs=len(runs),
        above=float(np.median([run.cost - run.truth_cost for run in runs])),
        reached=float(np.isfinite(reached).mean()),
        running_times={
            above: float(times[place]) if np.isfinite(times[place]) else None
            for above, place in zip(shown, places, strict=True)
        },
    )
