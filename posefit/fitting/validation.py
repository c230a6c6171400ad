"""Checks what optimisers and priors of plugins return: a broken rule ends the search, with one line that names them."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from traceback import extract_tb
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.box import Space
from posefit.fitting.optimiser import Optimiser
from posefit.fitting.prior import Latents
from posefit.fitting.problem import BudgetError
from posefit.silhouette.drawn import PoseCount

FEASIBILITY_SAMPLES = 1000  # poses of which one at least has to be feasible in a prior
POSEFIT = Path(__file__).parents[1]  # whose lines are not a plugin's


class BrokenRuleError(InputError):
    """A plugin broke one of the rules that its kind has to keep; it is shown in one line, as a user's mistake."""


class CheckedOptimiser:
    """An optimiser whose proposals are checked; errors name it by `name`.

    `evaluations` is the budget of a search, which has to hold the first population.
    """

    def __init__(
        self,
        optimiser: Optimiser,
        space: Space,
        name: str,
        evaluations: int | None = None,
    ) -> None:
        self._optimiser = optimiser
        self._space = space
        self._name = name
        self._evaluations, self._first, self._drawn = evaluations, True, PoseCount()

    def ask(self) -> Array:
        """Return the optimiser's next population. Raises BrokenRuleError where it is none."""
        with self._called("ask"):
            proposals = self._optimiser.ask()
        check_population(proposals, self._space, self._name)
        count = len(proposals)
        budget = self._evaluations
        if self._first and not count:
            raise self._broken(
                "ask must return a first population of one proposal or more, got none"
            )
        if self._first and budget is not None and count > budget:
            raise BudgetError(
                f"{self._name}: evaluations must hold one population of {count}, got {budget}"
            )
        return proposals

    def tell(self, proposals: Array, costs: Array) -> None:
        """Pass the costs on."""
        self._first = False
        with self._called("tell"):
            self._optimiser.tell(proposals, costs)

    def advance(self, space: Space) -> None:
        """Pass the next frame's space on."""
        self._space = space
        self._first = True
        with self._called("advance"):
            self._optimiser.advance(space)  # type: ignore[attr-defined]

    @contextmanager
    def _called(self, what: str) -> Iterator[None]:
        """Raise BrokenRuleError where the body fails, or draws poses: all evaluations are the search's."""
        with self._drawn.counting(), plugin_errors(self._name, what):
            yield
        if self._drawn.poses:
            raise self._broken(
                f"{what} must leave evaluations to the search, got {self._drawn.poses:g} of its own"
            )

    def _broken(self, rule: str) -> BrokenRuleError:
        return BrokenRuleError(f"{self._name}: {rule}")


def check_population(proposals: Any, space: Space, name: str) -> None:
    """Raise BrokenRuleError, which begins with `name`, where proposals are not (n, d) in the box."""
    # neither a matrix nor a masked array, which calculate otherwise
    plain = type(proposals) is np.ndarray
    rule = ""
    if not plain or proposals.shape[1:] != (space.dimensions,):
        came = f"shape {proposals.shape}" if plain else type(proposals).__name__
        rule = f"an array of shape (n, {space.dimensions}), got {came}"
    elif proposals.dtype.kind != "f":
        rule = f"numbers of type float64, got {proposals.dtype}"
    elif np.isnan(farthest := np.abs(proposals).max(initial=0.0)):
        rule = "finite proposals, got nan"
    elif farthest > 1.0:
        rule = f"proposals in [-1, 1], got {proposals.flat[np.abs(proposals).argmax()]}"
    if rule:
        raise BrokenRuleError(f"{name}: ask must return {rule}")


@contextmanager
def plugin_errors(
    name: str, what: str, passed: tuple[type[BaseException], ...] = ()
) -> Iterator[None]:
    """Raise BrokenRuleError, naming the plugin, for whatever the body raises, SystemExit too, but for what is `passed`.

    A BrokenRuleError stays as it is: it names another plugin, which this one called.
    """
    try:
        yield
    except BrokenRuleError:
        raise
    except passed as error:
        if isinstance(error, ValueError) and not isinstance(error, InputError):
            raise InputError(str(error)) from error  # a plugin's own check of a setting
        raise
    except (Exception, SystemExit) as error:
        raise _broken_by(name, what, error) from error


