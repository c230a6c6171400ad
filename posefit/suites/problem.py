"""Problems of a suite by number: `suite` returns one, `Suite` iterates over many.

Each is a `posefit.Problem` with a `SuiteCost` as its cost function. Its attributes have
the same names as in COCO, so loops written for COCO run on it unchanged.

A suite may get more problems. Everything else about it never changes.
"""

from collections import Counter
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

# above the true pose's cost, from 32 to 0.25; a pixel costs about 0.03
TARGETS = 2.0 ** np.arange(5.0, -2.25, -0.25)
# added to the cost for each half-range of the box between a penalised proposal and the
# repaired one
PENALTY = 100.0
EVALUATIONS = 100  # the default budget per dimension


@final
class SuiteCost:
    """The cost function of a numbered problem.

    A problem of a suite has these attributes as well.

    A proposal is infeasible outside the box, and outside the ellipsoid of
    `posefit.suites.boxes`, which contains the poses that people take. `infeasible`
    decides its cost:

    - "repair": the cost of the proposal that `repaired` returns for it
    - "reject": infinite
    - "penalise": the cost of the repaired proposal, plus 100 for each half-range of the
      box between the two

    Args:
        suite: The suite's name.
        function: The function.
        made: The instance.
        infeasible: The treatment of infeasible proposals.

    Attributes:
        id_function: The function's number.
        instance: The instance's number, also `id_instance`.
        name: The problem in words.
        start: The predicted start of the search with its spread, or None.
        optimum: The lowest cost: 0 if the silhouette is of a pose of the box, or None
            if it is unknown.
        truth_cost: The cost of the true pose, which is feasible.
        looked: Whether `look` was called, so that the method has used the pictures.
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
        self.name = (
            f"{suite} f{function.number} {function.name}, "
            f"instance {made.number} in {d}D"
        )
        self.start = made.space.start
        self.optimum = 0.0 if function.exact else None
        self.truth_cost = made.truth_cost
        self.looked = False

    def __call__(self, proposals: Array) -> Array:
        """Return the costs (n,) of proposals (n, d), without noise."""
        return self.made.evaluate(self.repaired(proposals)) + self._penalties(proposals)

    def noisy(self, proposals: Array, first: int) -> Array:
        """Return the costs (n,) of proposals (n, d) with noise.

        `first` is the number of earlier evaluations, on which the noise depends.
        """
        costs = self.made.evaluate_noisy(self.repaired(proposals), first)
        return costs + self._penalties(proposals)

    def noise_free(self, proposals: Array) -> Array:
        """Return the costs (n,) of proposals (n, d) without noise and without counting.

        A search that calls this cheats.
        """
        return self(np.asarray(proposals, dtype=np.float64).reshape(-1, self._d))

    def repaired(self, proposals: Array) -> Array:
        """Return feasible proposals (n, d).

        Infeasible ones are moved into the box, and then straight towards its middle.
        """
        rows = np.asarray(proposals, dtype=np.float64).reshape(-1, self._d)
        if self.made.space.feasible(rows).all():
            return rows
        return self.made.repaired(rows)

    def look(self) -> list[list[tuple[Camera, Mask]]]:
        """Return the cameras and masks of each frame.

        A method that calls this uses the pictures, and `looked` marks its run. If
        the problem is noisy, the result has the first of its masks.
        """
        self.looked = True
        # the masks without noise would be more than the search gets
        frames = self.made.noisy[:1] or self.made.frames
        views_of_frames = []
        for frame in frames:
            masks = [silhouette.mask for silhouette in frame.silhouettes]
            views_of_frames.append(list(zip(frame.cameras, masks, strict=True)))
        return views_of_frames

    @property
    def _d(self) -> int:
        return len(self.made.truth)

    def _penalties(self, proposals: Array) -> Array:
        """Return what infeasible proposals (n, d) cost in addition (n,)."""
        penalties = np.zeros(len(proposals))
        if self.infeasible == "repair":
            return penalties
        forbidden = ~self.made.space.feasible(proposals)
        if self.infeasible == "reject":
            penalties[forbidden] = np.inf
        else:
            # grows with the distance, so that a search can find its way back
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
    """Return a problem of a suite, the same for the same numbers on every machine.

    Args:
        name: The suite's name.
        function: The function's number. `posefit.Suite` lists the functions.
        instance: The instance's number. Instances below 10,000 are for training, and
            instances from 10,000 to 19,999 are held out.
        dimension: The dimension, one of the function's.
        infeasible: The treatment of infeasible proposals, see `SuiteCost`.
        budget: The most evaluations of the problem, or None for no limit.

    Returns:
        The problem, with nothing evaluated yet.

    Raises:
        ValueError: There is no such problem.

    Example:
        >>> import numpy as np
        >>> import posefit
        >>> problem = posefit.suite("posefit-2026.3", 1, 0, 9)
        >>> problem(np.zeros((3, 9))).shape, problem.evaluations
        ((3,), 3)
    """
    number, instance, dimension = checked_address(name, function, instance, dimension)
    one_of("infeasible", infeasible, INFEASIBLE)
    made = suite_instance(number, instance, dimension)
    chosen = suite_function(number)
    cost = SuiteCost(name, chosen, made, infeasible)
    repair = cost.repaired if infeasible == "repair" else None
    noisy = cost.noisy if chosen.noisy else None
    return Problem(
        cost,
        made.space,
        budget,
        repair=repair,
        noisy=noisy,
        targets=made.truth_cost + TARGETS,
        # without blanks, such as posefit-2026.3_f001_i00017_d09
        id=f"{name}_f{number:03d}_i{instance:05d}_d{dimension:02d}",
    )


@final
class Suite:
    """An iterable of problems, as in COCO: `for problem in Suite(): ...`.

    Each problem is made when it is reached. The order is by dimension, function and
    instance. A function has no problems in dimensions in which it does not exist.

    Args:
        name: The suite's name.
        functions: Numbers of functions, by default all.
        dimensions: Dimensions, by default all.
        instances: Numbers of instances, by default fifteen that are held out.
        infeasible: The treatment of infeasible proposals, see `SuiteCost`.
        budget: The most evaluations of each problem, or None for no limit.

    Attributes:
        passed_over: The functions that exist in none of the dimensions.

    Raises:
        ValueError: A number is unknown, or there are no problems.

    Example:
        >>> import posefit
        >>> suite = posefit.Suite(functions=[1], dimensions=[9], instances=[0, 1])
        >>> [problem.dimension for problem in suite]
        [9, 9]
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
        chosen: Sequence[SuiteFunction] = FUNCTIONS
        if functions is not None:
            chosen = list(map(suite_function, _numbers("functions", functions)))
        dimensions = _numbers("dimensions", dimensions)
        instances = _numbers("instances", instances)
        for dimension in dimensions:
            one_of("dimension", dimension, DIMENSIONS)
        passed_over = []
        for function in chosen:
            if not set(dimensions) & set(function.dimensions):
                passed_over.append(function)
        self.passed_over = tuple(passed_over)
        self.name = name
        self._options: dict[str, Any] = {"infeasible": infeasible, "budget": budget}
        self._addresses = []
        for dimension, function, instance in product(dimensions, chosen, instances):
            if dimension in function.dimensions:
                address = checked_address(name, function.number, instance, dimension)
                self._addresses.append(address)
        if not self._addresses:
            raise InputError(
                "a suite must contain at least one problem, "
                f"got none in {list(dimensions)} dimensions"
            )
        # a problem that came twice would count twice in a score
        problem, times = Counter(self._addresses).most_common(1)[0]
        if times > 1:
            number, instance, dimension = problem
            raise InputError(
                "the problems of a suite must differ, "
                f"got f{number} instance {instance} in {dimension}D twice"
            )

    @property
    def functions(self) -> tuple[SuiteFunction, ...]:
        """The functions of the problems."""
        numbers = {number for number, _, _ in self._addresses}
        chosen = []
        for function in FUNCTIONS:
            if function.number in numbers:
                chosen.append(function)
        return tuple(chosen)

    def __len__(self) -> int:
        return len(self._addresses)

    def __getitem__(self, index: int) -> Problem:
        # a slice of problems would make them all at once
        if isinstance(index, slice):
            raise InputError(
                f"index must be the number of one problem, got {quoted(index)}: "
                "itertools.islice gives several"
            )
        problem = suite(self.name, *self._addresses[index], **self._options)
        problem.index = index % len(self)
        return problem

    def __iter__(self) -> Iterator[Problem]:
        for index in range(len(self)):
            yield self[index]


def _numbers(what: str, numbers: object) -> list[int]:
    """Return numbers as a list. Raises InputError if there are none."""
    if not isinstance(numbers, Iterable) or isinstance(numbers, str):
        raise InputError(f"{what} must be a list of numbers, got {quoted(numbers)}")
    # a generator yields them only once
    listed = list(numbers)
    if not listed:
        raise InputError(f"{what} must contain at least one number, got none")
    return listed
