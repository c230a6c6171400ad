"""The hooks of a plugin.

A plugin is a module that is named in the entry-point group `posefit`. Its hooks
register what it offers.

    from posefit.plugin import hookimpl

    @hookimpl
    def posefit_register_optimisers(register):
        register("spiral", Spiral)

posefit imports the module of every plugin to find commands, even for `posefit --help`.
It calls the other hooks when it needs a method. So heavy imports belong inside the
hooks and inside what they register.
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

# the module that a factory imports when it is called, and what to install if it is
# missing: ("cma", "posefit[pycma]")
Needs = tuple[str, str]


class RegisterOptimiser(Protocol):
    """Registers an optimiser.

    Example:
        >>> from posefit.plugin import RegisterOptimiser, hookimpl
        >>> class Mine:
        ...     ...
        >>> @hookimpl
        ... def posefit_register_optimisers(register: RegisterOptimiser) -> None:
        ...     register("mine", Mine)
    """

    def __call__(
        self,
        name: str,
        factory: "OptimiserFactory",
        *,
        next_frame: "NextFrame" = "start",
        needs: Needs | None = None,
    ) -> None:
        """Register an optimiser.

        Args:
            name: How users name it.
            factory: Takes (space, rng) and keyword-only settings.
            next_frame: What happens to the optimiser in the next frame.
            needs: A module that the factory imports, and what to install for it.
        """


class RegisterTracker(Protocol):
    """Registers a tracker.

    Example:
        >>> from posefit.plugin import RegisterTracker, hookimpl
        >>> class Mine:
        ...     ...
        >>> @hookimpl
        ... def posefit_register_trackers(register: RegisterTracker) -> None:
        ...     register("mine", Mine)
    """

    def __call__(
        self,
        name: str,
        factory: "TrackerFactory",
        *,
        looks_ahead: bool = False,
        needs: Needs | None = None,
    ) -> None:
        """Register a tracker.

        Args:
            name: How users name it.
            factory: Takes (task) and keyword-only settings.
            looks_ahead: Whether it takes several observations before it yields the
                frame of the first.
            needs: A module that the factory imports, and what to install for it.
        """


class RegisterPrior(Protocol):
    """Registers a prior.

    Example:
        >>> from posefit.plugin import RegisterPrior, hookimpl
        >>> class Mine:
        ...     ...
        >>> @hookimpl
        ... def posefit_register_priors(register: RegisterPrior) -> None:
        ...     register("mine", Mine)
    """

    def __call__(
        self, name: str, factory: "PriorFactory", *, needs: Needs | None = None
    ) -> None:
        """Register a prior.

        Args:
            name: How users name it.
            factory: Takes keyword-only settings.
            needs: A module that the factory imports, and what to install for it.
        """


class RegisterStart(Protocol):
    """Registers a start, which guesses first poses.

    Example:
        >>> from posefit.plugin import RegisterStart, hookimpl
        >>> class Mine:
        ...     ...
        >>> @hookimpl
        ... def posefit_register_starts(register: RegisterStart) -> None:
        ...     register("mine", Mine)
    """

    def __call__(
        self, name: str, factory: "InitialiserFactory", *, needs: Needs | None = None
    ) -> None:
        """Register a start.

        Args:
            name: How users name it.
            factory: Takes (task) and keyword-only settings.
            needs: A module that the factory imports, and what to install for it.
        """


class RegisterSegmenter(Protocol):
    """Registers a segmenter.

    Example:
        >>> from posefit.plugin import RegisterSegmenter, hookimpl
        >>> class Mine:
        ...     ...
        >>> @hookimpl
        ... def posefit_register_segmenters(register: RegisterSegmenter) -> None:
        ...     register("mine", Mine)
    """

    def __call__(
        self,
        name: str,
        factory: "SegmenterFactory",
        *,
        still_background: bool = True,
        needs: Needs | None = None,
    ) -> None:
        """Register a segmenter.

        Args:
            name: How users name it.
            factory: Takes (film) and keyword-only settings.
            still_background: Whether it needs a still background. If so, motion outside
                its masks counts against them.
            needs: A module that the factory imports, and what to install for it.
        """


class RegisterDevice(Protocol):
    """Registers a device, which draws poses.

    Example:
        >>> from posefit.plugin import RegisterDevice, hookimpl
        >>> class Mine:
        ...     ...
        >>> @hookimpl
        ... def posefit_register_devices(register: RegisterDevice) -> None:
        ...     register("mine", Mine)
    """

    def __call__(
        self,
        name: str,
        factory: "Callable[[], Device]",
        *,
        needs: Needs | None = None,
    ) -> None:
        """Register a device.

        Args:
            name: How users name it.
            factory: Takes nothing. Raises InputError if the machine has no such device.
            needs: A module that the factory imports, and what to install for it.
        """


RegisterCommand: TypeAlias = Callable[["click.Command"], None]


@hookspec
def posefit_register_optimisers(register: RegisterOptimiser) -> Any:
    """Call `register(name, factory)` for each optimiser.

    See `posefit.fitting.optimiser`.
    """


@hookspec
def posefit_register_priors(register: RegisterPrior) -> Any:
    """Call `register(name, factory)` for each prior.

    See `posefit.fitting.prior`.
    """


@hookspec
def posefit_register_trackers(register: RegisterTracker) -> Any:
    """Call `register(name, factory)` for each tracker.

    See `posefit.fitting.tracker`.
    """


@hookspec
def posefit_register_starts(register: RegisterStart) -> Any:
    """Call `register(name, factory)` for each start.

    See `posefit.fitting.start`.
    """


@hookspec
def posefit_register_segmenters(register: RegisterSegmenter) -> Any:
    """Call `register(name, factory)` for each segmenter.

    See `posefit.silhouette.foreground`.
    """


@hookspec
def posefit_register_devices(register: RegisterDevice) -> Any:
    """Call `register(name, factory)` for each device that draws poses.

    See `posefit.silhouette.mask.Device`.
    """


@hookspec
def posefit_register_commands(register: RegisterCommand) -> Any:
    """Call `register(command)` for each command.

    A command is a `click.Command` or a group of commands. A click.UsageError, an
    ImportError or a missing file becomes one line for the user, with exit status 2.
    """
