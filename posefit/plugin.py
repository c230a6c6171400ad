"""What the author of a plugin imports: the marker of hooks, protocols and their data, functions on a search space.

    from posefit.plugin import draw_population, hookimpl, sample_normal

An optimiser knows four members of its space: `dimensions`, `start`, `periodic` and `feasible`. Everything else it does
with a space is a function here.

| what you write | what it is | its hook |
|---|---|---|
| optimiser | `Optimiser`, or `Filter`, of a `Space` | `posefit_register_optimisers` |
| prior | `Prior` | `posefit_register_priors` |
| tracker | `Tracker`: a `Task` and `Observation`s in, `Frame`s out | `posefit_register_trackers` |
| start | `Initialiser` of a `Task`: an `Observation` in, a `Posterior` of poses out | `posefit_register_starts` |
| segmenter | `Segmenter` of a `Film` | `posefit_register_segmenters` |
| device | `Device`, which draws poses and counts their areas | `posefit_register_devices` |
| command | a `click.Command` | `posefit_register_commands` |

A name is imported when it is first used, so that a command line that lists plugins stays quick.
"""

from posefit import hookimpl
from posefit.lazy import names_of_stub

__getattr__, __dir__, _names = names_of_stub(__name__, __file__)
__all__ = ["hookimpl", *_names]
