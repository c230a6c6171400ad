"""Steps of FitImage-v1 per second: the native vector, Gymnasium's Sync and Async.

    python docs/studies/stepping.py

The table has a line for each number of environments. Episodes have eight steps, and the
time includes their resets. All training instances were met before. The kinds take
turns, and the best turn counts. Seconds are CPU seconds, summed over processes, so that
other programs do not count.
"""

from collections.abc import Iterator
from time import process_time
from typing import Any

import click
import gymnasium as gym
import numpy as np
import psutil

from posefit.cli.output import Command
from posefit.motion.instances import TRAINING
from table import markdown

NAME = "posefit_envs:posefit/FitImage-v1"
COUNTS = (1, 64, 1024)
# calls and steps of each environment in a turn: two episodes, each with a reset; number
# of turns of each kind
CALLS = 18
STEPS = 16
TURNS = 5


def steps_per_second(kind: str, count: int) -> Iterator[float]:
    """Yield a vector environment's steps per second, turn by turn, with resets."""
    env: Any = gym.make_vec(
        NAME, count, None if kind == "native" else kind, errors=False
    )
    env.reset(seed=0)
    processes = [psutil.Process(worker.pid) for worker in getattr(env, "processes", [])]
    actions = (
        np.random.default_rng(0)
        .uniform(-1.0, 1.0, (CALLS, *env.action_space.shape))
        .astype(np.float32)
    )

    def seconds() -> float:
        return process_time() + sum(
            sum(process.cpu_times()[:2]) for process in processes
        )

    while True:
        start = seconds()
        repeats = max(1, 256 // count)
        for _ in range(repeats):
            for action in actions:
                env.step(action)
        yield repeats * STEPS * count / (seconds() - start)


@click.command(cls=Command, help=__doc__)
def main() -> None:
    met = gym.make_vec(NAME, 100, errors=False)
    for first in TRAINING[::100]:
        met.reset(options={"instance": list(range(first, first + 100))})
    lines = []
    for count in COUNTS:
        names = ("native", "sync", "async") if count == 1 else ("native", "sync")
        kinds = {name: steps_per_second(name, count) for name in names}
        turns = [
            {kind: next(rates) for kind, rates in kinds.items()} for _ in range(TURNS)
        ]
        best = {kind: f"{max(turn[kind] for turn in turns):,.0f}" for kind in kinds}
        lines.append(
            [
                f"{count:,}",
                *(best.get(kind, "") for kind in ("native", "sync", "async")),
            ]
        )
    for line in markdown(["environments", "native", "Sync", "Async"], lines, 0):
        click.echo(line)


if __name__ == "__main__":
    main()
