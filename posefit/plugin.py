"""What plugin authors import: the hook marker, protocols, data, and functions.

    from posefit.plugin import draw_population, hookimpl, sample_normal

An optimiser uses four members of its space: `dimensions`, `start`, `periodic` and
`feasible`. Whatever else it does with a space is a function here.

| plugin | meaning | hook |
|---|---|---|
| optimiser | `Optimiser`, or `Filter`, of a `Space` | `posefit_register_optimisers` |
| prior | `Prior` | `posefit_register_priors` |
| tracker | `Tracker`: `Observation`s in, `Frame`s out | `posefit_register_trackers` |
| start | `Initialiser`: `Observation` in, `Posterior` out | `posefit_register_starts` |
| segmenter | `Segmenter` of a `Film` | `posefit_register_segmenters` |
| device | `Device`, which rasterises poses | `posefit_register_devices` |
| command | a `click.Command` | `posefit_register_commands` |

A name is imported when it is first used, so that a command that lists plugins is quick.
"""

from posefit import hookimpl
from posefit.lazy import names_of_stub

__getattr__, __dir__, _names = names_of_stub(__name__, __file__)
__all__ = ["hookimpl", *_names]
