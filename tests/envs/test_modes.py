"""Modes-v0 pays for known poses that are reported, and for weights that are probabilities."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import posefit_envs  # noqa: F401, registers it
from posefit.niching import niche_instance
from posefit_envs.instance import ArgumentError

NAME = "posefit/Modes-v0"


def started(**arguments: Any) -> gym.Env[Any, Any]:
    env = gym.make(NAME, **{"instance": 1, **arguments}).unwrapped
    env.reset(seed=0)
    return env


def test_all_known_poses_with_all_the_weight_on_the_true_one_earn_the_most() -> None:
    posed = niche_instance(1)
    env = started(max_reports=len(posed.known))
    weights = np.where(np.arange(len(posed.known)) == posed.true, 1.0, 1e-9)
    steps = [env.step(np.append(pose, weight)) for pose, weight in zip(posed.proposals, weights, strict=True)]
    assert sum(step[1] for step in steps) == pytest.approx(1.0, abs=1e-6)
    assert [step[2] for step in steps] == [False] * (len(steps) - 1) + [True]
    assert steps[-1][4]["peak_ratio"].tolist() == [1.0, 1.0, 1.0]
    assert steps[-1][4]["brier"] == pytest.approx(0.0, abs=1e-6)


def test_one_known_pose_of_two_earns_half_of_the_peak_ratio_and_unreported_nothing() -> None:
    posed = niche_instance(1)
    assert len(posed.known) == 2
    env = started()
    picture, reward, _, _, info = env.step(np.append(posed.proposals[0], 0.0))
    assert (reward, info["reports"]) == (0.0, 0)
    assert info["cost"] == pytest.approx(posed.costs[0])
    assert (picture[..., 1] > 0).any()
    assert env.step(np.append(posed.proposals[0], 0.5))[1] == pytest.approx(0.5)
    assert env.step(np.append(posed.proposals[0], 0.5))[1] == 0.0


def test_an_episode_without_a_report_ends_with_the_worst_brier_score() -> None:
    env = started(max_evaluations=2)
    env.step(np.append(np.zeros(8), -1.0))
    _, reward, terminated, truncated, info = env.step(np.append(np.zeros(8), -1.0))
    assert (reward, terminated, truncated, info["brier"]) == (-2.0, False, True, 2.0)


def test_wrong_arguments_are_named() -> None:
    for name, value in (("split", "both"), ("max_reports", 11)):
        with pytest.raises(ArgumentError, match=f"{name} must be .*, got '?{value}"):
            gym.make(NAME, **{name: value})
