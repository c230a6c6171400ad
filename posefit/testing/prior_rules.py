"""Rules of a prior: shapes, ranges, independence of rows, repetition, success."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import REDRAWS, draw_population
from posefit.fitting.prior import Prior
from posefit.fitting.space import SearchSpace
from posefit.fitting.validation import FreeAxes
from posefit.motion import built_in
from posefit.testing import common
from posefit.testing.common import (
    PluginCase,
    check_speed,
    duplicates,
    global_random_state,
    left_alone,
    unchanged,
)
from posefit.testing.problem import walking_angles
from posefit.testing.results import BrokenError, expect

ROWS = 100
MAX_SECONDS = 5e-3  # longest time to recover a pose
# share of copies in a first population above which a warning is given
MAX_COPIES = 0.1


@dataclass(frozen=True)
class Fitting:
    """A prior that has learned, and whether it left everything else alone."""

    prior: Prior
    returned: Prior  # what fit returned
    inputs_unchanged: bool
    random_unchanged: bool


class Case(PluginCase):
    """A prior's factory with its settings."""

    @cached_property
    def first(self) -> Fitting:
        """The prior after one fit to the built-in walks.

        All rules share it, because a fit may take minutes.
        """
        prior: Prior = self.build()
        angles = walking_angles()
        inputs_unchanged = unchanged(angles)
        random = global_random_state()
        returned = prior.fit(angles, built_in.average_skeleton())
        return Fitting(
            prior, returned, inputs_unchanged(), random == global_random_state()
        )

    def use(self, **more: Any) -> Prior:
        """Return a new prior, fitted to the same poses."""
        prior: Prior = self.build(**more)
        return prior.fit(walking_angles(), built_in.average_skeleton())

    @property
    def random_unchanged(self) -> bool:
        """Whether the first fit has left the global random generators alone."""
        return self.first.random_unchanged

    @property
    def fitted(self) -> Prior:
        """The fitted prior, as `fit` returned it."""
        return self.first.returned

    @property
    def latents(self) -> Array:
        """Random latents (ROWS, m) within the range."""
        low = np.asarray(self.fitted.low)
        high = np.asarray(self.fitted.high)
        return np.random.default_rng(0).uniform(low, high, (ROWS, len(low)))


def _same(first: Prior, second: Prior, latents: Array) -> bool:
    angles = np.array_equal(
        first.inverse_transform(latents), second.inverse_transform(latents)
    )
    return angles and np.array_equal(first.feasible(latents), second.feasible(latents))


def _check_array(method: str, values: Array, shape: tuple[int, int]) -> None:
    expect(values.shape == shape, f"{method} must return {shape}, got {values.shape}")
    expect(
        values.dtype == np.float64, f"{method} must return float64, got {values.dtype}"
    )
    expect(
        np.isfinite(values).all(),
        f"{method} must return finite values, got nan or infinity",
    )


def fit(case: Case) -> None:
    """The method fit returns the prior itself."""
    expect(
        case.first.returned is case.first.prior,
        "fit must return self, got another object",
    )


def ranges(case: Case) -> str:
    """The range of the latents is finite and not reversed."""
    prior = case.fitted
    low = np.asarray(prior.low)
    high = np.asarray(prior.high)
    expect(
        low.ndim == 1 and low.shape == high.shape and len(low),
        f"low and high must be (m,), got {low.shape}",
    )
    expect(
        np.isfinite(low).all() and np.isfinite(high).all(),
        "low and high must be finite, got nan or infinity",
    )
    expect(
        (low <= high).all(), "low must not be above high, got a range that is reversed"
    )
    return f"{len(low)} latents"


def transform(case: Case) -> None:
    """Joint angles (n, 63) become latents (n, m)."""
    prior = case.fitted
    for rows in (1, 7):
        _check_array(
            "transform",
            np.asarray(prior.transform(walking_angles()[:rows])),
            (rows, len(prior.low)),
        )


def inverse(case: Case) -> None:
    """Latents (n, m), corners of the range too, become finite joint angles (n, 63)."""
    prior = case.fitted
    corners = np.where(
        np.random.default_rng(1).random((64, len(prior.low))) < 0.5,
        prior.low,
        prior.high,
    )
    for latents in (corners, case.latents, case.latents[:1]):
        _check_array(
            "inverse_transform",
            np.asarray(prior.inverse_transform(latents)),
            (len(latents), 63),
        )


def fixed_axes(case: Case) -> None:
    """Joints turn about their free axes only; the other angles of a pose are 0."""
    prior = case.fitted
    axes = FreeAxes(built_in.average_skeleton(), [walking_angles()])
    for latents in (prior.transform(walking_angles()), case.latents):
        broken = axes.broken(np.asarray(prior.inverse_transform(latents)))
        expect(not broken, f"inverse_transform must {broken}")


def training_in_range(case: Case) -> None:
    """The training poses lie within the range."""
    prior = case.fitted
    latents = np.asarray(prior.transform(walking_angles()))
    # rounding may put the poses at the ends of the range just outside
    slack = 1e-9 * (1.0 + np.abs(latents).max())
    out = (latents < np.asarray(prior.low) - slack) | (
        latents > np.asarray(prior.high) + slack
    )
    outside = int(out.any(axis=1).sum())
    expect(
        not outside,
        f"training poses must lie in low to high, got {outside} that do not",
    )


