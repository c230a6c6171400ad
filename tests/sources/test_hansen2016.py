"""One test for each equation of Hansen's tutorial, 2016: by hand, by law, or in matrices; and Auger and Hansen 2005."""

from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.fitting.box import Start
from posefit.fitting.cma import CMAES, Strategy, constants, default_population_size
from posefit.testing.toy import Toy, sphere

# Six proposals in two dimensions, worked by hand. mu = 3 and ln 3.5 - ln i is:
RAW = np.array([1.252763, 0.559616, 0.154151, -0.133531, -0.356675, -0.538997])
MU_EFF = 2.028615  # 1.966530^2 / (1.569415 + 0.313170 + 0.023763)
# the latter those of `learnt`
(WEIGHTS, SMALL), (EIGHT_WEIGHTS, EIGHT) = constants(2, 6), constants(3, 8)


@dataclass(frozen=True)
class Generation:
    """A strategy before and after it has learnt a generation, and what the tutorial's formulas are written in."""

    before: dict[str, Any]
    after: Strategy
    y: Array  # (n, d) steps, best first

    @property
    def step(self) -> Array:
        half = len(self.y) // 2
        return np.asarray(EIGHT_WEIGHTS[:half] @ self.y[:half])

    @property
    def root(self) -> Array:
        """C^(-1/2) of the old covariance."""
        values, vectors = np.linalg.eigh(self.before["covariance"])
        return np.asarray(vectors @ np.diag(values**-0.5) @ vectors.T)


def learnt(generations: int = 6, *, far: float = 0.0) -> Generation:
    """Return the last of some generations on an ellipsoid; with `far`, its proposals lie so much to one side."""
    strategy = Strategy(np.array([0.3, -0.2, 0.5]), np.array([0.1, 0.3, 0.2]), 8)
    rng = np.random.default_rng(4)
    for number in range(generations):
        x = strategy.sample(rng, 8) + far * (number == generations - 1)
        costs = x**2 @ np.array([1.0, 10.0, 3.0])
        before = deepcopy(vars(strategy))
        strategy.learn(x, costs)
    return Generation(
        before, strategy, (x[costs.argsort()] - before["mean"]) / before["sigma"]
    )


def heeded(one: Generation) -> float:
    """h_sigma, page 28: whether the path is not too long for the covariance to follow; the first generation is 1."""
    rates = EIGHT
    g = one.after.generation
    long = np.linalg.norm(one.after.step_path) / np.sqrt(
        1.0 - (1.0 - rates.c_sigma) ** (2 * (g + 1))
    )
    return float(long < (1.4 + 2.0 / 4.0) * rates.chi)


# HANSEN2016 (8)
def test_eq_8_mu_eff_is_how_many_equal_weights_select_as_much() -> None:
    assert pytest.approx(MU_EFF, abs=1e-5) == SMALL.mu_eff
    # four proposals: (0.916291 + 0.223144)^2 / (0.839589 + 0.049793)
    assert constants(3, 4)[1].mu_eff == pytest.approx(1.459792, abs=1e-5)


# HANSEN2016 (38)
def test_eq_38_the_first_draws_are_normal_around_the_mean_with_its_spread() -> None:
    mean = np.array([0.1, -0.2, 0.0, 0.3])
    spread = np.array([0.02, 0.05, 0.01, 0.03])
    drawn = Strategy(mean, spread, 10).sample(np.random.default_rng(0), 20000)
    np.testing.assert_allclose(drawn.mean(axis=0), mean, atol=1.5e-3)
    np.testing.assert_allclose(np.cov(drawn.T), np.diag(spread**2), atol=1e-4)


# HANSEN2016 (39)
def test_eq_39_steps_are_normal_draws_along_the_axes_of_the_covariance() -> None:
    strategy = learnt().after
    # what unit draws become are the columns of B D, and B D (B D)' = C
    steps = (
        strategy.sample(np.random.default_rng(0), 3) - strategy.mean
    ) / strategy.sigma
    columns = np.linalg.solve(np.random.default_rng(0).standard_normal((3, 3)), steps)
    np.testing.assert_allclose(
        columns.T @ columns, strategy.covariance, rtol=1e-10, atol=1e-12
    )
    np.testing.assert_allclose(
        columns @ columns.T,
        np.diag(np.linalg.eigvalsh(strategy.covariance)),
        atol=1e-12,
    )


# HANSEN2016 (40)
def test_eq_40_proposals_lie_a_step_size_times_a_step_from_the_mean() -> None:
    strategy = learnt().after
    near = strategy.sample(np.random.default_rng(0), 5) - strategy.mean
    strategy.sigma *= 3.0
    strategy.mean += 7.0
    far = strategy.sample(np.random.default_rng(0), 5) - strategy.mean
    np.testing.assert_allclose(far, 3.0 * near, rtol=1e-9)


