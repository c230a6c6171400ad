"""The hooks of a plugin: a module named in the entry-point group `posefit`, which registers what it offers.

    from posefit.plugin import hookimpl

    @hookimpl
    def posefit_register_optimisers(register):
        register("spiral", Spiral)

posefit imports the module of every plugin for its commands, even for `posefit --help`, and calls the other hooks when a
method is needed. So heavy imports belong inside the hooks and what they register.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from pluggy import HookspecMarker

if TYPE_CHECKING:
    import click

    from posefit.fitting.optimiser import NextFrame, OptimiserFactory
    from posefit.fitting.prior import PriorFactory
    from posefit.fitting.tracker import InitialiserFactory, TrackerFactory
    from posefit.silhouette.foreground import SegmenterFactory
    from posefit.silhouette.mask import Device

PROJECT = "posefit"
hookspec = HookspecMarker(PROJECT)

# The module a factory imports when it is called, and what to install where it is absent: ("cma", "posefit[pycma]").
Needs = tuple[str, str]


class RegisterOptimiser(Protocol):
    """Registers an optimiser: its name, its factory, what becomes of it in the next frame, and what it needs."""

    def __call__(
        self,
        name: str,
        factory: "OptimiserFactory",
        *,
        next_frame: "NextFrame" = "start",
        needs: Needs | None = None,
    ) -> None:
        """Register an optimiser."""


class RegisterTracker(Protocol):
    """Registers a tracker: its name, its factory, whether it looks ahead, and what it needs.

    One that looks ahead takes several observations before it yields the frame of the first.
    """

    def __call__(
        self,
        name: str,
        factory: "TrackerFactory",
        *,
        looks_ahead: bool = False,
        needs: Needs | None = None,
    ) -> None:
        """Register a tracker."""


class RegisterPrior(Protocol):
    """Registers a prior: its name, its factory and what it needs."""

    def __call__(
        self, name: str, factory: "PriorFactory", *, needs: Needs | None = None
    ) -> None:
        """Register a prior."""


class RegisterStart(Protocol):
    """Registers what guesses first poses: its name, its factory and what it needs."""

    def __call__(
        self, name: str, factory: "InitialiserFactory", *, needs: Needs | None = None
    ) -> None:
        """Register a start."""


class RegisterSegmenter(Protocol):
    """Registers a segmenter: its name, its factory, whether it needs a still background, and what else it needs.

    The masks of one that needs a still background are judged by what moves outside them.
    """

    def __call__(
        self,
        name: str,
        factory: "SegmenterFactory",
        *,
        still_background: bool = True,
        needs: Needs | None = None,
    ) -> None:
        """Register a segmenter."""


class RegisterDevice(Protocol):
    """Registers a device: its name, its factory, which raises InputError if there is none, and what it needs."""

    def __call__(
        self,
        name: str,
        factory: "Callable[[], Device]",
        *,
        needs: Needs | None = None,
    ) -> None:
        """Register a device."""


RegisterCommand: TypeAlias = Callable[["click.Command"], None]


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
def posefit_register_starts(register: RegisterStart) -> Any:
    """Call `register(name, factory)` for each way to guess a first pose; see `posefit.fitting.start`."""


@hookspec
def posefit_register_segmenters(register: RegisterSegmenter) -> Any:
    """Call `register(name, factory)` for each segmenter; see `posefit.silhouette.foreground`."""


@hookspec
def posefit_register_devices(register: RegisterDevice) -> Any:
    """Call `register(name, factory)` for each device that draws poses; see `posefit.silhouette.mask.Device`."""


@hookspec
def posefit_register_commands(register: RegisterCommand) -> Any:
    """Call `register(command)` for each command, a `click.Command` or a group of them.

    A ValueError, an ImportError or a missing file becomes one line for the user, with exit status 2.
    """
