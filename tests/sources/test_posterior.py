"""Godsill, Doucet and West 2004, Dunn, Wasserman and Ramdas 2023, Guo et al. 2017: against all ways, and by hand."""

from collections import Counter

import numpy as np
import pytest

from posefit.uncertainty.calibration import calibration_error, conformal_factor
from posefit_exemplars.window import backward_messages, sample_states
from tests.sources.test_exemplars_steps import SIZES, Model, model, ways

POWERS = (1.0, 0.4)


def tempered(one: Model, power: float) -> Model:
    """Return a model whose silhouettes cost so much less."""
    return one._replace(fits=[power * fit for fit in one.fits])


def test_a_message_is_the_share_of_all_ways_on_from_a_state() -> None:  # GODSILL2004 (messages)
    for power in POWERS:
        one = model(0)
        found = backward_messages(one.frames[1:], power)
        expected = np.zeros(SIZES[1])
        for way, cost in ways(tempered(one, power), len(SIZES)).items():
            first = power * one.fits[0][way[0]] + one.steps[0][way[0], way[1]] + power * one.fits[1][way[1]]
            expected[way[1]] += np.exp(first - cost)  # what comes after; each of the ways before it counts once
        np.testing.assert_allclose(found / found.sum(), expected / expected.sum(), rtol=1e-5)


def test_ways_are_drawn_as_often_as_they_are_likely() -> None:  # GODSILL2004 (step)
    for power in POWERS:
        one, count, rng = model(1), 40_000, np.random.default_rng(0)
        rows, drawn = None, []
        for k in range(len(SIZES)):
            rows = sample_states(one.frames[k:], rows, count, power, rng)
            drawn.append(rows)
        costs = ways(tempered(one, power), len(SIZES))
        total = sum(np.exp(-cost) for cost in costs.values())
        came = Counter(zip(*(each.tolist() for each in drawn), strict=True))
        expected = {way: count * np.exp(-cost) / total for way, cost in costs.items()}
        chi = sum((came[way] - each) ** 2 / each for way, each in expected.items())
        # a sum of 287 squares: its mean is 287, its standard deviation the root of 574, 24
        assert abs(chi - (len(costs) - 1)) < 3 * 24
        assert sum(came.values()) == count


def test_a_way_begins_anew_where_nothing_came_before() -> None:
    one, rng = model(2), np.random.default_rng(0)
    first = sample_states(one.frames[:1], None, 50_000, 1.0, rng)
    np.testing.assert_allclose(np.bincount(first) / 50_000, one.frames[0].forward, atol=0.01)


def test_clips_count_alike_and_the_one_to_come_as_infinitely_far() -> None:  # DUNN2023 (pooled CDF)
    # three clips: 1, 2 | 3 | 4. Each weighs a quarter, shared by its scores; the last quarter is the new clip's
    scores = [np.array([2.0, 1.0]), np.array([3.0]), np.array([4.0])]
    assert conformal_factor(scores, 0.125) == 1.0
    assert conformal_factor(scores, 0.2) == 2.0
    assert conformal_factor(scores, 0.5) == 3.0
    assert conformal_factor(scores, 0.6) == 4.0  # of the three that are known alone 3 would be enough
    assert conformal_factor(scores, 0.75) == 4.0
    with pytest.raises(ValueError, match=r"clips must be at least 4 for a level of 0\.8, got 3"):
        conformal_factor(scores, 0.8)


def test_conformal_factors_hold_for_clips_that_were_not_there() -> None:
    # errors of a clip go together: a factor of its own times a normal one. 19 clips to learn from, one to come
    rng, inside = np.random.default_rng(0), []
    for _ in range(400):
        clips = [np.exp(0.5 * rng.normal()) * np.abs(rng.normal(size=30)) for _ in range(20)]
        inside.append((clips[-1] <= conformal_factor(clips[:-1], 0.8)).mean())
    assert 0.78 <= np.mean(inside) <= 0.85  # at least the level, at most a twentieth above it


def test_the_calibration_error_is_the_mean_gap_of_the_bins() -> None:  # GUO2017 (3)
    # bins of 0.5: (0.2, 0.4) are right once of two, off by 0.2; (0.9, 0.7, 1.0) always, off by 2.6 / 3 - 1
    probabilities = np.array([0.2, 0.4, 0.9, 0.7, 1.0])
    right = np.array([True, False, True, True, True])
    assert calibration_error(probabilities, right, bins=2) == pytest.approx((2 * 0.2 + 3 * (1 - 2.6 / 3)) / 5)
    assert calibration_error(np.array([0.0, 1.0]), np.array([False, True])) == 0.0
