"""Problems of a suite, for any loop: call one with proposals, and it counts, keeps the best and the trace.

`suite` returns one by its numbers, `Suite` goes through many. A problem's attributes have the names of COCO's, so that
loops written for those run on it as they are.

Problems may be added to a suite; nothing else of one ever changes.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from pickle import PicklingError
from typing import Any, Literal, final

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.box import Space, draw_population
from posefit.fitting.check import one_of, whole
from posefit.fitting.dlpack import as_numpy
from posefit.geometry.camera import Camera
from posefit.reading import quoted
from posefit.silhouette.mask import Mask
from posefit.suites.functions import (
    DIMENSIONS,
    FUNCTIONS,
    HELD_OUT,
    SUITE,
    SUITES,
    SuiteFunction,
    checked_address,
    suite_function,
)
from posefit.suites.instances import SuiteInstance, suite_instance

Infeasible = Literal["repair", "reject", "penalise"]
INFEASIBLE: tuple[Infeasible, ...] = ("repair", "reject", "penalise")

# above the true pose's cost, 32 to 0.25: a pixel is about 0.03
TARGETS = 2.0 ** np.arange(5.0, -2.25, -0.25)
# cost of a half-side of the box between a penalised proposal and its repair
PENALTY = 100.0
EVALUATIONS = 100  # of the usual budget, for each dimension


class BudgetSpentError(Exception):
    """A call goes beyond the evaluations of a problem's budget."""


