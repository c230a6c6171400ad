"""Configure-v1: SAPSO is one of its policies, budgets are kept, and every number of an action does what is said."""

import copy
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import error
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.utils.seeding import np_random

import posefit_envs  # noqa: F401, registers it
from posefit.fitting.box import draw_population
from posefit_envs.configuring import herd
from posefit_envs.configuring.moves import differential, normal
from posefit_envs.configuring.orders import Order, action_of, order_of
from posefit_envs.policies import sapso_action, sapso_action_v0
from posefit_swarm.sapso import SAPSO
from posefit_swarm.swarm import inertia

NAME = "posefit/Configure-v1"
NOBODY = np.full(10, -1.0)


def made(**arguments: Any) -> Any:
    return gym.make(NAME, **{"instance": 3, **arguments}).unwrapped


@pytest.mark.filterwarnings("ignore:.*pkg_resources.*:UserWarning", "ignore:.*pkg_resources.*:DeprecationWarning")
@pytest.mark.parametrize(
    "arguments", [{}, {"translation": "searched", "prior": "full", "population_size": 9, "every": 2}]
)
def test_the_checkers_of_gymnasium_and_stable_baselines3_pass_without_a_warning(arguments: dict[str, Any]) -> None:
    check_env(made(**arguments))
    checker = pytest.importorskip("stable_baselines3.common.env_checker", reason="needs posefit[rl]")
    checker.check_env(made(**arguments))


@pytest.mark.parametrize("every", [1, 5])
def test_with_sapsos_own_schedule_it_costs_what_sapso_does_and_proposes_it_but_for_rounding(every: int) -> None:
    for number in range(2):
        env = made(instance=number, every=every)
        env.reset(seed=number)
        ended, step, asked, found = False, 0, [], []
        ask = env._search.ask
        env._search.ask = lambda ask=ask, asked=asked: asked.append(ask().copy()) or asked[-1]
        while not ended:
            _, _, ended, _, info = env.step(sapso_action(step, every=every))
            found.append(env._search.costs)
            step += 1
        # the same draws: an environment's generator begins with the seed, and hands one number on to its search
        rng, _ = np_random(number)
        sapso = SAPSO(env._search.space, np.random.default_rng(int(rng.integers(2**63))))
        problem = env._search.episode.scenery.problem(env._search.space)
        proposed, costs = [], []
        while len(proposals := sapso.ask()):
            proposed.append(proposals.copy())
            costs.append(problem.evaluate(proposals))
            sapso.tell(proposals, costs[-1])
        np.testing.assert_allclose(np.concatenate(asked), np.concatenate(proposed[1:]), rtol=0.0, atol=1e-12)
        np.testing.assert_array_equal(np.concatenate(found), np.concatenate(costs[1:]))
        assert info["best_cost"] == np.min(costs)
        assert info["evaluations"] == 2440


def test_the_schedule_of_v0_is_the_one_that_its_docstring_promises() -> None:
    for k in (0, 1, 30, 60):
        action = sapso_action_v0(k)
        assert 0.6 * (action[0] + 1.0) == pytest.approx(inertia(k, 60))
        assert 10.0 ** (-3.0 + 2.25 * (action[1] + 1.0)) == pytest.approx(0.95**k)
        assert action[2] == -1.0


def test_an_order_comes_back_from_its_action() -> None:
    for order in (
        Order(),
        Order((0.0, 1.0, 0.0), 0.5, 0.9, 0.001, 0.25, (0.3, 0.0, 0.1)),
        Order((0.5, 0.25, 0.25), 0.25, 0.0, 31.0, 1.0),
    ):
        back = order_of(action_of(order))
        # a share of nothing is e^-10 of the largest
        assert back.shares == pytest.approx(order.shares, abs=1e-4)
        assert back.diffusion == pytest.approx(order.diffusion)
        for name in ("population", "stride", "temperature", "restart"):
            assert getattr(back, name) == pytest.approx(getattr(order, name)), name
    for wrong in (Order(stride=2.0), Order(population=0.1), Order(diffusion=(0.5, 0.0, 0.0))):
        with pytest.raises(ValueError, match="an order must be within what actions stand for, got Order"):
            action_of(wrong)


def test_shares_are_those_of_the_exponentials() -> None:
    # e^(5 * 0.2) = e and e^0 = 1: the shares are e / (e + 2) and 1 / (e + 2)
    action = np.array([0.2, 0.0, 0.0, *np.zeros(7)])
    assert order_of(action).shares == pytest.approx((np.e / (np.e + 2.0), 1.0 / (np.e + 2.0), 1.0 / (np.e + 2.0)))


@pytest.mark.parametrize("power", [-1.0, -0.1, 0.2, 1.0])
def test_a_step_has_the_same_evaluations_whatever_part_of_the_population_moves(power: float) -> None:
    env = made(population_size=10, iterations=6, every=3)
    env.reset(seed=0)
    action = np.zeros(10)
    action[3], action[6] = power, 0.3
    infos = [env.step(action)[4] for _ in range(2)]
    assert [info["evaluations"] for info in infos] == [40, 70]


def test_of_a_quarter_only_the_best_particles_move_and_more_often() -> None:
    env = made(population_size=40, every=1)
    env.reset(seed=0)
    before = env._search.flock.best_cost.copy()
    asked = []
    ask = env._search.ask
    env._search.ask = lambda: asked.append(ask()) or asked[-1]
    env.step(action_of(Order(population=0.25)))
    assert [len(one) for one in asked] == [10, 10, 10, 10]
    changed = np.flatnonzero(env._search.flock.best_cost != before)
    # the best ten of the first turn are among the best ten of every other, as bests only get better
    assert set(changed) <= set(before.argsort()[:10])
    assert len(changed) > 2


