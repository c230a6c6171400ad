"""Priors of the related work: Wang 2003 on a known manifold, Urtasun 2005 against scikit-learn's Gaussian process."""

import warnings

import numpy as np
import pytest
from scipy.optimize import approx_fprime
from scipy.stats import multivariate_normal
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from posefit.arrays import Array
from posefit_related.gplvm import GPLVM, MAX_VARIANCE, kernel, loss
from posefit_related.isomap import IsomapPrior, rebuilt


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


def test_the_way_back_is_a_linear_model_of_the_nearest_poses() -> None:  # WANG2003 (way back)
    rng = np.random.default_rng(0)
    centres = rng.uniform(-1.0, 1.0, (400, 2))
    matrix, shift = rng.standard_normal((2, 63)), rng.standard_normal(63)
    latents = rng.uniform(-0.8, 0.8, (50, 2))
    angles = rebuilt(latents, centres, centres @ matrix + shift)
    away = np.abs(angles - (latents @ matrix + shift)).max(axis=1)  # what is linear comes back as it is
    assert np.median(away) < 0.02
    np.testing.assert_allclose(rebuilt(centres[:5], centres, centres @ matrix), centres[:5] @ matrix, atol=5e-3)


def test_the_loss_is_that_of_a_gaussian_process_with_latents() -> None:  # URTASUN2005 (likelihood)
    rng = np.random.default_rng(0)
    x, y, logs = rng.standard_normal((7, 2)), rng.standard_normal((7, 4)), np.log([1.5, 0.6, 0.2])
    numbers = np.concatenate([x.ravel(), logs])
    covariance = np.array([[1.5 * np.exp(-0.3 * ((a - b) ** 2).sum()) for a in x] for b in x])
    covariance += (0.2 + 1e-6) * np.eye(7)
    density = multivariate_normal(np.zeros(7), covariance)
    by_hand = -density.logpdf(y.T).sum() - 0.5 * 7 * 4 * np.log(2.0 * np.pi) + 0.5 * (x**2).sum()
    value, slope = loss(numbers, y)
    assert value == pytest.approx(by_hand)
    np.testing.assert_allclose(slope, approx_fprime(numbers, lambda at: loss(at, y)[0], 1e-6), atol=1e-3)


def test_each_angle_has_a_scale_of_its_own() -> None:  # URTASUN2005 (scales)
    _, poses = arc(40)
    larger = poses * np.linspace(1.0, 20.0, 63)
    first, second = (GPLVM(components=2).fit(part) for part in (10.0 * poses, 10.0 * larger))
    np.testing.assert_allclose(second.scale, first.scale * np.linspace(1.0, 20.0, 63))
    back = second.inverse_transform(second.latents) / np.linspace(1.0, 20.0, 63)
    np.testing.assert_allclose(back, 10.0 * poses, atol=0.2)


def twin(prior: GPLVM) -> GaussianProcessRegressor:
    """Return scikit-learn's Gaussian process with the kernel and the latents that a prior has learned."""
    variance, width, noise = np.exp(prior.logs)
    shape = ConstantKernel(variance, "fixed") * RBF(width**-0.5, "fixed") + WhiteKernel(noise + 1e-6, "fixed")
    process = GaussianProcessRegressor(shape, alpha=0.0, optimizer=None)
    return process.fit(prior.latents, (prior.angles - prior.mean) / prior.scale)


def test_a_pose_is_the_mean_of_the_process() -> None:  # URTASUN2005 (mean)
    prior = GPLVM(components=2).fit(arc(40)[1])
    latents = np.random.default_rng(0).uniform(prior.low, prior.high, (20, 2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        expected = prior.mean + prior.scale * twin(prior).predict(latents)
    np.testing.assert_allclose(prior.inverse_transform(latents), expected, atol=1e-6)


def test_a_latent_is_feasible_where_the_process_is_certain() -> None:  # URTASUN2005 (variance)
    prior = GPLVM(components=2).fit(arc(40)[1])
    latents = np.random.default_rng(0).uniform(5.0 * prior.low, 5.0 * prior.high, (200, 2))
    near = kernel(latents, prior.latents, prior.logs)
    noisy = kernel(prior.latents, prior.latents, prior.logs) + (np.exp(prior.logs[2]) + 1e-6) * np.eye(40)
    variances = np.exp(prior.logs[0]) - np.array([row @ np.linalg.solve(noisy, row) for row in near])
    certain = variances <= MAX_VARIANCE * np.exp(prior.logs[0])
    assert 0 < certain.sum() < 200
    np.testing.assert_array_equal(prior.feasible(latents), certain)
