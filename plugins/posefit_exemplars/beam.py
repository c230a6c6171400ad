"""The states that a frame may be in, and the costs of steps between them: a beam search.

A state is a pose of the exemplars and a yaw. Its total is the cost of the best path to it: of silhouettes, steps
and jumps.
"""

from dataclasses import dataclass, field

import numpy as np

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit_exemplars import kernels
from posefit_exemplars.exemplars import Codes, Exemplars, Rows, about_vertical

BINS = 36  # of a full turn: two states of one pose in one bin are one
SPEEDS = (0.8, 1.0, 1.25)  # at which a clip may be followed
OWN = SPEEDS.index(1.0)  # the clip's own speed
TURN = np.radians(7.0)  # how far a candidate turns away from its clip, to either side, or not at all
NEAR_GROUPS = 4  # groups of poses that a state goes on to
MAX_SHARES = 20  # of a beam: similar poses with similar yaws have at most one of them
FACINGS = 4  # yaws, of which each may have its share of a beam to itself
SPIN_COST = 100.0  # cost of each radian beyond the fastest possible turn
MAX_EXCESS_COST = 8.0  # beyond the cost of a jump; steps that cost more are left out


@dataclass(frozen=True)
class Steps:
    """What a step costs."""

    spread: float  # metres, root mean square over joints, that a pose may be off where its clip goes on
    turning: float  # radians that it may turn away
    jump: float  # the cost of a step to anywhere
    straying: float  # metres that an aligned root may be off where its clip goes on, across the line of sight
    depth: float  # and along it
    pace: float  # metres that a known root may be off where its clip goes on
    fastest: float = np.inf  # radians: the fastest possible turn in a step


@dataclass(frozen=True, eq=False)
class Beam:
    """States of one frame, where they come from, and what they cost."""

    states: Rows  # (n,) poses of the exemplars
    yaws: Array  # (n,) radians
    parents: Rows  # (n,) row of the frame before, or -1
    totals: Array  # (n,)
    places: Array = field(repr=False)  # (n, 3) metres where the root is, or is expected

    def __len__(self) -> int:
        return len(self.states)

    def chosen(self, rows: Rows) -> "Beam":
        """Return some of the states."""
        return Beam(*(getattr(self, name)[rows] for name in NAMES))


NAMES = ("states", "yaws", "parents", "totals", "places")  # of a beam's arrays