def test_all_begin_anew_and_the_best_of_all_is_kept() -> None:
    env = made(population_size=40, every=1)
    env.reset(seed=0)
    for k in range(20):
        best = env.step(sapso_action(k, every=1))[4]["best_cost"]
    known = env._search.flock.best.copy()
    _, reward, _, _, info = env.step(action_of(Order(restart=1.0)))
    assert info["best_cost"] == best
    assert reward == 0.0
    assert not (known[:, None] == env._search.flock.best).all(axis=2).any()
    assert env._search.flock.best_cost.min() > best
    half = made(population_size=40, every=1)
    half.reset(seed=0)
    order = half._search.flock.best_cost.argsort()
    still = {k: half._search.flock.best_cost[k] for k in order[:20]}
    half.step(action_of(Order(restart=0.5)))
    assert all(half._search.flock.best_cost[k] <= cost for k, cost in still.items())


def test_a_kick_goes_into_its_layer_alone() -> None:
    # without a stride, and particles that are their own best, the swarm is pulled towards the leader alone: the leader
    # stays where it is but for its kick
    for layer, columns in enumerate((slice(0, 3), slice(3, 6), slice(6, 9))):
        env = made(population_size=40, every=1)
        env.reset(seed=0)
        mine = env._search
        leader, row = mine.leader.copy(), int(mine.flock.best_cost.argmin())
        kick = [0.0, 0.0, 0.0]
        kick[layer] = 0.03
        mine.follow(Order(stride=0.0, diffusion=(kick[0], kick[1], kick[2])))
        moved = mine.ask()[row] - leader
        assert (np.abs(moved[columns]) > 1e-6).all()
        assert np.count_nonzero(np.abs(moved) > 1e-12) == 3  # but for rounding, where the box is folded


@pytest.mark.parametrize(
    ("shares", "differences", "draws"),
    [
        ((0.26, 0.37, 0.37), 15, 15),  # of 40: 10.4, 14.8, and what is left
        ((0.5125, 0.4875, 0.0), 20, 0),  # 20.5 and 19.5, both rounded to 20
        ((0.0, 0.4875, 0.5125), 20, 20),
    ],
)
def test_shares_become_whole_numbers_of_particles(
    monkeypatch: pytest.MonkeyPatch, shares: Any, differences: int, draws: int
) -> None:
    counted = {"differences": 0, "draws": 0}

    def different(space: Any, rng: Any, mine: Any, *others: Any) -> Any:
        counted["differences"] = len(mine)
        return mine

    def drawn(space: Any, rng: Any, bests: Any, order: Any, count: int, stride: float) -> Any:
        counted["draws"] = count
        return bests[:count]

    monkeypatch.setattr(herd, "differential", different)
    monkeypatch.setattr(herd, "normal", drawn)
    env = made(population_size=40, every=1)
    env.reset(seed=0)
    env._search.follow(Order(shares))
    env._search.ask()
    assert counted == {"differences": differences, "draws": draws}


def test_differences_and_draws_are_those_of_their_formulas() -> None:
    env = made()
    env.reset(seed=0)
    space, rng = env._search.space, np.random.default_rng(0)
    # of bests that are all the same neither has anywhere to go
    same = np.repeat(draw_population(space, rng, 1), 20, axis=0)
    order = np.arange(20)
    np.testing.assert_allclose(differential(space, rng, same, same, order, 0.7), same)
    np.testing.assert_allclose(normal(space, rng, same, order, 20, 0.6), same)
    # draws have mean and covariance of the better half, at twice the width by stride 1.2
    bests = 0.05 * rng.standard_normal((40, 9)) * np.linspace(0.5, 1.5, 9)
    drawn = normal(space, rng, bests, np.arange(40), 20_000, 1.2)
    np.testing.assert_allclose(drawn.mean(axis=0), bests[:20].mean(axis=0), atol=3e-3)
    np.testing.assert_allclose(np.cov(drawn.T), 4.0 * np.cov(bests[:20].T, bias=True), atol=8e-4)


def test_rewards_add_up_to_what_the_logarithm_of_the_cost_fell_by() -> None:
    env = made(population_size=12)
    first = env.reset(seed=0)[1]["best_cost"]
    rng, total, ended = np.random.default_rng(0), 0.0, False
    while not ended:
        state, reward, ended, cut, info = env.step(rng.uniform(-1.0, 1.0, 10))
        assert state in env.observation_space
        assert not cut
        assert reward >= 0.0
        total += reward
    assert total == pytest.approx(np.log((1.0 + first) / (1.0 + info["best_cost"])))
    with pytest.raises(error.ResetNeeded, match="the episode has ended"):
        env.step(NOBODY)


def test_it_can_be_pickled_and_copied_in_the_middle() -> None:
    env = made(population_size=8)
    env.reset(seed=0)
    action = np.full(10, 0.1)
    env.step(action)
    first = copy.deepcopy(env).step(action)
    for twin in (pickle.loads(pickle.dumps(env)), copy.deepcopy(env)):
        assert data_equivalence(first, twin.step(action))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"population_size": 3}, "population_size must be at least 4, got 3"),
        ({"iterations": 1}, "iterations must be at least 2, got 1"),
        ({"every": 0}, "every must be at least 1, got 0"),
        ({"iterations": 7, "every": 2}, "iterations must be a multiple of every 2, got 7"),
        ({"motion": "wakl"}, "did you mean 'walk'"),
    ],
)
def test_arguments_that_make_no_sense_are_named(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(error.Error, match=message):
        made(**arguments)
    with pytest.raises(error.Error, match=message):
        gym.make_vec(NAME, num_envs=2, **arguments)
