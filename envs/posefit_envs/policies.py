"""References as policies: chance, constant actions, SAPSO's own schedule, and a step from the best so far.

A policy is called with an observation and the number of the step, and returns an action.
"""

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

from posefit.arrays import Array
from posefit.fitting.check import positive
from posefit_envs.configure import INERTIA, ITERATIONS, LOG_TEMPERATURE
from posefit_envs.configuring.orders import Order, action_of
from posefit_envs.configuring.single import EVERY
from posefit_envs.scales import unscaled
from posefit_swarm.sapso import COOLING, TEMPERATURE
from posefit_swarm.swarm import inertia

Policy = Callable[[Any, int], Array]

PROPOSED = 1.0  # the last number of an action of Fit-v1 whose others are the proposal


def sapso_action(step: int, *, iterations: int = ITERATIONS, every: int = EVERY) -> Array:
    """Return the action (10,), float64, that makes step `step` of Configure-v1 what SAPSO does there.

    Its stride and temperature are SAPSO's but for rounding, and so are the proposals, within 1e-12 half-ranges. What
    they cost is the same, unless a pixel lies as near as that to a silhouette's edge.
    """
    now = min(step * every, iterations)
    return action_of(Order(stride=inertia(now, iterations), temperature=TEMPERATURE * COOLING**now))


def sapso_action_v0(step: int, *, iterations: int = ITERATIONS) -> Array:
    """Return the action (3,), float64, that makes iteration `step` of Configure-v0 what SAPSO does there."""
    now = min(step, iterations)
    temperature = np.log10(TEMPERATURE * COOLING**now)
    return np.array([unscaled(INERTIA, inertia(now, iterations)), unscaled(LOG_TEMPERATURE, temperature), -1.0])


def constant_policy(action: Any) -> Policy:
    """Return the policy that always takes this action."""
    always = np.array(action, dtype=np.float64)
    return lambda _, __: always


def sapso_policy(*, iterations: int = ITERATIONS, every: int = EVERY) -> Policy:
    """Return SAPSO's own schedule as a policy of Configure-v1."""
    return lambda _, step: sapso_action(step, iterations=iterations, every=every)


def uniform_policy(env: gym.Env[Any, Any], rng: np.random.Generator) -> Policy:
    """Return the policy that draws actions uniformly from an environment's box."""
    shape = env.action_space.shape
    return lambda _, __: rng.uniform(-1.0, 1.0, shape)


def random_search_policy(env: gym.Env[Any, Any], rng: np.random.Generator) -> Policy:
    """Return random search as a policy of Fit-v1: proposals drawn uniformly from the box, whatever is seen."""
    d = (env.action_space.shape or (0,))[0] - 1
    return lambda _, __: np.append(rng.uniform(-1.0, 1.0, d), PROPOSED)


def gaussian_policy(env: gym.Env[Any, Any], rng: np.random.Generator, spread: float = 0.1) -> Policy:
    """Return the policy of Fit-v1 that proposes a normal draw around the best so far.

    `spread` is its standard deviation in half-ranges. What leaves the box is clipped. Raises ValueError where `spread`
    is not above 0.
    """
    positive("spread", spread)
    d = (env.action_space.shape or (0,))[0] - 1

    def propose(observation: Any, _: int) -> Array:
        shown = observation["search"] if isinstance(observation, dict) else observation
        return np.append(np.clip(shown[:d] + spread * rng.standard_normal(d), -1.0, 1.0), PROPOSED)

    return propose


def played(env: gym.Env[Any, Any], policy: Policy, instance: int, seed: int) -> dict[str, Any]:
    """Return the last info of an episode that a policy plays on an instance, with its rewards' sum as `gain`."""
    observation, info = env.reset(seed=seed, options={"instance": instance})
    step, gain, ended, cut = 0, 0.0, False, False
    while not (ended or cut):
        observation, reward, ended, cut, info = env.step(policy(observation, step))
        step, gain = step + 1, gain + float(reward)
    return info | {"gain": gain}
