"""The related work, step by step, by hand, by law or by a twin.

John 2010, Zhao 2008, Krzeszowski 2010 and Gavrila 1996; Wang 2003 and Urtasun 2005; Peursum 2010, Wachter 1999 and
Agarwal 2006.
"""

import copy
import math
import warnings
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import approx_fprime
from scipy.stats import multivariate_normal
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from posefit import Start
from posefit.arrays import Array
from posefit.testing.toy import Toy, sphere
from posefit.testing.tracker_rules import scene
from posefit_related.gplvm import GPLVM, MAX_VARIANCE, kernel, loss
from posefit_related.gradient import predicted
from posefit_related.haga import HAGA
from posefit_related.hpso import HPSO
from posefit_related.isomap import IsomapPrior, rebuilt
from posefit_related.local import Local
from posefit_related.psopf import CHI, PHI, PSOPF
from posefit_related.regression import POINTS, Regression, contexts, histogram
from posefit_related.smoothing import smoothed
from posefit_related.stages import opened, runs


def expected_at_middle(d: int) -> Toy:
    """Return a space of d dimensions whose prediction is its middle, give or take 0.1."""
    return Toy(d, start=Start(np.zeros(d), np.full(d, 0.1), np.zeros(d)))


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


# JOHN2010 (hierarchy)
def test_the_root_comes_first_and_then_runs_along_the_chain() -> None:
    assert [run.tolist() for run in runs(10, 4)] == [[0, 1, 2], [3, 4, 5, 6], [7, 8, 9]]
    assert [run.tolist() for run in runs(2, 4)] == [[0, 1]]
    for d in range(1, 70):
        np.testing.assert_array_equal(np.concatenate(runs(d, 6)), np.arange(d))


def stages(optimiser: HPSO) -> list[list[tuple[Array, Array]]]:
    """Return the populations and costs of each stage of a search, the first poses first."""
    by_stage = [list[tuple[Array, Array]]() for _ in range(len(optimiser._runs) + 1)]
    while len(proposals := optimiser.ask()):
        costs = sphere(proposals)
        by_stage[optimiser._stage + 1].append((proposals, costs))
        optimiser.tell(proposals, costs)
    return by_stage


def test_a_stage_moves_its_own_coordinates_only() -> None:  # JOHN2010 (stage)
    _, *after = stages(
        HPSO(expected_at_middle(10), rng(), run_length=4, evaluations=300)
    )
    for run, populations in zip(runs(10, 4), after, strict=True):
        rows = np.concatenate([proposals for proposals, _ in populations])
        assert np.flatnonzero(np.ptp(rows, axis=0) > 0.0).tolist() == run.tolist()


def test_a_stage_holds_the_best_of_the_one_before() -> None:  # JOHN2010 (handed down)
    parts = stages(HPSO(expected_at_middle(10), rng(), run_length=4, evaluations=300))
    for before, after in pairwise(parts):
        proposals, costs = (np.concatenate(rows) for rows in zip(*before, strict=True))
        np.testing.assert_array_equal(after[0][0][0], proposals[costs.argmin()])


def test_the_inertia_falls_from_a_to_a_tenth() -> None:  # JOHN2010 (inertia)
    optimiser = HPSO(
        expected_at_middle(3),
        rng(),
        acceleration=0.0,
        inertia=2.0,
        alpha=10.0,
        evaluations=101,
    )
    optimiser.tell(optimiser.ask(), np.zeros(1))
    assert optimiser._generations == 10
    # the middle of a geometric fall
    for generation, omega in ((0, 2.0), (5, math.sqrt(0.2)), (10, 0.1)):
        optimiser._v[:], optimiser._generation = 0.01, generation
        optimiser._move()
        np.testing.assert_allclose(optimiser._v, 0.01 * omega)


def test_layers_open_the_root_and_then_equal_shares() -> None:  # ZHAO2008 (hierarchy)
    assert [opened(9, layer, 3) for layer in range(3)] == [5, 7, 9]
    # 7 components: 3, 2 and 2
    assert [opened(10, layer, 3) for layer in range(3)] == [6, 8, 10]
    assert [opened(2, layer, 3) for layer in range(3)] == [2, 2, 2]


def test_the_best_survives() -> None:  # ZHAO2008 (elite)
    optimiser = HAGA(expected_at_middle(9), rng(), evaluations=400)
    lowest = np.inf
    while len(proposals := optimiser.ask()):
        costs = sphere(proposals)
        assert costs[0] == lowest or not np.isfinite(lowest)
        lowest = min(lowest, costs.min())
        optimiser.tell(proposals, costs)


