"""Do shares of targets depend on which instances are taken, and does a tensor cost more than an array of NumPy?

    python docs/studies/suite_claims.py

Shares are of one search of 100 evaluations for each dimension, in 9 dimensions, on three disjoint ranges of held-out
instances; their 95 % intervals are those that other instances would give. Times of 100,000 points are the shortest CPU
time of several, an array and a tensor of PyTorch by turns; without PyTorch there are none.
"""

import time
from importlib.util import find_spec
from itertools import product
from typing import Any

import click
import numpy as np

from posefit.arrays.exchange import exchanged
from posefit.statistics.means import mean_interval
from posefit.statistics.profiles import hits
from posefit.suites.functions import FUNCTIONS, HELD_OUT, SUITE
from posefit.suites.problem import suite
from posefit.suites.running import run_on
from table import markdown

METHODS, RANGES = ("cma", "pso"), [HELD_OUT[k : k + 15] for k in (0, 15, 30)]
POINTS, ROUNDS = 100_000, 7


def share_text(function: int, method: str, instances: range) -> str:
    """Return the share of targets that a method reaches on some instances, with its interval, in percent."""
    runs = [run_on(suite(SUITE, function, instance), method) for instance in instances]
    shares = [float(np.isfinite(hits((run.evaluations, run.costs), run.targets)).mean()) for run in runs]
    mean = mean_interval(shares, np.zeros(len(shares)), np.arange(len(shares)))
    return f"{100.0 * mean.value:.0f} ({100.0 * mean.low:.0f} to {100.0 * mean.high:.0f})"


def seconds(points: Any) -> float:
    """Return the CPU seconds that costs of points (n, d) take."""
    problem = suite()
    began = time.process_time()
    problem.evaluate(points)
    return time.process_time() - began


@click.command(help=__doc__)
def main() -> None:
    heads = [f"{one[0]} to {one[-1]}" for one in RANGES]
    numbers = [one.number for one in FUNCTIONS if one.noisy or not one.exact]
    rows = [
        [str(n), method, *(share_text(n, method, one) for one in RANGES)] for n, method in product(numbers, METHODS)
    ]
    click.echo("\n".join(markdown(["function", "method", *heads], rows, 2)))
    if not find_spec("torch"):
        return
    import torch

    points = np.random.default_rng(0).uniform(-1.0, 1.0, (POINTS, 9))
    tensor = torch.from_numpy(points)
    assert exchanged("points", tensor)[0].ctypes.data == tensor.data_ptr()
    seconds(points)
    times = np.array([[seconds(points), seconds(tensor)] for _ in range(ROUNDS)]).min(axis=0)
    click.echo(f"\n{POINTS} points: array {times[0]:.3f} s, tensor {times[1]:.3f} s, {times[1] / times[0]:.3f} times")


if __name__ == "__main__":
    main()
