"""Evolution strategies for posefit: `cma`, covariance matrix adaptation.

It follows Hansen's tutorial (2016). The algorithm is `posefit.fitting.cma`, with which
posefit also fits a person's build. `pycma` is an adapter to another implementation.

Example:
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
    from posefit.fitting.cma import CMAES

    register("cma", CMAES)
