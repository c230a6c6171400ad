"""The likeliest ways to where a person may be now: Viterbi's recursion over the states that are worth a look.

A state is a pose of the exemplars and a yaw. Its total is what its best way has cost: silhouettes, steps and jumps.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit_exemplars import kernels
from posefit_exemplars.codes import Codes, Rows
from posefit_exemplars.exemplars import Exemplars, about_vertical

BINS = 36  # of a full turn: two states of one pose in one bin are one
SPEEDS = (0.8, 1.0, 1.25)  # at which a clip may be followed
TURN = np.radians(7.0)  # how far a candidate turns away from its clip, to either side, or not at all
NEAR = 4  # groups of poses that a state goes on to
SHARES = 20  # of a beam: poses that are alike and face alike have one of them at most
FACINGS = 4  # yaws, of which each may have its share of a beam to itself
WHIRL = 100.0  # cost of a radian that somebody turns farther than anybody does
HOPELESS = 8.0  # beyond the cost of a jump; what costs more is not looked at


@dataclass(frozen=True)
class Steps:
    """What a step costs."""

    spread: float  # metres, root mean square over joints, that a pose may be off where its clip goes on
    turning: float  # radians that it may turn away
    jump: float  # the cost of a step to anywhere
    straying: float  # metres that an aligned root may be off where its clip goes on, across the line of sight
    depth: float  # and along it
    pace: float  # metres that a known root may be off where its clip goes on
    fastest: float = np.inf  # radians that nobody turns by in a step


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
        return Beam(self.states[rows], self.yaws[rows], self.parents[rows], self.totals[rows], self.places[rows])


def assorted(exemplars: Exemplars, beam: Beam, totals: Array, most: int) -> Rows:
    """Return the states of least `totals` (n,), but of those that are alike and face alike only the best few.

    What else somebody may be doing is often behind for a while before silhouettes tell that it is right.
    """
    kind = exemplars.kinds[beam.states] * BINS + bins_of(beam.yaws)
    order = np.lexsort((totals, kind))
    begins = np.flatnonzero(np.diff(kind[order], prepend=-1))
    rank = np.arange(len(order)) - np.repeat(begins, np.diff(np.append(begins, len(order))))
    kept = order[rank < max(most // SHARES, 1)]
    return kept[np.argsort(totals[kept], kind="stable")[:most]]


def joined_beams(*beams: Beam) -> Beam:
    """Return the states of all beams; of several of one pose in one bin of yaw the one of least total."""
    names = ("states", "yaws", "parents", "totals", "places")
    states, yaws, parents, totals, places = (np.concatenate([getattr(one, name) for one in beams]) for name in names)
    every = Beam(states, yaws, parents, totals, places)
    code = states * BINS + bins_of(yaws)
    order = np.lexsort((totals, code))
    first = np.diff(code[order], prepend=-1) != 0
    return every.chosen(order[first])


def bins_of(yaws: Array) -> Rows:
    """Return the bin of each yaw."""
    return np.round(yaws * (BINS / (2.0 * np.pi))).astype(np.int64) % BINS


@dataclass(frozen=True, eq=False)
class Ahead:
    """Where the clips of a beam's states go on, at each of the speeds."""

    codes: list[Codes]  # (n, D) at a speed
    ways: list[Array]  # (n,) what the root's way costs at a speed
    yaws: Array  # (n,) at the clip's own speed
    places: Array  # (n, 3) at the clip's own speed

    @classmethod
    def of(cls, exemplars: Exemplars, beam: Beam, seconds: float, steps: Steps, root: Array | None) -> "Ahead":
        """Return where clips are so much later, and how far from `root` (3,), where it is known, they put the body."""
        ahead = [exemplars.after(beam.states, seconds * speed) for speed in SPEEDS]
        places = [beam.places + about_vertical(way, beam.yaws) for _, _, way in ahead]
        ways = [np.zeros(len(beam)) for _ in SPEEDS]
        if root is not None:
            offs = [((place - root) ** 2).sum(axis=1) / (2.0 * steps.pace**2) for place in places]
            ways = [np.minimum(np.log1p(off), steps.jump) for off in offs]  # or nothing might be within reach
        own = SPEEDS.index(1.0)
        return cls([codes for codes, _, _ in ahead], ways, beam.yaws + ahead[own][1], places[own])

    def costs(self, rows: Rows, codes: Codes, steps: Steps) -> Array:
        """Return what steps from some states to poses of these codes (m, D) cost (rows, m), at the best speed."""
        double = 2.0 * steps.spread**2
        each = zip(self.codes, self.ways, strict=True)
        return np.asarray(
            np.minimum.reduce([squares(code[rows], codes) / double + way[rows, None] for code, way in each])
        )


