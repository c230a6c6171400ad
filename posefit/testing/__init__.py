"""Is a plugin right? Checks for optimisers, priors, trackers and segmenters, for an author's own tests.

    from posefit.testing import check_optimiser
    assert check_optimiser(Mine)

or one test a rule:

    from posefit.testing import optimiser_checks, parametrize

    @parametrize(optimiser_checks(Mine))
    def test_kit(check):
        check()

The same checks run for an installed plugin as `posefit check optimiser NAME`, in a process of its own: there a plugin
that ends or hangs its process has failed a check, where here it ends or hangs the caller's. A factory with the
attribute `baseline = True` is chance itself, and need not beat it.
"""

from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from posefit.testing.results import Check, Report, Result, parametrize, run_checks

if TYPE_CHECKING:
    from posefit.fitting.optimiser import NextFrame

__all__ = [
    "Check",
    "Report",
    "Result",
    "check_optimiser",
    "check_prior",
    "check_segmenter",
    "check_tracker",
    "optimiser_checks",
    "parametrize",
    "prior_checks",
    "run_checks",
    "segmenter_checks",
    "tracker_checks",
]


def optimiser_checks(
    factory: Callable[..., Any], *, next_frame: "NextFrame" = "start", settings: dict[str, Any] | None = None
) -> list[Check]:
    """Return the checks of an optimiser's factory; `next_frame` as it is registered."""
    return _checks("optimiser", factory, settings, next_frame)


def prior_checks(factory: Callable[..., Any], *, settings: dict[str, Any] | None = None) -> list[Check]:
    """Return the checks of a prior's factory."""
    return _checks("prior", factory, settings)


def tracker_checks(
    factory: Callable[..., Any], *, settings: dict[str, Any] | None = None, looks_ahead: bool = False
) -> list[Check]:
    """Return the checks of a tracker's factory, which is registered as one that `looks_ahead` or not."""
    return _checks("tracker", factory, settings, looks_ahead)


def segmenter_checks(factory: Callable[..., Any], *, settings: dict[str, Any] | None = None) -> list[Check]:
    """Return the checks of a segmenter's factory."""
    return _checks("segmenter", factory, settings)


def _checks(kind: str, factory: Callable[..., Any], settings: dict[str, Any] | None, *more: Any) -> list[Check]:
    """Return the checks of a kind of plugin: each of its rules, which are loaded when they are needed."""
    rules = import_module(f"posefit.testing.{kind}_rules")
    case = rules.Case(factory, settings or {}, *more)
    texts = [rule.__doc__.partition("\n")[0].rstrip(".") for rule in rules.RULES]
    return [Check(rule.__name__, text, partial(rule, case)) for rule, text in zip(rules.RULES, texts, strict=True)]


def check_optimiser(factory: Callable[..., Any], **options: Any) -> Report:
    """Return the report on an optimiser's factory, true where no check failed; options as for `optimiser_checks`."""
    return run_checks(factory, optimiser_checks(factory, **options))


def check_prior(factory: Callable[..., Any], **options: Any) -> Report:
    """Return the report on a prior's factory, true where no check failed; options as for `prior_checks`."""
    return run_checks(factory, prior_checks(factory, **options))


def check_tracker(factory: Callable[..., Any], **options: Any) -> Report:
    """Return the report on a tracker's factory, true where no check failed; options as for `tracker_checks`."""
    return run_checks(factory, tracker_checks(factory, **options))


def check_segmenter(factory: Callable[..., Any], **options: Any) -> Report:
    """Return the report on a segmenter's factory, true where no check failed; options as for `segmenter_checks`."""
    return run_checks(factory, segmenter_checks(factory, **options))