# ZHAO2008 (annealing)
def test_the_temperature_falls_geometrically_in_each_layer() -> None:
    optimiser = HAGA(expected_at_middle(9), rng(), evaluations=3 * 40 * 5)
    temperatures = []
    while len(proposals := optimiser.ask()):
        temperatures.append(optimiser.temperature())
        optimiser.tell(proposals, sphere(proposals))
    layers = np.reshape(temperatures, (3, 5))
    np.testing.assert_allclose(layers[:, [0, -1]], [[5.0, 0.2]] * 3)
    # four steps
    np.testing.assert_allclose(layers[:, 1:] / layers[:, :-1], (0.2 / 5.0) ** 0.25)


def halves(optimiser: HAGA) -> Array:
    """Return individuals, of which every other one is at -0.4, the rest at 0.4."""
    x = np.full((optimiser._size, optimiser._space.dimensions), -0.4)
    x[::2] = 0.4
    return x


# ZHAO2008 (selection)
def test_parents_are_chosen_by_their_fitness_at_the_temperature() -> None:
    optimiser = HAGA(
        expected_at_middle(1),
        rng(),
        population_size=20_000,
        evaluations=20_000,
        layers=1,
        mutation=0.0,
    )
    x = halves(optimiser)
    # three to one at a temperature of 5
    costs = np.where(x[:, 0] > 0.0, 7.0, 7.0 + 5.0 * math.log(3.0))
    children = optimiser._children(x, costs)
    assert children.mean() == pytest.approx(0.75 * 0.4 - 0.25 * 0.4, abs=0.01)


# ZHAO2008 (crossover)
def test_children_lie_between_their_parents_or_a_quarter_beyond() -> None:
    optimiser = HAGA(
        expected_at_middle(1),
        rng(),
        population_size=20_000,
        evaluations=20_000,
        layers=1,
        mutation=0.0,
    )
    children = optimiser._children(halves(optimiser), np.zeros(20_000))
    assert np.abs(children).max() <= 0.6 + 1e-12  # 0.4 and a quarter of 0.8
    mixed = children[np.abs(np.abs(children) - 0.4) > 1e-9]
    assert len(mixed) == pytest.approx(10_000, abs=400)  # half of the pairs differ
    # uniform
    np.testing.assert_allclose(
        np.quantile(mixed, [0.25, 0.5, 0.75]), [-0.3, 0.0, 0.3], atol=0.02
    )


def test_open_coordinates_mutate_by_noise_that_cools() -> None:  # ZHAO2008 (mutation)
    optimiser = HAGA(
        expected_at_middle(9),
        rng(),
        population_size=20_000,
        evaluations=180_000,
        mutation=1.0,
    )
    # 5, 1 and 0.2: of three generations
    for generation, share in ((0, 1.0), (1, 0.2), (2, 0.04)):
        optimiser._generation = generation
        children = optimiser._children(np.zeros((20_000, 9)), np.zeros(20_000))
        np.testing.assert_allclose(children.std(axis=0)[:5], 0.1 * share, rtol=0.03)
        assert not children[:, 5:].any()


def test_a_swarm_shifts_the_particles() -> None:  # KRZESZOWSKI2010 (shift)
    optimiser = PSOPF(Toy(4), rng(), evaluations=60, iterations=2, alpha=10.0)
    x = optimiser.ask()
    optimiser.tell(x, sphere(x))
    # at rest before, and each its own best
    moved = optimiser.ask()
    v = optimiser.ask() - x
    twin = copy.deepcopy(optimiser._rng)
    gbest = x[sphere(x).argmin()]
    optimiser.tell(moved, sphere(moved))
    pulls = twin.random((2, *x.shape))
    best = (
        moved[sphere(moved).argmin()]
        if sphere(moved).min() < sphere(gbest[None])[0]
        else gbest
    )
    for row in range(len(x)):
        pbest = moved[row] if sphere(moved)[row] < sphere(x)[row] else x[row]
        by_hand = (
            v[row]
            + PHI * pulls[0, row] * (pbest - moved[row])
            + PHI * pulls[1, row] * (best - moved[row])
        )
        if (
            np.abs(moved[row] + CHI * by_hand).max() <= 1.0
            and np.abs(moved[row]).max() < 1.0
        ):
            np.testing.assert_allclose(
                optimiser._x[row], moved[row] + CHI * by_hand, atol=1e-12
            )


