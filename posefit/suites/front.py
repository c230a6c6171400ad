"""`posefit.suite` and `posefit.Suite`: one problem by its numbers, and many to go through."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from typing import final

from posefit.fitting.check import one_of
from posefit.reading import quoted
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
from posefit.suites.instances import suite_instance
from posefit.suites.problem import Infeasible, Problem


def suite(
    name: str = SUITE,
    function: int = 1,
    instance: int = 0,
    dimension: int = 9,
    *,
    infeasible: Infeasible = "repair",
    budget: int | None = None,
    seconds: float | None = None,
) -> Problem:
    """Return a problem of a suite: the same for the same numbers on every machine, with nothing evaluated yet.

    Instances below 10,000 are for training, those up to 19,999 are held out. `posefit.Suite` lists the functions and
    their dimensions; `Problem` says what the other arguments mean. Raises ValueError where there is no such problem.
    """
    number, instance, dimension = checked_address(name, function, instance, dimension)
    made = suite_instance(number, instance, dimension)
    return Problem(name, suite_function(number), made, infeasible=infeasible, budget=budget, seconds=seconds)


@final
class Suite:
    """Problems to go through: `for problem in Suite(): ...`, as with COCO's. Each is made when its turn comes.

    By default that is each function in each of its dimensions, on fifteen held-out instances; a dimension that a
    function has not is passed over, and a function that has none of them is `passed_over`. They come by dimension,
    function and instance. Raises ValueError where a number is not known, or where nothing is left.
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
        seconds: float | None = None,
    ) -> None:
        one_of("suite", name, SUITES)
        for what, numbers in (("functions", functions), ("dimensions", dimensions), ("instances", instances)):
            if numbers is not None and not isinstance(numbers, Iterable):
                raise ValueError(f"{what} must be a list of numbers, got {quoted(numbers)}")
        chosen = FUNCTIONS if functions is None else [suite_function(number) for number in functions]
        for dimension in dimensions:
            one_of("dimension", dimension, DIMENSIONS)
        self.passed_over = tuple(one for one in chosen if not set(dimensions) & set(one.dimensions))
        self.name, self._infeasible, self._budget, self._seconds = name, infeasible, budget, seconds
        self._addresses = [
            checked_address(name, one.number, instance, dimension)
            for dimension, one, instance in product(dimensions, chosen, instances)
            if dimension in one.dimensions
        ]
        if not self._addresses:
            raise ValueError(f"a suite must hold at least one problem, got none in {list(dimensions)} dimensions")

    @property
    def functions(self) -> tuple[SuiteFunction, ...]:
        """The functions that problems are of, each with its number, name, summary and dimensions."""
        numbers = {number for number, _, _ in self._addresses}
        return tuple(one for one in FUNCTIONS if one.number in numbers)

    def __len__(self) -> int:
        return len(self._addresses)

    def __getitem__(self, index: int) -> Problem:
        function, instance, dimension = self._addresses[index]
        return Problem(
            self.name,
            suite_function(function),
            suite_instance(function, instance, dimension),
            infeasible=self._infeasible,
            budget=self._budget,
            seconds=self._seconds,
            index=index % len(self),
        )

    def __iter__(self) -> Iterator[Problem]:
        return (self[index] for index in range(len(self)))
