"""The states that a frame may be in, and the costs of steps between them: a beam search.

A state is a pose of the exemplars and a yaw. Its total is the cost of the best path to it: of silhouettes, steps
and jumps.
"""

import math
from dataclasses import dataclass, field
from typing import NamedTuple, Self

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Task
from posefit.geometry.rotation import wrapped
from posefit_exemplars import kernels
from posefit_exemplars.exemplars import Codes, Exemplars, Rows, about_vertical

YAW_BINS = 36  # of a full turn: two states of one pose in one bin are one
CLIP_SPEEDS = (0.8, 1.0, 1.25)  # at which a clip may be followed
RECORDED_SPEED = CLIP_SPEEDS.index(1.0)
# of a candidate away from its clip, to either side, or not at all
CANDIDATE_TURN = np.radians(7.0)
# similar poses with similar yaws have at most one of so many shares of a beam
BEAM_SHARES = 20
YAW_SHARES = 4  # and one yaw's candidates at most one of so many
JUMP_COST = 12.0  # of a step to any other pose, in units of cost over the temperature
MAX_EXCESS_COST = 8.0  # beyond the cost of a jump; steps that cost more are left out
# standard deviation of turns away from the clip, for a thirtieth of a second
TURN_SPREAD = np.radians(4.0)
# metres that an aligned root is off where its clip continues, to the side or up
ROOT_SPREAD = 0.01
DEPTH_SPREAD = 0.03  # metres, the same along the line of sight of a single camera
# metres that a known root is off where its clip continues, in a thirtieth of a second
KNOWN_ROOT_SPREAD = 0.008
FAST_TURN_COST = 100.0  # of each radian beyond the fastest possible turn


class Step(NamedTuple):
    """From one frame to the next: the time between them, and which differences are usual in it."""

    seconds: float  # negative where a track goes back in time
    # metres, root mean square over joints, that a pose is off where its clip continues
    pose: float
    turn: float = TURN_SPREAD
    known_root: float = KNOWN_ROOT_SPREAD
    max_turn: float = math.inf  # radians: the fastest possible turn

    @classmethod
    def of(cls, task: Task, spread: float) -> Self:
        """Return a step of a track; `spread` is that of poses in a thirtieth of a second."""
        seconds = (-1.0 if task.backwards else 1.0) / task.fps
        intervals = 30.0 / task.fps
        max_turn = (
            math.inf if task.fastest_turn is None else task.fastest_turn / task.fps
        )
        slack = math.sqrt(intervals)
        return cls(
            seconds,
            spread * slack,
            TURN_SPREAD * slack,
            KNOWN_ROOT_SPREAD * intervals,
            max_turn,
        )


@dataclass(frozen=True, eq=False)
class Beam:
    """States of one frame, and the costs of the best paths to them."""

    states: Rows  # (n,) poses of the exemplars
    yaws: Array  # (n,) radians
    totals: Array  # (n,)
    places: Array = field(repr=False)  # (n, 3) metres where the root is, or is expected

    def __len__(self) -> int:
        return len(self.states)

    def rows(self, rows: Rows) -> "Beam":
        """Return some of the states."""
        return Beam(
            self.states[rows], self.yaws[rows], self.totals[rows], self.places[rows]
        )


