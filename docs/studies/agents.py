"""Baseline agents of FitState-v0 on held-out instances.

Chance, constants, a bandit, CMA-ES over settings, and PPO and SAC of Stable-Baselines3 with their defaults.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple

import click
import gymnasium as gym
import numpy as np

from posefit import minimise
from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.errors import InputError
from posefit.fitting.cma import Strategy, default_population_size
from posefit.registry import registry
from posefit.settings import planned
from posefit_envs.fit import MAX_EVALUATIONS
from posefit_envs.instance import first_episode, world_of
from posefit_envs.policies import (
    Policy,
    gaussian_policy,
    random_search_policy,
    rollout,
    uniform_policy,
)
from posefit_reproduce.jobs import each
from table import WORKERS, earlier, kept, markdown

HELD_OUT = 10_000  # the first instance of the test split
INSTANCES, SEEDS, STEPS = 40, 5, 20_000
QUICK_INSTANCES, QUICK_SEEDS, QUICK_STEPS = 4, 2, 300
CURVE = 5  # looks at an agent while it learns
CURVE_INSTANCES = 16  # that each look takes, the first of those held out
STRONGEST, BEST_KNOWN_EVALUATIONS = "cma", 24_400  # the method and budget of the best known costs
UNTRAINED = 0  # steps of training of a reference


NAME = "posefit/FitState-v0"
LENGTH = MAX_EVALUATIONS - 1  # steps of an episode, whose first proposal is the middle of the box
REFERENCES = ("random search", "random actions", "gaussian", "sapso", "cma")  # not trained
LEARNERS = ("bandit", "cma over constants", "ppo", "sac")


class Training(NamedTuple):
    """One row: an agent, a seed of its training and evaluation, and its steps."""

    agent: str
    seed: int
    steps: int
    instances: int


WIDE = 0.5  # the first step size of CMA-ES, of a box from -1 to 1
EPISODES = 4  # that a setting of CMA-ES is tried in, the same instances for a whole generation
SETTING_NUMBERS = 2  # the last number of the first action and of the last, with those between on a line
CURIOSITY = 0.5  # of the bandit: how many deviations of rewards an arm that was never tried is worth

Look = Callable[[int, Policy], None]


def arms() -> list[Array]:
    """Return the settings that the bandit may choose from."""
    return [np.full(SETTING_NUMBERS, power) for power in np.linspace(-1.0, 1.0, 9)]


def setting_policy(setting: Array, rng: np.random.Generator, dimensions: int) -> Policy:
    """Return the policy of a setting: random targets, and the part of the way to them that it says."""

    def propose(_: Any, step: int) -> Array:
        power = setting[0] + (setting[1] - setting[0]) * step / LENGTH
        return np.append(rng.uniform(-1.0, 1.0, dimensions - 1), power)

    return propose


def bandit(env: Any, steps: int, seed: int, look: Look) -> Policy:
    """Return the best arm by UCB1 over the whole episodes that `steps` steps of a training environment are.

    `look` is called with the steps so far and the policy of then.
    """
    rng, choices = np.random.default_rng(seed), arms()
    d = env.action_space.shape[0]
    policies = [setting_policy(arm, rng, d) for arm in choices]
    shown = [setting_policy(arm, _apart(seed), d) for arm in choices]
    sums, squares, counts = np.zeros(len(choices)), np.zeros(len(choices)), np.zeros(len(choices))
    for episode in range(steps // LENGTH):
        tried = np.maximum(counts, 1.0)
        deviation = np.sqrt(max(squares.sum() / max(episode, 1) - (sums.sum() / max(episode, 1)) ** 2, 0.0))
        bonus = CURIOSITY * deviation * np.sqrt(2.0 * np.log(episode + 1.0) / tried)
        arm = int(np.where(counts > 0, sums / tried + bonus, np.inf).argmax())
        gain = rollout(env, policies[arm], int(rng.integers(HELD_OUT)), int(rng.integers(2**31)))["gain"]
        sums[arm], squares[arm], counts[arm] = sums[arm] + gain, squares[arm] + gain**2, counts[arm] + 1
        look((episode + 1) * LENGTH, shown[int(np.where(counts > 0, sums / tried, -np.inf).argmax())])
    return shown[int(np.where(counts > 0, sums / np.maximum(counts, 1.0), -np.inf).argmax())]


def _apart(seed: int) -> np.random.Generator:
    """Return a generator for looks at what was learned, so that looking changes nothing of the training."""
    return np.random.default_rng([seed, 2])


GENERATION = default_population_size(SETTING_NUMBERS) * EPISODES * LENGTH  # steps of one of CMA-ES over settings


def evolved(env: Any, steps: int, seed: int, look: Look) -> Policy:
    """Return the setting at the mean of CMA-ES after the whole generations that `steps` steps of an environment are.

    Without one it is the middle.
    """
    rng, other = np.random.default_rng(seed), _apart(seed)
    d, size = env.action_space.shape[0], SETTING_NUMBERS
    population = default_population_size(size)
    strategy = Strategy(np.zeros(size), np.full(size, WIDE), population)
    for number in range(1, steps // GENERATION + 1):
        settings = np.clip(strategy.sample(rng, population), -1.0, 1.0)
        numbers, seeds = rng.integers(HELD_OUT, size=EPISODES), rng.integers(2**31, size=EPISODES)
        costs = [
            -np.mean(
                [
                    rollout(env, setting_policy(setting, rng, d), int(number), int(one))["gain"]
                    for number, one in zip(numbers, seeds, strict=True)
                ]
            )
            for setting in settings
        ]
        strategy.learn(settings, np.array(costs))
        look(number * GENERATION, setting_policy(np.clip(strategy.mean, -1.0, 1.0), other, d))
    return setting_policy(np.clip(strategy.mean, -1.0, 1.0), other, d)


DISCOUNT = 0.99  # their default, stated
ROLLOUT = 2048  # steps that PPO takes before it learns of them; its default, stated


def check_learners() -> None:
    """Return nothing. Raises ImportError where Stable-Baselines3, which PPO and SAC need, is not there."""
    if find_spec("stable_baselines3") is None:
        raise ImportError("ppo and sac need Stable-Baselines3: pip install posefit[rl]")


def trained(agent: str, env: Any, steps: int, seed: int, look: Look) -> Policy:
    """Return the policy of "ppo" or "sac" after so many steps in an environment, of "ppo" in whole rollouts.

    Its actions are drawn, as its noise is what searches. `look` is called with the steps so far and the policy of then.
    """
    import torch
    from stable_baselines3 import PPO, SAC
    from stable_baselines3.common.callbacks import BaseCallback

    torch.set_num_threads(1)
    common: dict[str, Any] = {"policy": "MlpPolicy", "env": env, "seed": seed, "device": "cpu", "gamma": DISCOUNT}
    model = PPO(**common, n_steps=ROLLOUT) if agent == "ppo" else SAC(**common)

    def act(observation: Any, _: int) -> Array:
        chosen: Array = model.predict(observation, deterministic=False)[0]
        return chosen

    class Looking(BaseCallback):  # type: ignore[misc]
        def _on_step(self) -> bool:
            with torch.random.fork_rng(devices=()):  # looking changes nothing of the training
                look(self.num_timesteps, act)
            return True

    model.learn(steps, callback=Looking())
    return act


BEST = "best known"


def agents(instances: int, quick: bool, rows: str | None, workers: int | None) -> list[dict[str, Any]]:
    """Return the rows of all agents; those in the file `rows` are not measured again, and others are added to it."""
    check_learners()
    seeds, steps, instances = (QUICK_SEEDS, QUICK_STEPS, QUICK_INSTANCES) if quick else (SEEDS, STEPS, instances)
    turns = [Training(BEST, 0, UNTRAINED, instances)]
    for seed in range(seeds):
        turns += [Training(agent, seed, UNTRAINED, instances) for agent in REFERENCES]
        turns += [Training(agent, seed, steps, instances) for agent in LEARNERS]
    done = earlier(rows, turn_of)
    jobs = {turn: partial(agent_row, turn) for turn in turns if turn not in done}
    done |= each(jobs, workers, partial(kept, rows)) if jobs else {}
    return [done[turn] | {"taken": steps_taken(turn)} for turn in turns]


def agent_row(turn: Training) -> dict[str, Any]:
    """Return a row: the best costs that an agent reached on held-out instances, and what it learned on the way."""
    start = time.perf_counter()
    numbers = range(HELD_OUT, HELD_OUT + turn.instances)
    row: dict[str, Any] = turn._asdict() | {"curve": []}
    if turn.agent == BEST:
        row["costs"] = _searched(STRONGEST, BEST_KNOWN_EVALUATIONS, numbers, turn.seed)
    elif turn.agent in ("sapso", "cma"):
        row["costs"] = _searched(turn.agent, MAX_EVALUATIONS, numbers, turn.seed)
    else:
        row["costs"] = _costs(turn, _policy(turn, row["curve"]), numbers)
        if row["curve"]:
            last = [steps_taken(turn), row["costs"][:CURVE_INSTANCES]]
            row["curve"] = [look for look in row["curve"] if look[0] < last[0]] + [last]
    return row | {"minutes": round((time.perf_counter() - start) / 60.0, 2)}


def _policy(turn: Training, curve: list[Any]) -> Policy:
    env, rng = _made(), np.random.default_rng([turn.seed, 1])
    plain: dict[str, Callable[[], Policy]] = {
        "random search": lambda: random_search_policy(env, rng),
        "random actions": lambda: uniform_policy(env, rng),
        "gaussian": lambda: gaussian_policy(env, rng),
    }
    if turn.agent in plain:
        return plain[turn.agent]()
    numbers = range(HELD_OUT, HELD_OUT + min(turn.instances, CURVE_INSTANCES))

    def look(steps: int, policy: Policy) -> None:
        due = turn.steps * len(curve) // CURVE
        if steps >= due and len(curve) < CURVE:
            curve.append([steps, _costs(turn, policy, numbers)])

    if turn.agent in ("bandit", "cma over constants"):
        learn = bandit if turn.agent == "bandit" else evolved
        return learn(env, steps_taken(turn), turn.seed, look)
    return trained(turn.agent, env, turn.steps, turn.seed, look)


def steps_taken(turn: Training) -> int:
    """Return how many steps of training an agent takes of those asked for: whole episodes, generations or rollouts."""
    if turn.agent == "bandit":
        return max(1, turn.steps // LENGTH) * LENGTH
    if turn.agent == "cma over constants":
        return turn.steps // GENERATION * GENERATION
    if turn.agent == "ppo":
        return -(-turn.steps // ROLLOUT) * ROLLOUT
    return turn.steps


def _made() -> gym.Env[Any, Any]:
    return gym.make(NAME, errors=False)


def _costs(turn: Training, policy: Policy, numbers: range) -> list[float]:
    env = _made()
    return [rollout(env, policy, number, 1000 * turn.seed + number)["best_cost"] for number in numbers]


def _searched(optimiser: str, evaluations: int, numbers: range, seed: int) -> list[float]:
    """Return the costs that an optimiser of the library reaches on the same instances, by itself."""
    world, factory = world_of(), registry().optimiser(optimiser)
    costs = []
    for number in numbers:
        problem = first_episode(world, number, evaluations).problem
        searching = factory(problem.space, np.random.default_rng([seed, number]), **planned(factory, {}, evaluations))
        costs.append(minimise(problem.evaluate, searching, evaluations, budget_known=True).cost)
    return costs


def turn_of(row: Mapping[str, Any]) -> Training:
    """Return the training of a row."""
    return Training(*(row[name] for name in Training._fields))


Row = Mapping[str, Any]

RESAMPLES, LEVEL, RNG_STREAM = 2000, 0.95, 67
MIN_GAP = 0.1  # of a cost between random search and the best known: instances without it are left out


def agent_table(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return the scores of an environment's agents: 0 is random search on the instance, 1 the best known cost.

    The best known is the lowest cost in any row. A score is the mean over seeds and instances; its interval is a
    bootstrap of both. `steps` are those of training, `taken` of a row.
    """
    names = dict.fromkeys(row["agent"] for row in rows)
    costs = {name: np.array([row["costs"] for row in rows if row["agent"] == name]) for name in names}
    chance = costs["random search"].mean(axis=0)
    best = np.concatenate(list(costs.values())).min(axis=0)
    table = []
    for name, of_agent in costs.items():
        scores = normalised(of_agent, chance, best)
        low, high = score_interval(scores)
        own = [row for row in rows if row["agent"] == name]
        table.append(
            {
                "agent": name,
                "steps": own[0]["taken"],
                "seeds": len(of_agent),
                "cost": float(of_agent.mean()),
                "median_cost": float(np.median(of_agent)),
                "score": float(scores.mean()),
                "low": low,
                "high": high,
                "minutes": float(np.mean([row["minutes"] for row in own])),
                "curve": _curve([row["curve"] for row in own], chance, best),
            }
        )
    return sorted(table, key=lambda row: row["score"])


