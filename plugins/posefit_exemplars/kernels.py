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
    longest = np.diff(bounds).max()
    away, nearest = np.empty(longest, dtype=np.float32), np.empty(longest, dtype=np.float32)
    for r in rows:
        if totals[r] >= limit:
            continue
        enough = np.float32((limit - totals[r]) / scale)
        for g in near[r]:
            first, stop = bounds[g], bounds[g + 1]
            size = stop - first
            nearest[:size] = enough
            for s in range(len(ahead)):
                away[:size] = ways[s, r] / scale
                for d in range(len(codes)):  # the inner loops take many poses at once
                    values, middle = codes[d, first:stop], ahead[s, r, d]
                    for k in range(size):
                        step = values[k] - middle
                        away[k] += step * step
                for k in range(size):
                    nearest[k] = min(nearest[k], away[k])
            for k in range(size):
                if nearest[k] < enough:
                    total, pose = totals[r] + scale * nearest[k], first + k
                    if total < least[pose]:
                        if least[pose] == np.inf:
                            touched[count] = pose
                            count += 1
                        least[pose], owners[pose] = total, r
    return count
