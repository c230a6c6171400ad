"""The hooks of a plugin: a module named in the entry-point group `posefit`, which registers what it offers.

    from posefit.plugin import hookimpl

    @hookimpl
    def posefit_register_optimisers(register):
        register("spiral", Spiral)

Two kinds of modules are imported apart from the others, and an entry point's name says which: every command line
imports the modules whose entry point ends in `-commands`, even for `posefit --help`, and a report those whose entry
point ends in `-claims`. All others are imported when a method is needed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, TypeVar

from pluggy import HookspecMarker

from posefit.errors import InputError

if TYPE_CHECKING:
    import click

    from posefit.fitting.optimiser import NextFrame, OptimiserFactory
    from posefit.fitting.prior import PriorFactory
    from posefit.fitting.tracker import TrackerFactory
    from posefit.silhouette.foreground import SegmenterFactory

PROJECT = "posefit"
hookspec = HookspecMarker(PROJECT)
Factory = TypeVar("Factory", contravariant=True)

# The module a factory imports when it is called, and what to install where it is absent: ("cma", "posefit[pycma]").
Needs = tuple[str, str]


@dataclass(frozen=True)
class ClaimedOrder:
    """What a publication claims of methods: each of them is beaten by the next.

    Raises ValueError for fewer than two methods, or one that is there twice.
    """

    source: str  # how a report calls the publication: "the SAPSO paper"
    statement: str  # the claim, as the second half of a sentence
    methods: tuple[str, ...]  # worst first, by the names that plans have for them

    def __post_init__(self) -> None:
        if len(set(self.methods)) != len(self.methods) or len(self.methods) < 2:
            raise InputError(f"methods must be at least two that differ, got {', '.join(self.methods) or 'none'}")

    @property
    def name(self) -> str:
        """How lists and errors name the claim."""
        return f"{self.source!r} of {', '.join(self.methods)}"


class RegisterOptimiser(Protocol):
    """Registers an optimiser: its name, its factory, what becomes of it in the next frame, and what it needs."""

    def __call__(
        self, name: str, factory: "OptimiserFactory", *, next_frame: "NextFrame" = "start", needs: Needs | None = None
    ) -> None:
        """Register an optimiser."""


class Register(Protocol[Factory]):
    """Registers anything else that has a factory: its name, its factory and what it needs."""

    def __call__(self, name: str, factory: Factory, *, needs: Needs | None = None) -> None:
        """Register a prior, a tracker or a segmenter."""


RegisterPrior: TypeAlias = Register["PriorFactory"]
RegisterTracker: TypeAlias = Register["TrackerFactory"]
RegisterSegmenter: TypeAlias = Register["SegmenterFactory"]
RegisterCommand: TypeAlias = Callable[["click.Command"], None]
RegisterClaim: TypeAlias = Callable[[ClaimedOrder], None]


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


@hookspec
def posefit_register_commands(register: RegisterCommand) -> Any:
    """Call `register(command)` for each command, a `click.Command` or a group of them.

    A ValueError, an ImportError or a missing file becomes one line for the user, with exit status 2.
    """


@hookspec
def posefit_register_claims(register: RegisterClaim) -> Any:
    """Call `register(ClaimedOrder(...))` for each order of methods that a publication claims."""
