"""Baseline agents are trained and evaluated: `posefit reproduce agents`, a row an agent and seed, kept as they come."""

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np

import posefit_envs  # noqa: F401, registers the environments
from agents.constants import bandit, evolved, generation
from agents.design import (
    BEST_KNOWN_EVALUATIONS,
    CURVE,
    CURVE_INSTANCES,
    HELD_OUT,
    QUICK_INSTANCES,
    QUICK_STEPS,
    STRONGEST,
    TASKS,
    Training,
    agent_turns,
    check_design,
)
from agents.learners import ROLLOUT, check_learners, trained
from agents.tables import agent_tables
from posefit import minimise
from posefit.registry import registry
from posefit.settings import planned
from posefit_envs.instance import instance, select
from posefit_envs.policies import (
    Policy,
    constant_policy,
    gaussian_policy,
    played,
    random_search_policy,
    sapso_policy,
    uniform_policy,
)
from posefit_reproduce.grid import Progress, each, earlier, kept

BEST = "best known"
FIGURES = ("costs", "curve", "minutes")  # of a row, beside what was asked for
SAMPLED = ("fit",)  # tasks in which a learner's actions are drawn, as its noise is what searches


def agents(
    environments: tuple[str, ...],
    names: tuple[str, ...],
    seeds: int,
    steps: int,
    instances: int,
    quick: bool,
    rows: str | None,
    workers: int | None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return the table of agents: normalised scores on held-out instances, with intervals, and learning curves.

    `rows` is a file for a row a line as they come; what it holds already is not measured again. Raises ValueError where
    something asked for is not there.
    """
    asked = tuple(dict.fromkeys(environments)) or tuple(TASKS)
    check_design(asked, names, {"seeds": seeds, "steps": steps, "instances": instances})
    if quick:
        seeds, steps, instances = min(seeds, 2), QUICK_STEPS, QUICK_INSTANCES
    turns = agent_turns(asked, names, seeds, steps, instances)
    check_learners({turn.agent for turn in turns})
    turns += [Training(name, BEST, 0, 0, instances) for name in asked]
    done = earlier(rows, (*Training._fields, *FIGURES), turn_of)
    jobs = {turn: partial(agent_row, turn) for turn in turns if turn not in done}
    done |= each(jobs, workers, partial(kept, rows, progress)) if jobs else {}
    found = [done[turn] | {"taken": steps_taken(turn)} for turn in turns]
    return {"seeds": seeds, "steps": steps, "instances": instances, "rows": found} | agent_tables(found)


def agent_row(turn: Training) -> dict[str, Any]:
    """Return a row: the best costs that an agent reached on held-out instances, and what it learned on the way."""
    began = time.perf_counter()
    numbers = range(HELD_OUT, HELD_OUT + turn.instances)
    row: dict[str, Any] = turn._asdict() | {"curve": []}
    evaluations = TASKS[turn.task].evaluations
    if turn.agent == BEST:
        row["costs"] = _searched(STRONGEST, BEST_KNOWN_EVALUATIONS, numbers, turn.seed)
    elif turn.agent in ("random search", "sapso", "cma") and not _is_policy(turn):
        row["costs"] = _searched(turn.agent.split()[0], evaluations, numbers, turn.seed)
    else:
        row["costs"] = _costs(turn, _policy(turn, row["curve"]), numbers)
        if row["curve"]:
            last = [steps_taken(turn), row["costs"][:CURVE_INSTANCES]]
            row["curve"] = [look for look in row["curve"] if look[0] < last[0]] + [last]
    return row | {"minutes": round((time.perf_counter() - began) / 60.0, 2)}


def _is_policy(turn: Training) -> bool:
    return (turn.task, turn.agent) in {("fit", "random search"), ("configure", "sapso")}


def _policy(turn: Training, curve: list[Any]) -> Policy:
    env, rng = _made(turn.task), np.random.default_rng([turn.seed, 1])
    plain: dict[str, Callable[[], Policy]] = {
        "random search": lambda: random_search_policy(env, rng),
        "random actions": lambda: uniform_policy(env, rng),
        "middle": lambda: constant_policy(np.zeros(env.action_space.shape or ())),
        "sapso": sapso_policy,
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
        return learn(turn.task, env, TASKS[turn.task].length, steps_taken(turn), turn.seed, look)
    return trained(turn.agent, env, turn.steps, turn.seed, turn.task not in SAMPLED, look)


def steps_taken(turn: Training) -> int:
    """Return how many steps of training an agent takes of those asked for: whole episodes, generations or rollouts."""
    length = TASKS[turn.task].length
    if turn.agent == "bandit":
        return max(1, turn.steps // length) * length
    if turn.agent == "cma over constants":
        whole = generation(turn.task, length)
        return turn.steps // whole * whole
    if turn.agent == "ppo":
        return -(-turn.steps // ROLLOUT) * ROLLOUT
    return turn.steps


def _made(task: str) -> gym.Env[Any, Any]:
    more: dict[str, Any] = {"max_evaluations": TASKS[task].evaluations} if task == "fit" else {}
    return gym.make(TASKS[task].name, errors=False, **more)


def _costs(turn: Training, policy: Policy, numbers: range) -> list[float]:
    env = _made(turn.task)
    return [played(env, policy, number, 1000 * turn.seed + number)["best_cost"] for number in numbers]


def _searched(optimiser: str, evaluations: int, numbers: range, seed: int) -> list[float]:
    """Return the costs that an optimiser of the library reaches on the same instances, by itself."""
    world, factory = select().world, registry().optimiser(optimiser)
    found = []
    for number in numbers:
        made = instance(world, number, 1, evaluations)
        space = made.space(world.learned)
        searching = factory(space, np.random.default_rng([seed, number]), **planned(factory, {}, evaluations))
        problem = made.scenery(0).problem(space)
        found.append(minimise(problem.evaluate, searching, evaluations, told=True).cost)
    return found


def turn_of(row: Mapping[str, Any]) -> Training:
    """Return whose row it is. Raises ValueError where its figures are none, or not as many as it has instances."""
    turn = Training(*(row[name] for name in Training._fields))
    looks = min(turn.instances, CURVE_INSTANCES)
    counts = [((), row["minutes"]), ((turn.instances,), row["costs"])]
    counts += [count for steps, costs in row["curve"] for count in (((), steps), ((looks,), costs))]
    for shape, numbers in counts:
        array = np.array(numbers)
        if array.shape != shape or array.dtype.kind not in "if":
            raise ValueError(f"figures must be numbers of shape {shape}")
    return turn
