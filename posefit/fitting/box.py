"""The box that an optimiser searches, and functions on it. All sampling terminates."""

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
    """The distribution of a first population, around a prediction. SAPSO (6), (7).

    Attributes:
        mean: The mean (d,).
        spread: The standard deviations (d,).
        velocity: The predicted velocity (d,).
        weight: The likelihood relative to `others`.
        others: Less likely starts. A population is drawn from all.

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import Start, draw_population
        >>> from posefit.testing.toy import Toy
        >>> start = Start(np.full(2, 0.5), np.full(2, 1e-9), np.zeros(2))
        >>> drawn = draw_population(Toy(2, start=start), np.random.default_rng(0), 8)
        >>> bool(np.allclose(drawn, 0.5))
        True
    """

    mean: Array  # (d,) in the unit box
    spread: Array  # (d,) standard deviations
    velocity: Array  # (d,) v_pred
    weight: float = 1.0  # likelihood relative to the others
    # less likely alternatives; a population is drawn from all
    others: Sequence["Start"] = ()


class Space(Protocol):
    """The box [-1, 1]^d as an optimiser knows it; part of it is feasible.

    `SearchSpace` is one.

    Example:
        >>> import numpy as np
        >>> from posefit.testing.toy import Toy
        >>> space = Toy(2)
        >>> space.dimensions, space.start
        (2, None)
        >>> space.feasible(np.array([[0.0, 0.0], [2.0, 0.0]])).tolist()
        [True, False]
    """

    @property
    def dimensions(self) -> int:
        """The dimension d of the box."""
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
    """Return proposals (..., d) with their periodic coordinates in [-1, 1).

    Args:
        space: The space, for its periodic coordinates.
        proposals: The proposals (..., d).

    Returns:
        The wrapped proposals (..., d).

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import wrap
        >>> from posefit.testing.toy import Toy
        >>> wrap(Toy(2, wrapping=1), np.array([[1.5, 0.25]])).tolist()
        [[-0.5, 0.25]]
    """
    if not space.periodic.any():
        return proposals
    return np.where(space.periodic, (proposals + 1.0) % 2.0 - 1.0, proposals)


def displacement(space: Space, origin: Array, target: Array) -> Array:
    """Return target - origin (..., d), the shorter way in periodic coordinates.

    Args:
        space: The space, for its periodic coordinates.
        origin: The first points (..., d).
        target: The second points (..., d).

    Returns:
        The differences (..., d).

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import displacement
        >>> from posefit.testing.toy import Toy
        >>> start = np.array([[0.75, 0.0]])
        >>> end = np.array([[-0.75, 0.5]])
        >>> displacement(Toy(2, wrapping=1), start, end).tolist()
        [[0.5, 0.5]]
    """
    return wrap(space, target - origin)


def converted(space: Space, proposals: Array, origin: Space) -> Array:
    """Return the proposals (n, d) in `space` for the poses of `proposals` in `origin`.

    A `Filter` calls this in `advance`, where `origin` is the space of the frame before.
    A space without a method `moved` is the same box in every frame.

    Args:
        space: The space of the result.
        proposals: The proposals (n, d) in `origin`.
        origin: The other space.

    Returns:
        The proposals (n, d) in `space`.

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import converted
        >>> from posefit.testing.toy import Toy
        >>> converted(Toy(2), np.array([[0.5, 0.0]]), Toy(2)).tolist()
        [[0.5, 0.0]]
    """
    moved = getattr(space, "moved", None)
    if moved is None:
        return np.array(proposals)
    return np.asarray(moved(proposals, origin))


