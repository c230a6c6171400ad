"""What is compared in the SAPSO paper's experiments, and how much of them is run."""

from dataclasses import dataclass
from typing import Any, NamedTuple

from posefit.tracking.options import ITERATIONS
from posefit_reproduce.sapso.numbers import FRAMES

DRIVEN: dict[str, Any] = {"tracker.tilt": "box"}  # Interpretation S16: the paper learns nothing of the root
WORKERS = 2  # tracks at once: what a frame takes depends on it


class PaperMethod(NamedTuple):
    """What is compared: an optimiser in a space."""

    label: str
    optimiser: str
    prior: str
    prior_settings: dict[str, Any]


_FULL = ("full", {"limits": "training"})  # constraint 1 on all angles; the files' joint limits alone are far wider
METHODS = {
    "particle@full": PaperMethod("PF", "particle", *_FULL),
    "sapso@full": PaperMethod("SAPSO", "sapso", *_FULL),
    "sapso@pca": PaperMethod("PCA + SAPSO", "sapso", "pca", {}),
    "pso@pca": PaperMethod("PCA + PSO", "pso", "pca", {}),
    "particle@pca": PaperMethod("PCA + PF", "particle", "pca", {}),
}
PAPER = ("particle@full", "sapso@full", "sapso@pca")
COMPARED = {"walk": tuple(METHODS), "turn": ("sapso@pca",), "run": tuple(METHODS)}


@dataclass(frozen=True)
class Scale:
    """How much of the paper's experiments is run."""

    frames: int = FRAMES
    views: tuple[float, ...] = (0.0, 45.0, 90.0)
    iterations: int = ITERATIONS
    swarms: tuple[int, ...] = (20, 40, 60, 100)  # N of figure 6

    @property
    def shown(self) -> float:
        """The view of table 1 and of figure 5, the middle one."""
        return self.views[len(self.views) // 2]


QUICK = Scale(frames=30, views=(45.0,))
