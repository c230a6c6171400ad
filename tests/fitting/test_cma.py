"""CMA-ES: our strategy and the library cmaes agree on the same proposals; `cma` at the sides of its box, round a circle."""

import numpy as np
import pytest
from cmaes import CMA

from posefit.errors import InputError
from posefit.fitting.cma import CMAES, Strategy
from posefit.plugin import Array, Start, displacement
from posefit.testing.toy import Toy, shell, slope
from tests.cases import each


@each("ties", [False, True])
@each("sizes", [(1, 5), (2, 6), (2, 7), (9, 10), (9, 40), (28, 13), (28, 40)])
def test_both_searches_learn_the_same_to_the_end(
    ties: bool, sizes: tuple[int, int]
) -> None:
    d, population = sizes
    rng = np.random.default_rng(d)
    mean = rng.normal(0.0, 0.1, d)
    spread = rng.uniform(0.05, 0.5, d)
    valley = rng.normal(size=(d, d))
    size = float(np.sqrt((spread**2).mean()))
    ours = Strategy(mean, spread, population)
    theirs = CMA(
        mean.copy(), size, population_size=population, cov=np.diag((spread / size) ** 2)
    )
    for _ in range(250):
        proposals = ours.sample(rng, population)
        costs = ((proposals @ valley) ** 2).sum(axis=1)
        costs = np.round(2.0 * costs) / 2.0 if ties else costs
        ours.learn(proposals, costs)
        theirs.tell(list(zip(proposals, costs.tolist(), strict=True)))
        mine = ours.mean, ours.covariance, ours.step_path, ours.path, ours.sigma
        other = theirs._mean, theirs._C, theirs._p_sigma, theirs._pc, theirs._sigma
        for one, same in zip(mine, other, strict=True):
            np.testing.assert_allclose(
                one, same, rtol=1e-9, atol=1e-9 * np.abs(same).max()
            )
        assert ours.ended() == theirs.should_stop()
        if ours.ended():
            return
    assert d > 2


def test_points_outside_the_box_are_redrawn_before_they_are_moved_to_its_side() -> None:
    # a tenth of a standard deviation from the side 46.02 % of all draws are beyond it: 54 % of enough are not
    space = Toy(
        2, start=Start(np.array([0.99, 0.0]), np.array([0.1, 0.01]), np.zeros(2))
    )
    optimiser = CMAES(space, np.random.default_rng(0), population_size=4000)
    for _ in range(2):
        asked = optimiser.ask()
        assert space.feasible(asked).all()
        assert (asked[:, 0] < 1.0).all()
        optimiser.tell(asked, np.zeros(len(asked)))


@each("wrapping", [1, 2])
def test_a_target_at_the_seam_of_a_circle_is_found(wrapping: int) -> None:
    space = Toy(5, wrapping=wrapping)
    target = np.where(space.periodic, 0.98, 0.3)

    def away(proposals: Array) -> Array:
        return np.asarray((displacement(space, target, proposals) ** 2).sum(axis=1))

    optimiser = CMAES(space, np.random.default_rng(0))
    for _ in range(100):
        proposals = optimiser.ask()
        assert space.feasible(proposals).all()
        optimiser.tell(proposals, away(proposals))
    assert away(proposals).max() < 1e-6


def test_settings_out_of_range_are_refused_by_name() -> None:
    for wrong in ({"population_size": 4}, {"spread": 0.0}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            CMAES(Toy(2), np.random.default_rng(0), **wrong)


def test_a_spread_of_nothing_is_refused() -> None:
    for spread in (np.zeros(4), np.full(4, np.nan), np.array([0.1, -0.1, 0.1, 0.1])):
        space = Toy(4, start=Start(np.zeros(4), spread, np.zeros(4)))
        with pytest.raises(
            InputError,
            match="spread must be 0 or more in each coordinate, and above 0 in one, got",
        ):
            CMAES(space, np.random.default_rng(0))
    narrow = Toy(
        4, start=Start(np.zeros(4), np.array([0.1, 0.0, 0.1, 0.1]), np.zeros(4))
    )
    assert np.abs(CMAES(narrow, np.random.default_rng(0)).ask()[:, 1]).max() < 1e-5


def test_infeasible_points_are_moved_towards_the_best_of_the_last_generation() -> None:
    optimiser = CMAES(Toy(3, shell), np.random.default_rng(0), population_size=10)
    for seed in range(3):
        proposals = optimiser.ask()
        costs = np.random.default_rng(seed).random(10)
        optimiser.tell(proposals, costs)
        np.testing.assert_array_equal(optimiser.home, proposals[costs.argmin()])


def test_an_eigenvalue_that_rounding_makes_negative_becomes_a_small_one() -> None:
    strategy = Strategy(np.zeros(3), np.ones(3), 7)
    strategy.covariance = np.diag([1.0, 1.0, -1e-17])
    strategy.decompose()
    np.testing.assert_allclose(
        strategy.covariance, np.diag([1.0, 1.0, 1e-8]), atol=1e-15
    )


@each("dimensions", [1, 4, 9])
def test_a_best_in_a_corner_or_beyond_the_box_is_reached(dimensions: int) -> None:
    # every face of the box is reached, and the step size falls there as it does inside
    def beyond(proposals: Array) -> Array:
        return np.asarray(((proposals - 1.5) ** 2).mean(axis=1) - 0.25)

    for cost in (slope, beyond):
        gaps = []
        for seed in range(3):
            optimiser = CMAES(Toy(dimensions), np.random.default_rng(seed))
            lowest = np.inf
            for _ in range(500):
                proposals = optimiser.ask()
                costs = cost(proposals)
                lowest = min(lowest, float(costs.min()))
                optimiser.tell(proposals, costs)
            gaps.append(lowest)
        assert max(gaps) < 1e-3, (cost, gaps)


def test_points_drawn_outside_the_box_are_learned_where_they_were_drawn() -> None:
    # in a corner of nine sides one draw of 2^9 is inside: nearly all of these are moved
    start = Start(np.full(9, 1.0), np.full(9, 0.1), np.zeros(9))
    optimiser = CMAES(Toy(9, start=start), np.random.default_rng(0), population_size=40)
    asked = optimiser.ask()
    assert (np.abs(asked) <= 1.0).all()
    beyond = np.linalg.norm(optimiser.learned - asked, axis=1)
    np.testing.assert_allclose(beyond, optimiser.beyond)
    assert np.count_nonzero(beyond) > 30
    np.testing.assert_array_equal(np.minimum(optimiser.learned, 1.0), asked)
    # whatever they cost, those inside count as the best ones: the mean moves inwards
    optimiser.tell(asked, -asked.sum(axis=1))
    assert (optimiser.strategy.mean < 1.0).all()
