"""Checks of what plugins return during a run.

A broken rule ends the run, with one line that names the plugin and the call.
"""

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from traceback import extract_tb
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.box import Space
from posefit.fitting.prior import Latents
from posefit.fitting.problem import BudgetError
from posefit.geometry.skeleton import ANGLES, INNER, JOINTS, Skeleton
from posefit.silhouette.drawn import PoseCount

FEASIBILITY_SAMPLES = 1000  # a prior must find at least one of these poses feasible
JOINT_ANGLES = 63
FIXED_TOLERANCE = 1e-9  # radians, the precision of an .amc file
POSEFIT = Path(__file__).parents[1]  # files in this folder are not a plugin's


class BrokenRuleError(InputError):
    """A plugin broke a rule of its kind. It is shown in one line, as a user mistake."""


class Checked:
    """An optimiser or a prior of a plugin, with checked calls.

    The error of a call that fails, or of an answer that breaks a rule, names the plugin
    and the call. All other rules of plugins are in `posefit.testing`.

    Args:
        plugin: The optimiser or the fitted prior.
        name: Its name.
        space: The space that an optimiser searches, or None for a prior.
        evaluations: The budget of a search. It must be enough for the first population.
    """

    def __init__(
        self,
        plugin: Any,
        name: str,
        space: Space | None = None,
        evaluations: int | None = None,
    ) -> None:
        self.plugin = plugin
        self.name = name
        self._space = space
        self._evaluations = evaluations
        self._first = True  # whether the next population is the first of a search
        self._drawn = PoseCount()
        if space is None:
            self.low = np.asarray(plugin.low)
            self.high = np.asarray(plugin.high)

    def ask(self) -> Array:
        """Return the optimiser's next population (n, d)."""
        proposals: Array = self._call("ask")
        assert self._space is not None
        check_population(proposals, self._space, self.name)
        if self._first:
            count = len(proposals)
            if not count:
                rule = "return a first population of one proposal or more, got none"
                raise BrokenRuleError(f"{self.name}: ask must {rule}")
            if self._evaluations is not None and count > self._evaluations:
                raise BudgetError(
                    f"{self.name}: evaluations must be at least {count}, "
                    f"one population, got {self._evaluations}"
                )
        return proposals

    def tell(self, proposals: Array, costs: Array) -> None:
        """Pass the costs (n,) on."""
        self._first = False
        self._call("tell", proposals, costs)

    def advance(self, space: Space) -> None:
        """Pass the next frame's space on."""
        self._space = space
        self._first = True
        self._call("advance", space)

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63)."""
        return self._rows("transform", angles, len(self.low))

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m)."""
        return self._rows("inverse_transform", latents, JOINT_ANGLES)

    def feasible(self, latents: Array) -> Any:
        """Return which latents (n, m) are poses at all (n,)."""
        return self._call("feasible", latents)

    def _call(self, what: str, *arguments: Any) -> Any:
        # not `plugin_errors`, whose overhead is as long as rasterising a few poses
        try:
            answer = self._drawn.during(getattr(self.plugin, what), *arguments)
        except BrokenRuleError:
            # it names another plugin, which this one called
            raise
        except (Exception, SystemExit) as error:
            raise _broken_by(self.name, what, error) from error
        if self._drawn.poses:
            rule = (
                f"leave evaluations to the search, got {self._drawn.poses:g} of its own"
            )
            raise BrokenRuleError(f"{self.name}: {what} must {rule}")
        return answer

    def _rows(self, what: str, rows: Array, columns: int) -> Array:
        answer: Array = self._call(what, rows)
        shape = (len(rows), columns)
        if np.shape(answer) != shape:
            rule = f"return shape {shape}, got {np.shape(answer)}"
            raise BrokenRuleError(f"{self.name}: {what} must {rule}")
        # a sum is finite only where all of it is
        if not math.isfinite(np.sum(answer)):
            rule = "return finite numbers, got some that are not"
            raise BrokenRuleError(f"{self.name}: {what} must {rule}")
        return answer


