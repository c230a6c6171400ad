"""The box that an optimiser searches, and functions on it; those that draw always end."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.check import whole

REDRAWS = 100  # Interpretation S7
BATCH = 8  # ours: redraws that `sample_normal` makes at once
REPAIR_STEPS = 32  # ours: points that `repair` tries along its line


@dataclass(frozen=True, eq=False)
class Start:
    """The distribution of a first population around a prediction, in the unit box. SAPSO (6), (7)."""

    mean: Array  # (d,)
    spread: Array  # (d,) standard deviations
    velocity: Array  # (d,) v_pred
    weight: float = 1.0  # how likely it is, beside the others
    # less likely ones, where several are possible; a population is drawn from all
    others: Sequence["Start"] = ()


class Space(Protocol):
    """The box [-1, 1]^d, part of which is feasible, as an optimiser knows it. `SearchSpace` is one."""

    @property
    def dimensions(self) -> int:
        """d."""
        ...

    @property
    def periodic(self) -> NDArray[np.bool_]:
        """Which coordinates wrap around (d,)."""
        ...

    @property
    def start(self) -> Start | None:
        """Where to start; None for anywhere."""
        ...

    def feasible(self, proposals: Array) -> NDArray[np.bool_]:
        """Return which proposals (n, d) lie in the box and are allowed (n,)."""
        ...


def wrap(space: Space, proposals: Array) -> Array:
    """Return proposals (..., d) with their periodic coordinates brought into [-1, 1)."""
    if not space.periodic.any():
        return proposals
    return np.where(space.periodic, (proposals + 1.0) % 2.0 - 1.0, proposals)


def displacement(space: Space, origin: Array, target: Array) -> Array:
    """Return target - origin (..., d), the short way round where a coordinate is periodic."""
    return wrap(space, target - origin)


def converted(space: Space, proposals: Array, origin: Space) -> Array:
    """Return the proposals (n, d) in `space` that stand for the poses of these in `origin`, the space before.

    A `Filter` needs it in `advance`. A space without a method `moved` is the same box in every frame.
    """
    moved = getattr(space, "moved", None)
    return (
        np.array(proposals) if moved is None else np.asarray(moved(proposals, origin))
    )


def draw_population(space: Space, rng: np.random.Generator, count: int) -> Array:
    """Return a first population (count, d) of feasible proposals, from the start or uniform. SAPSO (6).

    What breaks a constraint is redrawn at most 100 times (Interpretation S7). Out of the box that is a coordinate by
    itself: the coordinates of (6) are independent and the box is a product, so that this has the distribution of
    redrawing the whole proposal. One still out of the box is then folded back into it. An infeasible proposal is
    redrawn as a whole, and then becomes the start's mean, or the copy of a feasible one. Where nothing around the
    start is feasible, the population is drawn from anywhere. Raises InputError where nothing at all is, and where the
    count is no whole number above 0.
    """
    count = whole("count", count, 1)
    drawn = _drawn(space, space.start, rng, count)
    if drawn is None and space.start is not None:
        drawn = _drawn(space, None, rng, count)
    if drawn is None:
        raise InputError(
            f"the prior must find some of its range feasible, got none in {REDRAWS} x {count} draws"
        )
    return drawn


def _drawn(
    space: Space, start: Start | None, rng: np.random.Generator, count: int
) -> Array | None:
    drawn, broken = _redrawn(
        space, lambda rows: _sample(space, start, rng, len(rows)), count
    )
    if start is not None and space.feasible(start.mean[None])[0]:
        drawn[broken] = start.mean
    elif len(broken) == count > 0:
        return None
    elif len(broken):
        drawn[broken] = drawn[
            rng.choice(np.setdiff1d(np.arange(count), broken), len(broken))
        ]
    return drawn


def _redrawn(
    space: Space, draw: Callable[[NDArray[np.int64]], Array], count: int, batch: int = 1
) -> tuple[Array, NDArray[np.int64]]:
    """Return what `draw` draws for rows (count,), each redrawn until it is feasible, and the rows that never are."""
    drawn = draw(np.arange(count))
    broken = np.flatnonzero(~space.feasible(drawn))
    remaining = REDRAWS - 1
    while remaining and len(broken):
        shape = len(broken), min(remaining, batch)
        again = draw(np.repeat(broken, shape[1]))
        works = space.feasible(again).reshape(shape)
        drawn[broken] = first_that_works(
            again.reshape(*shape, -1), works, drawn[broken]
        )
        broken = broken[~works.any(axis=1)]
        remaining = remaining - shape[1]
    return drawn, broken


def first_that_works(
    attempts: Array, works: NDArray[np.bool_], otherwise: Array | float
) -> Array:
    """Return the first of each row's attempts (n, k, d) that works (n, k), and where none does `otherwise` (n, d)."""
    first = attempts[np.arange(len(works)), works.argmax(axis=1)]
    return np.where(np.asarray(works.any(axis=1))[:, None], first, otherwise)