@final
class Problem:
    """A numbered problem: proposals in [-1, 1]^d have costs of 0 to 100.

    Call it with one proposal (d,) for a float, or with some (n, d) for an array (n,). Every proposal counts as one
    evaluation, whether it is feasible or not.

    A proposal is infeasible outside the box, and outside the ellipsoid of `posefit.suites.boxes`, which holds the poses
    that people take. With `infeasible="repair"` it costs as much as the proposal that `repaired` returns for it; with
    "reject" its cost is infinite; with "penalise" it is the cost of the repaired one, and 100 for each half-side of the
    box between the two.

    Where the function is noisy, calls return costs with noise: the same at the k-th evaluation of every run. As in COCO
    the best cost, the trace and the targets reached are without it.

    `budget` is the largest number of evaluations, without one infinite: what goes beyond raises BudgetSpentError and is
    not evaluated.
    """

    number_of_objectives = 1
    number_of_constraints = 0
    evaluations_constraints = 0

    def __init__(
        self,
        suite: str,
        function: SuiteFunction,
        made: SuiteInstance,
        *,
        infeasible: Infeasible = "repair",
        budget: int | None = None,
    ) -> None:
        one_of("infeasible", infeasible, INFEASIBLE)
        if budget is not None:
            whole("budget", budget, 1)
        self.suite = suite
        self.function = function
        self.made = made
        self.infeasible = infeasible
        self.budget = budget
        self.index = 0  # in a `Suite`
        self.id_function = function.number
        self.instance = self.id_instance = made.number
        self.dimension = d = len(made.truth)
        self.lower_bounds, self.upper_bounds = np.full(d, -1.0), np.ones(d)
        # without blanks, as in posefit-2026.3_f001_i00017_d09; and in words
        self.id = f"{suite}_f{function.number:03d}_i{made.number:05d}_d{d:02d}"
        self.name = f"{suite} f{function.number} {function.name}, instance {made.number} in {d}D"
        # as posefit's own optimisers take it: `factory(problem.space, rng)`
        self.space: Space = made.space
        # the predicted start of the search, with its spread; None without a prediction
        self.start = self.space.start
        # the lowest cost there is: 0 where the silhouette is of a pose of the box; None where it is unknown
        self.optimum = 0.0 if function.exact else None
        # of the true pose, which is in the box and feasible
        self.truth_cost = made.truth_cost
        # whether `look` was called: then a run is one of a method that looks
        self.looked = False
        self.reset()

    def reset(self) -> None:
        """Forget all evaluations: the count, the best and the trace."""
        self.evaluations = 0
        self.best_observed_fvalue1 = np.inf
        # evaluations, cost and point of each improvement
        self._steps: list[tuple[int, float, Array]] = []

    def __call__(self, proposals: object) -> Any:
        """Return the cost of a proposal (d,), or the costs (n,) of proposals (n, d).

        Arrays may be of any library that has DLPack; the costs come as an array of the same one. Raises ValueError
        where the shape is another or a number is not finite, and BudgetSpentError.
        """
        values, back = as_numpy("proposals", proposals)
        checked = self._checked(values)
        costs = self._counted(checked.reshape(-1, self.dimension))
        return float(costs[0]) if checked.ndim == 1 else back(costs)

    def evaluate(self, proposals: Any) -> Any:
        """Return the costs (n,) of proposals (n, d), as `posefit.minimise` asks for them."""
        values, back = as_numpy("proposals", proposals)
        return back(self._counted(self._checked(values).reshape(-1, self.dimension)))

    def noise_free(self, proposals: object) -> Array:
        """Return the costs (n,) of proposals (n, d), without noise and uncounted: a search that calls this cheats."""
        return self._noise_free(self._checked(proposals).reshape(-1, self.dimension))[0]

    def look(self) -> list[list[tuple[Camera, Mask]]]:
        """Return each frame's cameras with what they show, for a method that does not search blind.

        A run is marked from then on. Where silhouettes are noisy, it is the first of them.
        """
        self.looked = True
        return [
            [
                (camera, silhouette.mask)
                for camera, silhouette in zip(
                    frame.cameras, frame.silhouettes, strict=True
                )
            ]
            for frame in self.made.noisy[:1] or self.made.frames
        ]

    def repaired(self, proposals: Array) -> Array:
        """Return proposals (n, d), those not feasible moved: into the box, then straight towards its middle."""
        return self.made.repaired(self._checked(proposals).reshape(-1, self.dimension))

    @property
    def initial_solution(self) -> Array:
        """The proposal (d,) to start from: the prediction, or the middle of the box."""
        return (
            np.zeros(self.dimension) if self.start is None else self.start.mean.copy()
        )

    def initial_solution_proposal(self, restart: int = 0) -> Array:
        """Return the proposal (d,) to start from first, and a random one for each restart."""
        if not restart:
            return self.initial_solution
        drawn: Array = draw_population(
            self.space, np.random.default_rng([self.instance, restart]), 1
        )[0]
        return drawn

    @property
    def targets(self) -> Array:
        """The costs to be reached (29,), falling from 32 to 0.25 above the true pose's."""
        return np.asarray(self.truth_cost + TARGETS)

    @property
    def final_target_hit(self) -> bool:
        """Whether the last target was reached."""
        return bool(self.best_observed_fvalue1 <= self.targets[-1])

    @property
    def remaining_evaluations(self) -> float:
        """How many evaluations the budget has left; infinite without one."""
        return np.inf if self.budget is None else self.budget - self.evaluations

    @property
    def best(self) -> Array:
        """The best proposal (d,) so far, repaired where it was not feasible. Raises ValueError before there is one."""
        if not self._steps:
            raise InputError(
                f"{self.id} must have been evaluated, got {self.evaluations} evaluations and no cost"
            )
        best: Array = self.repaired(self._steps[-1][2])[0]
        return best

    @property
    def points(self) -> Array:
        """The proposals (k, d) at which the cost fell; a problem with the same `infeasible` evaluates them to the same.

        With "repair" they are those that were evaluated: in the box and feasible. With "penalise" they are as proposed,
        since the penalty is of the distance. With "reject" only feasible ones have a cost.
        """
        return np.array([point for *_, point in self._steps]).reshape(
            -1, self.dimension
        )

    @property
    def trace(self) -> tuple[Array, Array]:
        """The evaluations (k,) at which the cost fell, and the last one, with the best cost (k,) at each.

        It begins where a cost was measured: with "reject" that may be after some that were infinite.
        """
        steps = [(used, cost) for used, cost, _ in self._steps]
        if steps and steps[-1][0] < self.evaluations:
            steps.append((self.evaluations, steps[-1][1]))
        return np.array([used for used, _ in steps], dtype=np.float64), np.array(
            [cost for _, cost in steps]
        )

    def __copy__(self) -> "Problem":
        """Return a problem with the same count, best and trace, which are its own from now on."""
        copy: Problem = object.__new__(Problem)
        copy.__dict__.update(self.__dict__, _steps=self._steps.copy())
        return copy

    def __deepcopy__(self, memo: object) -> "Problem":
        return self.__copy__()

    def __getstate__(self) -> Any:
        raise PicklingError(
            f"{self.id} counts evaluations in its own process and cannot be sent to another: make it there with "
            "posefit.suite, or give it whole populations, in one process"
        )

    def __repr__(self) -> str:
        return f"<{self.id}: {self.evaluations} evaluations, best {self.best_observed_fvalue1:.4g}>"

    def _checked(self, proposals: object) -> Array:
        try:
            checked = np.asarray(proposals, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(
                f"proposals must be numbers, got {quoted(proposals)}"
            ) from None
        if checked.ndim not in (1, 2) or checked.shape[-1] != self.dimension:
            d = self.dimension
            raise InputError(
                f"proposals must have shape ({d},) or (n, {d}), got {checked.shape}"
            )
        if not np.isfinite(checked).all():
            raise InputError("proposals must be finite, got nan or infinity")
        return checked

    def _counted(self, checked: Array) -> Array:
        """Return the costs (n,) of checked proposals (n, d), and count them."""
        if len(checked) > self.remaining_evaluations:
            raise BudgetSpentError(
                f"{self.id}: {self.remaining_evaluations:g} of {self.budget} evaluations are left, got {len(checked)}"
            )
        costs, repaired, penalties = self._noise_free(checked)
        measured = (
            self.made.evaluate_noisy(repaired, self.evaluations) + penalties
            if self.function.noisy
            else costs
        )
        points = checked if self.infeasible == "penalise" else repaired
        for k in np.flatnonzero(costs < self.best_observed_fvalue1):
            if costs[k] < self.best_observed_fvalue1:
                self.best_observed_fvalue1 = float(costs[k])
                self._steps.append(
                    (
                        self.evaluations + int(k) + 1,
                        self.best_observed_fvalue1,
                        points[k].copy(),
                    )
                )
        self.evaluations += len(checked)
        return measured

    def _noise_free(self, checked: Array) -> tuple[Array, Array, Array]:
        """Return the costs (n,) of checked proposals (n, d), their repaired ones (n, d), and the penalties (n,)."""
        allowed = self.space.feasible(checked)
        repaired = checked if allowed.all() else self.made.repaired(checked)
        penalties = np.zeros(len(checked))
        if self.infeasible == "reject":
            penalties[~allowed] = np.inf
        elif self.infeasible == "penalise":
            penalties[~allowed] = (
                PENALTY * np.linalg.norm(checked - repaired, axis=1)[~allowed]
            )
        return self.made.evaluate(repaired) + penalties, repaired, penalties


def suite(
    name: str = SUITE,
    function: int = 1,
    instance: int = 0,
    dimension: int = 9,
    *,
    infeasible: Infeasible = "repair",
    budget: int | None = None,
) -> Problem:
    """Return a problem of a suite: the same for the same numbers on every machine, with nothing evaluated yet.

    Instances below 10,000 are for training, those up to 19,999 are held out. `posefit.Suite` lists the functions and
    their dimensions; `Problem` documents the other arguments. Raises ValueError where there is no such problem.
    """
    number, instance, dimension = checked_address(name, function, instance, dimension)
    made = suite_instance(number, instance, dimension)
    return Problem(
        name, suite_function(number), made, infeasible=infeasible, budget=budget
    )


@final
class Suite:
    """Problems to go through, each made in its turn: `for problem in Suite(): ...`, as with COCO's.

    By default that is each function in each of its dimensions, on fifteen held-out instances; dimensions that a
    function does not have are passed over, and functions with none of them are `passed_over`. The order is by
    dimension, function and instance. Raises ValueError for an unknown number, or where nothing is left.
    """

    def __init__(
        self,
        name: str = SUITE,
        *,
        functions: Sequence[int] | None = None,
        dimensions: Sequence[int] = DIMENSIONS,
        instances: Sequence[int] = HELD_OUT[:15],
        infeasible: Infeasible = "repair",
        budget: int | None = None,
    ) -> None:
        one_of("suite", name, SUITES)
        for what, numbers in (
            ("functions", functions),
            ("dimensions", dimensions),
            ("instances", instances),
        ):
            if numbers is not None and not isinstance(numbers, Iterable):
                raise InputError(
                    f"{what} must be a list of numbers, got {quoted(numbers)}"
                )
        chosen = (
            FUNCTIONS
            if functions is None
            else [suite_function(number) for number in functions]
        )
        for dimension in dimensions:
            one_of("dimension", dimension, DIMENSIONS)
        self.passed_over = tuple(
            function
            for function in chosen
            if not set(dimensions) & set(function.dimensions)
        )
        self.name = name
        self._options: dict[str, Any] = {"infeasible": infeasible, "budget": budget}
        self._addresses = [
            checked_address(name, function.number, instance, dimension)
            for dimension, function, instance in product(dimensions, chosen, instances)
            if dimension in function.dimensions
        ]
        if not self._addresses:
            raise InputError(
                f"a suite must hold at least one problem, got none in {list(dimensions)} dimensions"
            )

    @property
    def functions(self) -> tuple[SuiteFunction, ...]:
        """The functions that problems are of, each with its number, name, summary and dimensions."""
        numbers = {number for number, _, _ in self._addresses}
        return tuple(function for function in FUNCTIONS if function.number in numbers)

    def __len__(self) -> int:
        return len(self._addresses)

    def __getitem__(self, index: int) -> Problem:
        if isinstance(index, slice):
            raise InputError(
                f"index must be the number of one problem, got {quoted(index)}: "
                "problems are made in their turn, as itertools.islice takes them"
            )
        problem = suite(self.name, *self._addresses[index], **self._options)
        problem.index = index % len(self)
        return problem

    def __iter__(self) -> Iterator[Problem]:
        return (self[index] for index in range(len(self)))
