"""The functions of a suite and their dimensions, which never change under one name."""

from dataclasses import dataclass

from posefit.fitting.check import one_of, whole
from posefit.motion.instances import instance_number

SUITE = "posefit-2026.3"
SUITES = (SUITE,)
# dimensions of the functions that search joint angles themselves
ANGLES = (20, 24, 40, 66)
DIMENSIONS = (9, 10, 16, 20, 24, 40, 66)


@dataclass(frozen=True)
class SuiteFunction:
    """One kind of problem, in some dimensions.

    Attributes:
        number: The function's number.
        name: The function's name.
        summary: A description in half a sentence.
        exact: Whether some proposal has the cost 0, as the silhouette is one of the
            box's poses.
        dimensions: The dimensions in which it exists.
        noisy: Whether the cost of a proposal differs when it is evaluated again.
    """

    number: int
    name: str
    summary: str
    exact: bool
    dimensions: tuple[int, ...] = (9, 10, 16, 20, 24, 40)
    noisy: bool = False


FUNCTIONS = (
    SuiteFunction(
        1, "single image", "one silhouette, the yaw known to within 20 degrees", True
    ),
    SuiteFunction(
        2,
        "next frame",
        "a fifth of a second after two poses of a track; starts at a prediction",
        True,
    ),
    SuiteFunction(3, "two views", "as 1, seen by two cameras at right angles", True),
    SuiteFunction(
        4,
        "noisy",
        "as 1, the silhouette damaged again at each evaluation",
        True,
        noisy=True,
    ),
    SuiteFunction(
        5,
        "sequence",
        "eight frames of 1.4 seconds at once: components, each over time",
        True,
    ),
    SuiteFunction(6, "mixed", "as 1, most components have 2, 4, 8 or 16 values", True),
    SuiteFunction(
        7,
        "high-dimensional",
        "as 1, joint angles themselves instead of components",
        True,
        ANGLES,
    ),
    SuiteFunction(
        8,
        "aligned translation",
        "as 1, the place unknown and taken from the silhouette's borders",
        False,
    ),
    SuiteFunction(
        9,
        "rotated",
        "as 7, the box rotated at random: coordinates cannot be searched one by one",
        True,
        ANGLES,
    ),
)


def suite_function(number: object) -> SuiteFunction:
    """Return the function with a number. Raises ValueError if there is none."""
    known = {function.number: function for function in FUNCTIONS}
    chosen = whole("function", number, 1)
    one_of("function", chosen, known)
    return known[chosen]


def checked_address(
    name: object, function: object, instance: object, dimension: object
) -> tuple[int, int, int]:
    """Return the function, instance and dimension of a problem as integers.

    Raises ValueError if the suite has no such problem.
    """
    one_of("suite", name, SUITES)
    chosen = suite_function(function)
    number = instance_number(instance)
    d = whole("dimension", dimension, 1)
    one_of(f"dimension of function {chosen.number}", d, chosen.dimensions)
    return chosen.number, number, d
