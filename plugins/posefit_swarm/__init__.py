"""Particle swarms for posefit: `sapso`, `pso`, and the baseline `random`.

- `sapso.SAPSO` is Algorithm 1 of the paper on which posefit is based:
  simulated-annealed particle swarm optimisation.
- `pso.PSO` is the swarm of Kennedy and Eberhart (1995), with the constriction of Clerc
  and Kennedy (2002).
- `random.Random` draws uniformly. Every optimiser should beat it.

Example:
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
