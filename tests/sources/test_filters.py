"""Gordon et al. 1993 and Deutscher and Reid 2005: each step by hand, by law, or against a Kalman filter."""

import numpy as np
import pytest

from posefit import Start
from posefit.plugin import Array, systematic_rows, weigh
from posefit.testing.toy import Toy
from posefit_filters.annealed import Annealed
from posefit_filters.particle import Particle
from posefit_filters.weighting import sharpness, survival


def test_likelihood_is_an_exponential_of_the_cost() -> None:  # GORDON1993 (likelihood)
    # e^-0 : e^-ln2 : e^-ln4 = 4 : 2 : 1
    np.testing.assert_allclose(
        weigh(np.log([1.0, 2.0, 4.0]), 1.0), [4 / 7, 2 / 7, 1 / 7]
    )
    np.testing.assert_allclose(
        weigh(np.log([1.0, 2.0, 4.0]) + 900.0, 2.0), [16 / 21, 4 / 21, 1 / 21]
    )
    np.testing.assert_allclose(
        weigh(np.array([0.0, np.nan, np.inf]), 1.0), [1.0, 0.0, 0.0]
    )
    np.testing.assert_allclose(weigh(np.array([np.nan, np.inf]), 1.0), [0.5, 0.5])


def test_resampling_gives_each_particle_its_share() -> None:  # GORDON1993 (resampling)
    weights = np.array([0.5, 0.3, 0.15, 0.05])
    teeth = np.linspace(0.0, 1.0, 2000, endpoint=False)
    counts = np.array(
        [np.bincount(systematic_rows(weights, u, 4), minlength=4) for u in teeth]
    )
    np.testing.assert_allclose(counts.mean(axis=0), 4 * weights, atol=2e-3)
    # never off by a whole particle
    assert (np.abs(counts - 4 * weights) < 1.0 + 1e-12).all()
    assert systematic_rows(np.array([0.0, 1.0, 0.0]), 0.999, 3).tolist() == [1, 1, 1]


def test_particles_move_by_normal_noise() -> None:  # GORDON1993 (motion)
    space = Toy(2, start=Start(np.zeros(2), np.full(2, 1e-6), np.array([0.3, -0.2])))
    particle = Particle(space, np.random.default_rng(0), evaluations=20_000, noise=0.05)
    particle.tell(particle.ask(), np.zeros(20_000))
    particle.advance(space)
    moved = particle.ask()
    np.testing.assert_allclose(moved.mean(axis=0), [0.0, 0.0], atol=2e-3)
    np.testing.assert_allclose(moved.std(axis=0), 0.05, rtol=0.02)


def test_the_filter_agrees_with_a_kalman_filter() -> None:
    # x_t = x_{t-1} + N(0, q^2), y_t = x_t + N(0, r^2), x_0 uniform on the box, all far from its sides
    q = 0.05
    r = 0.1
    rng = np.random.default_rng(1)
    truth = 0.2 + np.cumsum(q * rng.standard_normal(15))
    seen = truth + r * rng.standard_normal(15)
    space = Toy(1)
    particle = Particle(
        space, np.random.default_rng(0), evaluations=40_000, sharpness=1.0, noise=q
    )
    # a flat first belief leaves the first observation
    mean = seen[0]
    variance = r**2
    for t, y in enumerate(seen):
        if t:
            particle.advance(space)
            variance += q**2
            gain = variance / (variance + r**2)
            mean = mean + gain * (y - mean)
            variance = (1.0 - gain) * variance
        proposals = particle.ask()
        particle.tell(proposals, (proposals[:, 0] - y) ** 2 / (2.0 * r**2))
        assert particle._weights @ proposals[:, 0] == pytest.approx(mean, abs=5e-3)
    spread = np.sqrt(particle._weights @ (proposals[:, 0] - mean) ** 2)
    assert spread == pytest.approx(np.sqrt(variance), rel=0.05)


# DEUTSCHER2005 (survival)
def test_survival_is_the_effective_share_of_particles() -> None:
    assert survival(np.full(8, 3.0), 2.0) == pytest.approx(1.0)
    assert survival(np.array([3.0, np.inf, np.inf, np.nan]), 2.0) == pytest.approx(0.25)
    assert survival(np.array([3.0, 3.0, np.inf, np.nan]), 2.0) == pytest.approx(0.5)
    assert survival(np.full(3, np.nan), 2.0) == 1.0  # nothing is known: all weigh alike
    # 1 / (0.36 + 0.09 + 0.01) / 3 = 0.724638
    assert survival(-np.log([0.6, 0.3, 0.1]), 1.0) == pytest.approx(0.724638, abs=1e-6)


def test_beta_lets_the_wanted_share_survive() -> None:  # DEUTSCHER2005 (beta)
    for wanted in [0.1, 0.3, 0.5, 0.9]:
        costs = np.random.default_rng(0).exponential(5.0, 300)
        beta = sharpness(costs, wanted)
        assert survival(costs, beta) == pytest.approx(wanted, abs=1e-9)
        # the cost's own scale does not matter
        assert sharpness(10.0 * costs, wanted) == pytest.approx(beta / 10.0)


def test_beta_is_defined_even_if_no_share_can_be_reached() -> (
    None
):  # DEUTSCHER2005 (beta)
    # a quarter survives at most
    assert sharpness(np.array([1.0, np.inf, np.nan, np.inf]), 0.5) == 0.0
    assert sharpness(np.zeros(10), 0.5) > 1e12  # all survive at any beta
    assert sharpness(np.full(4, np.nan), 0.5) > 1e12


def annealed(particles: Array, layers: int = 2, **settings: float) -> Annealed:
    """Return a filter of one layer more than has been told, with these particles."""
    how = {"evaluations": layers * len(particles), "layers": layers, **settings}
    made = Annealed(Toy(particles.shape[1]), np.random.default_rng(0), **how)
    made._particles = particles
    return made


# DEUTSCHER2005 (diffusion)
def test_noise_is_a_multiple_of_the_particles_own_spread() -> None:
    scale = np.array([0.01, 0.05])
    particles = scale * np.random.default_rng(1).standard_normal((20_000, 2))
    made = annealed(particles.copy(), diffusion=0.5)
    # equal costs: all survive, once each
    made.tell(made.ask(), np.zeros(len(particles)))
    step = made.ask() - particles
    np.testing.assert_allclose(step.std(axis=0), 0.5 * particles.std(axis=0), rtol=0.02)


# DEUTSCHER2005 (next frame)
def test_survivors_enter_the_next_frame_with_the_noise_of_a_motion() -> None:
    particles = np.zeros((20_000, 2))
    made = annealed(particles, noise=0.07, layers=1)
    made.tell(made.ask(), np.zeros(len(particles)))
    assert not len(made.ask())
    made.advance(Toy(2))
    np.testing.assert_allclose(made.ask().std(axis=0), 0.07, rtol=0.02)


def test_a_frames_particles_are_carried_into_a_box_that_has_moved() -> None:
    class Moved(Toy):
        def moved(self, proposals: Array, origin: object) -> Array:
            return proposals - 0.25

    space = Toy(2, start=Start(np.full(2, 0.5), np.full(2, 1e-9), np.zeros(2)))
    particle = Particle(space, np.random.default_rng(0), evaluations=500, noise=1e-9)
    particle.tell(particle.ask(), np.zeros(500))
    particle.advance(Moved(2))
    np.testing.assert_allclose(particle.ask(), 0.25, atol=1e-6)
