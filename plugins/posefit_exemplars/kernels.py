"""Distances between codes of poses, compiled by Numba.

The functions take plain arrays and rely on the callers for their shapes. The codes of
`LANES` poses lie side by side in a tile, so that loops over lanes run in vector
registers. `tiles` are `exemplars.Tiles`.
"""

import numpy as np

from posefit.arrays import inlined, jit

DIMENSIONS = 24  # dimensions of a code; the remainder of the joints is below 5 mm
# Dimensions that are compared first. They rule out most tiles.
FIRST_DIMENSIONS = 6
LANES = 32


@inlined
def lower_distances(distances, start, code, tile, partial):
    """Lower `distances` (LANES,) to those of a tile's codes (DIMENSIONS, LANES).

    A distance is `start` plus the squared distance of a code from `code`. Codes are
    principal components: the first few show that all codes of most tiles are farther
    away, and the others are then not compared. `partial` (LANES,) is a buffer.

    Returns:
        Whether the first components left open that any distance is lower.

    """
    near = False
    for lane in range(LANES):
        total = start
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
                if not lower_distances(
                    distances, np.float32(0.0), codes[i], tiles.codes[t], partial
                ):
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


@jit
def cheapest_steps(codes, start_costs, totals, rows, groups, tiles, room, scale, limit):
    """Return the states that rows of a beam can step to, each with its cheapest step.

    Args:
        codes: (speeds, n, D) where the states of the beam continue.
        start_costs: (speeds, n) costs of these continuations.
        totals: (n,) the total of each state.
        rows: The states that take a step.
        groups: (n, g) the groups that each state can step to.
        tiles: The codes of all states.
        room: Three buffers with an entry for each place in the tiles. The first one is
            infinite before and after the call.
        scale: Cost of a unit of squared distance. The cheapest speed counts.
        limit: Steps with totals at or above the limit are left out.

    Returns:
        The states, the row from which each is reached at least cost, and that total.

    """
    best, parents, reached = room
    distances = np.empty(LANES, np.float32)
    partial = np.empty(LANES, np.float32)
    count = 0
    for row in rows:
        if totals[row] >= limit:
            continue
        farthest = np.float32((limit - totals[row]) / scale)
        for group in groups[row]:
            for t in range(tiles.starts[group], tiles.starts[group + 1]):
                distances[:] = farthest
                near = False
                for speed in range(len(codes)):
                    start = np.float32(start_costs[speed, row] / scale)
                    near |= lower_distances(
                        distances, start, codes[speed, row], tiles.codes[t], partial
                    )
                if not near:
                    continue
                for lane in range(LANES):
                    if distances[lane] < farthest:
                        total = totals[row] + scale * distances[lane]
                        place = LANES * t + lane
                        if total < best[place]:
                            if best[place] == np.inf:
                                reached[count] = place
                                count += 1
                            best[place] = total
                            parents[place] = row
    places = reached[:count].copy()
    steps = tiles.states[places], parents[places], best[places]
    best[places] = np.inf
    return steps