def stepped(
    exemplars: Exemplars, beam: Beam, seconds: float, steps: Steps, most: int, root: Array | None = None
) -> Beam:
    """Return the states that those of a beam may be in so much later, each by its cheapest step; at most so many.

    A pose costs half the square of its distance, over the spread, from what its parent's clip did next at one of the
    speeds; a yaw half the square of its turn away from the clip's own. Where the root is known to be at `root` (3,),
    its distance d from where the clip's own way leads costs log(1 + d^2 / 2 / pace^2), which bears that somebody is
    faster or slower than all clips: who walks goes where he faces, and sways to the side of the foot he stands on.
    """
    ahead = Ahead.of(exemplars, beam, seconds, steps, root)
    centres = exemplars.codes[exemplars.centres]
    near = min(NEAR, len(centres))
    groups = np.argpartition(squares(ahead.codes[SPEEDS.index(1.0)], centres), near - 1, axis=1)[:, :near]
    limit = beam.totals.min() + steps.jump + HOPELESS
    codes, ways = np.stack(ahead.codes), np.stack(ahead.ways)
    least, owners, touched = np.full(len(exemplars), np.inf), *np.empty((2, len(exemplars)), dtype=np.int64)
    bins = bins_of(ahead.yaws)
    found: list[tuple[Rows, Rows, Array]] = []
    for one in np.unique(bins):
        rows = np.flatnonzero(bins == one)
        count = kernels.cheapest_steps(
            codes,
            ways,
            beam.totals,
            rows,
            groups,
            exemplars.grouped,
            exemplars.bounds,
            1.0 / (2.0 * steps.spread**2),
            limit,
            least,
            owners,
            touched,
        )
        reached, total = touched[:count].copy(), least[touched[:count]]
        least[reached] = np.inf
        if count > most // FACINGS:
            best = np.argpartition(total, most // FACINGS)[: most // FACINGS]
            reached, total = reached[best], total[best]
        found.append((exemplars.members[reached], owners[reached], total))
    states, parents, totals = (np.concatenate(parts) for parts in zip(*found, strict=True))
    turns = np.repeat([0.0, -TURN, TURN], len(states))
    states, parents, totals = (np.tile(one, 3) for one in (states, parents, totals))
    every = Beam(
        states,
        ahead.yaws[parents] + turns,
        parents,
        totals + 0.5 * (turns / steps.turning) ** 2,
        ahead.places[parents],
    )
    found_all = joined_beams(every)
    return found_all.chosen(assorted(exemplars, found_all, found_all.totals, most))


def jumped(states: Rows, yaws: Array, beam: Beam, steps: Steps) -> Beam:
    """Return states as the best of a beam may jump to them."""
    best = int(beam.totals.argmin())
    many = len(states)
    return Beam(
        states,
        yaws,
        np.full(many, best),
        np.full(many, beam.totals[best] + steps.jump),
        np.repeat(beam.places[best : best + 1], many, axis=0),
    )


def squares(some: Codes, others: Codes) -> Codes:
    """Return the squared distances (n, m) of codes."""
    squares = (some**2).sum(axis=1)[:, None] - 2.0 * (some @ others.T) + (others**2).sum(axis=1)
    return np.asarray(np.maximum(squares, 0.0))


def strayed(places: Array, expected: Array, eye: Array | None, steps: Steps) -> Array:
    """Return what it costs that aligned roots are at `places` (n, 3) where they were `expected` (..., n, 3).

    `eye` (3,) is where the only camera stands: a silhouette tells little of how far away from it a body is.
    """
    off = places - expected
    along = np.zeros(off.shape[:-1])
    if eye is not None:
        sights = places - eye
        sights /= np.maximum(np.linalg.norm(sights, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        along = (off * sights).sum(axis=-1) ** 2
    across = (off**2).sum(axis=-1) - along
    return np.asarray(np.log1p(0.5 * (across / steps.straying**2 + along / steps.depth**2)))


@dataclass(frozen=True, eq=False)
class Transition:
    """From one frame to the next: all that a model of transitions may know."""

    exemplars: Exemplars
    before: Beam  # n states of a frame
    beam: Beam  # m states of the next one
    seconds: float  # between them
    root: Array | None  # (3,) metres: where the root is in the next one, where somebody knows
    eye: Array | None  # (3,) metres: where the only camera stands; None where there are several


Transitions = Callable[[Transition], Array]


def transition_costs(transition: Transition, *, steps: Steps) -> Array:
    """Return what each step from a state of one frame to one of the next costs (n, m).

    None costs more than a jump, unless it turns farther than anybody does.
    """
    exemplars, before, beam, root = transition.exemplars, transition.before, transition.beam, transition.root
    ahead = Ahead.of(exemplars, before, transition.seconds, steps, root)
    costs = ahead.costs(np.arange(len(before)), exemplars.codes[beam.states], steps)  # TOYAMA2001 (dynamics)
    costs += 0.5 * (wrapped(beam.yaws - ahead.yaws[:, None]) / steps.turning) ** 2
    if root is None:
        costs += strayed(beam.places, ahead.places[:, None], transition.eye, steps)
    turned = np.abs(wrapped(beam.yaws - before.yaws[:, None]))
    return np.asarray(np.minimum(costs, steps.jump) + WHIRL * np.maximum(turned - steps.fastest, 0.0))
