"""A function to minimise, and the loop in which an optimiser minimises it.

    from posefit import Problem, minimise, optimiser

    problem = Problem(cost, space, budget=2440)
    minimise(problem, optimiser("sapso")(space, rng))
    print(problem.best_cost, problem.evaluations)

Everything that posefit searches is a problem: a frame of a track, a person's build, a
numbered instance of a suite, an episode of an environment. Only the problem counts
its evaluations and remembers its best proposal.
"""

import warnings
from collections.abc import Callable
from copy import copy
from pickle import PicklingError
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.box import Space, draw_population
from posefit.fitting.check import whole
from posefit.fitting.dlpack import as_numpy
from posefit.fitting.optimiser import Optimiser
from posefit.reading import quoted

# Returns the costs (n,) of proposals (n, d); lower is better.
Cost = Callable[[Array], Array]


class BudgetError(InputError):
    """A budget is smaller than one population."""


class BudgetSpentError(Exception):
    """A call needs more evaluations than a problem's budget has left.

    Example:
        >>> import numpy as np
        >>> import posefit
        >>> problem = posefit.suite("posefit-2026.3", 1, 0, 9, budget=2)
        >>> problem(np.zeros((3, 9)))
        Traceback (most recent call last):
        posefit.fitting.problem.BudgetSpentError: ...
    """


def minimise(
    problem: "Problem", optimiser: Optimiser, *, budget_known: bool = False
) -> "Problem":
    """Minimise a problem with an optimiser, and return the problem.

    The search ends when the optimiser proposes nothing, or when its next population
    is larger than what is left of the budget; that population is not evaluated. If the
    optimiser stops before half of the budget is used, a warning is given, because its
    schedule may not know the budget. With `budget_known` there is no warning.

    Args:
        problem: What to minimise; it must have a budget.
        optimiser: An object with `ask` and `tell`, built for `problem.space`.
        budget_known: Whether the optimiser was built with the budget.

    Returns:
        The same problem: `problem.best`, `problem.best_cost`, `problem.trace`.

    Raises:
        BudgetError: The budget is smaller than the first population.
        InputError: The problem has no budget, the optimiser proposed nothing, or no
            cost was a finite number.

    Example:
        >>> import numpy as np
        >>> from posefit import minimise, optimiser, suite
        >>> problem = suite(
        ...     "posefit-2026.3", function=1, instance=17, dimension=9, budget=200
        ... )
        >>> cma = optimiser("cma")(problem.space, np.random.default_rng(0))
        >>> minimise(problem, cma).evaluations
        200
    """
    if problem.budget is None:
        raise InputError(f"{problem.id} must have a budget to be minimised, got none")
    before = problem.evaluations
    while len(proposals := optimiser.ask()):
        if len(proposals) > problem.remaining_evaluations:
            break
        costs = problem(proposals)  # SAPSO A1.2a
        optimiser.tell(proposals, costs)
    used = problem.evaluations - before
    if not used and not len(proposals):
        raise InputError("the optimiser must propose a population, got an empty one")
    if not used:
        raise BudgetError(
            f"evaluations must be at least {len(proposals)}, one population, "
            f"got {problem.remaining_evaluations:.0f}"
        )
    if not np.isfinite(problem.best_cost):
        raise InputError(
            f"costs must be finite, got only nan or infinity in {used} evaluations"
        )
    if not budget_known and 2 * problem.evaluations < problem.budget:
        warnings.warn(
            f"the optimiser ended its search after {used} of {problem.budget} "
            "evaluations: if its schedule follows the budget, pass the budget to its "
            "factory, as factory(space, rng, evaluations=...) or iterations=...",
            stacklevel=2,
        )
    return problem  # SAPSO A1.3


