"""Evolution strategies for posefit: `cma`.

`cma.CMAES` is covariance matrix adaptation after Hansen's tutorial (2016), with the restarts of Auger and Hansen
(2005), in a box whose constraints it keeps; the strategy itself is `posefit.evolution`. `pycma`, an adapter, has the
other implementation.

>>> import posefit
>>> track = posefit.track("walk", method="cma", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Offer `cma`."""
    from posefit_evolution.cma import CMAES

    register("cma", CMAES)
