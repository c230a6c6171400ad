"""Evolution strategies for posefit: `cma`, on the library cmaes."""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    from posefit_evolution.cma import CMAES

    register("cma", CMAES)
