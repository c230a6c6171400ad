"""What the author of a plugin imports: the marker of hooks, protocols and their data, functions on a search space.

    from posefit.plugin import draw_population, hookimpl, sample_normal

An optimiser knows four members of its space: `dimensions`, `start`, `periodic` and `feasible`. Everything else it does
with a space is a function here.

| what you write | what it is | its hook |
|---|---|---|
| optimiser | `Optimiser`, or `Filter`, of a `Space` | `posefit_register_optimisers` |
| prior | `Prior` | `posefit_register_priors` |
| tracker | `Tracker`: a `Task` and `Observation`s in, `Frame`s out | `posefit_register_trackers` |
| segmenter | `Segmenter` of a `Footage` | `posefit_register_segmenters` |
| command | a `click.Command` | `posefit_register_commands` |
"""

from typing import TYPE_CHECKING, Any

from posefit import hookimpl as hookimpl
from posefit.arrays import Array as Array
from posefit.fitting.box import Space as Space
from posefit.fitting.box import Start as Start
from posefit.fitting.box import converted as converted
from posefit.fitting.box import displacement as displacement
from posefit.fitting.box import draw_population as draw_population
from posefit.fitting.box import extent as extent
from posefit.fitting.box import fold as fold
from posefit.fitting.box import repair as repair
from posefit.fitting.box import sample_normal as sample_normal
from posefit.fitting.box import wrap as wrap
from posefit.fitting.check import at_least as at_least
from posefit.fitting.check import between as between
from posefit.fitting.check import choices as choices
from posefit.fitting.check import one_of as one_of
from posefit.fitting.check import positive as positive
from posefit.fitting.check import whole as whole
from posefit.fitting.optimiser import Adapter as Adapter
from posefit.fitting.optimiser import Filter as Filter
from posefit.fitting.optimiser import Optimiser as Optimiser
from posefit.fitting.optimiser import finite_costs as finite_costs
from posefit.fitting.prior import Prior as Prior
from posefit.fitting.tracker import Frame as Frame
from posefit.fitting.tracker import Observation as Observation
from posefit.fitting.tracker import Task as Task
from posefit.fitting.tracker import Tracker as Tracker
from posefit.hooks import RegisterCommand as RegisterCommand
from posefit.hooks import RegisterOptimiser as RegisterOptimiser
from posefit.hooks import RegisterPrior as RegisterPrior
from posefit.hooks import RegisterSegmenter as RegisterSegmenter
from posefit.hooks import RegisterTracker as RegisterTracker
from posefit.silhouette.cost import areas as areas
from posefit.silhouette.cost import mismatch as mismatch
from posefit.silhouette.foreground import Footage as Footage
from posefit.silhouette.foreground import Segmenter as Segmenter

if TYPE_CHECKING:
    from posefit.testing import check_optimiser as check_optimiser
    from posefit.testing import check_prior as check_prior
    from posefit.testing import check_segmenter as check_segmenter
    from posefit.testing import check_tracker as check_tracker

_CHECKS = ("check_optimiser", "check_prior", "check_segmenter", "check_tracker")  # imported when first used


def __getattr__(name: str) -> Any:
    if name not in _CHECKS:
        raise AttributeError(f"module 'posefit.plugin' has no attribute {name!r}")
    from posefit import testing

    return getattr(testing, name)
