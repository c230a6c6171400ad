"""Optimisers of other libraries for posefit, and posefit's problems for other tools.

`optimisers` wraps the optimisers of Nevergrad, Optuna, pycma, pymoo and SciPy for
posefit. `problems` converts the problems of posefit's suites for IOHexperimenter,
Nevergrad, OptunaHub and pymoo. `coco` tells COCO's post-processing about the suite. A
library is imported when it is used; `pip install posefit[NAME]` installs it, except
COCO's, which is `pip install cocopp`.
"""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Register the optimisers of each library: `pycma`, families such as `pymoo`."""
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
