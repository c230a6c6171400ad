"""Problems of a suite, by their numbers: `suite` returns one, `Suite` goes through many.

Each is a `posefit.Problem`, whose cost function is a `SuiteCost`. Its attributes have the names of COCO's problems, so
that loops written for those run on it as they are.

Problems may be added to a suite; nothing else of one ever changes.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from typing import Any, Literal, final

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.check import one_of
from posefit.fitting.problem import Problem
from posefit.geometry.camera import Camera
from posefit.motion.instances import HELD_OUT
from posefit.reading import quoted
from posefit.silhouette.mask import Mask
from posefit.suites.functions import (
    DIMENSIONS,
    FUNCTIONS,
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


@final
class SuiteCost:
    """The cost function of a numbered problem, and what is known of it: `problem.targets`, `problem.look()`.

    A proposal is infeasible outside the box, and outside the ellipsoid of `posefit.suites.boxes`, which holds the poses
    that people take. With `infeasible="repair"` it costs as much as the proposal that `repaired` returns for it; with
    "reject" its cost is infinite; with "penalise" it is the cost of the repaired one, and 100 for each half-side of the
    box between the two.
    """

    def __init__(
        self,
        suite: str,
        function: SuiteFunction,
        made: SuiteInstance,
        infeasible: Infeasible = "repair",
    ) -> None:
        self.suite = suite
        self.function = function
        self.made = made
        self.infeasible = infeasible
        self.id_function = function.number
        self.instance = made.number
        self.id_instance = made.number
        d = len(made.truth)
        self.name = f"{suite} f{function.number} {function.name}, instance {made.number} in {d}D"
        # the predicted start of the search, with its spread; None without a prediction
        self.start = made.space.start
        # the lowest cost there is: 0 where the silhouette is of a pose of the box; None where it is unknown
        self.optimum = 0.0 if function.exact else None
        # of the true pose, which is in the box and feasible
        self.truth_cost = made.truth_cost
        # whether `look` was called: then a run is one of a method that looks
        self.looked = False

    def __call__(self, proposals: Array) -> Array:
        """Return the costs (n,) of proposals (n, d), without noise."""
        return self.made.evaluate(self.repaired(proposals)) + self._penalties(proposals)

    def noisy(self, proposals: Array, first: int) -> Array:
        """Return the costs (n,) of proposals (n, d) with noise: the evaluations from number `first` on."""
        costs = self.made.evaluate_noisy(self.repaired(proposals), first)
        return costs + self._penalties(proposals)

    def noise_free(self, proposals: Array) -> Array:
        """Return the costs (n,) of proposals (n, d), without noise and uncounted: a search that calls this cheats."""
        return self(np.asarray(proposals, dtype=np.float64).reshape(-1, self._d))

    def repaired(self, proposals: Array) -> Array:
        """Return proposals (n, d), those not feasible moved: into the box, then straight towards its middle."""
        rows = np.asarray(proposals, dtype=np.float64).reshape(-1, self._d)
        return (
            rows if self.made.space.feasible(rows).all() else self.made.repaired(rows)
        )

    def look(self) -> list[list[tuple[Camera, Mask]]]:
        """Return each frame's cameras with what they show, for a method that does not search blind.

        A run is marked from then on. Where silhouettes are noisy, it is the first of them.
        """
        self.looked = True
        frames = self.made.noisy[:1] or self.made.frames
        return [
            [
                (camera, silhouette.mask)
                for camera, silhouette in zip(
                    frame.cameras, frame.silhouettes, strict=True
                )
            ]
            for frame in frames
        ]

    @property
    def _d(self) -> int:
        return len(self.made.truth)

    def _penalties(self, proposals: Array) -> Array:
        """Return what is added to the costs (n,) of proposals (n, d) that are not feasible."""
        penalties = np.zeros(len(proposals))
        if self.infeasible == "repair":
            return penalties
        forbidden = ~self.made.space.feasible(proposals)
        if self.infeasible == "reject":
            penalties[forbidden] = np.inf
        else:
            moved = np.linalg.norm(proposals - self.repaired(proposals), axis=1)
            penalties[forbidden] = PENALTY * moved[forbidden]
        return penalties


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
    their dimensions; `SuiteCost` documents `infeasible`; `budget` is the problem's.

    Raises ValueError where there is no such problem.
    """
    number, instance, dimension = checked_address(name, function, instance, dimension)
    one_of("infeasible", infeasible, INFEASIBLE)
    made = suite_instance(number, instance, dimension)
    chosen = suite_function(number)
    cost = SuiteCost(name, chosen, made, infeasible)
    return Problem(
        cost,
        made.space,
        budget,
        repair=cost.repaired if infeasible == "repair" else None,
        noisy=cost.noisy if chosen.noisy else None,
        targets=made.truth_cost + TARGETS,
        # without blanks, as in posefit-2026.3_f001_i00017_d09
        id=f"{name}_f{number:03d}_i{instance:05d}_d{dimension:02d}",
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
        chosen = (
            FUNCTIONS
            if functions is None
            else [suite_function(number) for number in _numbers("functions", functions)]
        )
        dimensions = _numbers("dimensions", dimensions)
        instances = _numbers("instances", instances)
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


def _numbers(what: str, numbers: object) -> list[int]:
    """Return numbers as a list, since a generator gives them once only. Raises InputError where there are none."""
    if not isinstance(numbers, Iterable) or isinstance(numbers, str):
        raise InputError(f"{what} must be a list of numbers, got {quoted(numbers)}")
    listed = list(numbers)
    if not listed:
        raise InputError(f"{what} must hold at least one number, got none")
    return listed