def normalised(costs: Array, chance: Array, best: Array) -> Array:
    """Return scores (seeds, instances) of costs: 0 is `chance` (instances,), 1 is `best`.

    Instances where both are nearly equal are left out. Raises ValueError where all are.
    """
    apart = chance - best >= MIN_GAP
    if not apart.any():
        raise InputError(f"best known must lie below random search, got none of {len(best)} instances that do")
    return ((chance - costs) / np.where(apart, chance - best, 1.0))[:, apart]


def score_interval(scores: Array) -> tuple[float, float]:
    """Return the ends of the 95 % interval of the mean of scores (seeds, instances), by a bootstrap of both."""
    rng = np.random.default_rng(RNG_STREAM)
    seeds, instances = scores.shape
    rows = rng.integers(seeds, size=(RESAMPLES, seeds))
    columns = rng.integers(instances, size=(RESAMPLES, instances))
    means = [scores[np.ix_(*drawn)].mean() for drawn in zip(rows, columns, strict=True)]
    low, high = np.quantile(means, [0.5 - LEVEL / 2.0, 0.5 + LEVEL / 2.0])
    return float(low), float(high)


def _curve(curves: Sequence[Any], chance: Array, best: Array) -> list[dict[str, float]]:
    """Return the score at each look of all seeds, with its interval."""
    points = []
    for looks in zip(*curves, strict=False):
        costs = np.array([costs for _, costs in looks])
        few = costs.shape[1]
        scores = normalised(costs, chance[:few], best[:few])
        low, high = score_interval(scores)
        steps = float(np.mean([steps for steps, _ in looks]))
        points.append({"steps": steps, "score": float(scores.mean()), "low": low, "high": high})
    return points


