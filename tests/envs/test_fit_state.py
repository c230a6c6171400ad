"""FitState-v0 shows proposals and their costs."""

import gymnasium as gym
import numpy as np
import pytest

import posefit_envs  # noqa: F401, registers it
from posefit_envs.fit import ProposalMemory
from posefit_envs.policies import gaussian_policy, random_search_policy, rollout, uniform_policy

NAME = "posefit/FitState-v0"


def remembered(dimensions: int, *proposals: tuple[float, float]) -> ProposalMemory:
    """Return the memory of a search whose middle costs 50, of proposals along the first axis with their costs."""
    memory = ProposalMemory(1, dimensions, 11)
    memory.begin(np.array([True]), np.array([50.0]))
    for place, cost in proposals:
        memory.add(place * np.eye(1, dimensions), np.array([cost]))
    return memory


def test_its_first_numbers_are_proposed_where_the_last_is_one_bit_for_bit() -> None:
    env, image = gym.make(NAME, instance=3).unwrapped, gym.make("posefit/FitImage-v0", instance=3).unwrapped
    env.reset(seed=0)
    image.reset(seed=0)
    for proposal in np.random.default_rng(0).uniform(-1.0, 1.0, (5, 9)):
        assert env.step(np.append(proposal, 1.0))[4]["cost"] == image.step(proposal)[4]["cost"]


def test_the_last_number_is_how_much_of_the_way_by_powers_of_ten() -> None:
    memory = remembered(2, (0.5, 20.0))
    for power, reach in ((-1.0, 0.01), (0.0, 0.1), (0.5, 10.0**-0.5)):
        # from the best, (0.5, 0), to (0, 1)
        np.testing.assert_allclose(memory.proposals(np.array([[0.0, 1.0, power]])), [[0.5 - 0.5 * reach, reach]])


def test_it_shows_the_best_proposals_and_the_last_ones_with_their_costs() -> None:
    (state,) = remembered(1, (0.1, 60.0), (0.2, 30.0), (0.3, 40.0)).states()
    np.testing.assert_allclose(state[:4], [0.2, 0.3, 0.0, 0.0], atol=1e-7)  # 30, 40, and the middle's 50
    np.testing.assert_allclose(state[4:8], [0.3, 0.2, 0.1, 0.0], atol=1e-7)
    costs = 2.0 * np.log([31.0, 41.0, 51.0, 51.0, 41.0, 31.0, 61.0, 51.0]) / np.log(101.0) - 1.0
    np.testing.assert_allclose(state[8:16], costs, rtol=1e-6)
    # 4 of 11 are used, and one since the last gain of 50 that show
    np.testing.assert_allclose(state[16:], [2.0 * 7.0 / 11.0 - 1.0, 2.0 / 50.0 - 1.0], rtol=1e-6)


def test_a_tie_is_no_improvement() -> None:
    for costs, stale in (((30.0, 30.0), 1), ((50.0,), 1), ((30.0, 30.0, 20.0), 0), ((30.0, 40.0, 30.0), 2)):
        memory = remembered(1, *((0.1 * place, cost) for place, cost in enumerate(costs)))
        assert memory.stale.tolist() == [stale]


def test_what_costs_no_less_than_the_middle_is_never_among_the_best() -> None:
    records = remembered(1, (0.1, 50.0), (0.2, 70.0), (0.3, 30.0), (0.4, 30.0)).records[0]
    np.testing.assert_array_equal(records[:4, 0], [0.3, 0.4, 0.0, 0.0])  # of equal ones the earlier first
    np.testing.assert_array_equal(records[:4, 1], [30.0, 30.0, 50.0, 50.0])
    np.testing.assert_array_equal(records[4:, 0], [0.4, 0.3, 0.2, 0.1])


def test_the_budget_counts_the_middle_and_rewards_add_up_to_the_fall_of_the_logarithm() -> None:
    env = gym.make(NAME, instance=3, max_evaluations=4).unwrapped
    _, info = env.reset(seed=0)
    assert info["evaluations"] == 1
    first, total, ends = info["best_cost"], 0.0, []
    for _ in range(3):
        _, reward, ended, cut, info = env.step(env.action_space.sample())
        total += float(reward)
        ends.append((ended, cut))
    assert ends == [(False, False), (False, False), (True, False)]
    assert total == pytest.approx(np.log((1.0 + first) / (1.0 + info["best_cost"])))


def test_the_picture_comes_beside_the_search_if_asked_for() -> None:
    observation, _ = gym.make(NAME, instance=3, image=True).reset(seed=0)
    assert sorted(observation) == ["image", "search"]
    assert observation["image"].shape == (48, 64, 2)
    assert observation["image"][..., 1].any()  # the middle of the box, which was proposed


def test_policies_act_in_their_environment() -> None:
    env = gym.make(NAME, max_evaluations=20).unwrapped
    for make in (gaussian_policy, random_search_policy, uniform_policy):
        info = rollout(env, make(env, np.random.default_rng(0)), 17, 0)
        assert (info["evaluations"], info["instance"]) == (20, 17)
        assert info["gain"] >= 0.0
    assert rollout(env, lambda _, __: np.zeros(10), 17, 0)["gain"] == 0.0
    with pytest.raises(ValueError, match="spread must be"):
        gaussian_policy(env, np.random.default_rng(0), spread=0.0)
