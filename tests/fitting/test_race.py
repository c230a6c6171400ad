"""A race of starts: within its budget, all that are likely take part, and the best are searched longer."""

import numpy as np
import pytest

from posefit import Problem
from posefit.arrays import Array
from posefit.fitting.box import Start
from posefit.fitting.contours import RACE_ROUNDS, STEP_EVALUATIONS, race_count
from posefit.fitting.race import FINALISTS, MIN_SHORT, MIN_WEIGHT, cheapest, race
from posefit.testing.toy import Toy

PLACES = (0.9, 0.1, -0.4, -0.9)


def valley(proposals: Array) -> Array:
    """Cost nothing at 0, and more the farther away."""
    return np.asarray((proposals**2).sum(axis=1))


def starts(weights: tuple[float, ...]) -> list[Start]:
    spread = np.full(2, 0.05)
    return [
        Start(np.full(2, place), spread, np.zeros(2), weight)
        for place, weight in zip(PLACES, weights, strict=True)
    ]


def search(start: Start, evaluations: int) -> Problem:
    problem = Problem(valley, Toy(2), evaluations)
    rng = np.random.default_rng(0)
    problem(np.clip(rng.normal(start.mean, start.spread, (evaluations, 2)), -1.0, 1.0))
    return problem


@pytest.mark.parametrize("budget", [MIN_SHORT, 3 * MIN_SHORT, 400, 1237])
def test_all_searches_together_have_the_budget(budget: int) -> None:
    searches = race(starts((1.0, 0.9, 0.8, 0.7)), search, budget)
    used = sum(problem.evaluations for problems in searches for problem in problems)
    assert used == budget


def test_the_best_starts_are_searched_longer_whatever_their_weight() -> None:
    searches = race(starts((1.0, 0.2, 0.2, 0.2)), search, 2000)
    assert len(searches) == len(PLACES)
    assert [len(problems) for problems in searches] == [2] * FINALISTS + [1, 1]
    costs = [cheapest(problems).best_cost for problems in searches]
    assert costs == sorted(costs)
    # the start at 0.1 is the nearest to the valley
    assert np.abs(cheapest(searches[0]).best).max() < 0.1


def test_unlikely_modes_are_not_searched() -> None:
    searches = race(starts((1.0, 0.9 * MIN_WEIGHT, 0.0, 0.0)), search, 1000)
    assert len(searches) == 1
    assert searches[0][0].evaluations == 1000


@pytest.mark.parametrize("evaluations", [0, 351, 352, 1000, 7808])
def test_as_many_poses_race_as_the_evaluations_hold(evaluations: int) -> None:
    def needed(count: int) -> float:
        total = float(count)  # what they cost at the end
        for scales, share in RACE_ROUNDS:
            fitted = max(int(share * count), 1)
            total += fitted * len(scales) * STEP_EVALUATIONS
            if fitted < count:
                total += count
        return total

    count = race_count(evaluations)
    assert needed(count + 1) > evaluations
    assert count == 0 or needed(count) <= evaluations
