"""Particle swarms for posefit: `sapso`, `pso`, and `random`, the baseline every optimiser has to beat.

- `sapso.SAPSO` is Algorithm 1 of the paper that posefit is built after, simulated-annealed particle swarm optimisation.
- `pso.PSO` is the swarm of Kennedy and Eberhart (1995), constricted as by Clerc and Kennedy (2002).
- `random.Random` draws uniformly.

>>> import posefit
>>> track = posefit.track("walk", method="sapso", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Offer `sapso`, `pso` and `random`."""
    from posefit_swarm.pso import PSO
    from posefit_swarm.random import Random
    from posefit_swarm.sapso import SAPSO

    register("sapso", SAPSO)
    register("pso", PSO)
    register("random", Random, next_frame="forget")
