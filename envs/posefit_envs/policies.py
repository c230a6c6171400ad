"""References as policies: random and constant actions, SAPSO's own schedule, and a step from the best so far.

A policy is called with an observation and the number of the step, and returns an action.
"""

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

from posefit.arrays import Array
from posefit.fitting.check import positive
from posefit_envs.configure import EVERY, ITERATIONS
from posefit_envs.population import ControlAction, action_of
from posefit_swarm.sapso import COOLING, TEMPERATURE
from posefit_swarm.swarm import inertia

Policy = Callable[[Any, int], Array]

WHOLE_WAY = 1.0  # the last number of an action of FitState-v0 whose others are the proposal


def sapso_action(step: int, *, iterations: int = ITERATIONS, every: int = EVERY) -> Array:
    """Return the action (10,), float64, that makes step `step` of Configure-v0 SAPSO's.

    Its stride and temperature are SAPSO's but for rounding, and so are the proposals, within 1e-12 half-ranges. Their
    costs are the same, unless a pixel lies as near as that to a silhouette's edge.
    """
    iteration = min(step * every, iterations)
    control = ControlAction(stride=inertia(iteration, iterations), temperature=TEMPERATURE * COOLING**iteration)
    return action_of(control)


def constant_policy(action: Any) -> Policy:
    """Return the policy that always takes this action."""
    constant = np.array(action, dtype=np.float64)
    return lambda _, __: constant


def sapso_policy(*, iterations: int = ITERATIONS, every: int = EVERY) -> Policy:
    """Return SAPSO's own schedule as a policy of Configure-v0."""
    return lambda _, step: sapso_action(step, iterations=iterations, every=every)


def uniform_policy(env: gym.Env[Any, Any], rng: np.random.Generator) -> Policy:
    """Return the policy that draws actions uniformly from an environment's box."""
    shape = env.action_space.shape
    return lambda _, __: rng.uniform(-1.0, 1.0, shape)


def random_search_policy(env: gym.Env[Any, Any], rng: np.random.Generator) -> Policy:
    """Return random search as a policy of FitState-v0: proposals drawn uniformly from the box."""
    d = (env.action_space.shape or (0,))[0] - 1
    return lambda _, __: np.append(rng.uniform(-1.0, 1.0, d), WHOLE_WAY)


def gaussian_policy(env: gym.Env[Any, Any], rng: np.random.Generator, spread: float = 0.1) -> Policy:
    """Return the policy of FitState-v0 that proposes a normal draw around the best so far.

    `spread` is its standard deviation in half-ranges. Draws outside the box are clipped. Raises ValueError where
    `spread` is not above 0.
    """
    positive("spread", spread)
    d = (env.action_space.shape or (0,))[0] - 1

    def propose(observation: Any, _: int) -> Array:
        state = observation["search"] if isinstance(observation, dict) else observation
        return np.append(np.clip(state[:d] + spread * rng.standard_normal(d), -1.0, 1.0), WHOLE_WAY)

    return propose


def rollout(env: gym.Env[Any, Any], policy: Policy, instance: int, seed: int) -> dict[str, Any]:
    """Return the last info of an episode of a policy on an instance, with the sum of its rewards as `gain`."""
    observation, info = env.reset(seed=seed, options={"instance": instance})
    step, gain, ended, cut = 0, 0.0, False, False
    while not (ended or cut):
        observation, reward, ended, cut, info = env.step(policy(observation, step))
        step, gain = step + 1, gain + float(reward)
    return info | {"gain": gain}
