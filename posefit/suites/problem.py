"""One problem of a suite, for anybody's loop: call it with proposals, and it counts, keeps the best and the trace.

Its attributes have the names that COCO's problems have, so that loops written for those run on it as they are.
"""

import time
from typing import Literal, final

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Space, Start, draw_population
from posefit.fitting.check import one_of, positive, whole
from posefit.reading import quoted
from posefit.suites.functions import SuiteFunction
from posefit.suites.instances import SuiteInstance
from posefit.suites.known import best_known_of

Infeasible = Literal["repair", "reject", "penalise"]
INFEASIBLE: tuple[Infeasible, ...] = ("repair", "reject", "penalise")

TARGETS = 2.0 ** np.arange(5.0, -2.25, -0.25)  # above the reference, 32 to 0.25: a pixel is about 0.03
WEIGHT = 100.0  # cost of a half-side of the box that a penalised proposal is out of what is feasible
EVALUATIONS = 100  # of the usual budget, for each dimension


class BudgetSpentError(Exception):
    """A problem was asked for more evaluations, or for longer, than its budget holds."""


@final
class Problem:
    """A numbered problem: proposals in [-1, 1]^d have costs of 0 to 100.

    Call it with one proposal (d,) for a float, or with some (n, d) for an array (n,). Every proposal counts as one
    evaluation, whether it is feasible or not.

    What is not feasible is out of the box, or no pose that people take: out of the ellipsoid of `posefit.suites.boxes`.
    With `infeasible="repair"` such a proposal costs what the one costs that `repaired` gives for it; with "reject" its
    cost is infinite; with "penalise" it is that of the repaired one, and 100 for each half-side of the box between the
    two. It is the same for every method, whoever wrote it.

    `budget` is how many evaluations there may be, and `seconds` how long after the first a call may
    begin: whatever goes beyond is not evaluated and raises BudgetSpentError. Without them there is no end.
    """

    number_of_objectives = 1
    number_of_constraints = 0
    number_of_integer_variables = 0
    evaluations_constraints = 0

    def __init__(
        self,
        suite: str,
        function: SuiteFunction,
        made: SuiteInstance,
        *,
        infeasible: Infeasible = "repair",
        budget: int | None = None,
        seconds: float | None = None,
        index: int = 0,
    ) -> None:
        one_of("infeasible", infeasible, INFEASIBLE)
        if budget is not None:
            whole("budget", budget, 1)
        if seconds is not None:
            positive("seconds", seconds)
        self.suite, self.function, self.made, self.index = suite, function, made, index
        self.infeasible, self.budget, self._limit = infeasible, budget, seconds
        self.evaluations = 0
        self.best_observed_fvalue1 = np.inf
        self._best: Array | None = None
        self._steps: list[tuple[int, float]] = []
        self._began: float | None = None

    def __call__(self, proposals: object) -> "float | Array":
        """Return the cost of a proposal (d,), or the costs (n,) of proposals (n, d).

        Raises ValueError where the shape is another or a number is not finite, and BudgetSpentError.
        """
        asked = self._checked(proposals)
        costs = self._counted(asked.reshape(-1, self.dimension))
        return float(costs[0]) if asked.ndim == 1 else costs

    def evaluate(self, proposals: Array) -> Array:
        """Return the costs (n,) of proposals (n, d), as `posefit.minimise` asks for them."""
        return self._counted(self._checked(proposals).reshape(-1, self.dimension))

    def repaired(self, proposals: Array) -> Array:
        """Return proposals (n, d), those not feasible moved: into the box, then straight towards its middle."""
        return self.made.repaired(self._checked(proposals).reshape(-1, self.dimension))

    @property
    def space(self) -> Space:
        """The box as posefit's own optimisers want it: `factory(problem.space, rng)`."""
        return self.made.posed.space

    @property
    def dimension(self) -> int:
        """d."""
        return len(self.made.truth)

    number_of_variables = dimension

    @property
    def instance(self) -> int:
        """The instance's number."""
        return self.made.number

    id_instance = instance

    @property
    def id_function(self) -> int:
        """The function's number."""
        return self.function.number

    @property
    def id(self) -> str:
        """Return the problem's name without blanks, as in `posefit-2026.1_f001_i00017_d09`."""
        return f"{self.suite}_f{self.function.number:03d}_i{self.instance:05d}_d{self.dimension:02d}"

    @property
    def name(self) -> str:
        """The problem's name in words."""
        return (
            f"{self.suite} f{self.function.number} {self.function.name}, instance {self.instance} in {self.dimension}D"
        )

    @property
    def lower_bounds(self) -> Array:
        """-1 (d,)."""
        return np.full(self.dimension, -1.0)

    @property
    def upper_bounds(self) -> Array:
        """1 (d,)."""
        return np.ones(self.dimension)

    @property
    def start(self) -> Start | None:
        """Where a prediction says that the search should start, with its spread; None where there is none."""
        return self.space.start

    @property
    def initial_solution(self) -> Array:
        """The proposal (d,) to start from: the prediction, or the middle of the box."""
        return np.zeros(self.dimension) if self.start is None else self.start.mean.copy()

    def initial_solution_proposal(self, restart: int = 0) -> Array:
        """Return the proposal (d,) to start from at first, and others, drawn, for each restart."""
        if not restart:
            return self.initial_solution
        drawn: Array = draw_population(self.space, np.random.default_rng([self.instance, restart]), 1)[0]
        return drawn

    @property
    def optimum(self) -> float | None:
        """The least cost there is, where it is known: 0 where what is seen was drawn from the box. Else None."""
        return 0.0 if self.function.exact else None

    @property
    def truth_cost(self) -> float:
        """The cost of the true pose, which is in the box and feasible."""
        return self.made.truth_cost

    @property
    def best_known(self) -> float:
        """The least cost that is known: the truth's, or what `posefit suite audit` found and the suite's file says."""
        found = best_known_of(self.id)
        return self.truth_cost if found is None else min(found, self.truth_cost)

    @property
    def targets(self) -> Array:
        """The costs to be reached (29,), falling from 32 to 0.25 above the best known."""
        return np.asarray(self.best_known + TARGETS)

    @property
    def final_target_hit(self) -> bool:
        """Whether the last target was reached."""
        return bool(self.best_observed_fvalue1 <= self.targets[-1])

    @property
    def left(self) -> float:
        """How many evaluations the budget has left; infinite without one."""
        return np.inf if self.budget is None else self.budget - self.evaluations

    @property
    def elapsed(self) -> float:
        """Seconds since the first evaluation began."""
        return 0.0 if self._began is None else time.perf_counter() - self._began

    @property
    def best(self) -> Array:
        """The best proposal (d,) so far, repaired where it was not feasible. Raises ValueError before there is one."""
        if self._best is None:
            raise ValueError(f"{self.id} must have been evaluated, got {self.evaluations} evaluations and no cost")
        return self._best.copy()

    @property
    def trace(self) -> tuple[Array, Array]:
        """The evaluations (k,) at which the cost fell, and the last one, with the best cost (k,) at each.

        It begins where a cost was measured: with "reject" that may be after some that were infinite.
        """
        steps = list(self._steps)
        if steps and steps[-1][0] < self.evaluations:
            steps.append((self.evaluations, steps[-1][1]))
        return np.array([used for used, _ in steps], dtype=np.float64), np.array([cost for _, cost in steps])

    def __repr__(self) -> str:
        return f"<{self.id}: {self.evaluations} evaluations, best {self.best_observed_fvalue1:.4g}>"

    def _checked(self, proposals: object) -> Array:
        try:
            asked = np.asarray(proposals, dtype=np.float64)
        except (TypeError, ValueError):
            raise ValueError(f"proposals must be numbers, got {quoted(proposals)}") from None
        if asked.ndim not in (1, 2) or asked.shape[-1] != self.dimension:
            d = self.dimension
            raise ValueError(f"proposals must have shape ({d},) or (n, {d}), got {asked.shape}")
        if not np.isfinite(asked).all():
            raise ValueError("proposals must be finite, got nan or infinity")
        return asked

    def _counted(self, asked: Array) -> Array:
        """Return the costs (n,) of checked proposals (n, d), and take note of them."""
        if self._began is None:
            self._began = time.perf_counter()
        if len(asked) > self.left:
            raise BudgetSpentError(f"{self.id}: {self.left:g} of {self.budget} evaluations are left, got {len(asked)}")
        if self._limit is not None and self.elapsed > self._limit:
            raise BudgetSpentError(f"{self.id}: its {self._limit:g} seconds are over")
        allowed = self.space.feasible(asked)
        mended = asked if allowed.all() else self.made.repaired(asked)
        costs = self.made.posed.evaluate(mended)
        if self.infeasible == "reject":
            costs[~allowed] = np.inf
        elif self.infeasible == "penalise":
            costs[~allowed] += WEIGHT * np.linalg.norm(asked - mended, axis=1)[~allowed]
        for k in np.flatnonzero(costs < self.best_observed_fvalue1):
            if costs[k] < self.best_observed_fvalue1:
                self.best_observed_fvalue1, self._best = float(costs[k]), mended[k].copy()
                self._steps.append((self.evaluations + int(k) + 1, self.best_observed_fvalue1))
        self.evaluations += len(asked)
        return costs
