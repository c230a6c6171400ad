"""One test for each step of waste-free sequential Monte Carlo: by hand and by law."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.stats import kstest, multivariate_normal, truncnorm

from posefit.arrays import Array
from posefit.testing.toy import Toy
from posefit.uncertainty import smc
from posefit.uncertainty.landscape import Landscape
from posefit.uncertainty.smc import NormalMixture, next_step, tempered
from tests.cases import each


@dataclass(frozen=True)
class Known:
    """A mixture of normal distributions whose weights are known, as a cost at temperature 2."""

    weights: Array  # (k,)
    means: Array  # (k, d)
    spreads: Array  # (k, d)

    def cost(self, proposals: Array) -> Array:
        away = (proposals[:, None] - self.means) / self.spreads
        logs = -0.5 * (away**2).sum(axis=2) - np.log(self.spreads * np.sqrt(2.0 * np.pi)).sum(axis=1)
        return np.asarray(-2.0 * np.logaddexp.reduce(logs + np.log(self.weights), axis=1))

    def shares(self, proposals: Array, weights: Array) -> Array:
        """The weights (k,) of the particles nearest to each mean."""
        nearest = ((proposals[:, None] - self.means) ** 2).sum(axis=2).argmin(axis=1)
        return np.bincount(nearest, weights, len(self.means))


def anywhere(dimensions: int) -> NormalMixture:
    """Return a start that is nearly uniform."""
    return NormalMixture(np.zeros((1, dimensions)), np.full((1, dimensions), 0.5), 0.999)


PAIR = Known(np.array([0.7, 0.3]), np.array([[-0.4, 0.2], [0.5, -0.3]]), np.array([[0.1, 0.06], [0.05, 0.1]]))


def test_the_next_step_leaves_the_wanted_share() -> None:  # DAU2022 (exponent)
    # weights 1 and e^-s: (1 + e^-s)^2 / (1 + e^-2s) = 2 x 0.9, so e^-s = 1/2, and s = ln 2
    assert next_step(np.array([0.0, -1.0]), 5.0, 0.9) == pytest.approx(np.log(2.0))
    assert next_step(np.array([0.0, -1.0]), 0.5, 0.9) == 0.5  # no more is left
    # what weighs nothing at all is no part of the share
    assert next_step(np.array([0.0, -np.inf, -1.0, -np.inf]), 5.0, 0.9) == pytest.approx(np.log(2.0))


def test_all_states_of_the_chains_are_particles(monkeypatch: pytest.MonkeyPatch) -> None:  # DAU2022 (waste-free)
    sizes, kept = [], smc.reweighed

    def watched(rises: Array, step: float) -> Array:
        sizes.append(len(rises))
        return kept(rises, step)

    monkeypatch.setattr(smc, "reweighed", watched)
    landscape = Landscape(Toy(2), PAIR.cost)
    found = tempered(landscape, anywhere(2), 2.0, np.random.default_rng(0), particles=96, chain=6)
    assert set(sizes) == {96}
    assert found.proposals.shape == (96, 2)
    # a step evaluates 5 moves of 16 chains, but for those that leave the box
    steps = len(sizes) - 1
    assert 96 + 0.7 * 80 * steps < landscape.evaluations <= 96 + 80 * steps


def test_a_walk_has_the_covariance_of_the_particles(monkeypatch: pytest.MonkeyPatch) -> None:  # DAU2022 (random walk)
    proposals = np.array([[0.1, 0.0], [-0.1, 0.0], [0.0, 0.2], [0.0, -0.2]])
    walk = smc._walk(anywhere(2), Landscape(Toy(2), PAIR.cost), proposals, np.array([0.3, 0.3, 0.2, 0.2]))
    # covariance diag(0.6 x 0.01, 0.4 x 0.04), scaled by 2.38^2 / 2
    np.testing.assert_allclose(walk @ walk.T, 2.38**2 / 2.0 * np.diag([0.006, 0.016]), rtol=1e-9, atol=1e-15)


def test_a_walk_has_the_covariance_within_the_modes() -> None:
    offsets = np.array([[0.1, 0.0], [-0.1, 0.0], [0.0, 0.1], [0.0, -0.1]])
    centres = np.array([[-0.5, -0.5], [0.5, 0.5]])
    start = NormalMixture(centres, np.full((2, 2), 0.1), 0.2)
    proposals = (centres[:, None] + offsets).reshape(-1, 2)
    walk = smc._walk(start, Landscape(Toy(2), PAIR.cost), proposals, np.full(8, 0.125))
    np.testing.assert_allclose(walk @ walk.T, 2.38**2 / 2.0 * np.diag([0.005, 0.005]), rtol=1e-6)


def test_a_start_has_the_density_that_it_draws_from() -> None:
    for broad in [0.2, 0.7]:
        start = NormalMixture(np.array([[-0.9, 0.2], [0.5, -0.8]]), np.array([[0.2, 0.1], [0.4, 0.3]]), broad)
        space = Toy(2, wrapping=1)
        drawn = start.draw(space, np.random.default_rng(0), 4000)
        # the mean of 1 / density over draws is the box's share, which is all of it
        assert np.exp(-start.log_density(space, drawn)).mean() == pytest.approx(1.0, abs=0.06)
        grid = (np.arange(200) + 0.5) / 100.0 - 1.0
        x, y = np.meshgrid(grid, grid)
        density = np.exp(start.log_density(space, np.stack([x.ravel(), y.ravel()], axis=1)))
        assert density.mean() == pytest.approx(1.0, abs=1e-3)
        # by hand, far from where anything is cut off or wraps
        alone = NormalMixture(np.zeros((1, 2)), np.full((1, 2), 0.1), 0.5)
        here = 0.5 + 0.5 * 4.0 * multivariate_normal([0.0, 0.0], 0.01).pdf([0.1, -0.1])
        assert np.exp(alone.log_density(space, np.array([[0.1, -0.1]])))[0] == pytest.approx(here)


def test_a_start_is_cut_off_at_the_sides_and_wraps_around_where_they_meet() -> None:
    start = NormalMixture(np.array([[0.9, 0.9]]), np.full((1, 2), 0.2), 1e-9)
    drawn = start.draw(Toy(2, wrapping=1), np.random.default_rng(1), 3000)
    assert 0.25 < (drawn[:, 0] < 0.0).mean() < 0.4  # half a deviation from the side: 31 %
    assert kstest(drawn[:, 1], truncnorm(-9.5, 0.5, 0.9, 0.2).cdf).pvalue > 1e-3


# the last one knows the lighter mode alone
@each(
    "start",
    [anywhere(2), *(NormalMixture(means, np.full(means.shape, 0.05), 0.2) for means in (PAIR.means, PAIR.means[1:]))],
)
def test_modes_have_their_known_weights(start: NormalMixture) -> None:
    shares, moments = [], []
    for seed in range(20):
        found = tempered(Landscape(Toy(2), PAIR.cost), start, 2.0, np.random.default_rng(seed), particles=1024)
        shares.append(PAIR.shares(found.proposals, found.weights)[0])
        moments.append(found.weights @ found.proposals)
    assert np.mean(shares) == pytest.approx(0.7, abs=0.08)
    np.testing.assert_allclose(np.mean(moments, axis=0), PAIR.weights @ PAIR.means, atol=0.05)


def test_a_mode_across_the_seam_of_a_turn_is_one() -> None:
    def seam(proposals: Array) -> Array:
        away = 1.0 - np.abs(proposals[:, 0])
        return np.asarray(0.5 * (away / 0.1) ** 2)

    start = NormalMixture(np.ones((1, 1)), np.full((1, 1), 0.5), 0.9)
    found = tempered(Landscape(Toy(1, wrapping=1), seam), start, 1.0, np.random.default_rng(0))
    assert 0.3 < found.weights @ (found.proposals[:, 0] > 0.0) < 0.7
    away = 1.0 - np.abs(found.proposals[:, 0])
    assert np.sqrt(found.weights @ away**2) == pytest.approx(0.1, rel=0.25)


def test_only_what_is_feasible_counts() -> None:
    quarter = Toy(2, lambda x: (x > 0.0).all(axis=1))
    landscape = Landscape(quarter, lambda x: np.zeros(len(x)))
    found = tempered(landscape, anywhere(2), 1.0, np.random.default_rng(0), particles=4096)
    assert quarter.feasible(found.proposals).all()
    np.testing.assert_allclose(found.weights @ found.proposals, 0.5, atol=0.05)


def test_what_costs_infinitely_much_weighs_nothing() -> None:
    landscape = Landscape(Toy(1), lambda x: np.where(x[:, 0] > 0.0, np.nan, 1.0))
    found = tempered(landscape, anywhere(1), 1.0, np.random.default_rng(0))
    assert found.weights @ (found.proposals[:, 0] > 0.0) == 0.0
    with pytest.raises(ValueError, match="costs must be finite somewhere"):
        tempered(Landscape(Toy(1), lambda x: x[:, 0] * np.nan), anywhere(1), 1.0, np.random.default_rng(0))


def test_settings_that_make_no_sense_are_refused() -> None:
    rng = np.random.default_rng(0)
    for given, message in [
        ({"temperature": 0.0}, "temperature must be above 0, got 0.0"),
        ({"particles": 10}, "particles must be at least 2 chains of 2 or more, got 10 and chains of 8"),
        ({"chain": 1}, "particles must be at least 2 chains of 2 or more, got 2048 and chains of 1"),
    ]:
        with pytest.raises(ValueError, match=message):
            tempered(Landscape(Toy(2), PAIR.cost), anywhere(2), **{"temperature": 1.0, "rng": rng, **given})
    with pytest.raises(ValueError, match="spreads must be above 0 and at most 0.5"):
        NormalMixture(np.zeros((1, 2)), np.zeros((1, 2)), 0.2)
    with pytest.raises(ValueError, match="the box must be feasible somewhere"):
        anywhere(1).draw(Toy(1, lambda x: x[:, 0] > 2.0), rng, 4)
