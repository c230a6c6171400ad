"""Particle filters for posefit, which carry their particles from frame to frame: `particle` and `annealed`."""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    from posefit_filters.annealed import Annealed
    from posefit_filters.particle import Particle

    register("particle", Particle, next_frame="carry")
    register("annealed", Annealed, next_frame="carry")
