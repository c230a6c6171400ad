"""Optimisers of pymoo for posefit: `pymoo:NAME`, one of its single-objective algorithms with a population.

J. Blank, K. Deb, pymoo: multi-objective optimization in Python, IEEE Access 8, 2020. `pip install posefit[pymoo]`.

>>> import posefit
>>> track = posefit.track("walk", method="pymoo:DE", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Register `pymoo:NAME`."""
    from posefit_pymoo.adapter import Pymoo

    register("pymoo", Pymoo, needs=("pymoo", "posefit[pymoo]"))
