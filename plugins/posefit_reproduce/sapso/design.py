"""What is compared in the SAPSO paper's experiments, and how much of them is run."""

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from posefit.tracking.options import ITERATIONS
from posefit_reproduce.sapso.numbers import FRAMES

DRIVEN: dict[str, Any] = {"tracker.tilt": "box"}  # Interpretation S16: the paper learns nothing of the root
OURS, LETTER = "sapso@pca", "sapso:paper@pca"  # the two variants that are run side by side
OCCLUDER = 0.5  # strength of the occluder that hides a part of the silhouette, as in figure 8
FirstYaw = Literal["known", "unknown"]
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
    OURS: PaperMethod("PCA + SAPSO", "sapso", "pca", {}),
    LETTER: PaperMethod("PCA + SAPSO, paper", "sapso:paper", "pca", {}),
    "pso@pca": PaperMethod("PCA + PSO", "pso", "pca", {}),
    "particle@pca": PaperMethod("PCA + PF", "particle", "pca", {}),
}
PAPER = ("particle@full", "sapso@full", OURS)
COMPARED = {"walk": tuple(METHODS), "turn": (OURS, LETTER), "run": tuple(METHODS)}


def settings_of(name: str) -> dict[str, Any]:
    """Return the settings with which a method is run, by the names that `--set` has for them."""
    method = METHODS[name]
    chosen = {f"{method.prior}.{setting}": value for setting, value in method.prior_settings.items()}
    return chosen | ({"tracker.variant": "paper"} if name == LETTER else DRIVEN)


@dataclass(frozen=True)
class Scale:
    """How much of the paper's experiments is run."""

    frames: int = FRAMES
    views: tuple[float, ...] = (0.0, 45.0, 90.0)
    iterations: int = ITERATIONS
    swarms: tuple[int, ...] = (20, 40, 60, 100)  # N of figure 6
    first_yaw: FirstYaw = "known"  # of a track: Interpretation S17

    @property
    def shown(self) -> float:
        """The view of table 1 and of figure 5, the middle one."""
        return self.views[len(self.views) // 2]


QUICK = Scale(frames=30, views=(45.0,))