@final
class Problem:
    """A function to minimise over proposals in the box [-1, 1]^d.

    Call it with proposals (n, d) for their costs (n,), or with one proposal (d,) for a
    float. Every proposal counts as one evaluation, whether it is feasible or not.

    A problem also has the attributes of its cost function, such as `problem.decode` in
    a frame and `problem.look` in a suite. Where COCO's problems have the same
    attribute, it has COCO's name.

    Args:
        cost: Returns the costs (n,) of proposals (n, d).
        space: The box that an optimiser searches.
        budget: The largest number of evaluations; None for any number.
        repair: Moves infeasible proposals (n, d) before they are evaluated; by default
            they are not moved.
        noisy: Takes proposals (n, d) and the number of evaluations before them, and
            returns the costs (n,) that the optimiser gets; by default these are the
            costs without noise. The best and the trace are always without noise.
        targets: Costs to be reached, in descending order.
        id: Names the problem in messages.

    Raises:
        InputError: The budget is not a whole number above 0.

    Example:
        >>> import numpy as np
        >>> from posefit import Problem
        >>> from posefit.testing.toy import Toy, sphere
        >>> problem = Problem(sphere, Toy(2), budget=3)
        >>> problem(np.array([[0.3, 0.3], [1.0, 0.3]])).round(6).tolist()
        [0.0, 12.25]
        >>> problem.best.tolist(), problem.best_cost, problem.evaluations
        ([0.3, 0.3], 0.0, 2)
    """

    number_of_objectives = 1
    number_of_constraints = 0
    evaluations_constraints = 0

    def __init__(
        self,
        cost: Cost,
        space: Space,
        budget: int | None = None,
        *,
        repair: Callable[[Array], Array] | None = None,
        noisy: Callable[[Array, int], Array] | None = None,
        targets: Array | None = None,
        id: str = "problem",  # noqa: A002, COCO's name
    ) -> None:
        if budget is not None:
            whole("budget", budget, 1)
        self.cost = cost
        self.space = space
        self.budget = budget
        self.targets = np.empty(0) if targets is None else targets
        self.id = id
        self.index = 0  # the problem's place in a suite
        self._repair = repair
        self._noisy = noisy
        self.reset()

    def reset(self) -> None:
        """Forget all evaluations: the count, the best and the trace."""
        self.evaluations = 0
        self.best_cost = np.inf
        # each improvement: evaluations so far, the cost, and the proposal (d,)
        self._improvements: list[tuple[int, float, Array]] = []

    def __call__(self, proposals: Any) -> Any:
        """Return the costs (n,) of proposals (n, d), or the cost of one proposal (d,).

        Proposals may be an array of any library that supports DLPack; the costs are
        returned as an array of the same library.

        Raises:
            ValueError: The shape is wrong, or a number is not finite. Nothing is
                counted.
            BudgetSpentError: There are more proposals than evaluations left. Nothing is
                evaluated.
        """
        values, back = as_numpy("proposals", proposals)
        checked = self.checked(values)
        rows = checked.reshape(-1, self.dimension)
        if len(rows) > self.remaining_evaluations:
            raise BudgetSpentError(
                f"{self.id}: {self.remaining_evaluations:.0f} of {self.budget}"
                f" evaluations are left, got {len(rows)}"
            )
        if self._repair is not None:
            rows = self._repair(rows)
        # a copy, because a cost function that works in place would change the proposals
        # that are recorded
        costs = self.cost(rows.copy())
        if not isinstance(costs, np.ndarray) or costs.shape != (len(rows),):
            came = getattr(costs, "shape", type(costs).__name__)
            raise TypeError(
                f"cost must return an array of shape ({len(rows)},), got {came}"
            )
        measured = costs
        if self._noisy is not None:
            measured = self._noisy(rows, self.evaluations)
        self.count(rows, costs)
        if checked.ndim == 1:
            return float(measured[0])
        return back(measured)

    def count(self, rows: Array, costs: Array) -> None:
        """Count proposals (n, d) with costs (n,), and remember the best. SAPSO (5).

        A call does this itself. Use it if the costs are known already, as when one call
        evaluates several problems.
        """
        # nan < x is False, so nan never becomes the best
        for k in np.flatnonzero(costs < self.best_cost):  # SAPSO (5)
            if costs[k] < self.best_cost:
                self.best_cost = float(costs[k])
                used = self.evaluations + int(k) + 1
                self._improvements.append((used, self.best_cost, rows[k].copy()))
        self.evaluations += len(rows)

    def checked(self, proposals: object) -> Array:
        """Return proposals (d,) or (n, d) as float64; raise ValueError for others."""
        try:
            values = np.asarray(proposals)
            if values.dtype.kind == "c":
                raise InputError("proposals must be real, got complex numbers")
            checked = np.asarray(values, dtype=np.float64)
        except InputError:
            raise
        except (TypeError, ValueError):
            raise InputError(
                f"proposals must be numbers, got {quoted(proposals)}"
            ) from None
        d = self.dimension
        if checked.ndim not in (1, 2) or checked.shape[-1] != d:
            raise InputError(
                f"proposals must have shape ({d},) or (n, {d}), got {checked.shape}"
            )
        if not np.isfinite(checked).all():
            raise InputError("proposals must be finite, got nan or infinity")
        return checked

    @property
    def remaining_evaluations(self) -> float:
        """The number of evaluations left in the budget; infinite without a budget."""
        if self.budget is None:
            return np.inf
        return self.budget - self.evaluations

    @property
    def best(self) -> Array:
        """The best proposal (d,) so far, as it was evaluated.

        Raises:
            ValueError: No proposal has a finite cost yet.
        """
        if not self._improvements:
            raise InputError(
                f"{self.id} must have a finite cost before it has a best proposal,"
                f" got none in {self.evaluations} evaluations"
            )
        return self._improvements[-1][2].copy()

    @property
    def points(self) -> Array:
        """The proposals (k, d) that improved the best cost, as they were evaluated."""
        points = [point for _, _, point in self._improvements]
        return np.array(points).reshape(-1, self.dimension)

    @property
    def trace(self) -> tuple[Array, Array]:
        """The evaluations (k,) at which the best improved, and the best costs (k,).

        The trace begins with the first finite cost, and ends with the last evaluation,
        even if that improved nothing.
        """
        used = [float(used) for used, _, _ in self._improvements]
        costs = [cost for _, cost, _ in self._improvements]
        if used and used[-1] < self.evaluations:
            used.append(float(self.evaluations))
            costs.append(costs[-1])
        return np.array(used), np.array(costs)

    @property
    def dimension(self) -> int:
        """The dimension d of the box."""
        return self.space.dimensions

    @property
    def lower_bounds(self) -> Array:
        """The lower bounds (d,) of the box, all -1."""
        return np.full(self.dimension, -1.0)

    @property
    def upper_bounds(self) -> Array:
        """The upper bounds (d,) of the box, all 1."""
        return np.ones(self.dimension)

    @property
    def best_observed_fvalue1(self) -> float:
        """COCO's name for `best_cost`."""
        return self.best_cost

    @property
    def final_target_hit(self) -> bool:
        """Whether the last of the targets was reached."""
        return len(self.targets) > 0 and bool(self.best_cost <= self.targets[-1])

    @property
    def initial_solution(self) -> Array:
        """The proposal (d,) to start from: the prediction, or the middle of the box."""
        start = self.space.start
        if start is None:
            return np.zeros(self.dimension)
        return start.mean.copy()

    def initial_solution_proposal(self, restart: int = 0) -> Array:
        """Return the proposal (d,) to start from, or a random one for a restart."""
        if not restart:
            return self.initial_solution
        rng = np.random.default_rng([getattr(self, "instance", 0), restart])
        drawn: Array = draw_population(self.space, rng, 1)[0]
        return drawn

    def __getattr__(self, name: str) -> Any:
        # only called for attributes that a problem lacks; `cost` itself is missing in a
        # copy while it is made
        if name.startswith("_") or name == "cost" or not hasattr(self.cost, name):
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
        return getattr(self.cost, name)

    def __copy__(self) -> "Problem":
        """Return an independent problem with the same count, best and trace."""
        twin: Problem = object.__new__(Problem)
        twin.__dict__.update(
            self.__dict__, cost=copy(self.cost), _improvements=[*self._improvements]
        )
        return twin

    def __deepcopy__(self, memo: object) -> "Problem":
        return copy(self)

    def __getstate__(self) -> Any:
        raise PicklingError(
            f"{self.id} counts evaluations in its own process and cannot be sent to"
            " another: make it there, as with posefit.suite, or keep it in one"
            " process and evaluate whole populations with each call"
        )

    def __repr__(self) -> str:
        return f"<{self.id}: {self.evaluations} evaluations, best {self.best_cost:.4g}>"


