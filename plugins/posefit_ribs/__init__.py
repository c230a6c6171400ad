"""Pyribs for posefit: `ribs`, evolution strategies on an archive of dominated novelty search.

B. Tjanaka et al., pyribs: a bare-bones Python library for quality diversity optimization, GECCO 2023; R. Bahlous-Boldi,
M. Faldor et al., Dominated novelty search: rethinking local competition in quality-diversity, arXiv:2502.00593, 2025;
`pip install posefit[ribs]`.

>>> import posefit
>>> track = posefit.track("walk", method="ribs", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

from posefit import hookimpl
from posefit.hooks import RegisterOptimiser


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Register `ribs`."""
    from posefit_ribs.adapter import Ribs

    register("ribs", Ribs, needs=("ribs", "posefit[ribs]"))
