"""How sharply costs are weighed, and the default budget of both filters."""

from posefit.plugin import Array, effective_sample_size, weigh

EVALUATIONS = 2440  # of a frame, as many as SAPSO's N (C + 1)
TOLERANCE, MAX_STEPS = 1e-9, 100  # ours: of the share that survives, and steps towards it
MAX_SHARPNESS = 1e12  # ours: where more particles than wanted share the lowest cost, none is sharp enough


def survival(costs: Array, beta: float) -> float:
    """Return the share of particles, 0 to 1, that survives resampling by weights exp(-beta cost): D / n.

    D is the effective sample size; the share is the survival diagnostic of MacCormick.
    """
    return effective_sample_size(weigh(costs, beta)) / len(costs)  # DEUTSCHER2005 (survival)


def sharpness(costs: Array, wanted: float) -> float:
    """Return the beta at which `wanted`, a share, of the particles survive; 0 where fewer do at any beta.

    The survival rate falls as beta rises.
    """
    if survival(costs, 0.0) <= wanted:
        return 0.0
    low, high = 0.0, 1.0
    while survival(costs, high) > wanted:
        low, high = high, 2.0 * high
        if high > MAX_SHARPNESS:
            return high
    above, below, side, beta = survival(costs, low) - wanted, survival(costs, high) - wanted, 0, high
    for _ in range(MAX_STEPS):  # false position, by the Illinois rule
        beta = (low * below - high * above) / (below - above)  # DEUTSCHER2005 (beta)
        if abs(rest := survival(costs, beta) - wanted) < TOLERANCE:
            break
        if rest > 0.0:
            low, above, below, side = beta, rest, below * (0.5 if side > 0 else 1.0), 1
        else:
            high, below, above, side = beta, rest, above * (0.5 if side < 0 else 1.0), -1
    return beta
