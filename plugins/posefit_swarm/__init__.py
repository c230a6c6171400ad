"""Particle swarms for posefit: `sapso`, `pso`, and `random`, the baseline every optimiser has to beat."""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    from posefit_swarm.pso import PSO
    from posefit_swarm.random import Random
    from posefit_swarm.sapso import SAPSO

    register("sapso", SAPSO)
    register("pso", PSO)
    register("random", Random, next_frame="forget")