def diverse_best(exemplars: Exemplars, beam: Beam, totals: Array, count: int) -> Rows:
    """Return the states of least `totals` (n,), but only the best few of those with similar poses and yaws.

    The right alternative often costs more for a while, until later silhouettes confirm it.
    """
    kinds = exemplars.coarse_groups[beam.states] * YAW_BINS + yaw_bins(beam.yaws)
    order = np.lexsort((totals, kinds))
    starts = np.flatnonzero(np.diff(kinds[order], prepend=-1))
    ranks = np.arange(len(order)) - np.repeat(
        starts, np.diff(np.append(starts, len(order)))
    )
    retained = order[ranks < max(count // BEAM_SHARES, 1)]
    return retained[np.argsort(totals[retained], kind="stable")[:count]]


def merged(*beams: Beam) -> Beam:
    """Return the states of all beams; of several of one pose in one bin of yaw the one of least total."""
    arrays = zip(
        *((beam.states, beam.yaws, beam.totals, beam.places) for beam in beams),
        strict=True,
    )
    joined = Beam(*map(np.concatenate, arrays))
    keys = joined.states * YAW_BINS + yaw_bins(joined.yaws)
    order = np.lexsort((joined.totals, keys))
    return joined.rows(order[np.diff(keys[order], prepend=-1) != 0])


def yaw_bins(yaws: Array) -> Rows:
    """Return the bin of each yaw."""
    return np.round(yaws * (YAW_BINS / (2.0 * np.pi))).astype(np.int64) % YAW_BINS


class Continuations(NamedTuple):
    """Where the clips of a beam's states continue, at each of the speeds."""

    codes: Codes  # (speeds, n, D)
    displacement_costs: Array  # (speeds, n) of the root
    yaws: Array  # (n,) at the recorded speed
    places: Array  # (n, 3) at the recorded speed

    @classmethod
    def of(
        cls, exemplars: Exemplars, beam: Beam, step: Step, root: Array | None
    ) -> Self:
        """Return where clips are a step later, and the costs of their distances from a known `root` (3,)."""
        codes, turns, displacements = zip(
            *(
                exemplars.continuation(beam.states, step.seconds * speed)
                for speed in CLIP_SPEEDS
            ),
            strict=True,
        )
        places = [
            beam.places + about_vertical(displacement, beam.yaws)
            for displacement in displacements
        ]
        costs = np.zeros((len(CLIP_SPEEDS), len(beam)))
        if root is not None:
            squares = ((np.array(places) - root) ** 2).sum(axis=2) / (
                2.0 * step.known_root**2
            )
            # or nothing might be within reach
            costs = np.minimum(np.log1p(squares), JUMP_COST)
        return cls(
            np.stack(codes),
            costs,
            beam.yaws + turns[RECORDED_SPEED],
            places[RECORDED_SPEED],
        )


def next_states(
    exemplars: Exemplars, beam: Beam, step: Step, count: int, root: Array | None = None
) -> Beam:
    """Return the states that those of a beam may reach in a step, each at its cheapest; at most `count`.

    A pose costs half the square of its distance, over its spread, from what its parent's clip did next at one of the
    speeds; a yaw half the square of its turn away from the clip's. Where the root is known to be at `root` (3,), its
    distance d from where the clip leads costs log(1 + d^2 / 2 / spread^2): a person may be faster than all clips.
    """
    continued = Continuations.of(exemplars, beam, step, root)
    groups = exemplars.near_groups(continued.codes[RECORDED_SPEED])
    limit = beam.totals.min() + JUMP_COST + MAX_EXCESS_COST
    scale = 1.0 / (2.0 * step.pose**2)
    costs = continued.displacement_costs
    bins = yaw_bins(continued.yaws)
    places = len(exemplars.tiles.states)
    room = np.full(places, np.inf), np.empty(places, int), np.empty(places, int)
    by_bin: list[tuple[Rows, Rows, Array]] = []
    for number in np.unique(bins):
        rows = np.flatnonzero(bins == number)
        states, parents, totals = kernels.cheapest_steps(
            continued.codes,
            costs,
            beam.totals,
            rows,
            groups,
            exemplars.tiles,
            room,
            scale,
            limit,
        )
        if len(states) > count // YAW_SHARES:
            best = np.argpartition(totals, count // YAW_SHARES)[: count // YAW_SHARES]
            states = states[best]
            parents = parents[best]
            totals = totals[best]
        by_bin.append((states, parents, totals))
    states, parents, totals = (
        np.tile(np.concatenate(parts), 3) for parts in zip(*by_bin, strict=True)
    )
    turns = np.repeat([0.0, -CANDIDATE_TURN, CANDIDATE_TURN], len(states) // 3)
    totals = totals + 0.5 * (turns / step.turn) ** 2
    candidates = merged(
        Beam(states, continued.yaws[parents] + turns, totals, continued.places[parents])
    )
    return candidates.rows(
        diverse_best(exemplars, candidates, candidates.totals, count)
    )


def squared_distances(codes: Codes, others: Codes) -> Codes:
    """Return the squared distances (n, m) of codes."""
    squares = (
        (codes**2).sum(axis=1)[:, None]
        - 2.0 * (codes @ others.T)
        + (others**2).sum(axis=1)
    )
    return np.asarray(np.maximum(squares, 0.0))


def root_deviation_costs(places: Array, expected: Array, camera: Array | None) -> Array:
    """Return the costs of aligned roots that are at `places` (n, 3) where they were `expected` (..., n, 3).

    `camera` (3,) is the position of the only camera: a silhouette says little about how far away from it a body is.
    """
    # sums over axes of 3 take far longer
    x, y, z = (places[..., axis] - expected[..., axis] for axis in range(3))
    along: Array | float = 0.0
    if camera is not None:
        sights = places - camera
        sights /= np.maximum(
            np.linalg.norm(sights, axis=1, keepdims=True), np.finfo(np.float64).tiny
        )
        along = (x * sights[:, 0] + y * sights[:, 1] + z * sights[:, 2]) ** 2
    across = x**2 + y**2 + z**2 - along
    return np.asarray(
        np.log1p(0.5 * (across / ROOT_SPREAD**2 + along / DEPTH_SPREAD**2))
    )


def transition_costs(
    exemplars: Exemplars,
    before: Beam,
    after: Beam,
    step: Step,
    root: Array | None = None,
    camera: Array | None = None,
) -> Array:
    """Return the costs (n, m) of steps from each state of one frame to each of the next.

    None costs more than a jump, unless it turns faster than possible. `root` (3,) is where the root is in the next
    frame, if it is known, and `camera` (3,) the position of the only camera.
    """
    continued = Continuations.of(exemplars, before, step, root)
    codes = exemplars.codes[after.states]
    double = 2.0 * step.pose**2
    speeds = zip(continued.codes, continued.displacement_costs, strict=True)
    squares = [
        squared_distances(code, codes) / double + cost[:, None] for code, cost in speeds
    ]
    costs: Array = np.minimum.reduce(squares)  # TOYAMA2001 (dynamics)
    costs = (
        costs + 0.5 * (wrapped(after.yaws - continued.yaws[:, None]) / step.turn) ** 2
    )
    if root is None:
        costs += root_deviation_costs(after.places, continued.places[:, None], camera)
    costs = np.minimum(costs, JUMP_COST)
    if step.max_turn < np.pi:
        turns = np.abs(wrapped(after.yaws - before.yaws[:, None]))
        costs += FAST_TURN_COST * np.maximum(turns - step.max_turn, 0.0)
    return costs
