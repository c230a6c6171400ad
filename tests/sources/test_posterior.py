"""Godsill, Doucet and West 2004: against all ways."""

from collections import Counter

import numpy as np

from posefit_exemplars.markov import Sampling, backward_messages, sample_states
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
            rows = sample_states(one.frames[k:], rows, Sampling(count, power), rng)
            drawn.append(rows)
        costs = ways(tempered(one, power), len(SIZES))
        total = sum(np.exp(-cost) for cost in costs.values())
        came = Counter(zip(*(each.tolist() for each in drawn), strict=True))
        expected = {way: count * np.exp(-cost) / total for way, cost in costs.items()}
        chi = sum((came[way] - each) ** 2 / each for way, each in expected.items())
        # a sum of 287 squares: its mean is 287, its standard deviation the root of 574, 24
        assert abs(chi - (len(costs) - 1)) < 3 * 24
        assert sum(came.values()) == count
