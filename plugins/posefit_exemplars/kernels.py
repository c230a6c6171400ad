"""Distances between codes of poses, in numba: plain functions over arrays, shapes checked by the callers.

The codes of `LANES` poses lie side by side in a tile, so that loops over lanes run in vector registers. `tiles` are
`exemplars.Tiles`.
"""

import numpy as np

from posefit.arrays import inlined, jit

DIMENSIONS = 24  # of a code: what it leaves out of the joints is below 5 mm
# that are compared first
FIRST_DIMENSIONS = 6
LANES = 32


@inlined
def lower_distances(distances, start, code, tile, partial):
    """Lower `distances` (LANES,) to `start` and the squared distances of the codes of a tile (DIMENSIONS, LANES).

    Returns whether any may be lower: codes are principal components, and the first few tell of most tiles that all
    their codes are farther away. `partial` (LANES,) is room for these.
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
    """Return the first frame of a clip with codes (T, D), those far from the latest returned one, and the last."""
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
    """Return the states in `groups` (n, g) nearest to codes (n, D), and squared distances (or inf), both (n, count)."""
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
                            squares[i, rank], states[i, rank] = (
                                squares[i, rank - 1],
                                states[i, rank - 1],
                            )
                            rank -= 1
                        squares[i, rank], states[i, rank] = (
                            distances[lane],
                            tiles.states[LANES * t + lane],
                        )
    return states, squares


@jit
def cheapest_steps(codes, start_costs, totals, rows, groups, tiles, room, scale, limit):
    """Return the states that some `rows` of a beam continue to, the row of each one's cheapest step, and its total.

    Row i continues at `codes` (speeds, n, D), which cost `start_costs` (speeds, n); a step to a state in its `groups`
    (n, g) costs the squared distance times `scale`, at the cheapest speed. Totals (n,) with a step are below `limit`.
    `room` holds three arrays of a number for each place in the tiles; the first one is inf before and afterwards.
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
                            best[place], parents[place] = total, row
    places = reached[:count].copy()
    steps = tiles.states[places], parents[places], best[places]
    best[places] = np.inf
    return steps