def draw_population(space: Space, rng: np.random.Generator, count: int) -> Array:
    """Return a first population (count, d) of feasible proposals. SAPSO (6).

    It is drawn from the space's start, or uniformly without one. Draws that break a
    constraint are redrawn at most 100 times (Interpretation S7):

    - A coordinate outside the box is redrawn alone. The coordinates of (6) are
      independent and the box is a product, so this has the same distribution as
      redrawing the whole proposal. If it is still outside, it is folded into the box.
    - An infeasible proposal is redrawn as a whole. If it is still infeasible, it
      becomes the start's mean, or a copy of a feasible proposal.

    If nothing around the start is feasible, the population is drawn from anywhere.

    Args:
        space: The space.
        rng: The generator.
        count: The number of proposals.

    Returns:
        The proposals (count, d).

    Raises:
        InputError: Nothing is feasible, or the count is not a whole number above 0.

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import draw_population
        >>> from posefit.testing.toy import Toy
        >>> draw_population(Toy(3), np.random.default_rng(0), 40).shape
        (40, 3)
    """
    count = whole("count", count, 1)
    drawn = _drawn(space, space.start, rng, count)
    if drawn is None and space.start is not None:
        drawn = _drawn(space, None, rng, count)
    if drawn is None:
        raise InputError(
            "the prior must have feasible latents in its range, "
            f"got none in {REDRAWS} x {count} samples"
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
        feasible = np.setdiff1d(np.arange(count), broken)
        drawn[broken] = drawn[rng.choice(feasible, len(broken))]
    return drawn


def _redrawn(
    space: Space, draw: Callable[[NDArray[np.int64]], Array], count: int, batch: int = 1
) -> tuple[Array, NDArray[np.int64]]:
    """Return draws for each row, redrawn until they are feasible.

    Args:
        space: The box.
        draw: Returns a proposal for each of some rows.
        count: The number of rows.
        batch: How many redraws of a row are made at once.

    Returns:
        The proposals (count, d), and the rows that never were feasible.
    """
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
    """Return each row's first of attempts (n, k, d) that works (n, k).

    A row without one gets `otherwise` (n, d).

    Args:
        attempts: The attempts (n, k, d).
        works: Whether each attempt works (n, k).
        otherwise: The value of rows without a working attempt, (n, d) or a number.

    Returns:
        The first working attempts (n, d).

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import first_that_works
        >>> attempts = np.array([[[0.9], [0.1]], [[0.8], [0.7]]])
        >>> works = np.array([[False, True], [False, False]])
        >>> first_that_works(attempts, works, 0.0).tolist()
        [[0.1], [0.0]]
    """
    first = attempts[np.arange(len(works)), works.argmax(axis=1)]
    return np.where(np.asarray(works.any(axis=1))[:, None], first, otherwise)


def _sample(
    space: Space, start: Start | None, rng: np.random.Generator, count: int
) -> Array:
    """Return proposals (count, d) in the box, feasible or not.

    They are drawn from the start, or uniformly without one.
    """
    if start is None:
        return rng.uniform(-1.0, 1.0, (count, space.dimensions))
    mean = start.mean
    spread = start.spread
    if start.others:
        starts = [start, *start.others]
        means = []
        spreads = []
        for each in starts:
            means.append(each.mean)
            spreads.append(each.spread)
        weights = np.array([each.weight for each in starts])
        rows = rng.choice(len(starts), count, p=weights / weights.sum())
        mean = np.array(means)[rows]  # (count, d)
        spread = np.array(spreads)[rows]
    mean = np.broadcast_to(mean, (count, space.dimensions))
    spread = np.broadcast_to(spread, (count, space.dimensions))
    drawn = wrap(space, rng.normal(mean, spread))  # SAPSO (6)
    for _ in range(REDRAWS):
        outside = np.abs(drawn) > 1.0
        if not outside.any():
            return drawn
        # periodic coordinates are never outside
        drawn[outside] = rng.normal(mean[outside], spread[outside])
    return fold(space, drawn)


def sample_normal(
    space: Space, rng: np.random.Generator, means: Array, spread: Array
) -> Array:
    """Return a normal draw (n, d) around each of n feasible means.

    `spread` (d,) or (n, d) has the standard deviations. A coordinate outside the box is
    folded back into it, as at a mirror. An infeasible draw is redrawn at most 100
    times, and then replaced by its mean.

    Args:
        space: The space.
        rng: The generator.
        means: Feasible means (n, d).
        spread: The standard deviations (d,) or (n, d).

    Returns:
        The draws (n, d).

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import sample_normal
        >>> from posefit.testing.toy import Toy
        >>> means = np.zeros((4, 2))
        >>> sample_normal(Toy(2), np.random.default_rng(0), means, np.ones(2)).shape
        (4, 2)
    """
    spread = np.broadcast_to(spread, means.shape)

    def draw(rows: NDArray[np.int64]) -> Array:
        normal = rng.standard_normal((len(rows), means.shape[1]))
        return fold(space, means[rows] + spread[rows] * normal)

    drawn, broken = _redrawn(space, draw, len(means), BATCH)
    drawn[broken] = means[broken]
    return drawn


def fold(space: Space, proposals: Array) -> Array:
    """Return proposals (n, d) folded into the box, periodic coordinates wrapped.

    Folding mirrors a coordinate at the sides of the box.

    Args:
        space: The space, for its periodic coordinates.
        proposals: The proposals (n, d).

    Returns:
        The folded proposals (n, d).

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import fold
        >>> from posefit.testing.toy import Toy
        >>> fold(Toy(2), np.array([[1.5, -0.25]])).tolist()
        [[0.5, -0.25]]
    """
    folded = np.abs((proposals + 3.0) % 4.0 - 2.0) - 1.0
    if not space.periodic.any():
        return folded
    return np.where(space.periodic, wrap(space, proposals), folded)


def repair(space: Space, proposals: Array, home: Array) -> Array:
    """Return proposals (n, d), with infeasible ones moved towards a feasible `home`.

    `home` is one point (d,) or one for each proposal (n, d). A moved proposal becomes
    the feasible point farthest from home, of 32 evenly spaced points on the line.

    Args:
        space: The space.
        proposals: The proposals (n, d).
        home: A feasible point (d,), or one for each proposal (n, d).

    Returns:
        The feasible proposals (n, d).

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import repair
        >>> from posefit.testing.toy import Toy
        >>> proposals = np.array([[0.5, 0.5], [1.5, 0.5]])
        >>> repair(Toy(2), proposals, np.zeros(2)).tolist()
        [[0.5, 0.5], [1.0, 0.5]]
    """
    repaired = np.clip(wrap(space, np.asarray(proposals, dtype=np.float64)), -1.0, 1.0)
    repaired = np.where(np.isfinite(repaired), repaired, home)
    broken = np.flatnonzero(~space.feasible(repaired))
    if len(broken):
        home = np.broadcast_to(home, repaired.shape)[broken]
        shares = np.arange(REPAIR_STEPS - 1, 0, -1)[:, None] / REPAIR_STEPS
        way = displacement(space, home, repaired[broken])
        line = home[:, None] + shares * way[:, None]  # (broken, steps, d)
        line = np.clip(wrap(space, line), -1.0, 1.0)
        works = space.feasible(line.reshape(-1, space.dimensions))
        works = works.reshape(line.shape[:2])
        repaired[broken] = first_that_works(line, works, home)
    return repaired
