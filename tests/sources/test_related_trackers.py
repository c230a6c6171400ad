"""Trackers of the related work: Peursum 2010, Wachter 1999, Agarwal 2006, against smoothers and by hand."""

import numpy as np
import pytest

from posefit.testing.tracker_rules import scene
from posefit_related.gradient import predicted
from posefit_related.regression import POINTS, Regression, contexts, histogram
from posefit_related.smoothing import smoothed


def test_backward_weights_agree_with_a_rauch_tung_striebel_smoother() -> None:  # PEURSUM2010 (backward)
    # x_t = x_{t-1} + N(0, q^2), y_t = x_t + N(0, r^2); states on a grid have the weights of a Kalman filter
    q, r, rng = 0.1, 0.2, np.random.default_rng(1)
    truth = np.cumsum(q * rng.standard_normal(8))
    observed = truth + r * rng.standard_normal(8)
    means, variances = [observed[0]], [r**2]
    for y in observed[1:]:
        before = variances[-1] + q**2
        gain = before / (before + r**2)
        means.append(means[-1] + gain * (y - means[-1]))
        variances.append((1.0 - gain) * before)
    grid = np.linspace(-2.0, 2.0, 401)[:, None]
    densities = [np.exp(-((grid[:, 0] - m) ** 2) / (2.0 * v)) for m, v in zip(means, variances, strict=True)]
    weights = [density / density.sum() for density in densities]
    after = [grid[:, 0] @ weight for weight in smoothed([grid] * 8, weights, np.array([q]))]
    mean, variance = means[-1], variances[-1]
    for t in reversed(range(8)):
        if t < 7:
            gain = variances[t] / (variances[t] + q**2)
            mean = means[t] + gain * (mean - means[t])
            variance = variances[t] + gain**2 * (variance - variances[t] - q**2)
        assert after[t] == pytest.approx(mean, abs=1e-3)


def test_a_pose_is_predicted_at_constant_velocity() -> None:  # WACHTER1999 (prediction)
    before, pose = np.zeros(66), np.zeros(66)
    before[0], pose[0], before[5], pose[5] = np.pi - 0.1, -np.pi + 0.1, 0.2, 0.3  # the yaw passes half a turn
    ahead, place = predicted([(before, np.zeros(3)), (pose, np.array([0.0, 0.0, 0.2]))], 0.5)
    assert ahead[0] == pytest.approx(-np.pi + 0.2)
    assert ahead[5] == pytest.approx(0.35)
    np.testing.assert_allclose(place, [0.0, 0.0, 0.3])
    alone, _ = predicted([(pose, np.zeros(3))], 1.0)
    np.testing.assert_array_equal(alone, pose)


def test_contexts_say_where_the_other_points_are_wherever_the_mask_is() -> None:  # AGARWAL2006 (shape context)
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


def test_the_regression_is_damped_least_squares_over_the_kernel(learned: Regression) -> None:  # AGARWAL2006 (ridge)
    for known, factors in learned.factors.items():
        gram = learned._kernel(learned.histograms, learned.predictions, known)
        np.testing.assert_allclose(gram @ factors + 0.1 * factors, learned.targets, atol=1e-9)


def test_the_kernel_falls_with_silhouette_and_pose(learned: Regression) -> None:  # AGARWAL2006 (kernel)
    histograms, predictions = learned.histograms[:2], learned.predictions[:2]
    far = 3.0 * ((histograms[0] - histograms[1]) ** 2).sum() / learned.spread
    yaw = 0.3 * ((predictions[0, :2] - predictions[1, :2]) ** 2).mean()
    for known, apart in ((0, 0.0), (2, yaw), (67, yaw + 0.5 * ((predictions[0, 2:] - predictions[1, 2:]) ** 2).mean())):
        by_hand = np.exp(-far - apart)
        assert learned._kernel(histograms, predictions, known)[0, 1] == pytest.approx(by_hand, abs=1e-9)


def test_the_pose_that_joins_a_silhouette_is_predicted(learned: Regression) -> None:  # AGARWAL2006 (prediction)
    first, second = np.zeros(67), np.full(67, 0.5)
    state, known = learned._predicted([first, second])
    assert known == 67
    np.testing.assert_allclose(state, 0.75)  # half the velocity
    assert learned._predicted([])[1] == 2  # of the first frame the yaw is known