# HANSEN2016 (41)
def test_eq_41_the_step_of_the_mean_is_the_better_halfs_weighted_sum() -> None:
    # two dimensions, where sigma is 1 and the mean 0, so that the new mean is the step
    strategy = Strategy(np.zeros(2), np.ones(2), 6)
    x = np.array(
        [[0.0, 9.0], [3.0, 0.0], [1.0, 0.0], [9.0, 9.0], [2.0, 0.0], [9.0, 0.0]]
    )
    strategy.learn(x, np.array([4.0, 3.0, 1.0, 6.0, 2.0, 5.0]))
    # (1 x 1.252763 + 2 x 0.559616 + 3 x 0.154151) / 1.966530
    np.testing.assert_allclose(strategy.mean, [1.441346, 0.0], atol=1e-5)


# HANSEN2016 (42)
def test_eq_42_the_mean_moves_by_a_step_size_times_the_step() -> None:
    one = learnt()
    np.testing.assert_allclose(
        one.after.mean, one.before["mean"] + one.before["sigma"] * one.step, rtol=1e-12
    )


# HANSEN2016 (43)
def test_eq_43_the_path_of_the_step_size_adds_the_whitened_step() -> None:
    one = learnt()
    fresh = (
        np.sqrt(EIGHT.c_sigma * (2.0 - EIGHT.c_sigma) * EIGHT.mu_eff)
        * one.root
        @ one.step
    )
    np.testing.assert_allclose(
        one.after.step_path,
        (1.0 - EIGHT.c_sigma) * one.before["step_path"] + fresh,
        rtol=1e-10,
    )


# HANSEN2016 (44)
def test_eq_44_the_step_size_grows_if_the_path_is_longer_than_by_chance() -> None:
    for far in (0.0, 2.0):
        one = learnt(far=far)
        share = np.linalg.norm(one.after.step_path) / EIGHT.chi
        grown = float(one.before["sigma"]) * np.exp(
            EIGHT.c_sigma / EIGHT.d_sigma * (share - 1.0)
        )
        assert one.after.sigma == pytest.approx(grown, rel=1e-12)
        assert (one.after.sigma > one.before["sigma"]) == (share > 1.0)


# HANSEN2016 (h_sigma)
def test_h_sigma_stops_the_path_of_the_covariance_while_that_of_the_step_size_is_long() -> (
    None
):
    near = learnt()
    far = learnt(far=5.0)
    assert (heeded(near), heeded(far)) == (1.0, 0.0)
    np.testing.assert_allclose(
        far.after.path, (1.0 - EIGHT.c_c) * far.before["path"], rtol=1e-12
    )


def test_eq_45_the_covariances_path_adds_the_step() -> None:  # HANSEN2016 (45)
    one = learnt()
    fresh = (
        heeded(one) * np.sqrt(EIGHT.c_c * (2.0 - EIGHT.c_c) * EIGHT.mu_eff) * one.step
    )
    np.testing.assert_allclose(
        one.after.path, (1.0 - EIGHT.c_c) * one.before["path"] + fresh, rtol=1e-10
    )


# HANSEN2016 (46)
def test_eq_46_negative_weights_are_scaled_to_the_length_of_a_typical_step() -> None:
    # far away proposals that are bad take away no more than ones nearby: sqrt(d) long they would weigh as they are
    good = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0]])
    taken = []
    for long in (np.sqrt(2.0), 100.0):
        strategy = Strategy(np.zeros(2), np.ones(2), 6)
        bad = long * np.array([[0.6, 0.8], [0.6, 0.8], [0.6, 0.8]])
        strategy.learn(np.concatenate([good, bad]), np.arange(6.0))
        taken.append(strategy.covariance)
    np.testing.assert_allclose(taken[0], taken[1], rtol=1e-7)
    # three of them, each the outer product of sqrt(2) (0.6, 0.8): (0.72, 0.96; 0.96, 1.28)
    path = SMALL.c_1 * np.outer(strategy.path, strategy.path)
    kept = 1.0 - SMALL.c_1 - SMALL.c_mu * WEIGHTS.sum()
    of_good = sum(w * np.outer(y, y) for w, y in zip(WEIGHTS, good, strict=False))
    of_bad = WEIGHTS[3:].sum() * np.array([[0.72, 0.96], [0.96, 1.28]])
    np.testing.assert_allclose(
        taken[0], kept * np.eye(2) + path + SMALL.c_mu * (of_good + of_bad), rtol=1e-7
    )


