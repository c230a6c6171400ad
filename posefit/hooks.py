"""What a plugin may offer. A plugin is a module named in the entry-point group `posefit`."""

from collections.abc import Callable

from pluggy import HookspecMarker

from posefit.fitting.optimiser import OptimiserFactory
from posefit.fitting.prior import PriorFactory

PROJECT = "posefit"
hookspec = HookspecMarker(PROJECT)


@hookspec
def posefit_register_optimisers(register: Callable[[str, OptimiserFactory], None]) -> None:
    """Call `register(name, factory)` for each optimiser; see `posefit.fitting.optimiser`."""


@hookspec
def posefit_register_priors(register: Callable[[str, PriorFactory], None]) -> None:
    """Call `register(name, factory)` for each prior; see `posefit.fitting.prior`."""