def _sample(
    space: Space, start: Start | None, rng: np.random.Generator, count: int
) -> Array:
    """Return proposals (count, d) from the start or uniform, in the box, feasible or not."""
    if start is None:
        return rng.uniform(-1.0, 1.0, (count, space.dimensions))
    mean = start.mean
    spread = start.spread
    if start.others:
        starts = [start, *start.others]
        weights = np.array([each.weight for each in starts])
        rows = rng.choice(len(starts), count, p=weights / weights.sum())
        mean, spread = (
            np.array([getattr(each, name) for each in starts])[rows]
            for name in ("mean", "spread")
        )
    mean, spread = (
        np.broadcast_to(values, (count, space.dimensions)) for values in (mean, spread)
    )
    drawn = wrap(space, rng.normal(mean, spread))  # SAPSO (6)
    for _ in range(REDRAWS):
        outside = np.abs(drawn) > 1.0
        if not outside.any():
            return drawn
        # periodic ones are never among them
        drawn[outside] = rng.normal(mean[outside], spread[outside])
    return fold(space, drawn)


def sample_normal(
    space: Space, rng: np.random.Generator, means: Array, spread: Array
) -> Array:
    """Return a normal draw (n, d) around each of n feasible means, standard deviations `spread` (d,) or (n, d).

    A coordinate that leaves the box is folded back into it, as at a mirror; what is infeasible is redrawn
    at most 100 times and then stays at its mean.
    """
    spread = np.broadcast_to(spread, means.shape)

    def draw(rows: NDArray[np.int64]) -> Array:
        return fold(
            space,
            means[rows]
            + spread[rows] * rng.standard_normal((len(rows), means.shape[1])),
        )

    drawn, broken = _redrawn(space, draw, len(means), BATCH)
    drawn[broken] = means[broken]
    return drawn


def fold(space: Space, proposals: Array) -> Array:
    """Return proposals (n, d) folded into the box: mirrored at its sides, periodic coordinates wrapped."""
    folded = np.abs((proposals + 3.0) % 4.0 - 2.0) - 1.0
    return (
        np.where(space.periodic, wrap(space, proposals), folded)
        if space.periodic.any()
        else folded
    )


def repair(space: Space, proposals: Array, home: Array) -> Array:
    """Return proposals (n, d), each infeasible one moved towards a feasible `home` until it is feasible.

    `home` is one point (d,) or one for each proposal (n, d). A moved proposal becomes the farthest feasible one of 32
    evenly spaced points on the line between them.
    """
    repaired = np.clip(wrap(space, np.asarray(proposals, dtype=np.float64)), -1.0, 1.0)
    repaired = np.where(np.isfinite(repaired), repaired, home)
    broken = np.flatnonzero(~space.feasible(repaired))
    if len(broken):
        home = np.broadcast_to(home, repaired.shape)[broken]
        shares = np.arange(REPAIR_STEPS - 1, 0, -1)[:, None] / REPAIR_STEPS
        line = (
            home[:, None]
            + shares * displacement(space, home, repaired[broken])[:, None]
        )
        line = np.clip(wrap(space, line), -1.0, 1.0)
        works = space.feasible(line.reshape(-1, space.dimensions)).reshape(
            line.shape[:2]
        )
        repaired[broken] = first_that_works(line, works, home)
    return repaired
