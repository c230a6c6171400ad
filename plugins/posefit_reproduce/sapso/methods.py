"""The compared methods: the paper's, its letter, and variants without one part."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.evaluation.measures import BASELINES
from posefit_priors.pca import PCA
from posefit_swarm.sapso import SAPSO, inertia_at

# our reading and the letter, which are run side by side in every experiment
OURS = "sapso@pca"
LETTER = "sapso-letter@pca"
# without constraint 1, this factor widens the range of the training latents
WIDER = 3.0
NO_LIMIT = 2.0  # alpha with which a velocity may cross the whole box
# Interpretation S16: the paper does not learn the root
DRIVEN = {"tracker.tilt": "box"}


class WidePCA(PCA):
    """The compact space without the range of constraint 1."""

    def fit(self, angles: Array, skeleton: object = None) -> "WidePCA":
        """Learn the space, and widen its box around the middle."""
        super().fit(angles)
        middle = (self.high + self.low) / 2.0
        half = (self.high - self.low) / 2.0
        self.low = middle - WIDER * half
        self.high = middle + WIDER * half
        return self


class UnclusteredPCA(PCA):
    """The compact space without constraint 2."""

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return True (n,) for all latents (n, m)."""
        return np.ones(len(latents), dtype=bool)


class ConstantInertia(SAPSO):
    """SAPSO with a constant inertia, 0.3, that of the middle of a search."""

    def inertia(self) -> float:
        """Return omega in the middle of a search."""
        return inertia_at(self.C // 2, self.C, self.A)


class PaperMethod(NamedTuple):
    """A method: its name in tables and the options of its tracks.

    A prior or optimiser in a pair may be a class.
    """

    label: str
    options: Mapping[str, Any]


def _search(
    label: str,
    method: str | tuple[Any, Any],
    settings: Mapping[str, Any] = DRIVEN,
    **more: Any,
) -> PaperMethod:
    return PaperMethod(label, {"method": method, "settings": settings, **more})


# constraint 1 on all angles: the files' joint limits alone are far wider
_FULL = DRIVEN | {"full.limits": "training"}
# a temperature at which every move is accepted, and one at which no worse one is
_ALWAYS = {"sapso.temperature": 1e9, "sapso.cooling": 1.0}
_NEVER = {"sapso.temperature": 1e-9, "sapso.cooling": 1.0}
PAPER = {
    "particle@full": _search("PF", "particle@full", _FULL),
    "sapso@full": _search("SAPSO", "sapso@full", _FULL),
    OURS: _search("PCA + SAPSO", OURS),
}
OTHERS = {
    LETTER: _search("PCA + SAPSO, the letter", LETTER, {"tracker.variant": "paper"}),
    "pso@pca": _search("PCA + PSO", "pso@pca"),
    "particle@pca": _search("PCA + PF", "particle@pca"),
}
# PCA + SAPSO without one of its parts, with as many evaluations
PARTS = {
    "no-velocity-limits": _search(
        "no velocity limits (half of constraint 1)",
        OURS,
        DRIVEN | {"sapso.alpha": NO_LIMIT},
    ),
    "no-range": _search(
        "no constraint 1", ("sapso", WidePCA), DRIVEN | {"sapso.alpha": NO_LIMIT}
    ),
    "no-clusters": _search("no constraint 2", ("sapso", UnclusteredPCA)),
    "every-move": _search("no annealing: every move counts", OURS, DRIVEN | _ALWAYS),
    "better-moves": _search(
        "no annealing: only better moves count", OURS, DRIVEN | _NEVER
    ),
    "constant-inertia": _search("inertia constant at 0.3", (ConstantInertia, "pca")),
}
# variants that may follow a turn better, with the walk's budget
TURNING = {
    "turning-prior": _search(
        "PCA of walks with turns + SAPSO", OURS, train=["16_18", "16_20"]
    ),
    "wider-yaw": _search(
        "PCA + SAPSO, yaw of 90 degrees to either side",
        OURS,
        DRIVEN | {"tracker.root_range_degrees": (90.0, 15.0, 15.0)},
    ),
    "exemplars": PaperMethod(
        "exemplars, of other people", {"method": "exemplars", "train": ["library:-16"]}
    ),
}
METHODS = PAPER | OTHERS | PARTS | TURNING
LABELS = {name: method.label for name, method in METHODS.items()} | BASELINES
