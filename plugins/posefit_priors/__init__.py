"""Priors for posefit: `pca`, the paper's compact pose space; `loose`, freer limbs; `full`; `union`; scikit-learn's."""

from posefit import hookimpl
from posefit.hooks import RegisterPrior


@hookimpl
def posefit_register_priors(register: RegisterPrior) -> None:
    from posefit_priors.full import Full
    from posefit_priors.loose import Loose
    from posefit_priors.pca import PCA
    from posefit_priors.sklearn import Transformed
    from posefit_priors.union import Union

    register("pca", PCA)
    register("loose", Loose)
    register("full", Full)
    register("union", Union)
    register("sklearn", Transformed)
