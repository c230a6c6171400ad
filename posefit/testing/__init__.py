"""Checks for optimisers, priors, trackers, starts and segmenters, for your own tests.

    from posefit.testing import check_optimiser

    def test_it_keeps_the_rules_of_an_optimiser():
        report = check_optimiser(Mine)
        assert report, str(report)

`posefit check optimiser NAME` runs the same checks on an installed plugin, in a
separate process. There a plugin that ends or hangs its process fails a check; here it
ends or hangs the caller. Set the attribute `baseline = True` on a factory that searches
at random: it is then not asked to beat chance.
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
    """Return the report on an optimiser's factory.

    Args:
        factory: Takes (space, rng) and keyword-only settings.
        next_frame: The registered treatment of the optimiser at a new frame.
        settings: Passed to the factory.

    Returns:
        The report. It is true if no check failed.

    Example:
        >>> import posefit
        >>> from posefit.plugin import check_optimiser
        >>> check_optimiser(posefit.optimiser("random")).of("failed")
        []
    """
    return run_checks(factory, checks_of("optimiser", factory, settings, next_frame))


def check_prior(factory: Factory, *, settings: Settings = None) -> Report:
    """Return the report on a prior's factory.

    Args:
        factory: Takes keyword-only settings.
        settings: Passed to the factory.

    Returns:
        The report. It is true if no check failed.

    Example:
        >>> import posefit
        >>> from posefit.plugin import check_prior
        >>> check_prior(posefit.prior("pca")).of("failed")
        []
    """
    return run_checks(factory, checks_of("prior", factory, settings))


def check_tracker(
    factory: Factory, *, looks_ahead: bool = False, settings: Settings = None
) -> Report:
    """Return the report on a tracker's factory.

    Args:
        factory: Takes (task) and keyword-only settings.
        looks_ahead: Whether the tracker is registered to read later frames first.
        settings: Passed to the factory.

    Returns:
        The report. It is true if no check failed.

    Example:
        >>> from posefit.plugin import check_tracker
        >>> class Lazy:
        ...     def __init__(self, task):
        ...         pass
        ...
        ...     def track(self, observations, rng):
        ...         return iter(())  # yields no frame
        >>> bool(check_tracker(Lazy))
        False
    """
    return run_checks(factory, checks_of("tracker", factory, settings, looks_ahead))


def check_start(factory: Factory, *, settings: Settings = None) -> Report:
    """Return the report on a start's factory.

    Args:
        factory: Takes (task) and keyword-only settings.
        settings: Passed to the factory.

    Returns:
        The report. It is true if no check failed.

    Example:
        >>> from posefit.plugin import check_start
        >>> class Blind:
        ...     def __init__(self, task):
        ...         pass
        ...
        ...     def posterior(self, observation):
        ...         return None  # nothing is known
        >>> [finding.rule for finding in check_start(Blind).of("failed")]
        []
    """
    return run_checks(factory, checks_of("start", factory, settings))


def check_segmenter(factory: Factory, *, settings: Settings = None) -> Report:
    """Return the report on a segmenter's factory.

    Args:
        factory: Takes (film) and keyword-only settings.
        settings: Passed to the factory.

    Returns:
        The report. It is true if no check failed.

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import check_segmenter
        >>> class Nobody:
        ...     def __init__(self, film):
        ...         pass
        ...
        ...     def segment(self, image):
        ...         empty = np.zeros(image.shape[:2], bool)
        ...         return empty, empty
        >>> bool(check_segmenter(Nobody))
        False
    """
    return run_checks(factory, checks_of("segmenter", factory, settings))


def checks_of(
    kind: str, factory: Factory, settings: Settings = None, *registered: Any
) -> list[Check]:
    """Return the checks of a kind of plugin, one per rule.

    The rules of a kind are imported only when they are needed.
    """
    rules = import_module(f"posefit.testing.{kind}_rules")
    case = rules.Case(factory, dict(settings or {}), *registered)
    return [Check(rule.__name__, partial(rule, case)) for rule in rules.RULES]