@pytest.mark.pure
# HANSEN2016 (47)
def test_eq_47_the_covariance_learns_from_its_path_and_from_every_step() -> None:
    for far in [0.0, 5.0]:
        one = learnt(far=far)
        h = heeded(one)
        rates = EIGHT
        w = EIGHT_WEIGHTS
        lengths = np.linalg.norm(one.y @ one.root, axis=1)
        shares = np.where(w >= 0.0, w, 3.0 * w / lengths**2)
        rank_mu = sum(
            wi * np.outer(yi, yi) for wi, yi in zip(shares, one.y, strict=True)
        )
        kept = (
            1.0
            + rates.c_1 * (1.0 - h) * rates.c_c * (2.0 - rates.c_c)
            - rates.c_1
            - rates.c_mu * w.sum()
        )
        of_path = rates.c_1 * np.outer(one.after.path, one.after.path)
        expected = kept * one.before["covariance"] + of_path + rates.c_mu * rank_mu
        np.testing.assert_allclose(
            one.after.covariance, expected, rtol=1e-7, atol=1e-12
        )
        assert (one.after.covariance == one.after.covariance.T).all()


def test_eq_48_the_population_is_4_plus_3_ln_d() -> None:  # HANSEN2016 (48)
    # 4 + floor(3 ln d): ln 4 = 1.386, ln 9 = 2.197, ln 66 = 4.190
    assert [default_population_size(d) for d in (1, 4, 9, 66)] == [4, 8, 10, 16]


def test_eq_49_weights_fall_as_the_logarithm_of_the_rank() -> None:  # HANSEN2016 (49)
    # whatever each half is divided by, its ratios are those of ln((lambda + 1) / 2) - ln i
    np.testing.assert_allclose(WEIGHTS[:3] / WEIGHTS[0], RAW[:3] / RAW[0], atol=1e-5)
    np.testing.assert_allclose(WEIGHTS[3:] / WEIGHTS[3], RAW[3:] / RAW[3], atol=1e-4)
    # of an odd number, the one in the middle counts for nothing
    assert constants(2, 7)[0][3] == 0.0