def agents_lines(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the printed table, and what each agent learns."""
    table = agent_table(rows)
    yield f"{NAME}, {MAX_EVALUATIONS} evaluations, {rows[0]['instances']} held-out instances"
    yield ""
    lines = []
    for row in table:
        interval = f"{row['low']:.3f} to {row['high']:.3f}"
        cells = [row["agent"], str(row["steps"]), str(row["seeds"]), f"{row['score']:.3f}", interval]
        cells += [f"{row['cost']:.2f}", f"{row['median_cost']:.2f}", f"{row['minutes']:.1f}"]
        lines.append(cells)
    heads = ["agent", "trained steps", "seeds", "score", "95 % interval", "mean cost", "median cost", "minutes"]
    yield from markdown(heads, lines)
    yield ""
    for row in table:
        if row["curve"]:
            looks = ", ".join(
                f"{look['steps']:.0f}: {look['score']:.2f} ({look['low']:.2f} to {look['high']:.2f})"
                for look in row["curve"]
            )
            yield f"{row['agent']} learns: {looks}"


@click.command(cls=Command, help=__doc__)
@click.option("--instances", type=click.IntRange(1, HELD_OUT), default=INSTANCES, show_default=True, help="Held out.")
@click.option("--quick", is_flag=True, help="Two trainings of 300 steps, four instances: a look, not a measurement.")
@click.option("--rows", metavar="FILE", help="A file for a row a line: the same command continues there.")
@WORKERS
def main(instances: int, quick: bool, rows: str | None, workers: int | None) -> None:
    for line in agents_lines(agents(instances, quick, rows, workers)):
        click.echo(line)


if __name__ == "__main__":
    main()
