"""Priors for posefit: `pca`, `loose`, `full`, and `sklearn:NAME`.

- `pca.PCA` is section 2 of the SAPSO paper, the compact pose space: principal
  components, a range (constraint 1) and clusters (constraint 2).
- `loose.Loose` adds freedom at shoulders, elbows, hips and knees, for movements outside
  the training poses.
- `full.Full` has every joint angle that moves, within its limits.
- `sklearn.Transformed` is a decomposition of scikit-learn with an inverse, such as
  `sklearn:KernelPCA`.

Example:
    >>> import posefit
    >>> track = posefit.track("walk", method="@loose", frames=(0, 3))
    >>> track.summary["iou"] > 0.5
    True
"""

from posefit import hookimpl
from posefit.hooks import RegisterPrior


@hookimpl
def posefit_register_priors(register: RegisterPrior) -> None:
    """Offer `pca`, `loose`, `full` and `sklearn:NAME`."""
    from posefit_priors.full import Full
    from posefit_priors.loose import Loose
    from posefit_priors.pca import PCA
    from posefit_priors.sklearn import Transformed

    register("pca", PCA)
    register("loose", Loose)
    register("full", Full)
    register("sklearn", Transformed)