def bounds(dimensions: int, population: int) -> tuple[float, float, float, float]:
    """Return how much the negative weights sum to, and the three bounds (50), (51), (52) on that."""
    weights, rates = constants(dimensions, population)
    raw = np.log((population + 1) / 2) - np.log(
        np.arange(population // 2 + 1, population + 1)
    )
    worth = raw.sum() ** 2 / (raw**2).sum()
    mu_eff = rates.mu_eff
    c_1 = rates.c_1
    c_mu = rates.c_mu
    negative = -float(weights[weights < 0.0].sum())
    return (
        negative,
        1 + c_1 / c_mu,
        1 + 2 * worth / (mu_eff + 2),
        (1 - c_1 - c_mu) / (dimensions * c_mu),
    )


# HANSEN2016 (50)
def test_eq_50_bounds_the_negative_weights_of_a_middling_population_in_many_dimensions() -> (
    None
):
    negative, *least = bounds(28, 40)
    assert min(least) == least[0] == pytest.approx(negative)


# HANSEN2016 (51)
def test_eq_51_bounds_the_negative_weights_of_a_small_population() -> None:
    negative, *least = bounds(2, 6)
    assert min(least) == least[1] == pytest.approx(negative)
    # 1 + 2 x 2.431917 / 4.028615
    assert negative == pytest.approx(2.207318, abs=1e-4)


# HANSEN2016 (52)
def test_eq_52_bounds_the_negative_weights_of_a_large_population() -> None:
    negative, *least = bounds(2, 100)
    assert min(least) == least[2] == pytest.approx(negative)


# HANSEN2016 (53)
def test_eq_53_the_better_half_sums_to_1_and_each_weight_is_by_hand() -> None:
    # 1.252763 / 1.966530 and so on; -0.133531 / 1.029203 x 2.207318 and so on
    expected = [0.637042, 0.284570, 0.078387, -0.286383, -0.764956, -1.155978]
    np.testing.assert_allclose(WEIGHTS, expected, atol=1e-5)
    assert WEIGHTS[:3].sum() == pytest.approx(1.0)


def test_eq_55_the_step_sizes_rate_and_damping() -> None:  # HANSEN2016 (55)
    # 4.028615 / 9.028615; and 1 more, as sqrt(1.028615 / 3) is below 1
    np.testing.assert_allclose(
        [SMALL.c_sigma, SMALL.d_sigma], [0.446205, 1.446205], atol=1e-5
    )
    # where it is above: mu_eff of 100 is 26.97, sqrt(25.97 / 3) = 2.942 and 28.97 / 33.97 = 0.853
    large = constants(2, 100)[1]
    assert large.mu_eff == pytest.approx(26.97, abs=0.01)
    assert large.d_sigma == pytest.approx(1.0 + 2.0 * 1.942 + 0.853, abs=5e-3)


def test_eq_56_the_covariances_paths_rate() -> None:  # HANSEN2016 (56)
    # (4 + 1.014308) / (6 + 2.028615)
    assert pytest.approx(0.624555, abs=1e-5) == SMALL.c_c


def test_eq_57_how_fast_the_covariance_follows_its_path() -> None:  # HANSEN2016 (57)
    # 2 / (3.3^2 + 2.028615)
    assert pytest.approx(0.154815, abs=1e-5) == SMALL.c_1


# HANSEN2016 (58)
def test_eq_58_how_fast_the_covariance_follows_the_population() -> None:
    # 2 (0.028615 + 0.492947) / (16 + 2.028615)
    assert pytest.approx(0.057859, abs=1e-5) == SMALL.c_mu
    # of a huge population it takes all that the path leaves
    huge = constants(1, 10**5)[1]
    assert huge.c_mu == pytest.approx(1.0 - huge.c_1, abs=1e-6)


def test_chi_is_how_long_a_standard_normal_vector_is() -> None:  # HANSEN2016 (chi)
    # sqrt(2) Gamma((d + 1) / 2) / Gamma(d / 2): sqrt(2 / pi), sqrt(pi / 2), and in nine dimensions 2.918...; the
    # tutorial's series is good to a few in ten thousand
    exact = {1: 0.797885, 2: 1.253314, 3: 1.595769, 9: 2.9180}
    for d, long in exact.items():
        assert constants(d, 10)[1].chi == pytest.approx(
            long, rel=8e-3 if d == 1 else 1e-3
        )


# HANSEN2016 (B.2)
def test_b_2_axes_are_decomposed_at_regular_intervals() -> None:
    # 200 dimensions, four proposals: 0.1 / (200 (c_1 + c_mu)), c_1 = 2 / (201.3^2 + 1.459792) = 4.9354e-5 and
    # c_mu = 2 (1.459792 - 2 + 0.685029) / (202^2 + 1.459792) = 7.0938e-6, is 8.86
    strategy = Strategy(np.zeros(200), np.ones(200), 4)
    rng = np.random.default_rng(0)
    changed = []
    for _ in range(24):
        axes = strategy.axes
        x = strategy.sample(rng, 4)
        strategy.learn(x, (x**2).sum(axis=1))
        changed.append(strategy.axes is not axes)
    assert np.flatnonzero(changed).tolist() == [7, 15, 23]


# HANSEN2016 (B.3)
def test_b_3_a_search_ends_when_it_stagnates_or_diverges() -> None:
    def initial() -> Strategy:
        strategy = Strategy(np.array([0.3, -0.2]), np.array([0.1, 0.1]), 6)
        assert not strategy.ended()
        return strategy

    flat, still, far, fixed, thin = (initial() for _ in range(5))
    # TolFun: 10 + 30 d / lambda generations cost the same
    for _ in range(2 * (10 + 10)):
        assert flat.generation <= 20 or flat.ended()
        flat.learn(flat.sample(np.random.default_rng(flat.generation), 6), np.ones(6))
    assert flat.ended()
    still.mean[:] = 0.0  # TolX, where no step is too small for the mean
    still.sigma *= 0.99e-12
    assert still.ended()
    far.sigma = 1.01e4  # TolXUp
    assert far.ended()
    fixed.mean[:] = 1e15  # NoEffectCoord
    assert fixed.ended()
    thin.lengths = np.array([1e-15, 1.0])  # ConditionCov
    assert thin.ended()


# AUGER2005 (restart)
def test_a_search_that_stagnates_starts_again_with_twice_the_population() -> None:
    optimiser = CMAES(Toy(3), np.random.default_rng(0))
    sizes = []
    for _ in range(400):
        proposals = optimiser.ask()
        sizes.append(len(proposals))
        optimiser.tell(proposals, sphere(proposals))
    assert sizes[0] == 7
    assert set(sizes) >= {7, 14, 28}
    assert sorted(sizes) == sizes


# HANSEN2016 (B.5)
def test_b_5_points_outside_the_box_rank_behind_all_points_inside(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    start = Start(np.array([1.0, 0.0]), np.array([0.3, 0.01]), np.zeros(2))
    optimiser = CMAES(Toy(2, start=start), np.random.default_rng(0), population_size=9)
    optimiser.beyond = np.array([0, 0, 0.3, 0, 0.1, 0, 0, 0.2, 0])
    ranked: list[Array] = []
    monkeypatch.setattr(
        optimiser.strategy, "learn", lambda _, costs: ranked.append(costs)
    )
    optimiser.tell(optimiser.ask(), np.arange(9.0, 0.0, -1.0))
    # 9 is the highest cost: 9 + 0.3, 9 + 0.1 and 9 + 0.2 by hand
    np.testing.assert_allclose(ranked, [[9, 8, 9.3, 6, 9.1, 4, 3, 9.2, 1]])
