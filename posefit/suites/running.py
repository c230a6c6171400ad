"""Runs of an optimiser, or of any loop, on problems of a suite, and scores of runs.

A score summarises the runs with the same method, function, dimension, budget and
treatment of infeasible proposals. It has the share of targets that were reached, and
expected running times.

The targets of an instance are from 32 to 0.25 above the cost of its true pose.
Hansen et al., COCO: a platform for comparing continuous optimizers in a black-box
setting, 2021.
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
    """The run of a method on a problem.

    Attributes:
        suite: The suite's name.
        method: The method's name.
        settings: The method's settings by name.
        function: The function's number.
        dimension: The problem's dimension.
        instance: The instance's number.
        seed: The seed of the run.
        budget: The most evaluations.
        infeasible: The treatment of infeasible proposals, see `SuiteCost`.
        truth_cost: The cost of the true pose.
        targets: The costs of the targets (t,), in descending order.
        evaluations: Evaluations of the trace (k,), the last one at the end of the run.
        costs: The best cost after each of these (k,).
        looked: Whether the method read the silhouette, see `Problem.look`.
    """

    suite: str
    method: str
    settings: Mapping[str, Any]
    function: int
    dimension: int
    instance: int
    seed: int
    budget: int
    infeasible: str
    truth_cost: float
    targets: Array = field(repr=False)
    evaluations: Array = field(repr=False)
    costs: Array = field(repr=False)
    looked: bool = False

    @property
    def cost(self) -> float:
        """The best cost of the run."""
        return float(self.costs[-1])


def run_on(
    problem: Problem,
    method: str,
    chosen: Mapping[str, Any] | None = None,
    *,
    evaluations: int | None = None,
    seed: int = 0,
) -> SuiteRun:
    """Run an optimiser on a problem. The same seed gives the same run.

    Args:
        problem: The problem, with nothing evaluated yet.
        method: The optimiser's name.
        chosen: Its settings by name.
        evaluations: The problem's new budget. By default it is the problem's present
            one, or 100 per dimension if it has none.
        seed: The seed of the run.

    Returns:
        The run.

    Raises:
        ValueError: There is no such optimiser or setting, one population takes more
            than the budget, or the plugin breaks a rule of optimisers.
        ImportError: The optimiser needs a library that is not installed.
    """
    if evaluations is None:
        evaluations = problem.budget or EVALUATIONS * problem.dimension
    problem.budget = evaluations
    space = problem.space
    # no two problems of a suite get the same random numbers
    rng = np.random.default_rng(
        [RNG_STREAM, seed, problem.id_function, problem.instance, problem.dimension]
    )
    factory = registry().optimiser(method)
    chosen = settings.check(method, factory, chosen or {})
    plugin = f"optimiser {method}"
    with plugin_errors(plugin, "construction", (BudgetError, ImportError)):
        planned = settings.planned(factory, chosen, evaluations)
        optimiser = factory(space, rng, **planned)
    guarded = Checked(optimiser, plugin, space, evaluations)
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
    """Return the run of any loop that has evaluated a problem.

    Args:
        problem: The problem, after the run.
        method: The method's name.
        chosen: Its settings by name.
        seed: The seed of the run.
        budget: The most evaluations that the run could have had, by default the
            problem's budget.

    Returns:
        The run.

    Raises:
        ValueError: Nothing feasible was evaluated, the budget is unknown, or there were
            more evaluations than the budget.

    Example:
        >>> import numpy as np
        >>> import posefit
        >>> problem = posefit.suite("posefit-2026.3", 1, 0, 9, budget=10)
        >>> _ = problem(np.zeros((10, 9)))
        >>> posefit.run_of(problem, "my search").method
        'my search'
    """
    # with `infeasible="reject"` every proposal may have cost infinity
    if not len(problem.points):
        raise InputError(
            f"{problem.id}: {method} must propose something feasible, "
            f"got {problem.evaluations} rejected"
        )
    if budget is None:
        budget = problem.budget
    if budget is None:
        raise InputError(
            f"{problem.id}: budget must be given, here or in the problem, got none"
        )
    # a longer run would be compared with shorter ones
    if problem.evaluations > budget:
        raise InputError(
            f"{problem.id}: evaluations must be at most {budget}, the budget, "
            f"got {problem.evaluations}"
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


ALL = 0  # the number of all functions together
# the targets, above the true pose's cost, with an expected running time
SHOWN = (16.0, 4.0, 1.0, 0.25)


@dataclass(frozen=True)
class SuiteScore:
    """The score of runs of one method with one budget on one function in one dimension.

    Attributes:
        method: The method with its settings.
        function: The function's number, 0 for all functions together.
        name: The function's name.
        dimension: The dimension.
        budget: The most evaluations of a run.
        infeasible: The treatment of infeasible proposals, see
            `posefit.suites.problem.SuiteCost`.
        looked: Whether the method read silhouettes, and not only costs.
        runs: The number of runs.
        above: The median of the best costs above the true poses'. It is below 0 if
            searches find lower costs.
        reached: The share of runs and targets that were reached.
        running_times: The expected evaluations until the cost is this much above the
            true pose's, None for never. All functions together have none, because the
            hardest function would decide their mean.
    """

    method: str
    function: int
    name: str
    dimension: int
    budget: int
    infeasible: str
    looked: bool
    runs: int
    above: float
    reached: float
    running_times: dict[float, float | None]


def suite_scores(runs: Iterable[SuiteRun]) -> list[SuiteScore]:
    """Return the scores of runs, by dimension and function, the best method first.

    Methods that looked at the silhouettes come after the others. In a dimension with
    several functions, the scores of all functions together come first, as function 0. A
    method with other settings is another method. Runs with different budgets or
    treatments of infeasible proposals have separate scores.

    Args:
        runs: The runs.

    Returns:
        The scores.

    Raises:
        ValueError: There are no runs.

    Example:
        >>> import numpy as np
        >>> import posefit
        >>> problem = posefit.suite("posefit-2026.3", 1, 0, 9, budget=10)
        >>> _ = problem(np.zeros((10, 9)))
        >>> scores = posefit.suite_scores([posefit.run_of(problem, "my search")])
        >>> scores[0].runs
        1
    """
    # only runs of the same problems under the same rules can be compared
    groups: dict[tuple[int, int, str, int, str], list[SuiteRun]] = {}
    for run in runs:
        for function in (run.function, ALL):
            key = run.dimension, function, method_name(run), run.budget, run.infeasible
            groups.setdefault(key, []).append(run)
    if not groups:
        raise InputError("runs must contain at least one run, got none")
    functions_of: dict[int, set[int]] = {}
    for dimension, function, *_ in groups:
        functions_of.setdefault(dimension, set()).add(function)
    scores = []
    for (dimension, function, method, *_), group in groups.items():
        # `ALL` and one function would be the same score twice
        is_repeated = function == ALL and len(functions_of[dimension]) == 2
        if not is_repeated:
            scores.append(_score(method, function, group))
    return sorted(scores, key=_rank)


def _rank(score: SuiteScore) -> tuple[Any, ...]:
    """Return the key by which scores are sorted."""
    return (
        score.dimension,
        score.function,
        score.looked,
        -score.reached,
        score.above,
        score.method,
        score.budget,
        score.infeasible,
    )


def method_name(run: SuiteRun) -> str:
    """Return a run's method with its settings, and "looks" if it read silhouettes."""
    details = [f"{name}={value}" for name, value in sorted(run.settings.items())]
    if run.looked:
        details.append("looks")
    if details:
        return f"{run.method} ({', '.join(details)})"
    return run.method


def _score(method: str, function: int, runs: Sequence[SuiteRun]) -> SuiteScore:
    """Return the score of runs that differ only in instances, seeds and functions."""
    evaluations_to_targets = []
    used = []
    above_truth = []
    for run in runs:
        run_hits = hits((run.evaluations, run.costs), run.targets)
        evaluations_to_targets.append(run_hits)
        used.append(run.evaluations[-1])
        above_truth.append(run.cost - run.truth_cost)
    reached = np.array(evaluations_to_targets)
    name = "all functions"
    running_times: dict[float, float | None] = {}
    # the hardest function would decide the running time of all functions together
    if function != ALL:
        name = suite_function(function).name
        times = expected_running_time(reached, np.array(used))
        for above in SHOWN:
            time = times[int(np.flatnonzero(above == TARGETS)[0])]
            running_times[above] = float(time) if np.isfinite(time) else None
    return SuiteScore(
        method=method,
        function=function,
        name=name,
        dimension=runs[0].dimension,
        budget=runs[0].budget,
        infeasible=runs[0].infeasible,
        looked=runs[0].looked,
        runs=len(runs),
        above=float(np.median(above_truth)),
        reached=float(np.isfinite(reached).mean()),
        running_times=running_times,
    )
