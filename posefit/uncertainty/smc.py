"""Weighted proposals that are distributed as exp(-cost / temperature) over a box: a tempered, waste-free sampler.

H.-D. Dau, N. Chopin, Waste-free sequential Monte Carlo, Journal of the Royal Statistical Society B 84(1), 2022.
Constants of our own are marked.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.errors import InputError
from posefit.uncertainty.kernels import accept_moves, covariance_within, effective, longest_step, random_walk
from posefit.uncertainty.landscape import Landscape
from posefit.uncertainty.mixture import NormalMixture

PARTICLES = 2048  # N, ours
CHAIN = 8  # P, ours: of N = M P particles, M survive and each becomes a chain of P
SURVIVAL = 0.5  # alpha: the share of the particles that the next temperature leaves
HALVINGS = 24  # ours: bisection steps, to a ten millionth of what is left
WANTED = 0.234  # ours: the share of moves that is to be accepted, as is best for long random walks
STEPS = 500  # ours: temperatures, at most


@dataclass(frozen=True, eq=False)
class Sampled:
    """Weighted proposals, and what they say of the whole box."""

    proposals: Array  # (n, d)
    weights: Array  # (n,), which sum to 1
    costs: Array  # (n,)
    log_evidence: float  # of the mean of exp(-cost / temperature) over the box, where nothing infeasible counts
    exponents: Array = field(repr=False)  # (t,) how much of the temperature was reached after each step; the last is 1
    accepted: Array = field(repr=False)  # (t - 1,) share of the moves that was accepted in each


def tempered(
    landscape: Landscape,
    start: NormalMixture,
    temperature: float,
    rng: np.random.Generator,
    *,
    particles: int = PARTICLES,
    chain: int = CHAIN,
    survival: float = SURVIVAL,
    evaluations: int | None = None,
) -> Sampled:
    """Return weighted proposals of the density that exp(-cost / temperature) has in the feasible box.

    The particles begin at `start` and go in steps to that density, on the geometric path between both: each step is as
    long as leaves a share `survival` of them, by effective sample size. Some survive, and each becomes a chain of
    `chain` random-walk moves, all of which are particles. With a budget of so many `evaluations`, steps are as long as
    it takes to arrive within it, and the last particles are weighed by what is left. Raises ValueError where a setting
    makes no sense, or where nothing is feasible.
    """
    if not temperature > 0.0:
        raise InputError(f"temperature must be above 0, got {temperature}")
    if not (chain >= 2 and particles >= 2 * chain):
        raise InputError(f"particles must be at least 2 chains of 2 or more, got {particles} and chains of {chain}")
    if not 0.0 < survival < 1.0:
        raise InputError(f"survival must lie between 0 and 1, got {survival}")
    before, moved = landscape.evaluations, particles // chain * (chain - 1)
    proposals, share = start.draw(landscape.box, rng, particles)
    costs, starts = landscape.costs(proposals), start.log_density(landscape.box, proposals)
    log_evidence, exponent, factor = float(np.log(share)), 0.0, 1.0
    exponents: list[float] = []
    accepted: list[float] = []
    while True:
        rises = -costs / temperature - starts
        rounds = _rounds(evaluations, landscape.evaluations - before, moved)
        step = left = 1.0 - exponent
        if rounds and len(exponents) < STEPS - 1:
            step = max(next_step(rises, left, survival), left / (1 + rounds))
        weights, mean = reweighed(rises, step)
        log_evidence += mean  # DAU2022 (normalising constant)
        exponent = 1.0 if step >= left else exponent + step
        exponents.append(exponent)
        if exponent == 1.0:
            return Sampled(proposals, weights, costs, log_evidence, np.array(exponents), np.array(accepted))
        rows = systematic_rows(weights, rng.random(), particles // chain)
        walk = factor * _walk(start, landscape, proposals, weights)
        state = (proposals[rows], costs[rows], starts[rows])
        states, moves = [state], 0.0
        for _ in range(chain - 1):
            state, share = _moved(landscape, start, state, walk, exponent, temperature, rng)
            states.append(state)
            moves += share / (chain - 1)
        accepted.append(moves)
        factor = float(np.clip(factor * np.exp(2.0 * (moves - WANTED)), 0.01, 1.0))
        proposals, costs, starts = (np.concatenate(part) for part in zip(*states, strict=True))  # DAU2022 (waste-free)


def _rounds(evaluations: int | None, used: int, moved: int) -> float:
    """Return how often so many particles can be `moved` within what is left of a budget."""
    return np.inf if evaluations is None else max(evaluations - used, 0) // moved


def next_step(rises: Array, left: float, survival: float) -> float:
    """Return how far to go on a path, at most what is `left`, so that weights exp(step rise) leave a share `survival`.

    The share is the effective sample size of the weights over the number of particles that have any; it falls as the
    step grows, so bisection finds it.
    """
    alive = rises[rises > -np.inf]
    if not len(alive) or effective(left * alive) >= survival * len(alive):
        return left
    return float(longest_step(alive, left, survival * len(alive), HALVINGS))  # DAU2022 (exponent)


def reweighed(rises: Array, step: float) -> tuple[Array, float]:
    """Return weights (n,) exp(step rise), which sum to 1, and the logarithm of their mean before they did.

    Raises ValueError where all weigh nothing.
    """
    highest = rises.max()
    if highest == -np.inf:
        raise InputError(f"costs must be finite somewhere, got infinite ones for all {len(rises)} proposals")
    weights = np.exp(step * (rises - highest))
    return np.asarray(weights / weights.sum()), float(step * highest + np.log(weights.mean()))


def systematic_rows(weights: Array, u: float, count: int) -> NDArray[np.int64]:
    """Return `count` rows, each as often as its weight asks: one of the two whole numbers next to count times it.

    `u` in [0, 1) is where the comb of evenly spaced teeth begins.
    """
    rows = weights.cumsum().searchsorted((np.arange(count) + u) / count, side="right")
    return np.asarray(np.minimum(rows, np.flatnonzero(weights)[-1]))


def _walk(start: NormalMixture, landscape: Landscape, proposals: Array, weights: Array) -> Array:
    """Return the root (d, d) of a random walk's covariance, in proportion to that of the particles.

    It is taken within the modes of the start, as a walk does not reach from one to the other; where there are none, of
    all particles, as they lie around the heaviest one.
    """
    box, dimensions = landscape.box, proposals.shape[1]
    groups = start.nearest(box, proposals)
    centres = start.centres if len(start.centres) else proposals[[weights.argmax()]]
    covariance = covariance_within(writeable(proposals), weights, groups, centres, box.periodic)
    covariance += 1e-12 * np.eye(dimensions)
    return np.asarray(2.38 / np.sqrt(dimensions) * np.linalg.cholesky(covariance))  # DAU2022 (random walk)


_State = tuple[Array, Array, Array]  # proposals (m, d), costs (m,), log densities of the start (m,)


def _moved(
    landscape: Landscape,
    start: NormalMixture,
    state: _State,
    walk: Array,
    exponent: float,
    temperature: float,
    rng: np.random.Generator,
) -> tuple[_State, float]:
    """Return a chain's next state, and the share of its moves that was accepted."""
    tried = random_walk(state[0], rng.standard_normal(state[0].shape), walk, landscape.box.periodic)
    new = (tried, landscape.costs(tried), start.log_density(landscape.box, tried))
    moved_state = (state[0].copy(), state[1].copy(), state[2].copy())
    share = accept_moves(*moved_state, *new, rng.random(len(tried)), exponent, temperature)
    return moved_state, float(share)
