"""Make posefit/suites/methods.zip, the runs of posefit's own methods that every leaderboard shows.

    python docs/studies/make_bundles.py posefit/suites/methods.zip

That is one search of 100 evaluations for each dimension by each of six methods, on each function of the latest suite in
its lowest dimension, on the fifteen first held-out instances. It takes about a minute on two cores.

So that the file is small, a run keeps the improvements that reach another target, and its last one; and each point is
rounded to as few binary digits as leave its cost what it was, to the last bit. Shares of targets, running times and
costs are those of the whole run. The file has another digest where another processor decides a search otherwise.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from posefit.files import check_free
from posefit.suites.bundles import write_bundle
from posefit.suites.functions import FUNCTIONS, HELD_OUT, SUITE
from posefit.suites.problem import Problem, suite
from posefit.suites.running import SuiteRun, run_on

METHODS = ("random", "sapso", "pso", "cma", "annealed", "scipy")
INSTANCES = HELD_OUT[:15]
DIGITS = 2.0 ** np.arange(4, 53)[:, None]  # of a rounded coordinate, the fewest first


def compact(run: SuiteRun, problem: Problem) -> SuiteRun:
    """Return a run with fewer improvements and shorter points, which scores as before."""
    costs, points = run.costs[: len(run.points)], run.points
    first = np.searchsorted(-costs, -run.targets[run.targets >= costs[-1]])  # the improvement that reaches each target
    chosen = np.unique([*first, len(points) - 1])
    ends = [] if run.evaluations[-1] == run.evaluations[chosen[-1]] else [len(run.costs) - 1]
    return replace(
        run,
        points=np.array([rounded(problem, points[k], costs[k]) for k in chosen]),
        evaluations=run.evaluations[[*chosen, *ends]],
        costs=run.costs[[*chosen, *ends]],
    )


def rounded(problem: Problem, point: np.ndarray, cost: float) -> np.ndarray:
    """Return the point of the fewest digits, near to another one, that has its cost."""
    near = np.concatenate([np.rint(point * DIGITS) / DIGITS, point[None]])
    return near[problem.space.feasible(near) & (problem.noise_free(near) == cost)][0]


def searched(address: tuple[str, int, int, int]) -> SuiteRun:
    method, function, instance, dimension = address
    run = run_on(suite(SUITE, function, instance, dimension), method)
    return compact(run, suite(SUITE, function, instance, dimension))


def main(path: str) -> None:
    check_free(path)
    problems = [(one.number, instance, one.dimensions[0]) for one, instance in product(FUNCTIONS, INSTANCES)]
    with ProcessPoolExecutor() as pool:
        runs = list(pool.map(searched, [(method, *problem) for problem, method in product(problems, METHODS)]))
    digest = write_bundle(runs, path)
    print(f"{path}: {len(runs)} runs, {Path(path).stat().st_size:,} bytes, digest {digest}")


if __name__ == "__main__":
    main(*sys.argv[1:])
