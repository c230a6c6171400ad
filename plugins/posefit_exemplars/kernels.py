"""Distances between codes of poses, compiled by Numba.

The functions take plain arrays and rely on the callers for their shapes. The codes of
`LANES` poses lie side by side in a tile, so that loops over lanes run in vector
registers. `tiles` are `exemplars.Tiles`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, inlined, jit

DIMENSIONS = 24  # dimensions of a code; the remainder of the joints is below 5 mm
# Dimensions that are compared first. They rule out most tiles.
FIRST_DIMENSIONS = 6
LANES = 32

# (n, D): the distance of two codes is the distance of their poses' joints, rms, metres
Codes = NDArray[np.float32]
Rows = NDArray[np.int64]


@inlined
def lower_distances(distances, code, tile, partial):
    """Lower `distances` (LANES,) to those of a tile's codes (DIMENSIONS, LANES).

    These are squared distances from `code`. Codes are principal components: the first
    few show that all codes of most tiles are farther away, and the others are then not
    compared. `partial` (LANES,) is a buffer.

    Returns:
        Whether all components were compared.
    """
    near = False
    for lane in range(LANES):
        total = np.float32(0.0)
        for d in range(FIRST_DIMENSIONS):
            difference = tile[d, lane] - code[d]
            total += difference * difference
        partial[lane] = total
        near |= total < distances[lane]
    if near:
        for lane in range(LANES):
            total = partial[lane]
            for d in range(FIRST_DIMENSIONS, DIMENSIONS):
                difference = tile[d, lane] - code[d]
                total += difference * difference
            distances[lane] = min(distances[lane], total)
    return near


@jit
def frames_apart(codes, min_square):
    """Return frames of a clip with codes (T, D) that are far apart.

    These are the first frame, each frame far from the one returned before it, and the
    last frame.
    """
    frames = np.zeros(len(codes), np.int64)
    count = 1
    last = len(codes) - 1
    for k in range(1, len(codes)):
        square = np.float32(0.0)
        for d in range(codes.shape[1]):
            difference = codes[k, d] - codes[frames[count - 1], d]
            square += difference * difference
        if k == last or square > min_square:
            frames[count] = k
            count += 1
    return frames[:count]


@jit
def nearest_codes(codes, groups, tiles, count):
    """Return the states in `groups` (n, g) nearest to codes (n, D), and distances.

    Returns:
        The states (n, count), nearest first, and the squared distances (n, count),
        infinite if the groups have fewer states.
    """
    squares = np.full((len(codes), count), np.inf, np.float32)
    states = np.zeros((len(codes), count), np.int64)
    distances = np.empty(LANES, np.float32)
    partial = np.empty(LANES, np.float32)
    last = count - 1
    for i in range(len(codes)):
        for group in groups[i]:
            for t in range(tiles.starts[group], tiles.starts[group + 1]):
                distances[:] = squares[i, last]
                if not lower_distances(distances, codes[i], tiles.codes[t], partial):
                    continue
                for lane in range(LANES):
                    rank = last
                    if distances[lane] < squares[i, rank]:
                        while rank > 0 and distances[lane] < squares[i, rank - 1]:
                            squares[i, rank] = squares[i, rank - 1]
                            states[i, rank] = states[i, rank - 1]
                            rank -= 1
                        squares[i, rank] = distances[lane]
                        states[i, rank] = tiles.states[LANES * t + lane]
    return states, squares


class Sources(NamedTuple):
    """The states of a beam, and where their clips continue."""

    totals: Array  # (n,) the total of each state
    codes: Codes  # (n, D) where its clip continues
    groups: Rows  # (n, g) the groups of poses that it can step to


class Buffers(NamedTuple):
    """Arrays with an entry for each slot of the tiles: a lane of one of them."""

    totals: Array  # the least total of each slot, infinite before and after a call
    parents: Rows  # the row from which each slot is reached at that total
    reached: Rows  # the slots that were reached, in that order


class Bounds(NamedTuple):
    """Which steps are wanted, by the totals of the states that they reach.

    The bound of `cheapest_steps` falls from the limit as states are reached:

        least                          bound                      limit
          |------ the wanted states -----|------ not looked at -----|--- left out ---
    """

    scale: float  # cost of a unit of squared distance
    least: float  # no step has a lower total
    limit: float  # steps with totals at or above it are left out
    wanted: int  # how many states of least totals are wanted, at least


@inlined
def bin_of(total, least, width, count):
    """Return the bin of a total in a histogram of `count` bins from `least`."""
    return min(int((total - least) / width), count - 1)


@inlined
def bound_of(bins, least, width, count, bound):
    """Return a total that at least `count` states do not exceed, or else `bound`.

    `bins` is the histogram of the totals so far, from `least` in bins of a `width`.
    """
    below = 0
    for number in range(len(bins)):
        below += bins[number]
        if below >= count:
            return min(bound, least + width * (number + 1))
    return bound


@jit
def cheapest_steps(sources, rows, tiles, buffers, bounds):
    """Return the states that rows of a beam can step to, each with its cheapest step.

    A histogram of the totals so far shows which total the wanted states do not exceed.
    Codes that are too far away for it are not compared. The bound falls fastest if rows
    with low totals come first.

    Args:
        sources: The `Sources`.
        rows: The states that take a step.
        tiles: The codes of all states.
        buffers: The `Buffers`.
        bounds: The `Bounds`.

    Returns:
        The states, the row from which each is reached at least cost, and that total:
        the wanted states, and a few that cost a little more.
    """
    best, parents, reached = buffers
    distances = np.empty(LANES, np.float32)
    partial = np.empty(LANES, np.float32)
    # as many bins as there are states in a bin, if the totals are evenly spread
    bins = np.zeros(int(np.sqrt(bounds.wanted)) + 1, np.int64)
    width = (bounds.limit - bounds.least) / len(bins)
    bound = bounds.limit
    count = 0
    for row in rows:
        total_before = sources.totals[row]
        if total_before >= bound:
            continue
        farthest = np.float32((bound - total_before) / bounds.scale)
        for group in sources.groups[row]:
            for t in range(tiles.starts[group], tiles.starts[group + 1]):
                # a lane that is no nearer keeps this distance, and is left out below
                distances[:] = farthest
                if not lower_distances(
                    distances, sources.codes[row], tiles.codes[t], partial
                ):
                    continue
                for lane in range(LANES):
                    if distances[lane] >= farthest:
                        continue
                    total = total_before + bounds.scale * distances[lane]
                    slot = LANES * t + lane
                    if total >= best[slot]:
                        continue
                    if best[slot] == np.inf:
                        reached[count] = slot
                        count += 1
                    else:
                        old = bin_of(best[slot], bounds.least, width, len(bins))
                        bins[old] -= 1
                    new = bin_of(total, bounds.least, width, len(bins))
                    bins[new] += 1
                    best[slot] = total
                    parents[slot] = row
        bound = bound_of(bins, bounds.least, width, bounds.wanted, bound)
    slots = reached[:count]
    wanted = slots[best[slots] <= bound]
    steps = tiles.states[wanted], parents[wanted], best[wanted]
    best[slots] = np.inf
    return steps


@jit
def first_distinct(order, keys, kinds, share, count):
    """Return the first rows of an order, none with the key of one before it.

    Args:
        order: (n,) rows.
        keys: (n,) the key of each row, from 0. Rows with equal keys count as one.
        kinds: (n,) the kind of each row, from 0.
        share: How many rows of a kind are returned, at most.
        count: How many rows are returned, at most.
    """
    is_used = np.zeros(keys.max() + 1, np.bool_)  # of each key
    of_kind = np.zeros(kinds.max() + 1, np.int64)  # rows chosen of each kind
    rows = np.empty(min(count, len(order)), np.int64)
    chosen = 0
    for row in order:
        if chosen == len(rows):
            break
        if is_used[keys[row]]:
            continue
        is_used[keys[row]] = True
        if of_kind[kinds[row]] == share:
            continue
        of_kind[kinds[row]] += 1
        rows[chosen] = row
        chosen += 1
    return rows[:chosen]
