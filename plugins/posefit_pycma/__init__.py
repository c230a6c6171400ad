"""CMA-ES as the library pycma implements it, for posefit: `pycma`.

N. Hansen, Y. Akimoto, P. Baudis, CMA-ES/pycma on GitHub, 2019. `pip install posefit[pycma]`.

>>> import posefit
>>> track = posefit.track("walk", method="pycma", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Register `pycma`."""
    from posefit_pycma.adapter import PyCMA

    register("pycma", PyCMA, needs=("cma", "posefit[pycma]"))
