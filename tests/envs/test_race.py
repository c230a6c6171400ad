"""Race-v1: a step is one generation of the chosen search, and its policies choose what they should."""

import copy
import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import error

import posefit_envs  # noqa: F401, registers it
from posefit_envs.policies import race_action, race_features
from tests.cases import each

LOG_101 = math.log(101.0)


def made(**arguments: Any) -> Any:
    usual = {"instance": 3, "searches": 4, "generations": (20, 20)}
    return gym.make("posefit/Race-v1", **{**usual, **arguments}).unwrapped


def test_a_step_is_one_generation_of_the_chosen_search() -> None:
    env = made()
    before, info = env.reset(seed=0)
    assert info["evaluations"] == 4 * 8
    # the first generation of each
    np.testing.assert_allclose(race_features(before)[0][:, 3], 1.0 / 20.0)
    observation, _, _, _, info = env.step(race_action(2, 4))
    assert info["evaluations"] == 5 * 8
    old = race_features(before)[0]
    new = race_features(observation)[0]
    np.testing.assert_array_equal(old[[0, 1, 3]], new[[0, 1, 3]])
    assert new[2, 3] == pytest.approx(2.0 / 20.0)
    assert race_features(observation)[1][1] == pytest.approx(19.0 / 20.0)


def test_another_search_begins_in_the_place_of_the_worst_and_the_best_is_kept() -> None:
    env = made(searches=2)
    observation, _ = env.reset(seed=0)
    for _ in range(3):
        before, _ = race_features(observation)
        worst = int(before[:, 0].argmax())
        observation, _, _, _, info = env.step(race_action(2, 2))
        after, common = race_features(observation)
        np.testing.assert_array_equal(before[1 - worst], after[1 - worst])
        assert after[worst, 1] == 1.0
        assert after[worst, 3] == pytest.approx(1.0 / 20.0)
        assert common[0] <= before[:, 0].min()
    # the best of all outlives its search: both others are replaced until none is as good
    env.races.costs[0, :] = 90.0
    _, _, _, _, later = env.step(race_action(2, 2))
    assert later["best_cost"] <= info["best_cost"]


@each(
    ("optimiser", "population_size"),
    [("pso", 8), ("sapso", 5), ("cma", 8), ("random", 4), ("scipy", 6)],
)
def test_a_search_is_its_optimiser_by_ask_and_tell(
    optimiser: str, population_size: int
) -> None:
    env = made(
        optimiser=optimiser,
        population_size=population_size,
        generations=(6, 6),
        translation="searched",
    )
    env.reset(seed=4)
    expected = copy.deepcopy(env.races._optimisers[0][1])
    problem = env.problem
    best = env.races.costs[0, 1]
    for _ in range(6):
        asked = expected.ask()
        assert asked.shape == (population_size, problem.space.dimensions)
        costs = problem(asked)
        expected.tell(asked, costs)
        best = min(best, costs.min())
        observation, _, _, _, info = env.step(race_action(1, 4))
        assert race_features(observation)[0][1, 0] == pytest.approx(
            math.log1p(best) / LOG_101
        )
    assert info["evaluations"] == population_size * (4 + 6)


def test_an_optimiser_with_another_population_size_is_named() -> None:
    with pytest.raises(
        error.Error,
        match="optimiser must propose 8 poses at a time, got .* of 'annealed'",
    ):
        made(optimiser="annealed").reset(seed=0)


def test_personal_bests_are_feasible_and_have_their_costs() -> None:
    env = made(generations=(60, 60))
    env.reset(seed=1)
    env.action_space.seed(1)
    total = 0.0
    first = env.races.problems.best_costs[0]
    for _ in range(60):
        _, reward, ended, _, info = env.step(env.action_space.sample())
        total += reward
        assert env.problem.space.feasible(env.races.bests.reshape(-1, 9)).all()
    assert ended
    problem = env.problem
    assert info["best_cost"] == problem(info["proposal"][None])[0]
    assert info["evaluations"] == 8 * (4 + 60)
    assert total == pytest.approx(math.log((1.0 + first) / (1.0 + info["best_cost"])))
    pose = problem.decode(info["proposal"][None])[0][0]
    truth = env.instance.truth.poses[0]
    wrapped = (truth - pose + np.pi) % (2.0 * np.pi) - np.pi
    assert info["error_degrees"] == pytest.approx(np.degrees(np.abs(wrapped)).mean())


def test_costs_slopes_and_spreads_are_observed_on_their_scales() -> None:
    env = made()
    env.reset(seed=2)
    slope = 0.1
    cost = env.races.costs[0, 3]
    for _ in range(5):
        observation, _, _, _, _ = env.step(race_action(3, 4))
        new = env.races.best_costs[0, 3].min()
        slope = 0.8 * slope + 0.2 * math.log((1.0 + cost) / (1.0 + new))
        cost = new
        features, common = race_features(observation)
        spread = env.races.bests[0, 3].std(axis=0).mean()
        # the logarithm of 0.001 to 1 is three powers of ten
        expected = [
            math.log1p(cost) / LOG_101,
            min(slope / 0.1, 1.0),
            1.0 + math.log10(spread) / 3.0,
        ]
        np.testing.assert_allclose(features[3, :3], expected, rtol=1e-6)
        assert common[0] == pytest.approx(
            math.log1p(env.races.problems.best_costs[0]) / LOG_101
        )


def test_the_budget_is_drawn_from_the_generations_and_ends_the_episode() -> None:
    env = made(generations=(3, 5))
    lengths = set()
    for seed in range(20):
        observation, _ = env.reset(seed=seed)
        budget = round(5.0 * race_features(observation)[1][2])
        steps = 0
        ended = False
        while not ended:
            observation, _, ended, cut, _ = env.step(race_action(steps % 4, 4))
            steps += 1
            assert not cut
        assert steps == budget
        assert race_features(observation)[1][1] == 0.0
        lengths.add(steps)
    assert lengths == {3, 4, 5}
