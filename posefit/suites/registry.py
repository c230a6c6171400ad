"""The suite in the form of IOHexperimenter's registry, which leaderboards read.

The form is schema 1 of `ioh.registry()` in ioh 0.4.2. In addition, each problem lists
the `dimensions` in which it exists, and has a `summary`.
"""

from typing import Any

from posefit.motion.instances import HELD_OUT, INSTANCES
from posefit.suites.functions import DIMENSIONS, FUNCTIONS, SUITE, SuiteFunction
from posefit.suites.problem import EVALUATIONS, TARGETS

SCHEMA_VERSION = 1
STANDARD_INSTANCES = 15  # the first held-out instances, as in plans


def suite_registry() -> dict[str, Any]:
    """Return the registry of the numbered benchmark, as values for JSON.

    Example:
        >>> problem = suite_registry()["suites"]["posefit-2026.3"]["problems"][0]
        >>> problem["name"], problem["bounds"]
        ('single image', {'lower': -1.0, 'upper': 1.0})
    """
    first = HELD_OUT[0]
    suite = {
        "name": SUITE,
        "problem_class": SUITE,
        "variable_type": "real",
        "instances": {"min": INSTANCES[0], "max": INSTANCES[-1]},
        "dimensions": {"min": min(DIMENSIONS), "max": max(DIMENSIONS)},
        "standard_instances": list(range(first, first + STANDARD_INSTANCES)),
        "standard_dimensions": list(DIMENSIONS),
        "budget": {"base": 0, "per_dimension": EVALUATIONS},
        "target_bounds": {
            "scale": "log",
            "relative_to_optimum": True,
            "lower": float(TARGETS.min()),
            "upper": float(TARGETS.max()),
        },
        "scoring": {"method": "ECDF", "parameters": {"targets": len(TARGETS)}},
        "problems": [_problem(function) for function in FUNCTIONS],
    }
    return {"schema_version": SCHEMA_VERSION, "suites": {SUITE: suite}}


def _problem(function: SuiteFunction) -> dict[str, Any]:
    """Return the registry's entry of a function."""
    listed = ", ".join(map(str, function.dimensions))
    return {
        "id": function.number,
        "name": function.name,
        "optimization_type": "MIN",
        "maximization": False,
        "bounds": {"lower": -1.0, "upper": 1.0},
        "fixed_dimension": None,
        "dimension_requirement": f"one of {listed}",
        "known_optimum": function.exact,
        "optimum": {
            "instance": HELD_OUT[0],
            "dimension": function.dimensions[0],
            "value": 0.0 if function.exact else None,
            "depends_on_instance": False,
            "depends_on_dimension": False,
        },
        "scoring": None,
        "dimensions": list(function.dimensions),
        "summary": function.summary,
    }
