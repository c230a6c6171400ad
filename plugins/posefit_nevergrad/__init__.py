"""Optimisers of Nevergrad for posefit: `nevergrad:NAME`, a name of `nevergrad.optimizers.registry`.

J. Rapin, O. Teytaud, Nevergrad, a gradient-free optimization platform, 2018. `pip install posefit[nevergrad]`.

>>> import posefit
>>> track = posefit.track("walk", method="nevergrad:OnePlusOne", frames=(0, 3))
>>> track.summary["iou"] > 0.3
True
"""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Register `nevergrad:NAME`."""
    from posefit_nevergrad.adapter import Nevergrad

    register("nevergrad", Nevergrad, needs=("nevergrad", "posefit[nevergrad]"))
