"""What the author of a plugin imports: the marker of hooks, protocols and their data, functions on a search space.

    from posefit.plugin import draw_population, hookimpl, sample_normal

An optimiser knows four members of its space: `dimensions`, `start`, `periodic` and `feasible`. Everything else it does
with a space is a function here.

| what you write | what it is | its hook |
|---|---|---|
| optimiser | `Optimiser`, also `Filter` or `Niching`, of a `Space` | `posefit_register_optimisers` |
| prior | `Prior` | `posefit_register_priors` |
| tracker | `Tracker`: a `Task` and `Observation`s in, `Frame`s out | `posefit_register_trackers` |
| segmenter | `Segmenter` of a `Footage` | `posefit_register_segmenters` |
| command | a `click.Command` | `posefit_register_commands` |
| claim of a publication | `ClaimedOrder` | `posefit_register_claims` |
"""

from typing import TYPE_CHECKING, Any

from posefit import hookimpl
from posefit.arrays import Array
from posefit.fitting.box import (
    Space,
    Start,
    converted,
    displacement,
    draw_population,
    extent,
    fold,
    repair,
    sample_normal,
    wrap,
)
from posefit.fitting.check import at_least, between, one_of, positive, whole
from posefit.fitting.optimiser import Filter, Niching, Optimiser, finite_costs
from posefit.fitting.prior import Prior
from posefit.fitting.tracker import Frame, Observation, Task, Tracker
from posefit.hooks import (
    ClaimedOrder,
    RegisterClaim,
    RegisterCommand,
    RegisterOptimiser,
    RegisterPrior,
    RegisterSegmenter,
    RegisterTracker,
)
from posefit.silhouette.cost import areas, mismatch
from posefit.silhouette.foreground import Footage, Segmenter

if TYPE_CHECKING:
    from posefit.testing import check_optimiser, check_prior, check_segmenter, check_tracker

_CHECKS = ("check_optimiser", "check_prior", "check_segmenter", "check_tracker")  # imported when first used

__all__ = [
    "Array",
    "ClaimedOrder",
    "Filter",
    "Footage",
    "Frame",
    "Niching",
    "Observation",
    "Optimiser",
    "Prior",
    "RegisterClaim",
    "RegisterCommand",
    "RegisterOptimiser",
    "RegisterPrior",
    "RegisterSegmenter",
    "RegisterTracker",
    "Segmenter",
    "Space",
    "Start",
    "Task",
    "Tracker",
    "areas",
    "at_least",
    "between",
    "check_optimiser",
    "check_prior",
    "check_segmenter",
    "check_tracker",
    "converted",
    "displacement",
    "draw_population",
    "extent",
    "finite_costs",
    "fold",
    "hookimpl",
    "mismatch",
    "one_of",
    "positive",
    "repair",
    "sample_normal",
    "whole",
    "wrap",
]


def __getattr__(name: str) -> Any:
    if name not in _CHECKS:
        raise AttributeError(f"module 'posefit.plugin' has no attribute {name!r}")
    from posefit import testing

    return getattr(testing, name)