@final
class Problems:
    """Several problems, one per row: counts and bests as arrays.

    The caller evaluates the proposals of all problems together, in one compiled call,
    and then counts them here.

    Args:
        count: The number of problems.
        dimension: The dimension of their proposals.

    Example:
        >>> from posefit import Problems
        >>> Problems(3, 9).best.shape
        (3, 9)
    """

    def __init__(self, count: int, dimension: int) -> None:
        self.evaluations = np.zeros(count, dtype=np.int64)
        self.best_costs = np.full(count, np.inf)
        self.best = np.zeros((count, dimension))
        self._makers: dict[int, Callable[[], Problem]] = {}

    def __len__(self) -> int:
        return len(self.evaluations)

    def __getitem__(self, row: int) -> Problem:
        """Return the problem of a row as a new `Problem`, without evaluations."""
        return self._makers[range(len(self))[row]]()

    def begin(self, row: int, make_problem: Callable[[], Problem]) -> None:
        """Reset the count and the best of a row; `make_problem` makes its problem."""
        self._makers[row] = make_problem
        self.evaluations[row] = 0
        self.best_costs[row] = np.inf

    def count(self, rows: NDArray[np.int64], proposals: Array, costs: Array) -> None:
        """Count proposals (m, k, d) with costs (m, k) in rows (m,); keep the best."""
        self.evaluations[rows] += costs.shape[1]
        least = np.fmin.reduce(costs, axis=1)  # nan only if all are nan
        better = np.flatnonzero(least < self.best_costs[rows])
        if better.size:
            lowest = np.nanargmin(costs[better], axis=1)
            self.best_costs[rows[better]] = least[better]
            self.best[rows[better]] = proposals[better, lowest]
