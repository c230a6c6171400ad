from __future__ import annotations

import optunahub
import posefit
from posefit_bridges.problems import optunahub_problem


def Problem(function: int = 1, instance: int = 0, dimension: int = 9) -> optunahub.benchmarks.BaseProblem:
    """Return a problem of the suite posefit-2026.3, by its numbers."""
    return optunahub_problem(posefit.suite("posefit-2026.3", function, instance, dimension))
