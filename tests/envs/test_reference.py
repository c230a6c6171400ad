"""A tracker is a reference in Track-v0: it sees what an episode shows, and its poses are judged as an episode's are."""

import gymnasium as gym
import numpy as np
import pytest

import posefit_envs  # noqa: F401, registers the environments
from posefit_envs import track_reference
from posefit_envs.track import TrackEnv


@pytest.fixture(scope="module")
def env() -> gym.Env[np.ndarray, np.ndarray]:
    made: gym.Env[np.ndarray, np.ndarray] = gym.make(
        "posefit/Track-v0", instance=17, frames=4, evaluations_per_frame=400
    )
    made.reset(seed=0)
    return made


def test_its_rows_are_what_a_step_says_that_commits(env: gym.Env[np.ndarray, np.ndarray]) -> None:
    rows = track_reference(env)
    assert [row["committed_frame"] for row in rows] == [0, 1, 2, 3]
    followed = env.unwrapped
    assert isinstance(followed, TrackEnv)
    for _ in range(400):
        info = env.step(np.zeros(env.action_space.shape or ()))[-1]
    assert set(rows[0]) == {name for name in info if name.startswith("committed_")}
    assert rows[0]["committed_error_degrees"] == followed.instance.errors(0, rows[0]["committed_pose"])["error_degrees"]


def test_exemplars_of_the_same_kind_are_nearer_than_the_middle_of_the_box(
    env: gym.Env[np.ndarray, np.ndarray],
) -> None:
    env.reset(seed=0)
    found = np.mean([row["committed_mpjpe_mm"] for row in track_reference(env, "exemplars")])
    still = []
    for _ in range(4 * 400):
        info = env.step(np.zeros(env.action_space.shape or ()))[-1]
        still += [info["committed_mpjpe_mm"]] if "committed_mpjpe_mm" in info else []
    assert len(still) == 4
    assert found < 0.5 * np.mean(still)


def test_a_tracker_learns_from_what_it_is_told_and_has_its_settings(env: gym.Env[np.ndarray, np.ndarray]) -> None:
    env.reset(seed=0)
    told = track_reference(env, "exemplars", train=["walk-b"], lag=0)
    assert not np.array_equal(told[0]["committed_pose"], track_reference(env, "exemplars")[0]["committed_pose"])
    assert np.array_equal(told[0]["committed_pose"], track_reference(env, train=["walk-b"], lag=0)[0]["committed_pose"])


def test_mistakes_are_named(env: gym.Env[np.ndarray, np.ndarray]) -> None:
    env.reset(seed=0)
    with pytest.raises(ValueError, match="tracker must be one of exemplars, .*did you mean 'exemplars'"):
        track_reference(env, "exemplar")
    with pytest.raises(ValueError, match="a setting of exemplars must be one of .*, got 'lags'"):
        track_reference(env, lags=3)
    with pytest.raises(gym.error.Error, match="env must be posefit/Track-v0, got FitEnv"):
        track_reference(gym.make("posefit/Fit-v0"))
    with pytest.raises(gym.error.ResetNeeded):
        track_reference(gym.make("posefit/Track-v0").unwrapped)