# KRZESZOWSKI2010 (weights)
def test_particles_survive_by_their_weights_after_the_move() -> None:
    optimiser = PSOPF(
        Toy(1), rng(), evaluations=4000, iterations=0, sharpness=2.0, noise=1e-9
    )
    x = np.where(rng().permutation(4000) % 2, 0.5, -0.5)[:, None]
    optimiser._x = x
    optimiser.ask()
    # three to one
    optimiser.tell(x, np.where(x[:, 0] > 0.0, 1.0, 1.0 + 0.5 * math.log(3.0)))
    assert not len(optimiser.ask())
    optimiser.advance(Toy(1))
    assert (optimiser.ask() > 0.0).mean() == pytest.approx(0.75, abs=0.01)


def test_one_part_is_searched_after_the_other() -> None:  # GAVRILA1996 (decomposition)
    optimiser = Local(expected_at_middle(10), rng(), run_length=4, evaluations=500)
    parts = runs(10, 4)
    optimiser.tell(optimiser.ask(), np.zeros(1))
    order = []
    for _ in range(12):
        best = optimiser._best
        proposals = optimiser.ask()
        moved = np.flatnonzero((proposals != best).any(axis=0))
        order.append(
            next(k for k, run in enumerate(parts) if np.isin(moved, run).all())
        )
        optimiser.tell(proposals, np.ones(len(proposals)))  # never better
    assert order == [0, 0, 1, 1, 2, 2] * 2  # two expansions in vain end a part
    assert optimiser._step == 0.1 / 4.0  # halved after each round without a better pose


# GAVRILA1996 (best first)
def test_the_best_pose_that_was_not_expanded_is_next() -> None:
    optimiser = Local(
        expected_at_middle(3), rng(), step=0.1, patience=5, evaluations=500
    )
    optimiser.tell(optimiser.ask(), np.array([9.0]))
    near = optimiser.ask()
    np.testing.assert_allclose(near, 0.1 * np.concatenate([np.eye(3), -np.eye(3)]))
    optimiser.tell(near, np.array([8.0, 5.0, 7.0, 9.0, 9.0, 9.0]))
    # around the one that costs 5, but for the pose it came from
    second = optimiser.ask()
    np.testing.assert_allclose(np.abs(second - near[1]).sum(axis=1), 0.1)
    assert len(second) == 5
    optimiser.tell(second, np.full(5, 10.0))  # in vain: back to the one that costs 7
    third = optimiser.ask()
    np.testing.assert_allclose(np.abs(third - near[2]).sum(axis=1), 0.1)


def arc(count: int) -> tuple[Array, Array]:
    """Return turns (count,) of three quarters of a circle, and poses (count, 63) on one of radius 1."""
    turns = np.linspace(0.0, 1.5 * np.pi, count)
    axes = np.linalg.qr(np.random.default_rng(0).standard_normal((63, 2)))[0].T
    return turns, np.column_stack([np.cos(turns), np.sin(turns)]) @ axes


def test_latents_are_lengths_along_the_manifold() -> None:  # WANG2003 (Isomap)
    turns, poses = arc(120)
    prior = IsomapPrior(components=1).fit(poses)
    slope, _ = np.polyfit(turns, prior.centres[:, 0], 1)
    assert abs(slope) == pytest.approx(1.0, abs=0.02)  # an arc's length is its turn
    assert abs(np.corrcoef(turns, prior.centres[:, 0])[0, 1]) > 0.9999


# WANG2003 (way back)
def test_the_inverse_is_a_linear_model_of_the_nearest_poses() -> None:
    rng = np.random.default_rng(0)
    centres = rng.uniform(-1.0, 1.0, (400, 2))
    matrix = rng.standard_normal((2, 63))
    shift = rng.standard_normal(63)
    latents = rng.uniform(-0.8, 0.8, (50, 2))
    angles = rebuilt(latents, centres, centres @ matrix + shift)
    # what is linear comes back as it is
    away = np.abs(angles - (latents @ matrix + shift)).max(axis=1)
    assert np.median(away) < 0.02
    np.testing.assert_allclose(
        rebuilt(centres[:5], centres, centres @ matrix), centres[:5] @ matrix, atol=5e-3
    )


