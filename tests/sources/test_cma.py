"""Hansen 2016 through cmaes, Auger and Hansen 2005: one generation against the tutorial's equations, and restarts."""

import numpy as np

from posefit import Start
from posefit.arrays import Array
from posefit.testing.toy import Toy, sphere
from posefit_evolution.cma import CMAES

STD = np.array([0.02, 0.05, 0.01, 0.03])


def prepared() -> tuple[CMAES, Toy]:
    space = Toy(4, start=Start(np.array([0.1, -0.2, 0.0, 0.3]), STD, np.zeros(4)))
    return CMAES(space, np.random.default_rng(0)), space


def test_the_population_is_4_plus_3_ln_d() -> None:  # HANSEN2016 (population)
    # 4 + floor(3 ln d): ln 4 = 1.386, ln 9 = 2.197, ln 66 = 4.190
    for dimensions, size in ((4, 8), (9, 10), (66, 16)):
        assert len(CMAES(Toy(dimensions), np.random.default_rng(0)).ask()) == size


def test_the_first_population_is_normal_with_the_starts_mean_and_spread() -> None:  # HANSEN2016 (sampling)
    _, space = prepared()
    drawn = np.concatenate([CMAES(space, np.random.default_rng(seed), population=50).ask() for seed in range(200)])
    assert space.start is not None
    np.testing.assert_allclose(drawn.mean(axis=0), space.start.mean, atol=1.5e-3)
    np.testing.assert_allclose(np.cov(drawn.T), np.diag(STD**2), atol=1e-4)


def generation(x: Array, costs: Array, mean: Array, sigma: float, c: Array) -> tuple[Array, float, Array]:
    """Return mean, step size and covariance after the first generation: the tutorial's appendix A, (41) to (58)."""
    size, n = x.shape
    mu = size // 2
    raw = np.log((size + 1) / 2) - np.log(np.arange(1, size + 1))
    mu_eff = raw[:mu].sum() ** 2 / (raw[:mu] ** 2).sum()
    mu_minus = raw[mu:].sum() ** 2 / (raw[mu:] ** 2).sum()
    c1 = 2 / ((n + 1.3) ** 2 + mu_eff)
    cmu = min(1 - c1, 2 * (mu_eff - 2 + 1 / mu_eff) / ((n + 2) ** 2 + mu_eff))
    least = min(1 + c1 / cmu, 1 + 2 * mu_minus / (mu_eff + 2), (1 - c1 - cmu) / (n * cmu))
    weights = np.where(raw >= 0, raw / raw[raw > 0].sum(), least * raw / -raw[raw < 0].sum())
    cs = (mu_eff + 2) / (n + mu_eff + 5)
    ds = 1 + 2 * max(0.0, np.sqrt((mu_eff - 1) / (n + 1)) - 1) + cs
    cc = (4 + mu_eff / n) / (n + 4 + 2 * mu_eff / n)
    chi = np.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n * n))
    y = (x[costs.argsort()] - mean) / sigma
    step = weights[:mu] @ y[:mu]
    values, vectors = np.linalg.eigh(c)
    root = vectors @ np.diag(values**-0.5) @ vectors.T
    path = np.sqrt(cs * (2 - cs) * mu_eff) * root @ step
    long = np.linalg.norm(path)
    still = float(long / np.sqrt(1 - (1 - cs) ** 4) < (1.4 + 2 / (n + 1)) * chi)
    pc = still * np.sqrt(cc * (2 - cc) * mu_eff) * step
    w = np.where(weights >= 0, weights, weights * n / np.linalg.norm(y @ root, axis=1) ** 2)
    rank_mu = sum(wi * np.outer(yi, yi) for wi, yi in zip(w, y, strict=True))
    kept = 1 + c1 * (1 - still) * cc * (2 - cc) - c1 - cmu * weights.sum()
    return (
        mean + sigma * step,
        sigma * np.exp(cs / ds * (long / chi - 1)),
        kept * c + c1 * np.outer(pc, pc) + cmu * rank_mu,
    )


def test_a_generation_updates_mean_step_and_covariance_as_the_tutorial_does() -> None:  # HANSEN2016 (update)
    optimiser, _ = prepared()
    strategy = optimiser._strategy
    mean, sigma, c = strategy.mean.copy(), strategy._sigma, strategy._C.copy()
    np.testing.assert_allclose(sigma**2 * np.diag(c), STD**2)
    x = optimiser.ask()
    costs = sphere(x)
    expected = generation(x, costs, mean, sigma, c)
    optimiser.tell(x, costs)
    np.testing.assert_allclose(strategy.mean, expected[0], rtol=1e-9)
    np.testing.assert_allclose(strategy._sigma, expected[1], rtol=1e-9)
    np.testing.assert_allclose(strategy._C, expected[2], rtol=1e-7, atol=1e-12)


def test_a_search_that_stagnates_starts_again_with_twice_the_population() -> None:  # AUGER2005 (restart)
    optimiser = CMAES(Toy(3), np.random.default_rng(0))
    sizes = []
    for _ in range(400):
        proposals = optimiser.ask()
        sizes.append(len(proposals))
        optimiser.tell(proposals, sphere(proposals))
    assert sizes[0] == 7
    assert set(sizes) >= {7, 14, 28}
    assert sorted(sizes) == sizes


def test_without_growth_it_starts_again_as_it_was() -> None:
    optimiser = CMAES(Toy(3), np.random.default_rng(0), growth=1)
    spreads = []
    for _ in range(300):
        proposals = optimiser.ask()
        assert len(proposals) == 7
        spreads.append(proposals.std())
        optimiser.tell(proposals, sphere(proposals))
    assert min(spreads) < 1e-6
    assert spreads[-1] > 1e-6 or (np.diff(np.log(spreads)) > 5.0).any()  # it has spread out again
