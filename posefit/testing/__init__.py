"""Is a plugin right? Checks for optimisers, priors, trackers, starts and segmenters, for an author's own tests.

    from posefit.testing import check_optimiser

    def test_it_keeps_the_rules_of_an_optimiser():
        report = check_optimiser(Mine)
        assert report, str(report)

The same checks run for an installed plugin as `posefit check optimiser NAME`, in a process of its own: there a plugin
that ends or hangs its process has failed a check, where here it ends or hangs the caller's. A factory with the
attribute `baseline = True` is chance itself, and need not beat it.
"""

from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from posefit.testing.results import Check, Report, Result, run_checks

if TYPE_CHECKING:
    from posefit.fitting.optimiser import NextFrame

__all__ = [
    "Check",
    "Report",
    "Result",
    "check_optimiser",
    "check_prior",
    "check_segmenter",
    "check_start",
    "check_tracker",
]

Factory = Callable[..., Any]
Settings = Mapping[str, Any] | None


def check_optimiser(
    factory: Factory, *, next_frame: "NextFrame" = "start", settings: Settings = None
) -> Report:
    """Return the report on an optimiser's factory, true where no check failed; `next_frame` as it is registered."""
    return run_checks(factory, checks_of("optimiser", factory, settings, next_frame))


def check_prior(factory: Factory, *, settings: Settings = None) -> Report:
    """Return the report on a prior's factory, true where no check failed."""
    return run_checks(factory, checks_of("prior", factory, settings))


def check_tracker(
    factory: Factory, *, looks_ahead: bool = False, settings: Settings = None
) -> Report:
    """Return the report on a tracker's factory, true where no check failed; `looks_ahead` as it is registered."""
    return run_checks(factory, checks_of("tracker", factory, settings, looks_ahead))


def check_start(factory: Factory, *, settings: Settings = None) -> Report:
    """Return the report on a start's factory, true where no check failed."""
    return run_checks(factory, checks_of("start", factory, settings))


def check_segmenter(factory: Factory, *, settings: Settings = None) -> Report:
    """Return the report on a segmenter's factory, true where no check failed."""
    return run_checks(factory, checks_of("segmenter", factory, settings))


def checks_of(
    kind: str, factory: Factory, settings: Settings = None, *registered: Any
) -> list[Check]:
    """Return the checks of a kind of plugin: each of its rules, which are loaded when they are needed."""
    rules = import_module(f"posefit.testing.{kind}_rules")
    case = rules.Case(factory, dict(settings or {}), *registered)
    return [Check(rule.__name__, partial(rule, case)) for rule in rules.RULES]