# URTASUN2005 (likelihood)
def test_the_loss_is_that_of_a_gaussian_process_with_latents() -> None:
    rng = np.random.default_rng(0)
    x = rng.standard_normal((7, 2))
    y = rng.standard_normal((7, 4))
    logs = np.log([1.5, 0.6, 0.2])
    numbers = np.concatenate([x.ravel(), logs])
    covariance = np.array(
        [[1.5 * np.exp(-0.3 * ((a - b) ** 2).sum()) for a in x] for b in x]
    )
    covariance += (0.2 + 1e-6) * np.eye(7)
    density = multivariate_normal(np.zeros(7), covariance)
    by_hand = (
        -density.logpdf(y.T).sum()
        - 0.5 * 7 * 4 * np.log(2.0 * np.pi)
        + 0.5 * (x**2).sum()
    )
    value, slope = loss(numbers, y)
    assert value == pytest.approx(by_hand)
    np.testing.assert_allclose(
        slope, approx_fprime(numbers, lambda at: loss(at, y)[0], 1e-6), atol=1e-3
    )


def test_each_angle_has_a_separate_scale() -> None:  # URTASUN2005 (scales)
    _, poses = arc(40)
    larger = poses * np.linspace(1.0, 20.0, 63)
    first, second = (
        GPLVM(components=2).fit(part) for part in (10.0 * poses, 10.0 * larger)
    )
    np.testing.assert_allclose(second.scale, first.scale * np.linspace(1.0, 20.0, 63))
    back = second.inverse_transform(second.latents) / np.linspace(1.0, 20.0, 63)
    np.testing.assert_allclose(back, 10.0 * poses, atol=0.2)


def twin(prior: GPLVM) -> GaussianProcessRegressor:
    """Return scikit-learn's Gaussian process with the kernel and the latents that a prior has learned."""
    variance, width, noise = np.exp(prior.logs)
    shape = ConstantKernel(variance, "fixed") * RBF(width**-0.5, "fixed") + WhiteKernel(
        noise + 1e-6, "fixed"
    )
    process = GaussianProcessRegressor(shape, alpha=0.0, optimizer=None)
    return process.fit(prior.latents, (prior.angles - prior.mean) / prior.scale)


