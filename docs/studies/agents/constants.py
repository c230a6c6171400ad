"""Agents that learn a constant setting: a bandit over a few of them, and CMA-ES over all.

A setting of Configure-v1 is an action, which every step takes. One of Fit-v1 is two last numbers of an action, for the
beginning and the end of the budget, the others drawn uniformly: how far proposals go from the best so far.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from agents.design import HELD_OUT
from posefit.arrays import Array
from posefit.evolution.constants import usual_population
from posefit.evolution.strategy import Strategy
from posefit_envs.configuring.orders import NUMBERS, Order, action_of
from posefit_envs.policies import Policy, constant_policy, played

WIDE = 0.5  # the first step size of CMA-ES, of a box from -1 to 1
EPISODES = 4  # that a setting of CMA-ES is tried in, the same instances for a whole generation
SIZES = {"configure": NUMBERS, "fit": 2}  # numbers of a setting
CURIOSITY = 0.5  # of the bandit: how many deviations of rewards an arm that was never tried is worth

Look = Callable[[int, Policy], None]


def arms(task: str) -> list[Array]:
    """Return the settings that the bandit may choose from."""
    if task == "fit":
        return [np.full(2, power) for power in np.linspace(-1.0, 1.0, 9)]
    kinds = [tuple(float(k == kind) for k in range(3)) for kind in range(3)]
    return [
        action_of(Order((one, two, three), population, stride, 0.01))
        for one, two, three in kinds
        for population in (1.0, 0.5)
        for stride in (0.3, 0.6, 0.9)
    ]


def setting_policy(task: str, setting: Array, rng: np.random.Generator, dimensions: int, length: int) -> Policy:
    """Return what a setting does in episodes of so many steps."""
    if task == "configure":
        return constant_policy(setting)

    def propose(_: Any, step: int) -> Array:
        power = setting[0] + (setting[1] - setting[0]) * step / length
        return np.append(rng.uniform(-1.0, 1.0, dimensions - 1), power)

    return propose


def bandit(task: str, env: Any, length: int, steps: int, seed: int, look: Look) -> Policy:
    """Return the best arm by UCB1 over the whole episodes that `steps` steps of a training environment are.

    `length` is how many an episode has; `look` is called with the steps so far and the policy of then.
    """
    rng, choices = np.random.default_rng(seed), arms(task)
    d = env.action_space.shape[0]
    policies = [setting_policy(task, arm, rng, d, length) for arm in choices]
    shown = [setting_policy(task, arm, _apart(seed), d, length) for arm in choices]
    sums, squares, counts = np.zeros(len(choices)), np.zeros(len(choices)), np.zeros(len(choices))
    for episode in range(steps // length):
        tried = np.maximum(counts, 1.0)
        deviation = np.sqrt(max(squares.sum() / max(episode, 1) - (sums.sum() / max(episode, 1)) ** 2, 0.0))
        bonus = CURIOSITY * deviation * np.sqrt(2.0 * np.log(episode + 1.0) / tried)
        arm = int(np.where(counts > 0, sums / tried + bonus, np.inf).argmax())
        gain = played(env, policies[arm], int(rng.integers(HELD_OUT)), int(rng.integers(2**31)))["gain"]
        sums[arm], squares[arm], counts[arm] = sums[arm] + gain, squares[arm] + gain**2, counts[arm] + 1
        look((episode + 1) * length, shown[int(np.where(counts > 0, sums / tried, -np.inf).argmax())])
    return shown[int(np.where(counts > 0, sums / np.maximum(counts, 1.0), -np.inf).argmax())]


def _apart(seed: int) -> np.random.Generator:
    """Return a generator for looks at what was learned, so that looking changes nothing of the training."""
    return np.random.default_rng([seed, 2])


def generation(task: str, length: int) -> int:
    """Return how many steps a generation of CMA-ES over settings takes, where an episode has `length`."""
    return usual_population(SIZES[task]) * EPISODES * length


def evolved(task: str, env: Any, length: int, steps: int, seed: int, look: Look) -> Policy:
    """Return the setting at the mean of CMA-ES after the whole generations that `steps` steps of an environment are.

    Without one it is the middle.
    """
    rng, other = np.random.default_rng(seed), _apart(seed)
    d, size, whole = env.action_space.shape[0], SIZES[task], generation(task, length)
    population = usual_population(size)
    strategy = Strategy(np.zeros(size), np.full(size, WIDE), population)
    for number in range(1, steps // whole + 1):
        settings = np.clip(strategy.sample(rng, population), -1.0, 1.0)
        numbers, seeds = rng.integers(HELD_OUT, size=EPISODES), rng.integers(2**31, size=EPISODES)
        costs = [
            -np.mean(
                [
                    played(env, setting_policy(task, setting, rng, d, length), int(number), int(one))["gain"]
                    for number, one in zip(numbers, seeds, strict=True)
                ]
            )
            for setting in settings
        ]
        strategy.learn(settings, np.array(costs))
        look(number * whole, setting_policy(task, np.clip(strategy.mean, -1.0, 1.0), other, d, length))
    return setting_policy(task, np.clip(strategy.mean, -1.0, 1.0), other, d, length)
