"""Libraries of learners step every environment as it is; see docs/howto/learners.md.

They are in no extra but Stable-Baselines3; `.ci/learners` installs all of them.
"""

import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import posefit_envs
from tests.cases import each

STEPS = 12
# four or six steps an episode, so that a learner sees several
ARGUMENTS: dict[str, dict[str, Any]] = {
    "posefit/FitImage-v1": {"max_evaluations": 4},
    "posefit/Track-v1": {"frames": 2, "evaluations_per_frame": 2},
    "posefit/Race-v1": {"searches": 3, "generations": (4, 4)},
}
NAMES = tuple(ARGUMENTS)
EPISODES = STEPS // 4


def single(name: str) -> gym.Env[Any, Any]:
    return gym.make(name, **ARGUMENTS[name])


def library(name: str) -> Any:
    return pytest.importorskip(name, reason=f"needs {name}, see .ci/learners")


@each("name", NAMES)
def test_gymnasium_alone_is_enough_for_a_loop_in_one_file(name: str) -> None:
    envs = gym.make_vec(name, num_envs=2, **ARGUMENTS[name])
    envs = gym.wrappers.vector.RecordEpisodeStatistics(envs)
    envs.reset(seed=1)
    envs.action_space.seed(1)
    lengths = []
    for _ in range(STEPS):
        *_, infos = envs.step(envs.action_space.sample())
        if "episode" in infos:
            lengths += infos["episode"]["l"][infos["_episode"]].tolist()
    assert lengths == [4] * len(lengths)
    assert len(lengths) >= 4


@each("name", NAMES)
def test_stable_baselines3_trains(name: str) -> None:
    algorithms = library("stable_baselines3")
    from stable_baselines3.common.env_util import make_vec_env

    vectors = [
        make_vec_env(name, n_envs=2, env_kwargs=ARGUMENTS[name]),
        posefit_envs.to_sb3_vec_env(gym.make_vec(name, 2, **ARGUMENTS[name])),
    ]
    for vector in vectors:
        model = algorithms.PPO(
            "MlpPolicy", vector, n_steps=STEPS, batch_size=4, n_epochs=1, device="cpu"
        )
        assert model.learn(2 * STEPS).num_timesteps == 2 * STEPS


@each("name", NAMES)
def test_torchrl_collects(name: str) -> None:
    envs = library("torchrl.envs")
    made = envs.GymEnv(name, **ARGUMENTS[name])
    envs.check_env_specs(made)
    vector = gym.make_vec(
        name, num_envs=2, autoreset_mode="SameStep", **ARGUMENTS[name]
    )
    for env, count in ((made, 1), (envs.GymWrapper(vector), 2)):
        steps = env.rollout(STEPS, break_when_any_done=False)
        assert int(steps["next", "done"].sum()) == count * EPISODES


@each("name", NAMES)
def test_skrl_steps_vectors(name: str) -> None:
    wrappers = library("skrl.envs.wrappers.torch")
    import torch

    assert wrappers.wrap_env(single(name)).num_envs == 1
    # it recognises environments by their direct base classes alone
    vector = gym.make_vec(name, num_envs=2, **ARGUMENTS[name])
    envs = wrappers.wrap_env(vector, wrapper="gymnasium")
    envs.reset()
    ended = 0
    for _ in range(STEPS):
        actions = torch.zeros(2, *envs.action_space.shape)
        _, _, terminated, truncated, _ = envs.step(actions)
        ended += int((terminated | truncated).sum())
    assert ended >= 4


@pytest.mark.filterwarnings("ignore:action_scaling and action_bound_method:UserWarning")
@each("name", NAMES)
def test_tianshou_collects(name: str) -> None:
    library("tianshou")
    from tianshou.algorithm import PPO
    from tianshou.algorithm.modelfree.reinforce import ProbabilisticActorPolicy
    from tianshou.algorithm.optim import AdamOptimizerFactory
    from tianshou.data import Collector, VectorReplayBuffer
    from tianshou.env import DummyVectorEnv
    from tianshou.utils.net.common import Net
    from tianshou.utils.net.continuous import (
        ContinuousActorProbabilistic,
        ContinuousCritic,
    )
    from torch.distributions import Independent, Normal

    space = single(name).observation_space
    actions = single(name).action_space
    actor = ContinuousActorProbabilistic(
        preprocess_net=Net(state_shape=space.shape, hidden_sizes=[8]),
        action_shape=actions.shape,
        unbounded=True,
    )
    policy = ProbabilisticActorPolicy(
        actor=actor,
        dist_fn=lambda parameters: Independent(Normal(*parameters), 1),
        action_space=actions,
    )
    critic = ContinuousCritic(
        preprocess_net=Net(state_shape=space.shape, hidden_sizes=[8])
    )
    learner = PPO(policy=policy, critic=critic, optim=AdamOptimizerFactory(lr=1e-3))
    envs = DummyVectorEnv([lambda: single(name)] * 2)
    collector = Collector(learner, envs, VectorReplayBuffer(64, 2))
    collector.reset()
    collected = collector.collect(n_step=2 * STEPS)
    assert collected.n_collected_steps == 2 * STEPS
    assert collected.n_collected_episodes == 2 * EPISODES


@each("name", NAMES)
def test_pufferlib_steps(name: str) -> None:
    library("pufferlib.emulation")
    import pufferlib.emulation
    import pufferlib.vector

    def env_of(buf: Any = None, seed: int = 0) -> Any:
        return pufferlib.emulation.GymnasiumPufferEnv(
            env_creator=lambda: single(name), buf=buf, seed=seed
        )

    envs = pufferlib.vector.make(env_of, num_envs=2, backend=pufferlib.vector.Serial)
    envs.reset(seed=3)
    ended = 0
    for _ in range(STEPS):
        _, _, terminated, _, _ = envs.step(envs.action_space.sample())
        ended += int(np.sum(terminated))
    assert ended >= 4
    envs.close()


@each("name", NAMES)
def test_minari_records_and_gives_back(
    name: str, tmp_path: Any, monkeypatch: Any
) -> None:
    minari = library("minari")
    from minari.data_collector.episode_buffer import EpisodeBuffer

    # what only somebody who publishes a data set would fill in
    warnings.filterwarnings("ignore", module="minari")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    env = single(name)
    observation, _ = env.reset(seed=5)
    rows: dict[str, list[Any]] = {"observations": [observation], "actions": []}
    rows |= {"rewards": [], "terminations": [], "truncations": []}
    for _ in range(4):
        action = env.action_space.sample()
        observation, reward, terminated, truncated, _ = env.step(action)
        rows["observations"].append(observation)
        rows["actions"].append(action)
        rows["rewards"].append(reward)
        rows["terminations"].append(terminated)
        rows["truncations"].append(truncated)
    steps = {key: np.array(values) for key, values in rows.items()}
    minari.create_dataset_from_buffers(
        "posefit/tried-v0",
        [EpisodeBuffer(id=0, **steps)],
        env=env,
        algorithm_name="random",
        author="posefit",
        description="one episode",
        jpeg_encoding=False,
    )
    kept = minari.load_dataset("posefit/tried-v0")
    assert np.array_equal(kept[0].observations, steps["observations"])
    assert kept.recover_environment().observation_space == env.observation_space
