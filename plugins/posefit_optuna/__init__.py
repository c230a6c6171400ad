"""Samplers of Optuna for posefit: `optuna:SAMPLER`, such as `optuna:TPESampler` or `optuna:GPSampler`.

T. Akiba et al., Optuna: a next-generation hyperparameter optimization framework, KDD 2019.
`pip install posefit[optuna]`.

>>> import posefit
>>> track = posefit.track("walk", method="optuna:CmaEsSampler", frames=(0, 3), evaluations=100)
>>> track.summary["iou"] > 0.3
True
"""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Register `optuna:SAMPLER`."""
    from posefit_optuna.adapter import Optuna

    register("optuna", Optuna, needs=("optuna", "posefit[optuna]"))
