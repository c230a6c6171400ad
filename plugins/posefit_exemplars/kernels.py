"""From the states of a beam to the poses that they may go on to, in numba: plain functions over arrays."""

import numpy as np

from posefit.arrays import jit

STRETCH = 4  # dimensions of a code after which a distance is looked at; their number is a multiple of it


@jit
def cheapest_steps(ahead, ways, totals, rows, near, codes, bounds, scale, limit, least, owners, touched):
    """Return how many poses some states of a beam go on to, each by its cheapest step.

    `ahead` (speeds, n, D) is where clips go on, `ways` (speeds, n) what the root's way costs there; `rows` are the
    states of the beam, `near` (n, g) the groups that each looks at; `codes` (K, D) are those of all poses, group by
    group from `bounds` (G + 1,) on. A step costs the squared distance of codes by `scale`. `least` (K,) has to hold
    infinity; it gets the totals below `limit`, `owners` (K,) whose they are, and `touched` (K,) which poses they are.
    """
    count = 0
    for r in rows:
        for g in near[r]:
            for k in range(bounds[g], bounds[g + 1]):
                best = min(least[k], limit)
                cheaper = False
                for s in range(ahead.shape[0]):
                    before = totals[r] + ways[s, r]
                    if before < best:
                        bound = np.float32((best - before) / scale)
                        away = np.float32(0.0)
                        d = 0
                        while d < codes.shape[1] and away < bound:  # the first dimensions tell most poses apart
                            for e in range(d, d + STRETCH):
                                step = ahead[s, r, e] - codes[k, e]
                                away += step * step
                            d += STRETCH
                        if away < bound:
                            best, cheaper = before + scale * away, True
                if cheaper:
                    if least[k] == np.inf:
                        touched[count] = k
                        count += 1
                    least[k], owners[k] = best, r
    return count