def diverse_best(exemplars: Exemplars, beam: Beam, totals: Array, most: int) -> Rows:
    """Return the states of least `totals` (n,), but only the best few of those with similar poses and yaws.

    The right alternative often costs more for a while, until later silhouettes confirm it.
    """
    kind = exemplars.kinds[beam.states] * BINS + bins_of(beam.yaws)
    order = np.lexsort((totals, kind))
    begins = np.flatnonzero(np.diff(kind[order], prepend=-1))
    rank = np.arange(len(order)) - np.repeat(begins, np.diff(np.append(begins, len(order))))
    kept = order[rank < max(most // MAX_SHARES, 1)]
    return kept[np.argsort(totals[kept], kind="stable")[:most]]


def merged(*beams: Beam) -> Beam:
    """Return the states of all beams; of several of one pose in one bin of yaw the one of least total."""
    every = Beam(*(np.concatenate([getattr(beam, name) for beam in beams]) for name in NAMES))
    code = every.states * BINS + bins_of(every.yaws)
    order = np.lexsort((every.totals, code))
    return every.chosen(order[np.diff(code[order], prepend=-1) != 0])


def bins_of(yaws: Array) -> Rows:
    """Return the bin of each yaw."""
    return np.round(yaws * (BINS / (2.0 * np.pi))).astype(np.int64) % BINS


@dataclass(frozen=True, eq=False)
class Continuations:
    """Where the clips of a beam's states go on, at each of the speeds."""

    codes: Codes  # (speeds, n, D)
    ways: Array  # (speeds, n) what the root's displacement costs
    yaws: Array  # (n,) at the clip's own speed
    places: Array  # (n, 3) at the clip's own speed

    @classmethod
    def of(cls, exemplars: Exemplars, beam: Beam, seconds: float, steps: Steps, root: Array | None) -> "Continuations":
        """Return where clips are so much later, and how far from `root` (3,), where it is known, they put the body."""
        ahead = [exemplars.after(beam.states, seconds * speed) for speed in SPEEDS]
        places = [beam.places + about_vertical(way, beam.yaws) for _, _, way in ahead]
        ways = np.zeros((len(SPEEDS), len(beam)))
        if root is not None:
            offs = ((np.array(places) - root) ** 2).sum(axis=2) / (2.0 * steps.pace**2)
            ways = np.minimum(np.log1p(offs), steps.jump)  # or nothing might be within reach
        return cls(np.stack([codes for codes, _, _ in ahead]), ways, beam.yaws + ahead[OWN][1], places[OWN])

    def costs(self, codes: Codes, steps: Steps) -> Array:
        """Return what steps to poses of these codes (m, D) cost (n, m), at the best speed."""
        double = 2.0 * steps.spread**2
        each = zip(self.codes, self.ways, strict=True)
        return np.asarray(
            np.minimum.reduce([squared_distances(code, codes) / double + way[:, None] for code, way in each])
        )


def next_states(
    exemplars: Exemplars, beam: Beam, seconds: float, steps: Steps, most: int, root: Array | None = None
) -> Beam:
    """Return the states that those of a beam may reach in `seconds`, each by its cheapest step; at most `most`.

    A pose costs half the square of its distance, over the spread, from what its parent's clip did next at one of the
    speeds; a yaw half the square of its turn away from the clip's own. Where the root is known to be at `root` (3,),
    its distance d from where the clip leads costs log(1 + d^2 / 2 / pace^2): a person may be faster than all clips.
    """
    ahead = Continuations.of(exemplars, beam, seconds, steps, root)
    groups, tiles = exemplars.near_groups(ahead.codes[OWN], NEAR_GROUPS), exemplars.tiles
    limit, scale = beam.totals.min() + steps.jump + MAX_EXCESS_COST, 1.0 / (2.0 * steps.spread**2)
    poses = tiles.codes, tiles.bounds, scale, limit
    least, owners, touched = np.full(len(tiles.states), np.inf), *np.empty((2, len(tiles.states)), dtype=np.int64)
    bins = bins_of(ahead.yaws)
    by_bin: list[tuple[Rows, Rows, Array]] = []
    for number in np.unique(bins):
        origins = ahead.codes, ahead.ways, beam.totals, np.flatnonzero(bins == number), groups
        count = kernels.cheapest_steps(*origins, *poses, least, owners, touched)
        reached, total = touched[:count].copy(), least[touched[:count]]
        least[reached] = np.inf
        if count > most // FACINGS:
            best = np.argpartition(total, most // FACINGS)[: most // FACINGS]
            reached, total = reached[best], total[best]
        by_bin.append((tiles.states[reached], owners[reached], total))
    states, parents, totals = (np.tile(np.concatenate(parts), 3) for parts in zip(*by_bin, strict=True))
    turns = np.repeat([0.0, -TURN, TURN], len(states) // 3)
    totals = totals + 0.5 * (turns / steps.turning) ** 2
    every = merged(Beam(states, ahead.yaws[parents] + turns, parents, totals, ahead.places[parents]))
    return every.chosen(diverse_best(exemplars, every, every.totals, most))


def squared_distances(some: Codes, others: Codes) -> Codes:
    """Return the squared distances (n, m) of codes."""
    squares = (some**2).sum(axis=1)[:, None] - 2.0 * (some @ others.T) + (others**2).sum(axis=1)
    return np.asarray(np.maximum(squares, 0.0))


def root_deviation_costs(places: Array, expected: Array, eye: Array | None, steps: Steps) -> Array:
    """Return what it costs that aligned roots are at `places` (n, 3) where they were `expected` (..., n, 3).

    `eye` (3,) is where the only camera stands: a silhouette tells little of how far away from it a body is.
    """
    x, y, z = (places[..., axis] - expected[..., axis] for axis in range(3))  # sums over axes of 3 take far longer
    along: Array | float = 0.0
    if eye is not None:
        sights = places - eye
        sights /= np.maximum(np.linalg.norm(sights, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        along = (x * sights[:, 0] + y * sights[:, 1] + z * sights[:, 2]) ** 2
    across = x**2 + y**2 + z**2 - along
    return np.asarray(np.log1p(0.5 * (across / steps.straying**2 + along / steps.depth**2)))


def transition_costs(
    exemplars: Exemplars,
    before: Beam,
    beam: Beam,
    seconds: float,
    steps: Steps,
    root: Array | None = None,
    eye: Array | None = None,
) -> Array:
    """Return what each step from a state of one frame to one of the next, `seconds` later, costs (n, m).

    None costs more than a jump, unless it turns faster than possible. `root` (3,) is where the root is in the next
    frame, if it is known, and `eye` (3,) where the only camera stands.
    """
    ahead = Continuations.of(exemplars, before, seconds, steps, root)
    costs = ahead.costs(exemplars.codes[beam.states], steps)  # TOYAMA2001 (dynamics)
    costs += 0.5 * (wrapped(beam.yaws - ahead.yaws[:, None]) / steps.turning) ** 2
    if root is None:
        costs += root_deviation_costs(beam.places, ahead.places[:, None], eye, steps)
    costs = np.minimum(costs, steps.jump)
    if steps.fastest < np.pi:
        turned = np.abs(wrapped(beam.yaws - before.yaws[:, None]))
        costs += SPIN_COST * np.maximum(turned - steps.fastest, 0.0)
    return costs
