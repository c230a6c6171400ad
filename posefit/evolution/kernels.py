"""How covariance matrix adaptation learns, in numba: plain functions over arrays, shapes checked by the callers."""

import math

import numpy as np

from posefit.arrays import jit

APART = 1e-8  # ours, as cmaes has it: keeps the lengths of steps away from 0 where they divide
LARGEST = 1e32  # ours, as cmaes has it: of a step size
LONGEST = 1e4  # ours, as cmaes has it: an axis of proposals beyond it diverges
FLATTEST = 1e14  # the longest axis over the shortest, as cmaes has it; the tutorial means their squares
MENDED = 1e-8  # ours, as cmaes has it: an eigenvalue that rounding has made negative


@jit
def sample(rng, mean, sigma, scaled, drawn):
    """Write proposals (n, d) that are drawn, with `scaled` (d, d) the axes in rows, to scale."""
    for k in range(drawn.shape[0]):
        for j in range(mean.size):
            drawn[k, j] = 0.0
        for i in range(mean.size):
            normal = rng.standard_normal()  # HANSEN2016 (38)
            for j in range(mean.size):
                drawn[k, j] += normal * scaled[i, j]  # HANSEN2016 (39)
        for j in range(mean.size):
            drawn[k, j] = mean[j] + sigma * drawn[k, j]  # HANSEN2016 (40)


@jit
def decompose(covariance, axes, lengths, scaled):
    """Write the axes (d, d) of a covariance, in columns, their lengths (d,), and in rows the axes to scale."""
    values, vectors = np.linalg.eigh(covariance)
    if values[0] < 0.0:
        for i in range(values.size):  # np.where would compile three times as long as all the rest
            values[i] = MENDED if values[i] < 0.0 else values[i]
        for i in range(values.size):
            for j in range(values.size):
                covariance[i, j] = 0.0
                for k in range(values.size):
                    covariance[i, j] += vectors[i, k] * values[k] * vectors[j, k]
    for j in range(values.size):
        lengths[j] = math.sqrt(values[j])
        for i in range(values.size):
            axes[i, j], scaled[j, i] = vectors[i, j], vectors[i, j] * lengths[j]


@jit
def rank(costs, order):
    """Write the rows of costs (n,), none of them nan, to `order` (n,): best first, of equal ones the first."""
    n = gap = costs.size
    for i in range(n):
        order[i] = i
    while gap > 1:  # Shell's sort: numba's own takes three times as long to compile
        gap //= 2
        for i in range(gap, n):
            row, j = order[i], i
            while j >= gap:
                before = order[j - gap]
                if costs[before] < costs[row] or (costs[before] == costs[row] and before < row):
                    break
                order[j] = before
                j -= gap
            order[j] = row


@jit
def learn(proposals, costs, weights, rates, every, generation, sigma, state):
    """Adapt a state to a generation of proposals (n, d) and their finite costs (n,); return the step size.

    The state are mean (d,), axes (d, d), lengths (d,), both paths (d,), covariance (d, d), the axes to scale (d, d) and
    the best and worst costs of the last generations. The covariance is axes diag(lengths^2) axes', from when it was
    last decomposed.
    """
    mean, axes, lengths, step_path, path, covariance, scaled, recent = state
    order, slot = np.empty(costs.size, np.int64), 2 * generation % recent.size
    rank(costs, order)
    recent[slot], recent[slot + 1] = costs[order[0]], costs[order[-1]]
    mu_eff, c_sigma, d_sigma, c_c, c_1, c_mu, chi = rates
    n, d = proposals.shape
    steps, step, turned = np.empty((n, d)), np.empty(d), np.empty(d)
    for i in range(d):
        step[i] = turned[i] = 0.0
    total = 0.0
    for k in range(n):
        total += weights[k]
        for i in range(d):
            steps[k, i] = (proposals[order[k], i] - mean[i]) / sigma
            if weights[k] > 0.0:
                step[i] += weights[k] * steps[k, i]  # HANSEN2016 (41)
    for i in range(d):
        mean[i] += sigma * step[i]  # HANSEN2016 (42)

    for i in range(d):
        for j in range(d):
            turned[j] += axes[i, j] * step[i] / lengths[j]
    towards, long = math.sqrt(c_sigma * (2.0 - c_sigma) * mu_eff), 0.0
    for i in range(d):
        white = 0.0
        for j in range(d):
            white += axes[i, j] * turned[j]
        step_path[i] = (1.0 - c_sigma) * step_path[i] + towards * white  # HANSEN2016 (43)
        long += step_path[i] * step_path[i]
    long = math.sqrt(long)
    grown = sigma * math.exp(c_sigma / d_sigma * (long / chi - 1.0))  # HANSEN2016 (44)

    settled = math.sqrt(1.0 - (1.0 - c_sigma) ** (2.0 * (generation + 1.0)))
    heeded = 1.0 if long / settled < (1.4 + 2.0 / (d + 1.0)) * chi else 0.0  # HANSEN2016 (h_sigma)
    towards = heeded * math.sqrt(c_c * (2.0 - c_c) * mu_eff)
    for i in range(d):
        path[i] = (1.0 - c_c) * path[i] + towards * step[i]  # HANSEN2016 (45)
    kept = 1.0 + c_1 * (1.0 - heeded) * c_c * (2.0 - c_c) - c_1 - c_mu * total
    for i in range(d):
        for j in range(i + 1):
            covariance[i, j] = kept * covariance[i, j] + c_1 * path[i] * path[j]
    for k in range(n):
        weight = weights[k]
        if weight < 0.0:
            for j in range(d):
                turned[j] = 0.0
            for i in range(d):
                for j in range(d):
                    turned[j] += axes[i, j] * steps[k, i]
            square = 0.0
            for j in range(d):
                square += (turned[j] / lengths[j]) ** 2
            weight *= d / (square + APART)  # HANSEN2016 (46)
        for i in range(d):
            for j in range(i + 1):
                covariance[i, j] += c_mu * weight * steps[k, i] * steps[k, j]  # HANSEN2016 (47)
    for i in range(d):
        for j in range(i):
            covariance[j, i] = covariance[i, j]
    if generation % every == 0:
        decompose(covariance, axes, lengths, scaled)
    return min(grown, LARGEST)


@jit
def stagnant(generation, sigma, state, flat, small):
    """Return whether a search has come to an end: nothing changes any more, or it diverges.

    The state is that of `learn`. The costs of the last generations are `flat` where they differ by less; proposals are
    `small` apart where their spread and their path are less.
    """
    mean, axes, lengths, _, path, covariance, _, recent = state
    d = mean.size
    low, high = recent[0], recent[0]
    for cost in recent:
        low, high = min(low, cost), max(high, cost)
    if 2 * generation > recent.size and high - low < flat:
        return True
    still, axis = True, True
    k = generation % d
    longest, shortest = lengths[k], lengths[k]
    for i in range(d):
        longest, shortest = max(longest, lengths[i]), min(shortest, lengths[i])
        if sigma * covariance[i, i] >= small or sigma * path[i] >= small:
            still = False
        if mean[i] == mean[i] + 0.2 * sigma * math.sqrt(covariance[i, i]):
            return True
        if mean[i] != mean[i] + 0.1 * sigma * lengths[k] * axes[i, k]:
            axis = False
    return still or axis or sigma * longest > LONGEST or longest / shortest > FLATTEST  # HANSEN2016 (B.3)
