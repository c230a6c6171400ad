"""Modes with weights from several searches, on mixtures whose weights are known, and by simulation-based calibration.

There a truth drawn from the prior is one more draw of the sampler: S. Talts, M. Betancourt, D. Simpson, A. Vehtari,
A. Gelman, Validating Bayesian inference algorithms with simulation-based calibration, 2018.
"""

import numpy as np
import pytest
from scipy.stats import chisquare

from posefit.arrays import Array
from posefit.fitting.optimiser import populations
from posefit.registry import registry
from posefit.testing.toy import Toy
from posefit.tracking.modes import gathered
from posefit.uncertainty.landscape import Landscape
from posefit.uncertainty.searches import best_of_each, boltzmann_weights, weighed, widths
from tests.cases import each

WEIGHTS = np.array([0.6, 0.3, 0.1])
SPREADS = np.array([0.04, 0.1, 0.07])


def means(dimensions: int) -> Array:
    return np.stack([np.full(dimensions, 0.5), np.full(dimensions, -0.4), np.linspace(-0.6, 0.6, dimensions)])


def mixture(proposals: Array) -> Array:
    """Return costs (n,) whose exp(-cost) is a mixture of three normal distributions."""
    d = proposals.shape[1]
    away = ((proposals[:, None] - means(d)) ** 2).sum(axis=2) / SPREADS**2
    logs = -0.5 * away - d * np.log(SPREADS * np.sqrt(2.0 * np.pi)) + np.log(WEIGHTS)
    return np.asarray(-np.logaddexp.reduce(logs, axis=1))


def searches(dimensions: int, rng: np.random.Generator) -> list[tuple[Array, Array]]:
    """Return the evaluations of nine searches, each near one of the three."""
    evaluated = []
    for k in range(9):
        proposals = means(dimensions)[k % 3] + 0.5 * SPREADS[k % 3] * rng.standard_normal((60, dimensions))
        evaluated.append((proposals, mixture(proposals)))
    return evaluated


@each(("dimensions", "off"), [(2, 0.05), (5, 0.08), (10, 0.15)])
def test_modes_have_their_weights(dimensions: int, off: float) -> None:
    wrong = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        landscape = Landscape(Toy(dimensions), mixture)
        sample = weighed(landscape, searches(dimensions, rng), 1.0, rng)
        weights = np.bincount(sample.groups, sample.weights, len(sample.modes))
        assert weights.sum() == pytest.approx(1.0)
        nearest = ((sample.modes[:, None] - means(dimensions)) ** 2).sum(axis=2).argmin(axis=1)
        assert set(nearest) == {0, 1, 2}
        wrong.append(0.5 * np.abs(np.bincount(nearest, weights, 3) - WEIGHTS).sum())
    assert np.mean(wrong) < off


def test_even_rows_have_the_shares_of_the_modes() -> None:
    rng = np.random.default_rng(1)
    sample = weighed(Landscape(Toy(3), mixture), searches(3, rng), 1.0, rng)
    rows, weights = sample.even(100, rng)
    np.testing.assert_array_equal(weights, 0.01)
    near = np.array([((rows - mode) ** 2).sum(axis=1) for mode in sample.modes]).argmin(axis=0)
    shares = np.bincount(near, minlength=len(sample.modes)) / 100.0
    np.testing.assert_allclose(shares, np.bincount(sample.groups, sample.weights), atol=0.03)


def test_the_width_of_a_valley_is_its_standard_deviation() -> None:
    # costs are a sum of squares: exp(-cost / 2) has the deviations 0.1 and 0.03 times the root of 2 about the mode
    spread, box = np.array([0.1, 0.03]), Toy(2)
    proposals = np.random.default_rng(0).uniform(-1.0, 1.0, (2000, 2)) * 0.3
    costs = 0.5 * ((proposals / spread) ** 2).sum(axis=1)
    mode = np.zeros((1, 2)), np.zeros(1)
    valley = widths(box, [(proposals, costs)], *mode, 2.0)
    np.testing.assert_allclose(valley, [np.sqrt(2.0) * spread], rtol=0.01)
    # a flat or unknown valley has the greatest width
    np.testing.assert_allclose(widths(box, [(proposals, np.zeros(2000))], *mode, 1.0), 0.5)
    np.testing.assert_allclose(widths(box, [(np.zeros((1, 2)), np.zeros(1))], *mode, 1.0), 0.5)