def check_population(proposals: Any, space: Space, name: str) -> None:
    """Raise BrokenRuleError, beginning with `name`, unless proposals are in the box."""
    # not a matrix or a masked array: their operators mean something else
    plain = type(proposals) is np.ndarray
    rule = ""
    if not plain or proposals.shape[1:] != (space.dimensions,):
        if plain:
            came = f"shape {proposals.shape}"
        else:
            came = type(proposals).__name__
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
    """Turn exceptions of the body, SystemExit too, into a BrokenRuleError.

    A BrokenRuleError is not changed: it names another plugin, which this one called.

    Args:
        name: The name of the plugin.
        what: The call.
        passed: Exceptions that are passed on. A ValueError becomes an InputError.
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
    frames = []
    for frame in extract_tb(error.__traceback__):
        if POSEFIT not in Path(frame.filename).parents:
            frames.append(frame)
    of_plugin = []
    for frame in frames:
        if Path(frame.filename).parent == Path(frames[0].filename).parent:
            of_plugin.append(frame)
    if of_plugin:
        place = f" ({Path(of_plugin[-1].filename).name}:{of_plugin[-1].lineno})"
    else:
        place = ""
    return BrokenRuleError(
        f"{name}: {what} must not fail, got {type(error).__name__}: {error}{place}"
    )


class FreeAxes:
    """The axes about which the joints of a skeleton turn.

    Angles about all other axes are 0, and cannot be written to a file. Training angles,
    (T, 63) each, of a skeleton with other free axes may differ from 0; the same
    difference is then allowed.
    """

    def __init__(self, skeleton: Skeleton, training: Iterable[Array]) -> None:
        self._fixed = np.flatnonzero(~skeleton.free[ANGLES - JOINT_ANGLES :])
        self._training = training

    @cached_property
    def _reach(self) -> Array:
        """The largest allowed angles (n,). Cached: a large library takes long."""
        reach = np.zeros(len(self._fixed))
        for angles in self._training:
            off = np.abs(angles[:, self._fixed]).max(axis=0, initial=0.0)
            reach = np.maximum(reach, off)
        return reach + FIXED_TOLERANCE

    def broken(self, angles: Array) -> str:
        """Return the rule that joint angles (n, 63) break, or ""."""
        off = np.abs(angles[:, self._fixed]).max(axis=0, initial=0.0)
        if not (off > FIXED_TOLERANCE).any() or not (off > self._reach).any():
            return ""
        worst = int((off - self._reach).argmax())
        joint, axis = divmod(int(self._fixed[worst]), 3)
        place = f"the {'xyz'[axis]} axis of {JOINTS[INNER[joint]]}"
        came = f"{off[worst]:.3g} rad about {place}"
        return f"turn joints about their free axes only, got {came}"


def check_prior(prior: Latents, training: Array, skeleton: Skeleton, name: str) -> None:
    """Raise BrokenRuleError if the range or the answers of a prior are wrong.

    Args:
        prior: The fitted prior.
        training: (T, 63) the joint angles that it has learned from.
        skeleton: The skeleton of their person.
        name: The name of the prior. Messages begin with it.
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
            "low and high must be finite and of shape (m,),"
            f" got {low.shape}, {high.shape}"
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
    axes = FreeAxes(skeleton, [training])
    for poses in (back, prior.inverse_transform(drawn)):
        if rule := axes.broken(np.asarray(poses)):
            raise broken(f"inverse_transform must {rule}")
    # otherwise a search would have nothing to draw
    if not (
        np.any(feasible)
        or np.any(prior.feasible(prior.transform(sample)))
        or np.any(prior.feasible(drawn))
    ):
        came = (
            f"none of {len(sample)} training poses"
            f" and {FEASIBILITY_SAMPLES} of the range"
        )
        raise broken(f"feasible must allow some poses, got {came}")