def training_feasible(case: Case) -> str:
    """At least 90 % of the training poses are feasible."""
    prior = case.fitted
    feasible = np.asarray(prior.feasible(prior.transform(walking_angles())))
    expect(
        feasible.shape == (len(walking_angles()),),
        f"feasible must return (n,), got {feasible.shape}",
    )
    expect(
        feasible.dtype == np.bool_,
        f"feasible must return booleans, got {feasible.dtype}",
    )
    percent = f"{100 * feasible.mean():.0f} %"
    expect(
        feasible.mean() >= 0.9,
        f"90 % of the training poses must be feasible, got {percent}",
    )
    return percent


def same_bits(case: Case) -> None:
    """A row has the same bits, independent of the other rows."""
    prior = case.fitted
    latents = case.latents
    whole = prior.inverse_transform(latents)
    feasible = prior.feasible(latents)
    # the first row alone, some rows, and all of them in reverse
    for rows in (slice(0, 1), slice(3, 10), slice(None, None, -1)):
        same = np.array_equal(prior.inverse_transform(latents[rows]), whole[rows])
        expect(
            same,
            "inverse_transform must give a row the same bits with any other rows, "
            "but did not",
        )
        expect(
            np.array_equal(prior.feasible(latents[rows]), feasible[rows]),
            "feasible must not depend on other rows, but does",
        )


def same_again(case: Case) -> None:
    """Fitting to the same poses again gives the same space."""
    again = case.use()
    same = np.array_equal(case.fitted.low, again.low) and _same(
        case.fitted, again, case.latents
    )
    expect(same, "fitting twice must give the same space, got two")


def inputs(case: Case) -> None:
    """The methods do not modify their arguments."""
    prior = case.fitted
    angles = walking_angles()
    latents = case.latents
    prior.transform(angles), prior.inverse_transform(latents), prior.feasible(latents)
    same = case.first.inputs_unchanged and np.array_equal(angles, walking_angles())
    expect(same, "the methods must not modify joint angles, but did")
    expect(
        np.array_equal(latents, case.latents),
        "the methods must not modify latents, but did",
    )


def global_randomness(case: Case) -> None:
    """The global random generators are neither used nor changed."""
    common.global_randomness(case)
    with left_alone():
        case.fitted.inverse_transform(case.latents)


def copies(case: Case) -> None:
    """A deep copy and an unpickled copy are the same space."""
    for what, twin in duplicates(case.fitted).items():
        expect(
            _same(twin, case.fitted, case.latents),
            f"{what} must be the same space, got another",
        )


def learns(case: Case) -> str:
    """Transformed and back, training poses are nearer than the mean pose."""
    prior = case.fitted
    angles = walking_angles()
    back = prior.inverse_transform(prior.transform(angles))
    error = np.degrees(np.abs(back - angles).mean())
    mean = np.degrees(np.abs(angles.mean(axis=0) - angles).mean())
    expect(
        error < 0.9 * mean,
        f"poses must be recovered better than by their mean, {mean:.2f} degrees off, "
        f"got {error:.2f}",
    )
    return f"{error:.2f} degrees, the mean pose {mean:.2f}"


def bad_input(case: Case) -> None:
    """Joint angles of a wrong shape, with nan, or too few are refused."""
    angles = walking_angles()
    with_nan = angles.copy()
    with_nan[3, 3] = np.nan
    for what, value in (
        ("60 columns", angles[:, :60]),
        ("nan", with_nan),
        ("no frames", angles[:0]),
    ):
        try:
            case.build().fit(value, built_in.average_skeleton())
        except ValueError:
            continue
        raise BrokenError(f"fit must raise ValueError for {what}, got a prior")


def searchable(case: Case) -> str:
    """A search space on the prior can be sampled."""
    prior = case.fitted
    space = SearchSpace(prior, np.zeros(3), np.ones(3), np.zeros(3))
    drawn = draw_population(space, np.random.default_rng(0), ROWS)
    expect(
        space.feasible(drawn).all(),
        "a first population must be feasible, got some that are not",
    )
    uniform = np.random.default_rng(0).uniform(-1.0, 1.0, (2000, space.dimensions))
    share = space.feasible(uniform).mean()
    # the share of proposals that are infeasible in every redraw
    copies = (1.0 - share) ** REDRAWS
    text = f"{100 * share:.3g} % of the box is feasible"
    if copies <= MAX_COPIES:
        return text
    return (
        f"warning: only {text}: "
        f"of a first population about {100 * copies:.0f} % are copies of the others"
    )


def speed(case: Case) -> str:
    """A pose is recovered in less than 5 ms."""
    prior = case.fitted
    latents = case.latents
    return check_speed(
        "a pose", MAX_SECONDS, lambda _: len(prior.inverse_transform(latents))
    )


RULES = [
    common.construction,
    fit,
    ranges,
    transform,
    inverse,
    fixed_axes,
    training_in_range,
    training_feasible,
    same_bits,
    same_again,
    inputs,
    global_randomness,
    copies,
    learns,
    bad_input,
    common.silence,
    common.nonsense_settings,
    searchable,
    speed,
]
