"""Optimisers of SciPy for posefit: `scipy:differential_evolution` and `scipy:dual_annealing`.

R. Storn, K. Price, Differential evolution, Journal of Global Optimization 11, 1997; Y. Xiang et al., Generalized
simulated annealing for global optimization, The R Journal 5(1), 2013.

>>> import posefit
>>> track = posefit.track("walk", method="scipy:differential_evolution", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Register `scipy:NAME`."""
    from posefit_scipy.adapter import scipy

    register("scipy", scipy)
