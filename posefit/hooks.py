"""What a plugin may offer. A plugin is a module named in the entry-point group `posefit`."""

from typing import Any, Protocol

from pluggy import HookspecMarker

from posefit.entries import PROJECT
from posefit.fitting.optimiser import NextFrame, OptimiserFactory
from posefit.fitting.prior import PriorFactory
from posefit.fitting.tracker import TrackerFactory
from posefit.silhouette.foreground import SegmenterFactory

hookspec = HookspecMarker(PROJECT)

# The module a factory imports when it is called, and what to install where it is absent: ("cma", "posefit[pycma]").
Needs = tuple[str, str]


class RegisterOptimiser(Protocol):
    """Offers an optimiser under a name, says what becomes of it in the next frame, and what it needs."""

    def __call__(
        self, name: str, factory: OptimiserFactory, *, next_frame: NextFrame = "start", needs: Needs | None = None
    ) -> None:
        """Take an optimiser's factory."""


class RegisterPrior(Protocol):
    """Offers a prior under a name, and says what it needs."""

    def __call__(self, name: str, factory: PriorFactory, *, needs: Needs | None = None) -> None:
        """Take a prior's factory."""


class RegisterTracker(Protocol):
    """Offers a tracker under a name, and says what it needs."""

    def __call__(self, name: str, factory: TrackerFactory, *, needs: Needs | None = None) -> None:
        """Take a tracker's factory."""


class RegisterSegmenter(Protocol):
    """Offers a segmenter under a name, and says what it needs."""

    def __call__(self, name: str, factory: SegmenterFactory, *, needs: Needs | None = None) -> None:
        """Take a segmenter's factory."""


@hookspec
def posefit_register_optimisers(register: RegisterOptimiser) -> Any:
    """Call `register(name, factory)` for each optimiser; see `posefit.fitting.optimiser`."""


@hookspec
def posefit_register_priors(register: RegisterPrior) -> Any:
    """Call `register(name, factory)` for each prior; see `posefit.fitting.prior`."""


@hookspec
def posefit_register_trackers(register: RegisterTracker) -> Any:
    """Call `register(name, factory)` for each tracker; see `posefit.fitting.tracker`."""


@hookspec
def posefit_register_segmenters(register: RegisterSegmenter) -> Any:
    """Call `register(name, factory)` for each segmenter; see `posefit.silhouette.foreground`."""
