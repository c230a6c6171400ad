"""Configure-v0: SAPSO is one of its policies, budgets are kept, and every number of an action has its effect."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import posefit_envs  # noqa: F401, registers it
from posefit.fitting.box import draw_population
from posefit_envs.policies import sapso_action
from posefit_envs.population import ControlAction, action_of, control_of, differential, normal

NAME = "posefit/Configure-v0"
NO_ACTION = np.full(10, -1.0)


def made(**arguments: Any) -> Any:
    return gym.make(NAME, **{"instance": 3, **arguments}).unwrapped


def population_of(env: Any) -> Any:
    return env._vector._populations[0]


def recorded(env: Any) -> list[Any]:
    """Return the list to which every population that an environment asks for is added."""
    asked: list[Any] = []
    ask = population_of(env).ask
    population_of(env).ask = lambda: asked.append(ask().copy()) or asked[-1]
    return asked


def test_a_control_comes_back_from_its_action() -> None:
    for control in (
        ControlAction(),
        ControlAction((0.0, 1.0, 0.0), 0.5, 0.9, 0.001, 0.25, (0.3, 0.0, 0.1)),
        ControlAction((0.5, 0.25, 0.25), 0.25, 0.0, 31.0, 1.0),
    ):
        back = control_of(action_of(control))
        # a share of nothing is e^-10 of the largest
        assert back.shares == pytest.approx(control.shares, abs=1e-4)
        assert back.diffusion == pytest.approx(control.diffusion)
        for name in ("population", "stride", "temperature", "restart"):
            assert getattr(back, name) == pytest.approx(getattr(control, name)), name
    for wrong in (ControlAction(stride=2.0), ControlAction(population=0.1), ControlAction(diffusion=(0.5, 0.0, 0.0))):
        with pytest.raises(ValueError, match="a control must lie in the range of actions, got ControlAction"):
            action_of(wrong)


def test_shares_are_those_of_the_exponentials() -> None:
    # e^(5 * 0.2) = e and e^0 = 1: the shares are e / (e + 2) and 1 / (e + 2)
    action = np.array([0.2, 0.0, 0.0, *np.zeros(7)])
    assert control_of(action).shares == pytest.approx((np.e / (np.e + 2.0), 1.0 / (np.e + 2.0), 1.0 / (np.e + 2.0)))


def test_a_step_has_the_same_evaluations_whatever_part_of_the_population_moves() -> None:
    for power in (-1.0, -0.1, 0.2, 1.0):
        env = made(population_size=10, iterations=6, every=3)
        env.reset(seed=0)
        action = np.zeros(10)
        action[3], action[6] = power, 0.3
        infos = [env.step(action)[4] for _ in range(2)]
        assert [info["evaluations"] for info in infos] == [40, 70], power


def test_of_a_quarter_only_the_best_particles_move_and_more_often() -> None:
    env = made(population_size=40, every=1)
    env.reset(seed=0)
    before = population_of(env).swarm.best_cost.copy()
    asked = recorded(env)
    env.step(action_of(ControlAction(population=0.25)))
    assert [len(proposals) for proposals in asked] == [10, 10, 10, 10]
    changed = np.flatnonzero(population_of(env).swarm.best_cost != before)
    # the best ten of the first turn are among the best ten of every other, as bests only get better
    assert set(changed) <= set(before.argsort()[:10])
    assert len(changed) > 2


def test_all_are_restarted_and_the_best_of_all_is_kept() -> None:
    env = made(population_size=40, every=1)
    env.reset(seed=0)
    for k in range(20):
        best = env.step(sapso_action(k, every=1))[4]["best_cost"]
    known = population_of(env).swarm.best.copy()
    _, reward, _, _, info = env.step(action_of(ControlAction(restart=1.0)))
    assert info["best_cost"] == best
    assert reward == 0.0
    assert not (known[:, None] == population_of(env).swarm.best).all(axis=2).any()
    assert population_of(env).swarm.best_cost.min() > best


def test_a_kick_goes_into_its_layer_alone() -> None:
    # without a stride, and particles that are their own best, the swarm is pulled towards the leader alone: the leader
    # stays where it is but for its kick
    for layer, columns in enumerate((slice(0, 3), slice(3, 6), slice(6, 9))):
        env = made(population_size=40, every=1)
        env.reset(seed=0)
        own = population_of(env)
        leader, row = own.leader.copy(), int(own.swarm.best_cost.argmin())
        kick = [0.0, 0.0, 0.0]
        kick[layer] = 0.03
        own.begin_step(ControlAction(stride=0.0, diffusion=(kick[0], kick[1], kick[2])))
        moved = own.ask()[row] - leader
        assert (np.abs(moved[columns]) > 1e-6).all()
        assert np.count_nonzero(np.abs(moved) > 1e-12) == 3  # but for rounding, where the box is folded


def test_differences_and_draws_are_those_of_their_formulas() -> None:
    env = made()
    env.reset(seed=0)
    space, rng = population_of(env).space, np.random.default_rng(0)
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
