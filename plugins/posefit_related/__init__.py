"""The methods to which the SAPSO paper compares its own, from their publications.

They get posefit's masks and budgets.

- `hpso.HPSO`: a swarm that searches the kinematic chain part by part (John, Trucco and
  Ivekovic, 2010).
- `haga.HAGA`: an annealed genetic search in layers of coordinates (Zhao and Liu, 2008).
- `psopf.PSOPF`: a particle filter whose particles are moved by a swarm (Krzeszowski,
  Kwolek and Wojciechowski, 2010).
- `local.Local`: best-first search, limb after limb (Gavrila and Davis, 1996).
- `smoothing.Smoothing`: a particle filter with backward smoothing (Peursum, Venkatesh
  and West, 2010).
- `gradient.Gradient`: Gauss-Newton steps to the contours (Wachter and Nagel, 1999).
- `regression.Regression`: poses from silhouettes by regression (Agarwal and Triggs,
  2006).
- `isomap.IsomapPrior`: an Isomap with a local linear inverse (Wang, Xu and Ai, 2003).
- `gplvm.GPLVM`: latents of a Gaussian process (Urtasun, Fleet, Hertzmann and Fua,
  2005).

The searches share `stages`, the trackers share `frames`, and the models learn from
poses of `training`. None of these publications was available in full.
docs/ways/related.md lists the available parts; docstrings name everything else as
interpretations.

Example:
    >>> import posefit
    >>> track = posefit.track("walk", method="psopf", frames=(0, 3))
    >>> track.summary["iou"] > 0.5
    True
"""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser, RegisterPrior, RegisterTracker


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Offer `hpso`, `haga`, `psopf` and `local`."""
    from posefit_related.haga import HAGA
    from posefit_related.hpso import HPSO
    from posefit_related.local import Local
    from posefit_related.psopf import PSOPF

    register("hpso", HPSO)
    register("haga", HAGA)
    register("psopf", PSOPF, next_frame="carry")
    register("local", Local)


@hookimpl
def posefit_register_priors(register: RegisterPrior) -> None:
    """Offer `isomap` and `gplvm`."""
    from posefit_related.gplvm import GPLVM
    from posefit_related.isomap import IsomapPrior

    register("isomap", IsomapPrior)
    register("gplvm", GPLVM)


@hookimpl
def posefit_register_trackers(register: RegisterTracker) -> None:
    """Offer `smoothing`, `gradient` and `regression`."""
    from posefit_related.gradient import Gradient
    from posefit_related.regression import Regression
    from posefit_related.smoothing import Smoothing

    register("smoothing", Smoothing, looks_ahead=True)
    register("gradient", Gradient)
    register("regression", Regression)
