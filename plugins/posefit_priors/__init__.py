"""Priors for posefit: `pca`, the paper's compact pose space."""

from collections.abc import Callable

from posefit import hookimpl
from posefit.fitting.prior import PriorFactory


@hookimpl
def posefit_register_priors(register: Callable[[str, PriorFactory], None]) -> None:
    from posefit_priors.pca import PCA

    register("pca", PCA)