def test_a_valley_has_its_own_width_where_enough_is_known() -> None:
    rng, modes, spreads = np.random.default_rng(0), np.array([[-0.5], [0.5], [0.9]]), np.array([0.05, 0.1])
    near = [modes[k] + spreads[k] * rng.standard_normal((50, 1)) for k in range(2)]
    searched = [(near[k], 0.5 * ((near[k][:, 0] - modes[k]) / spreads[k]) ** 2) for k in range(2)]
    valley = widths(Toy(1), searched, modes, np.zeros(3), 1.0)[:, 0]
    np.testing.assert_allclose(valley[:2], spreads, rtol=0.01)
    assert spreads[0] < valley[2] < spreads[1]  # nothing is known of it: as all together


def test_the_best_of_each_search_are_distinct_and_feasible() -> None:
    space = Toy(1, lambda x: x[:, 0] >= 0.0)
    proposals = np.array([[0.3], [0.1], [0.1], [-0.2], [0.5], [0.4]])
    costs = np.array([3.0, 1.0, 1.0, 0.0, np.nan, 4.0])
    landscape = Landscape(space, lambda x: x[:, 0])
    best, known = best_of_each(landscape, [(proposals, costs), (proposals[:1], costs[:1])], 2)
    np.testing.assert_array_equal(best[:, 0], [0.1, 0.3, 0.3])
    np.testing.assert_array_equal(known, [1.0, 3.0, 3.0])
    with pytest.raises(ValueError, match="searches must have a finite cost, got none in 1 searches"):
        best_of_each(landscape, [(proposals, np.full(6, np.inf))], 2)


def test_boltzmann_weights_are_exponentials_and_0_where_a_cost_is_not_finite() -> None:
    np.testing.assert_allclose(boltzmann_weights(np.array([0.0, 2.0 * np.log(3.0), np.nan]), 2.0), [0.75, 0.25, 0.0])
    np.testing.assert_allclose(boltzmann_weights(np.array([np.inf, np.nan]), 2.0), 0.5)


NOISE, DRAWS, TRUTHS = 0.2, 9, 200


def observed(proposals: Array) -> Array:
    """Return observations (n, d) of proposals (n, d): the first coordinate without its sign, sums of the others."""
    return np.concatenate([np.abs(proposals[:, :1]), proposals[:, 1:] @ MIXED], axis=1)


MIXED = np.array([[1.0, 0.4, 0.0], [0.0, 1.0, 0.4], [0.4, 0.0, 1.0]])


@each("evaluations", [490, 4000])
def test_a_truth_is_one_more_draw(evaluations: int) -> None:
    space, make, rng = Toy(4), registry().optimiser("sapso"), np.random.default_rng(0)
    ranks = []
    for _ in range(TRUTHS):
        truth = rng.uniform(-1.0, 1.0, (1, 4))
        observation = observed(truth) + NOISE * rng.standard_normal((1, 4))

        def cost(proposals: Array, observation: Array = observation) -> Array:
            return np.asarray(0.5 * ((observed(proposals) - observation) ** 2).sum(axis=1) / NOISE**2)

        landscape = Landscape(space, cost)
        first = gathered([(one.copy(), costs) for one, costs in populations(make(space, rng), cost, 2440)])
        other = first[0][[first[1].argmin()]] * [-1.0, 1.0, 1.0, 1.0]  # its twin, as a tracker knows those of poses
        sample = weighed(landscape, [first, (other, cost(other))], 1.0, rng, evaluations=evaluations)
        assert landscape.evaluations <= 1.1 * evaluations
        rows = rng.choice(len(sample.weights), DRAWS, p=sample.weights)
        ranks.append((sample.proposals[rows] < truth).sum(axis=0))
    for column in np.transpose(ranks):
        counts = np.bincount(column, minlength=DRAWS + 1)
        assert chisquare(counts).pvalue > 0.01, counts
