"""Race-v0: a step is one generation of the chosen search, and its policies choose what they should."""

import copy
import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import error

import posefit_envs  # noqa: F401, registers it
from posefit_envs.policies import (
    bandit_policy,
    halving_policy,
    linear_policy,
    race_action,
    race_features,
    restarted_policy,
    rollout,
    round_robin_policy,
)
from tests.cases import each

NAME = "posefit/Race-v0"
LOG_101 = math.log(101.0)


def made(**arguments: Any) -> Any:
    return gym.make(NAME, **{"instance": 3, "searches": 4, "generations": (20, 20), **arguments}).unwrapped


def observation_of(costs: Any, slopes: Any, used: Any, left: float) -> Any:
    """Return an observation of searches with these costs, slopes and shares of the budget used."""
    return np.array([*costs, *slopes, *np.full(len(costs), 0.5), *used, min(costs), left, 1.0], dtype=np.float32)


def choice(policy: Any, observation: Any, step: int = 0) -> int:
    return int(policy(observation, step).argmax())


def test_a_step_is_one_generation_of_the_chosen_search() -> None:
    env = made()
    before, info = env.reset(seed=0)
    assert info["evaluations"] == 4 * 8
    np.testing.assert_allclose(race_features(before)[0][:, 3], 1.0 / 20.0)  # the first generation of each
    observation, _, _, _, info = env.step(race_action(2, 4))
    assert info["evaluations"] == 5 * 8
    old, new = race_features(before)[0], race_features(observation)[0]
    np.testing.assert_array_equal(old[[0, 1, 3]], new[[0, 1, 3]])
    assert new[2, 3] == pytest.approx(2.0 / 20.0)
    assert race_features(observation)[1][1] == pytest.approx(19.0 / 20.0)


def test_of_equal_numbers_the_first_is_the_choice() -> None:
    env, other = made(), made()
    env.reset(seed=0)
    other.reset(seed=0)
    np.testing.assert_array_equal(env.step(np.zeros(5))[0], other.step(race_action(0, 4))[0])


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
    env._vector._costs[0, :] = 90.0
    _, _, _, _, later = env.step(race_action(2, 2))
    assert later["best_cost"] <= info["best_cost"]


@each(("optimiser", "population_size"), [("pso", 8), ("sapso", 5), ("cma", 8), ("random", 4), ("scipy", 6)])
def test_a_search_is_its_optimiser_by_ask_and_tell(optimiser: str, population_size: int) -> None:
    env = made(optimiser=optimiser, population_size=population_size, generations=(6, 6), translation="searched")
    env.reset(seed=4)
    expected = copy.deepcopy(env._vector._searches[0][1])
    problem, best = env._vector.episodes[0].problem, env._vector._costs[0, 1]
    for _ in range(6):
        asked = expected.ask()
        assert asked.shape == (population_size, problem.space.dimensions)
        costs = problem.evaluate(asked)
        expected.tell(asked, costs)
        best = min(best, costs.min())
        observation, _, _, _, info = env.step(race_action(1, 4))
        assert race_features(observation)[0][1, 0] == pytest.approx(math.log1p(best) / LOG_101)
    assert info["evaluations"] == population_size * (4 + 6)


def test_an_optimiser_with_populations_of_its_own_is_named() -> None:
    with pytest.raises(error.Error, match="optimiser must propose 8 poses at a time, got .* of 'annealed'"):
        made(optimiser="annealed").reset(seed=0)


def test_the_bests_of_all_particles_are_feasible_and_the_best_is_what_it_costs() -> None:
    env = made(generations=(60, 60))
    env.reset(seed=1)
    env.action_space.seed(1)
    total, first = 0.0, env._vector._best[0]
    for _ in range(60):
        _, reward, ended, _, info = env.step(env.action_space.sample())
        total += reward
        assert env.problem.space.feasible(env._vector._bests.reshape(-1, 9)).all()
    assert ended
    problem = env._vector.episodes[0].problem
    assert info["best_cost"] == problem.evaluate(info["proposal"][None])[0]
    assert info["evaluations"] == 8 * (4 + 60)
    assert total == pytest.approx(math.log((1.0 + first) / (1.0 + info["best_cost"])))
    pose, truth = problem.decode(info["proposal"][None])[0][0], env.instance.truth.poses[0]
    wrapped = (truth - pose + np.pi) % (2.0 * np.pi) - np.pi
    assert info["error_degrees"] == pytest.approx(np.degrees(np.abs(wrapped)).mean())


def test_costs_slopes_and_spreads_are_observed_on_their_scales() -> None:
    env = made()
    env.reset(seed=2)
    slope, cost = 0.1, env._vector._costs[0, 3]
    for _ in range(5):
        observation, _, _, _, _ = env.step(race_action(3, 4))
        new = env._vector._best_costs[0, 3].min()
        slope, cost = 0.8 * slope + 0.2 * math.log((1.0 + cost) / (1.0 + new)), new
        features, common = race_features(observation)
        spread = env._vector._bests[0, 3].std(axis=0).mean()
        # the logarithm of 0.001 to 1 is three powers of ten
        expected = [math.log1p(cost) / LOG_101, min(slope / 0.1, 1.0), 1.0 + math.log10(spread) / 3.0]
        np.testing.assert_allclose(features[3, :3], expected, rtol=1e-6)
        assert common[0] == pytest.approx(math.log1p(env._vector._best[0]) / LOG_101)


