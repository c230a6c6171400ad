"""What the SAPSO paper claims of its method, for the reports of sweeps in which its three methods take part."""

from posefit import hookimpl
from posefit.hooks import ClaimedOrder, RegisterClaim

SAPSO_ORDER = ClaimedOrder(
    source="the SAPSO paper",
    statement="the swarm beats a particle filter in the full space of angles, and is better again in the compact "
    "space of principal components",
    methods=("particle@full", "sapso@full", "sapso@pca"),
)


@hookimpl
def posefit_register_claims(register: RegisterClaim) -> None:
    """Offer the paper's order."""
    register(SAPSO_ORDER)
