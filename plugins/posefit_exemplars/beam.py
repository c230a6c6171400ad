"""Beam search: the states that a frame may be in, and the costs of steps between them.

A state is a pose of the exemplars with a yaw. Its total is the cost of the best path to
it: the sum of the costs of silhouettes, steps and jumps.
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

# Yaw bins in a full turn. States with the same pose and the same bin count as one.
YAW_BINS = 36
CLIP_SPEEDS = (0.8, 1.0, 1.25)  # multiples of a clip's recorded speed
RECORDED_SPEED = CLIP_SPEEDS.index(1.0)
# Each candidate is also tried with this turn away from its clip, to either side.
CANDIDATE_TURN = np.radians(7.0)
# Similar poses with similar yaws fill at most 1 / BEAM_SHARES of a beam.
BEAM_SHARES = 20
YAW_SHARES = 4  # candidates in one yaw bin: at most 1 / YAW_SHARES of the beam
JUMP_COST = 12.0  # cost of a jump to any other pose; costs are over the temperature
MAX_EXCESS_COST = 8.0  # steps that cost more than a jump plus this are left out
# Standard deviation of turns away from the clip, for a thirtieth of a second.
TURN_SPREAD = np.radians(4.0)
# Metres between an aligned root and where its clip continues, to the side or up.
ROOT_SPREAD = 0.01
# Metres, the same along the line of sight of a single camera. It is larger because one
# silhouette says little about the distance from the camera.
DEPTH_SPREAD = 0.03
# Metres between a known root and where its clip continues, for a thirtieth of a second.
KNOWN_ROOT_SPREAD = 0.008
FAST_TURN_COST = 100.0  # cost of each radian beyond the fastest possible turn


class Step(NamedTuple):
    """The time from one frame to the next, and the usual differences between them."""

    seconds: float  # negative in a track that runs backwards in time
    # metres, root mean square over joints, between a pose and where its clip continues
    pose: float
    turn: float = TURN_SPREAD
    known_root: float = KNOWN_ROOT_SPREAD
    max_turn: float = math.inf  # radians: the fastest possible turn

    @classmethod
    def of(cls, task: Task, spread: float) -> Self:
        """Return the step of a task; `spread` is for a thirtieth of a second."""
        seconds = (-1.0 if task.backwards else 1.0) / task.fps
        intervals = 30.0 / task.fps
        max_turn = math.inf
        if task.fastest_turn is not None:
            max_turn = task.fastest_turn / task.fps
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
    """The states of one frame, and the costs of the best paths to them."""

    states: Rows  # (n,) poses of the exemplars
    yaws: Array  # (n,) radians
    totals: Array  # (n,)
    places: Array = field(repr=False)  # (n, 3) metres: the root, aligned or expected

    def __len__(self) -> int:
        return len(self.states)

    def rows(self, rows: Rows) -> "Beam":
        """Return the states in these rows."""
        return Beam(
            self.states[rows], self.yaws[rows], self.totals[rows], self.places[rows]
        )


def diverse_best(exemplars: Exemplars, beam: Beam, totals: Array, count: int) -> Rows:
    """Return the `count` states of least `totals` (n,), with few similar ones.

    Of states with equal poses and yaw bins only the cheapest is kept. Of the states
    with similar poses and yaws only the best few are kept: the right alternative often
    costs more for a while, until later silhouettes confirm it.
    """
    bins = yaw_bins(beam.yaws)
    order = np.argsort(totals, kind="stable")
    keys = beam.states * YAW_BINS + bins
    kinds = exemplars.coarse_groups[beam.states] * YAW_BINS + bins
    share = max(count // BEAM_SHARES, 1)
    rows: Rows = kernels.first_distinct(order, keys, kinds, share, count)
    return rows


def joined(*beams: Beam) -> Beam:
    """Return the states of all beams."""
    arrays = zip(
        *((beam.states, beam.yaws, beam.totals, beam.places) for beam in beams),
        strict=True,
    )
    return Beam(*map(np.concatenate, arrays))


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
        """Return where clips are a step later, and the costs of missing a known root.

        Args:
            exemplars: The poses of the clips.
            beam: The states that continue.
            step: The time to the next frame, and the usual differences.
            root: (3,) metres, the root in the next frame, or None if it is unknown.

        """
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
            # without a limit no step might be cheap enough
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
    """Return at most `count` states that a beam reaches in one step, at least cost.

    A pose costs half the square of its distance, in spreads, from where the clip of its
    parent continues at one of the speeds. A yaw costs half the square of its turn away
    from the clip's yaw, in spreads.

    If the root (3,) is known, its distance d from where the clip leads costs
    log(1 + d^2 / 2 / spread^2). This grows slowly with d, because a person may be
    faster than all clips.
    """
    continued = Continuations.of(exemplars, beam, step, root)
    sources = kernels.Sources(
        beam.totals,
        continued.codes,
        continued.displacement_costs,
        exemplars.near_groups(continued.codes[RECORDED_SPEED]),
    )
    least = beam.totals.min()
    share = max(count // YAW_SHARES, 1)
    bounds = kernels.Bounds(
        1.0 / (2.0 * step.pose**2), least, least + JUMP_COST + MAX_EXCESS_COST, share
    )
    places = len(exemplars.tiles.states)
    room = kernels.Room(
        np.full(places, np.inf),
        np.empty(places, np.int64),
        np.empty(places, np.int64),
    )
    bins = yaw_bins(continued.yaws)
    cheapest_first = np.argsort(beam.totals, kind="stable")
    by_bin: list[tuple[Rows, Rows, Array]] = []
    for number in np.unique(bins):
        rows = cheapest_first[bins[cheapest_first] == number]
        states, parents, totals = kernels.cheapest_steps(
            sources, rows, exemplars.tiles, room, bounds
        )
        best = np.argsort(totals, kind="stable")[:share]
        by_bin.append((states[best], parents[best], totals[best]))
    states, parents, totals = (
        np.tile(np.concatenate(parts), 3) for parts in zip(*by_bin, strict=True)
    )
    turns = np.repeat([0.0, -CANDIDATE_TURN, CANDIDATE_TURN], len(states) // 3)
    totals = totals + 0.5 * (turns / step.turn) ** 2
    candidates = Beam(
        states, continued.yaws[parents] + turns, totals, continued.places[parents]
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
    """Return the costs of aligned roots at `places` that were expected elsewhere.

    Args:
        places: (n, 3) metres, the aligned roots.
        expected: (..., n, 3) metres, where the roots were expected.
        camera: (3,) metres, the position of the only camera, or None if there are
            several. Differences along its line of sight cost less, because one
            silhouette says little about how far away a body is.

    Returns:
        The costs (..., n).

    """
    # axis by axis, because NumPy's sums over an axis of length 3 take far longer
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
    """Return the costs (n, m) of steps between the states of successive frames.

    A step costs at most as much as a jump, unless it turns faster than possible.

    Args:
        exemplars: The poses of the clips.
        before: The n states of one frame.
        after: The m states of the next frame.
        step: The time between the frames, and the usual differences.
        root: (3,) metres, the root in the next frame, or None if it is unknown.
        camera: (3,) metres, the position of the only camera, or None for several.

    """
    continued = Continuations.of(exemplars, before, step, root)
    codes = exemplars.codes[after.states]
    double = 2.0 * step.pose**2
    speeds = zip(continued.codes, continued.displacement_costs, strict=True)
    squares = [
        squared_distances(code, codes) / double + cost[:, None] for code, cost in speeds
    ]
    costs: Array = np.minimum.reduce(squares)  # TOYAMA2001 (dynamics)
    yaw_differences = wrapped(after.yaws - continued.yaws[:, None])  # (n, m)
    costs = costs + 0.5 * (yaw_differences / step.turn) ** 2
    if root is None:
        costs += root_deviation_costs(after.places, continued.places[:, None], camera)
    costs = np.minimum(costs, JUMP_COST)
    if step.max_turn < np.pi:
        turns = np.abs(wrapped(after.yaws - before.yaws[:, None]))
        costs += FAST_TURN_COST * np.maximum(turns - step.max_turn, 0.0)
    return costs
