from __future__ import annotations

import posefit
from posefit_bridges import optunahub


class Problem(optunahub.Problem):
    """A problem of the suite posefit-2026.3, by its numbers."""

    def __init__(self, function: int = 1, instance: int = 0, dimension: int = 9) -> None:
        super().__init__(posefit.suite("posefit-2026.3", function, instance, dimension))
