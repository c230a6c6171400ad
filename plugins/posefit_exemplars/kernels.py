"""Poses to keep of clips, and those that a beam may go on to, in numba: plain functions over arrays."""

import numpy as np

from posefit.arrays import jit


@jit
def keep_apart(codes, least, kept):
    """Return how many frames of a clip are kept, of codes (T, D), and write them to `kept` (T,).

    They are the first, the last, and each whose squared distance from the one kept before it is above `least`.
    """
    kept[0] = 0
    count, last = 1, len(codes) - 1
    for k in range(1, len(codes)):
        away = np.float32(0.0)
        for d in range(codes.shape[1]):
            step = codes[k, d] - codes[kept[count - 1], d]
            away += step * step
        if k == last or away > least:
            kept[count] = k
            count += 1
    return count


@jit
def cheapest_steps(ahead, ways, totals, rows, near, codes, bounds, scale, limit, least, owners, touched):
    """Return how many poses some states of a beam go on to, each by its cheapest step.

    `ahead` (speeds, n, D) is where clips go on, `ways` (speeds, n) what the root's way costs there; `rows` are the
    states of the beam, `near` (n, g) the groups that each looks at; `codes` (D, K) are those of all poses, group by
    group from `bounds` (G + 1,) on. A step costs the squared distance of codes by `scale`. `least` (K,) has to hold
    infinity; it gets the totals below `limit`, `owners` (K,) whose they are, and `touched` (K,) which poses they are.
    """
    count = 0
    squares = np.empty((len(ahead), np.diff(bounds).max()), dtype=np.float32)
    for r in rows:
        for g in near[r]:
            first, stop = bounds[g], bounds[g + 1]
            for s in range(len(ahead)):
                if totals[r] + ways[s, r] < limit:
                    away = squares[s, : stop - first]
                    away[:] = 0.0
                    for d in range(len(codes)):  # the inner loop takes many poses at once
                        values, middle = codes[d, first:stop], ahead[s, r, d]
                        for k in range(len(away)):
                            step = values[k] - middle
                            away[k] += step * step
            for k in range(first, stop):
                best = min(least[k], limit)
                cheaper = False
                for s in range(len(ahead)):
                    before = totals[r] + ways[s, r]
                    if before < best:
                        away_by = squares[s, k - first]
                        if away_by < np.float32((best - before) / scale):
                            best, cheaper = before + scale * away_by, True
                if cheaper:
                    if least[k] == np.inf:
                        touched[count] = k
                        count += 1
                    least[k], owners[k] = best, r
    return count
