"""Optimisers of other libraries for posefit, and problems of posefit's suites for other tools.

| looking for | file |
|---|---|
| optimisers of Nevergrad, Optuna, pycma, pymoo and SciPy, by ask and tell | nevergrad.py, optuna.py, ... |
| problems for IOHexperimenter, Nevergrad, OptunaHub and pymoo | problems.py |

A library is imported where it is used; `pip install posefit[NAME]` brings it along.
"""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Register the optimisers of each library: `pycma`, and those of a family such as `optuna:SAMPLER`."""
    from posefit_bridges.nevergrad import Nevergrad
    from posefit_bridges.optuna import Optuna
    from posefit_bridges.pycma import PyCMA
    from posefit_bridges.pymoo import Pymoo
    from posefit_bridges.scipy import scipy

    register("nevergrad", Nevergrad, needs=("nevergrad", "posefit[nevergrad]"))
    register("optuna", Optuna, needs=("optuna", "posefit[optuna]"))
    register("pycma", PyCMA, needs=("cma", "posefit[pycma]"))
    register("pymoo", Pymoo, needs=("pymoo", "posefit[pymoo]"))
    register("scipy", scipy)
