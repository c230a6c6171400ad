"""Optimisers of other libraries for posefit, and problems of posefit's suites for other tools.

`optimisers` are those of Nevergrad, Optuna, pycma, pymoo and SciPy, by ask and tell; `problems` are for
IOHexperimenter, Nevergrad, OptunaHub and pymoo. A library is imported where it is used; `pip install posefit[NAME]`
brings it along.
"""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Register the optimisers of each library: `pycma`, and those of a family such as `optuna:SAMPLER`."""
    from posefit_bridges.optimisers import (
        bridge,
        nevergrad,
        optuna,
        pycma,
        pymoo,
        scipy,
    )

    register("nevergrad", bridge(nevergrad), needs=("nevergrad", "posefit[nevergrad]"))
    register("optuna", bridge(optuna), needs=("optuna", "posefit[optuna]"))
    register("pycma", bridge(pycma), needs=("cma", "posefit[pycma]"))
    register("pymoo", bridge(pymoo), needs=("pymoo", "posefit[pymoo]"))
    register("scipy", bridge(scipy))
