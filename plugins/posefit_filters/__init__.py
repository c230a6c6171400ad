"""Particle filters for posefit, which carry their particles from frame to frame: `particle` and `annealed`.

- `particle.Particle` is the bootstrap filter of Gordon, Salmond and Smith (1993), the SAPSO paper's opponent.
- `annealed.Annealed` is the annealed particle filter of Deutscher and Reid (2005).

`weighting` weighs particles, computes how sharply, and resamples by weight.

>>> import posefit
>>> track = posefit.track("walk", method="annealed", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Offer `particle` and `annealed`."""
    from posefit_filters.annealed import Annealed
    from posefit_filters.particle import Particle

    register("particle", Particle, next_frame="carry")
    register("annealed", Annealed, next_frame="carry")
