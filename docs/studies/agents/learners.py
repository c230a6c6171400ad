"""PPO and SAC of Stable-Baselines3 as they come: no normalisation, discount 0.99, two layers of 64 or 256."""

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

from posefit.arrays import Array
from posefit_envs.policies import Policy

DISCOUNT = 0.99  # their default, stated
ROLLOUT = 2048  # steps that PPO takes before it learns of them; its default, stated


def check_learners(agents: set[str]) -> None:
    """Return nothing. Raises ImportError where agents need Stable-Baselines3 and it is not there."""
    if agents & {"ppo", "sac"} and find_spec("stable_baselines3") is None:
        raise ImportError("ppo and sac need Stable-Baselines3: pip install posefit[rl]")


def trained(
    agent: str, env: Any, steps: int, seed: int, deterministic: bool, look: Callable[[int, Policy], None]
) -> Policy:
    """Return the policy of "ppo" or "sac" after so many steps in an environment, of "ppo" in whole rollouts.

    `deterministic` takes the middle of its distribution in place of a draw. `look` is called with the steps so far and
    the policy of then.
    """
    import torch
    from stable_baselines3 import PPO, SAC
    from stable_baselines3.common.callbacks import BaseCallback

    torch.set_num_threads(1)
    common: dict[str, Any] = {"policy": "MlpPolicy", "env": env, "seed": seed, "device": "cpu", "gamma": DISCOUNT}
    model = PPO(**common, n_steps=ROLLOUT) if agent == "ppo" else SAC(**common)

    def act(observation: Any, _: int) -> Array:
        chosen: Array = model.predict(observation, deterministic=deterministic)[0]
        return chosen

    class Looking(BaseCallback):  # type: ignore[misc]
        def _on_step(self) -> bool:
            with torch.random.fork_rng(devices=()):  # looking changes nothing of the training
                look(self.num_timesteps, act)
            return True

    model.learn(steps, callback=Looking())
    return act