def test_a_pose_is_the_mean_of_the_process() -> None:  # URTASUN2005 (mean)
    prior = GPLVM(components=2).fit(arc(40)[1])
    latents = np.random.default_rng(0).uniform(prior.low, prior.high, (20, 2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        expected = prior.mean + prior.scale * twin(prior).predict(latents)
    np.testing.assert_allclose(prior.inverse_transform(latents), expected, atol=1e-6)


# URTASUN2005 (variance)
def test_a_latent_is_feasible_where_the_process_is_certain() -> None:
    prior = GPLVM(components=2).fit(arc(40)[1])
    latents = np.random.default_rng(0).uniform(
        5.0 * prior.low, 5.0 * prior.high, (200, 2)
    )
    near = kernel(latents, prior.latents, prior.logs)
    noisy = kernel(prior.latents, prior.latents, prior.logs) + (
        np.exp(prior.logs[2]) + 1e-6
    ) * np.eye(40)
    variances = np.exp(prior.logs[0]) - np.array(
        [row @ np.linalg.solve(noisy, row) for row in near]
    )
    certain = variances <= MAX_VARIANCE * np.exp(prior.logs[0])
    assert 0 < certain.sum() < 200
    np.testing.assert_array_equal(prior.feasible(latents), certain)


# PEURSUM2010 (backward)
def test_backward_weights_agree_with_a_rauch_tung_striebel_smoother() -> None:
    # x_t = x_{t-1} + N(0, q^2), y_t = x_t + N(0, r^2); states on a grid have the weights of a Kalman filter
    q = 0.1
    r = 0.2
    rng = np.random.default_rng(1)
    truth = np.cumsum(q * rng.standard_normal(8))
    observed = truth + r * rng.standard_normal(8)
    means = [observed[0]]
    variances = [r**2]
    for y in observed[1:]:
        before = variances[-1] + q**2
        gain = before / (before + r**2)
        means.append(means[-1] + gain * (y - means[-1]))
        variances.append((1.0 - gain) * before)
    grid = np.linspace(-2.0, 2.0, 401)[:, None]
    densities = [
        np.exp(-((grid[:, 0] - m) ** 2) / (2.0 * v))
        for m, v in zip(means, variances, strict=True)
    ]
    weights = [density / density.sum() for density in densities]
    after = [
        grid[:, 0] @ weight for weight in smoothed([grid] * 8, weights, np.array([q]))
    ]
    mean = means[-1]
    variance = variances[-1]
    for t in reversed(range(8)):
        if t < 7:
            gain = variances[t] / (variances[t] + q**2)
            mean = means[t] + gain * (mean - means[t])
            variance = variances[t] + gain**2 * (variance - variances[t] - q**2)
        assert after[t] == pytest.approx(mean, abs=1e-3)


def test_a_pose_is_predicted_at_constant_velocity() -> None:  # WACHTER1999 (prediction)
    before = np.zeros(66)
    pose = np.zeros(66)
    # the yaw passes half a turn
    before[0], pose[0], before[5], pose[5] = np.pi - 0.1, -np.pi + 0.1, 0.2, 0.3
    ahead, place = predicted(
        [(before, np.zeros(3)), (pose, np.array([0.0, 0.0, 0.2]))], 0.5
    )
    assert ahead[0] == pytest.approx(-np.pi + 0.2)
    assert ahead[5] == pytest.approx(0.35)
    np.testing.assert_allclose(place, [0.0, 0.0, 0.3])
    alone, _ = predicted([(pose, np.zeros(3))], 1.0)
    np.testing.assert_array_equal(alone, pose)


# AGARWAL2006 (shape context)
def test_shape_contexts_do_not_depend_on_the_position_of_the_mask() -> None:
    mask = np.zeros((60, 80), dtype=bool)
    mask[10:30, 20:28] = True
    shapes = contexts(mask)
    assert shapes.shape == (52, 60)  # a border of 2 (20 + 8) - 4 pixels
    np.testing.assert_allclose(shapes.sum(axis=1), 1.0)
    np.testing.assert_allclose(contexts(np.roll(mask, (15, -9), (0, 1))), shapes)
    assert contexts(np.kron(mask, np.ones((4, 4), dtype=bool))).shape == (POINTS, 60)
    assert not contexts(np.zeros_like(mask)).any()
    # of three pixels side by side the first has one neighbour at a distance of 1 and one of 2, both to the right
    row = np.zeros((3, 5), dtype=bool)
    row[1, 1:4] = True
    assert sorted(contexts(row)[0][contexts(row)[0] > 0.0].tolist()) == [0.5, 0.5]


def test_contexts_vote_for_the_words_near_them() -> None:  # AGARWAL2006 (histogram)
    words = np.eye(3, 60)
    votes = histogram(words[[0, 0, 0, 1]], words)
    np.testing.assert_allclose(votes, [0.75, 0.25, 0.0], atol=1e-2)
    between = histogram((words[:1] + words[1:2]) / 2.0, words)
    assert between[0] == pytest.approx(between[1])
    assert between.sum() == pytest.approx(1.0)


@pytest.fixture(scope="module")
def learned() -> Regression:
    return Regression(scene()[0], samples=40, words=10, ridge=0.1)


# AGARWAL2006 (ridge)
def test_the_regression_is_damped_least_squares_over_the_kernel(
    learned: Regression,
) -> None:
    for known, factors in learned.factors.items():
        gram = learned._kernel(learned.histograms, learned.predictions, known)
        np.testing.assert_allclose(
            gram @ factors + 0.1 * factors, learned.targets, atol=1e-9
        )


# AGARWAL2006 (kernel)
def test_the_kernel_falls_with_silhouette_and_pose(learned: Regression) -> None:
    histograms = learned.histograms[:2]
    predictions = learned.predictions[:2]
    far = 3.0 * ((histograms[0] - histograms[1]) ** 2).sum() / learned.spread
    yaw = 0.3 * ((predictions[0, :2] - predictions[1, :2]) ** 2).mean()
    for known, apart in (
        (0, 0.0),
        (2, yaw),
        (67, yaw + 0.5 * ((predictions[0, 2:] - predictions[1, 2:]) ** 2).mean()),
    ):
        by_hand = np.exp(-far - apart)
        assert learned._kernel(histograms, predictions, known)[0, 1] == pytest.approx(
            by_hand, abs=1e-9
        )


# AGARWAL2006 (prediction)
def test_the_pose_that_joins_a_silhouette_is_predicted(learned: Regression) -> None:
    first = np.zeros(67)
    second = np.full(67, 0.5)
    state, known = learned._predicted([first, second])
    assert known == 67
    np.testing.assert_allclose(state, 0.75)  # half the velocity
    assert learned._predicted([])[1] == 2  # of the first frame the yaw is known