def test_the_budget_is_drawn_from_the_generations_and_ends_the_episode() -> None:
    env = made(generations=(3, 5))
    lengths = set()
    for seed in range(20):
        observation, _ = env.reset(seed=seed)
        budget, steps, ended = round(5.0 * race_features(observation)[1][2]), 0, False
        while not ended:
            observation, _, ended, cut, _ = env.step(race_action(steps % 4, 4))
            steps += 1
            assert not cut
        assert steps == budget
        assert race_features(observation)[1][1] == 0.0
        lengths.add(steps)
    assert lengths == {3, 4, 5}


def test_a_seed_is_an_episode_whatever_was_before() -> None:
    first, second = made(instance=None), made(instance=None)
    rollout(second, restarted_policy(1.0), 5, seed=9)  # which begins many searches
    assert (
        rollout(first, restarted_policy(0.5), 7, seed=3)["best_cost"]
        == (rollout(second, restarted_policy(0.5), 7, seed=3)["best_cost"])
    )


def test_searches_take_turns() -> None:
    observation = observation_of([0.5, 0.4, 0.3], [1.0] * 3, [0.1] * 3, 1.0)
    assert [choice(round_robin_policy(), observation, step) for step in range(5)] == [0, 1, 2, 0, 1]


def test_halving_lets_the_better_half_go_on_and_these_take_turns() -> None:
    costs, slopes = [0.5, 0.4, 0.3, 0.2], [1.0] * 4
    # three parts of the budget for four, two and one of four searches; the least used of those has its turn
    for left, used, expected in (
        (1.0, [0.0, 0.1, 0.1, 0.1], 0),
        (0.7, [0.1, 0.1, 0.0, 0.1], 2),
        (0.65, [0.0, 0.0, 0.2, 0.1], 3),
        (0.4, [0.0, 0.0, 0.1, 0.2], 2),
        (0.3, [0.0, 0.0, 0.0, 0.9], 3),
        (0.0, [0.0, 0.0, 0.0, 0.9], 3),
    ):
        assert choice(halving_policy(), observation_of(costs, slopes, used, left)) == expected, left


def test_one_search_goes_on_until_it_is_stuck_and_then_another() -> None:
    policy, costs = restarted_policy(0.1), [0.5, 0.4, 0.3]
    for slopes, used, expected in (
        ([0.2, 1.0, 1.0], [0.3, 0.1, 0.1], 0),
        ([0.05, 1.0, 1.0], [0.3, 0.1, 0.1], 1),
        ([0.05, 0.4, 1.0], [0.3, 0.2, 0.1], 1),
        ([0.05, 0.05, 0.05], [0.3, 0.2, 0.2], 3),
    ):
        assert choice(policy, observation_of(costs, slopes, used, 0.5)) == expected, slopes


def test_a_bandit_tries_the_cheapest_unless_another_had_few_generations() -> None:
    costs, slopes = [0.5, 0.45, 0.6], [1.0] * 3
    assert choice(bandit_policy(0.0), observation_of(costs, slopes, [0.9, 0.9, 0.05], 0.5), 30) == 1
    assert choice(bandit_policy(0.4), observation_of(costs, slopes, [0.2, 0.2, 0.2], 0.5), 30) == 1
    # 33 generations: shares of them 0.45, 0.5 and 0.05 are 14.85, 16.5 and 1.65 generations, and ln 33 = 3.497; the
    # index of search 1 is 0.45 - 0.1 * sqrt(3.497 / 16.5) = 0.404, of search 2 0.6 - 0.1 * sqrt(3.497 / 1.65) = 0.454
    used = [0.225, 0.25, 0.025]
    assert choice(bandit_policy(0.1), observation_of(costs, slopes, used, 0.5), 30) == 1
    # and at 0.2 they are 0.358 and 0.309
    assert choice(bandit_policy(0.2), observation_of(costs, slopes, used, 0.5), 30) == 2


def test_a_linear_policy_takes_the_highest_score() -> None:
    observation = observation_of([0.5, 0.4, 0.6], [0.1, 0.2, 0.9], [0.1, 0.2, 0.3], 0.5)
    for weights, expected in (
        ([-1.0, 0, 0, 0, 0, 0, 0, 0, -1.0], 1),  # costs above the best are 0.1, 0 and 0.2
        ([0, 1.0, 0, 0, 0, 0, 0, 0, 0.8], 2),  # slopes
        ([0, 1.0, 0, 0, 0, 0, 0, 0, 0.95], 3),
        ([0, 0, 0, -1.0, 0, 0, 0, 0, -1.0], 0),  # use
        ([0, 0, 0, 0, 0, 1.0, 0, 0, 0.5], 3),  # slopes, of which half the budget left makes 0.45 at most
    ):
        assert choice(linear_policy(weights), observation) == expected, weights
    both = linear_policy(np.array([[-1.0, *[0.0] * 7, -1.0], [0.0, 1.0, *[0.0] * 7]]))
    assert both(np.stack([observation, observation]), 0).argmax(axis=1).tolist() == [1, 2]


def test_policies_take_the_observations_of_a_vector() -> None:
    vector = gym.make_vec(NAME, num_envs=3, generations=(20, 20))
    observations, _ = vector.reset(seed=0)
    for policy in (
        round_robin_policy(),
        halving_policy(),
        restarted_policy(),
        bandit_policy(),
        linear_policy(np.ones(9)),
    ):
        actions = policy(observations, 1)
        np.testing.assert_array_equal(actions, [policy(observation, 1) for observation in observations])
        assert actions.shape == (3, 9)
