"""Particle swarms for posefit: `sapso`, and `random`, the baseline every optimiser has to beat."""

from collections.abc import Callable

from posefit import hookimpl
from posefit.fitting.optimiser import OptimiserFactory


@hookimpl
def posefit_register_optimisers(register: Callable[[str, OptimiserFactory], None]) -> None:
    from posefit_swarm.random import Random
    from posefit_swarm.sapso import SAPSO

    register("sapso", SAPSO)
    register("random", Random)
