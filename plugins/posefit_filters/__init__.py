"""Particle filters for posefit: `particle` and `annealed`.

They carry their particles from frame to frame.

- `particle.Particle` is the bootstrap filter of Gordon, Salmond and Smith (1993), with
  which the SAPSO paper compares.
- `annealed.Annealed` is the annealed particle filter of Deutscher and Reid (2005).

`weighting` finds how sharply to weigh the particles.

Example:
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