def _broken_by(name: str, what: str, error: BaseException) -> BrokenRuleError:
    if isinstance(error, SystemExit):
        return BrokenRuleError(
            f"{name}: {what} must not end the program, got SystemExit: {error.code}"
        )
    # where the plugin raised it, or passed it on from a library
    frames = [
        frame
        for frame in extract_tb(error.__traceback__)
        if POSEFIT not in Path(frame.filename).parents
    ]
    of_plugin = [
        frame
        for frame in frames
        if Path(frame.filename).parent == Path(frames[0].filename).parent
    ]
    place = (
        f" ({Path(of_plugin[-1].filename).name}:{of_plugin[-1].lineno})"
        if of_plugin
        else ""
    )
    return BrokenRuleError(
        f"{name}: {what} must not fail, got {type(error).__name__}: {error}{place}"
    )


class CheckedPrior:
    """A prior that has learned; an error in it names it, whichever plugin called it."""

    def __init__(self, prior: Latents, name: str) -> None:
        self._prior = prior
        self._name = name
        self.low, self.high = np.asarray(prior.low), np.asarray(prior.high)

    def transform(self, angles: Array) -> Any:
        """Return the latents (n, m) of joint angles (n, 63)."""
        return self._call("transform", angles)

    def inverse_transform(self, latents: Array) -> Any:
        """Return the joint angles (n, 63) of latents (n, m)."""
        return self._call("inverse_transform", latents)

    def feasible(self, latents: Array) -> Any:
        """Return which latents (n, m) are poses at all (n,)."""
        return self._call("feasible", latents)

    def _call(self, method: str, *arguments: Any) -> Any:
        try:  # not `plugin_errors`, which takes as long as a few poses
            return getattr(self._prior, method)(*arguments)
        except (Exception, SystemExit) as error:
            raise _broken_by(self._name, method, error) from error


def check_prior(prior: Latents, training: Array, name: str) -> None:
    """Raise BrokenRuleError, which begins with `name`, where a prior's range or answers are wrong.

    `training` (T, 63) are the joint angles that it has learned from.
    """

    def broken(rule: str) -> BrokenRuleError:
        return BrokenRuleError(f"{name}: {rule}")

    low = np.asarray(prior.low)
    high = np.asarray(prior.high)
    if (
        low.ndim != 1
        or low.shape != high.shape
        or not (np.isfinite(low).all() and np.isfinite(high).all())
    ):
        raise broken(
            f"low and high must be finite and of shape (m,), got {low.shape}, {high.shape}"
        )
    for k in np.flatnonzero(low > high):
        raise broken(
            f"low must not be above high, got {low[k]:g} and {high[k]:g} of latent {k}"
        )
    angles = training[:3]
    latents = np.asarray(prior.transform(angles))
    back = prior.inverse_transform(latents)
    feasible = prior.feasible(latents)
    for method, value, shape in (
        ("transform", latents, (len(angles), len(low))),
        ("inverse_transform", back, angles.shape),
        ("feasible", feasible, (len(angles),)),
    ):
        if np.shape(value) != shape:
            raise broken(f"{method} must return shape {shape}, got {np.shape(value)}")
        if not np.isfinite(value).all():
            raise broken(f"{method} must return finite numbers, got some that are not")
    sample = training[
        np.unique(
            np.linspace(0, len(training) - 1, FEASIBILITY_SAMPLES).astype(np.int64)
        )
    ]
    drawn = np.random.default_rng(0).uniform(low, high, (FEASIBILITY_SAMPLES, len(low)))
    if not (
        np.any(feasible)
        or any(
            np.any(prior.feasible(some)) for some in (prior.transform(sample), drawn)
        )
    ):
        came = f"none of {len(sample)} training poses and {FEASIBILITY_SAMPLES} of the range"
        raise broken(f"feasible must allow some poses, got {came}")
