"""How sharply costs are weighed, and the default budget of both filters."""

from posefit.plugin import Array, effective_sample_size, weigh

EVALUATIONS = 2440  # of a frame, as many as SAPSO's N (C + 1)
# ours: tolerance of the surviving share, and limit on the iterations
TOLERANCE = 1e-9
MAX_STEPS = 100
# ours: if more particles than wanted share the lowest cost, no sharpness is enough
MAX_SHARPNESS = 1e12


def survival(costs: Array, beta: float) -> float:
    """Return the share of particles that survives resampling, D / n, 0 to 1.

    The weights are exp(-beta cost), and D is the effective sample size. The share is
    MacCormick's survival diagnostic.
    """
    # DEUTSCHER2005 (survival)
    return effective_sample_size(weigh(costs, beta)) / len(costs)


def sharpness(costs: Array, wanted: float) -> float:
    """Return the beta at which a share `wanted` of the particles survives.

    The survival rate falls as beta rises. Return 0 if fewer survive at any beta.
    """
    if survival(costs, 0.0) <= wanted:
        return 0.0
    low = 0.0
    high = 1.0
    while survival(costs, high) > wanted:
        low = high
        high = 2.0 * high
        if high > MAX_SHARPNESS:
            return high
    above = survival(costs, low) - wanted
    below = survival(costs, high) - wanted
    side = 0  # which end the last step moved: 1 the low one, -1 the high one
    beta = high
    # False position, by the Illinois rule: if the same end moves twice, the value at
    # the other end is halved. Otherwise that end would never move if the function is
    # curved.
    for _ in range(MAX_STEPS):
        beta = (low * below - high * above) / (below - above)  # DEUTSCHER2005 (beta)
        if abs(rest := survival(costs, beta) - wanted) < TOLERANCE:
            break
        if rest > 0.0:
            low = beta
            above = rest
            if side > 0:
                below = 0.5 * below
            side = 1
        else:
            high = beta
            below = rest
            if side < 0:
                above = 0.5 * above
            side = -1
    return beta
