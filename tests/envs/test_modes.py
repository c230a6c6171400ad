"""Modes-v0 keeps Gymnasium's rules, and pays for what is found and for weights that mean what they say."""

import copy
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import error
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import SyncVectorEnv

import posefit_envs  # noqa: F401, registers it
from posefit.niching import niche_instance
from posefit_envs.instance import ArgumentError
from tests.cases import each

NAME = "posefit/Modes-v0"


def started(**arguments: Any) -> gym.Env[Any, Any]:
    env = gym.make(NAME, **{"instance": 1, **arguments}).unwrapped
    env.reset(seed=0)
    return env


def action(proposal: Any, report: float) -> Any:
    return np.append(proposal, report)


@pytest.mark.filterwarnings("ignore:.*pkg_resources.*:UserWarning", "ignore:.*pkg_resources.*:DeprecationWarning")
@pytest.mark.parametrize("arguments", [{}, {"instance": 0}, {"split": "test", "max_reports": 1}])
def test_the_checkers_pass_without_a_warning(arguments: dict[str, Any]) -> None:
    check_env(gym.make(NAME, **arguments).unwrapped)


@pytest.mark.filterwarnings("ignore:.*pkg_resources.*:UserWarning", "ignore:.*pkg_resources.*:DeprecationWarning")
def test_the_checker_of_stable_baselines3_passes_without_a_warning() -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker", reason="needs posefit[rl]")
    checker.check_env(gym.make(NAME, instance=0).unwrapped)


def test_all_known_poses_with_the_true_one_sure_earn_all_there_is() -> None:
    posed = niche_instance(1)
    env = started(max_reports=len(posed.known))
    weights = np.where(np.arange(len(posed.known)) == posed.true, 1.0, 1e-9)
    steps = [env.step(action(one, weight)) for one, weight in zip(posed.proposals, weights, strict=True)]
    assert sum(step[1] for step in steps) == pytest.approx(1.0, abs=1e-6)
    assert [step[2] for step in steps] == [False] * (len(steps) - 1) + [True]
    assert steps[-1][4]["peak_ratio"].tolist() == [1.0, 1.0, 1.0]
    assert steps[-1][4]["brier"] == pytest.approx(0.0, abs=1e-6)


def test_one_known_pose_of_two_earns_half_of_the_peak_ratio() -> None:
    posed = niche_instance(1)
    assert len(posed.known) == 2
    env = started()
    assert env.step(action(posed.proposals[0], 0.5))[1] == pytest.approx(0.5)
    assert env.step(action(posed.proposals[0], 0.5))[1] == 0.0


def test_a_proposal_that_is_not_reported_earns_nothing_and_is_seen() -> None:
    posed = niche_instance(1)
    picture, reward, _, _, info = started().step(action(posed.proposals[0], 0.0))
    assert reward == 0.0
    assert info["cost"] == pytest.approx(posed.costs[0])
    assert info["reports"] == 0
    assert (picture[..., 1] > 0).any()


def test_an_episode_without_a_report_ends_with_the_worst_brier_score() -> None:
    env = started(max_evaluations=2)
    env.step(action(np.zeros(8), -1.0))
    _, reward, terminated, truncated, info = env.step(action(np.zeros(8), -1.0))
    assert (reward, terminated, truncated, info["brier"]) == (-2.0, False, True, 2.0)
    with pytest.raises(error.ResetNeeded):
        env.step(action(np.zeros(8), -1.0))


def test_it_can_be_pickled_and_copied_in_the_middle() -> None:
    env = started()
    env.step(action(niche_instance(1).proposals[0], 0.3))
    for twin in (pickle.loads(pickle.dumps(env)), copy.deepcopy(env)):
        following = action(np.full(8, 0.1), 0.2)
        assert data_equivalence(copy.deepcopy(env).step(following), twin.step(following))


def test_many_of_them_run_side_by_side() -> None:
    many = SyncVectorEnv([lambda: gym.make(NAME, instance=1, max_evaluations=3)] * 2)
    many.reset(seed=3)
    for _ in range(5):
        observations, *_ = many.step(many.action_space.sample())
    assert observations.shape == (2, 96, 128, 2)
    many.close()


def test_a_picture_is_drawn() -> None:
    env = started(render_mode="rgb_array")
    before = np.asarray(env.render())
    env.step(action(np.zeros(8), -1.0))
    assert (np.asarray(env.render()) != before).any()


@each(
    ("arguments", "said"),
    [
        ({"instance": 20_000}, "instance must lie in 0 to 19999, got 20000"),
        ({"instance": 1.5}, "instance must be a whole number from 0 to 19999, got 1.5"),
        ({"split": "both"}, "split must be one of train, test, got 'both'"),
        ({"max_reports": 11}, "max_reports must be at most 10, got 11"),
        ({"max_reports": 0}, "max_reports must be"),
        ({"max_evaluations": 1}, "max_evaluations must be"),
    ],
)
def test_a_wrong_argument_is_named(arguments: dict[str, Any], said: str) -> None:
    with pytest.raises(ArgumentError, match=said):
        gym.make(NAME, **arguments)


def test_before_a_reset_there_is_nothing() -> None:
    with pytest.raises(error.ResetNeeded):
        gym.make(NAME).unwrapped.step(np.zeros(9))
