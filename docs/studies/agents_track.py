"""Track-v1: PPO with its last proposals stacked, compared with blind searches.

    python docs/studies/agents_track.py

Costs are those of committed poses, averaged over the frames of held-out tracks. A
search has the environment's box and prediction, and the stated number of evaluations
per frame. Its committed pose moves the next frame's box.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from time import process_time
from typing import Any

import click
import gymnasium as gym
import numpy as np
from gymnasium.wrappers.vector import ResizeObservation

from agents import (
    ENVIRONMENTS,
    HELD_OUT,
    SEARCHES,
    SHOWN,
    check_learners,
    minimum,
    ppo,
)
from posefit.arrays import Array
from posefit.cli.output import Command
from posefit_envs import to_sb3_vec_env
from posefit_envs.fit import MAX_EVALUATIONS
from posefit_envs.track import FRAMES
from posefit_reproduce.jobs import each
from table import WORKERS, bar, drawn_means, markdown, quantiles

NAME = "posefit_envs:posefit/Track-v1"
# the people of the test are those of training, as when its page was measured
PEOPLE: dict[str, Any] = {"held_out_people": False}
STACKED = 4  # number of latest pictures that the agent sees
BUDGETS = (8, 40, 100, 200)  # evaluations per frame of blind searches
STEPS = 270_000
SEEDS = 2
INSTANCES = 100
TESTED = list(range(HELD_OUT, HELD_OUT + INSTANCES))
SHOWN_FRAMES = {
    "of first frames": slice(1),
    "of the fourth to sixth": slice(3, 6),
    "of last ones": slice(-1, None),
}
DIMENSIONS = 9  # coordinates of a proposal


def stacked(count: int, split: str) -> tuple[Any, Any]:
    """Return a vector environment for Stable-Baselines3, and one that stacks it.

    There are eight proposals per frame.
    """
    from stable_baselines3.common.vec_env import VecFrameStack

    env = gym.make_vec(
        NAME, count, evaluations_per_frame=MAX_EVALUATIONS, split=split, **PEOPLE
    )
    vector = to_sb3_vec_env(ResizeObservation(env, SHOWN))
    return vector, VecFrameStack(vector, STACKED)


def committed(act: Callable[[Any], Array]) -> Array:
    """Return the costs (n, frames) that a policy commits in the held-out tracks."""
    vector, env = stacked(INSTANCES, "test")
    vector.set_options({"instance": TESTED})
    pictures = env.reset()
    costs = []
    for step in range(1, FRAMES * MAX_EVALUATIONS + 1):
        pictures, _, _, infos = env.step(act(pictures))
        if step % MAX_EVALUATIONS == 0:
            costs.append([info["committed_cost"] for info in infos])
    return np.array(costs).T


def trained(seed: int) -> Callable[[Any], Array]:
    """Return the policy of a training, the mean of its distribution."""
    model = ppo(stacked(ENVIRONMENTS, "train")[1], seed)
    model.learn(STEPS)
    return lambda pictures: np.asarray(model.predict(pictures, deterministic=True)[0])


def searched(name: str, budget: int) -> Array:
    """Return the costs (n, frames) that an optimiser commits in the held-out tracks."""
    env: Any = gym.make_vec(
        NAME, INSTANCES, evaluations_per_frame=2, split="test", **PEOPLE
    )
    env.reset(options={"instance": TESTED})
    costs = []
    for frame in range(FRAMES):
        best = [
            minimum(problem, problem.space, name, budget, [frame, number]).best
            for number, problem in enumerate(env.unwrapped.problems)
        ]
        for _ in range(2):  # a frame needs at least two proposals to commit one
            infos = env.step(np.array(best))[-1]
        costs.append(infos["committed_cost"])
    return np.array(costs).T


def row_of(agent: str, budget: int, seed: int) -> dict[str, Any]:
    """Return the costs (n, frames) that an agent or a search commits.

    The CPU seconds are those of the training or the search.
    """
    start = process_time()
    if agent in SEARCHES:
        return {"costs": searched(agent, budget), "cpu_seconds": process_time() - start}
    rng = np.random.default_rng(seed)

    def uniform(_: Any) -> Array:
        return rng.uniform(-1.0, 1.0, (INSTANCES, DIMENSIONS))

    policy = trained(seed) if agent == "PPO" else uniform
    cpu = process_time() - start
    return {"costs": committed(policy), "cpu_seconds": cpu}


def table(done: Mapping[tuple[str, int, int], Mapping[str, Any]]) -> Iterator[str]:
    """Yield the table of rows under their agents, evaluations and seeds."""
    groups: dict[tuple[str, int], list[Mapping[str, Any]]] = {}
    for (agent, budget, _), row in done.items():
        groups.setdefault((agent, budget), []).append(row)
    cells = []
    for (agent, budget), group in groups.items():
        cpu = f"{np.mean([row['cpu_seconds'] for row in group]):.0f}"
        training = (
            [f"{STEPS:,}", cpu, str(len(group))] if agent == "PPO" else ["", "", ""]
        )
        costs = np.array([row["costs"] for row in group])  # (seeds, n, frames)
        low, high = quantiles(drawn_means(costs.mean(axis=2)))
        shown = [f"{costs[..., frames].mean():.1f}" for frames in SHOWN_FRAMES.values()]
        cells.append(
            [
                agent,
                f"{budget:,}",
                *training,
                f"{costs.mean():.1f}",
                f"{low:.1f} to {high:.1f}",
                *shown,
            ]
        )
    heads = [
        "",
        "evaluations a frame",
        "steps",
        "CPU s",
        "seeds",
        "cost",
        "95 % interval",
        *SHOWN_FRAMES,
    ]
    yield from markdown(heads, cells)


@click.command(cls=Command, help=__doc__)
@WORKERS
def main(workers: int | None) -> None:
    check_learners()
    turns = [("uniform", MAX_EVALUATIONS, 0)]
    turns += [(name, budget, 0) for name in SEARCHES for budget in BUDGETS]
    turns += [("PPO", MAX_EVALUATIONS, seed) for seed in range(SEEDS)]
    jobs = {turn: partial(row_of, *turn) for turn in turns}
    done = each(jobs, workers, bar)
    for line in table({turn: done[turn] for turn in turns}):
        click.echo(line)


if __name__ == "__main__":
    main()
