"""What the SAPSO paper claims of its method, for the reports of sweeps in which its three methods take part."""

from collections.abc import Callable

from posefit import hookimpl
from posefit.claims import ClaimedOrder

SAPSO_ORDER = ClaimedOrder(
    source="the SAPSO paper",
    said="the swarm beats a particle filter in the full space of angles, and is better again in the compact space of "
    "principal components",
    methods=("particle@full", "sapso@full", "sapso@pca"),
)


@hookimpl
def posefit_register_claims(register: Callable[[ClaimedOrder], None]) -> None:
    """Offer the paper's order."""
    register(SAPSO_ORDER)
