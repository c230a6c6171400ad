"""The timings of the search loop.

All figures are from one run, so that their ratios can be compared between machines.
"""

import time
from collections.abc import Callable
from typing import Any, cast

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

from posefit.arrays import Array
from posefit.fitting.box import draw_population
from posefit.fitting.optimiser import Filter
from posefit.fitting.problem import Problem, minimise
from posefit.fitting.space import SearchSpace
from posefit.registry import Offer, registry
from posefit.settings import planned
from posefit.silhouette.sharing import cores
from posefit_reproduce.bench.kernel import (
    SIZE,
    bench_cost,
    fastest,
    opencv_costs,
    processor,
)

POSES = 1000  # in one call of a cost
# the population size and the budget of a search
PARTICLES = 40
EVALUATIONS = 2440
SEARCHES = 5  # searches by each optimiser; the fastest counts
SLOW_SECONDS = 3.0  # no further search of an optimiser begins after this time


def loop_figures(threads: int | None = None) -> dict[str, Any]:
    """Return the timings in microseconds, and the conditions of the run.

    The keys with `opencv` are for a cost function that is called for one pose at a
    time, the usual form. With `opencv_batched`, kinematics and outlines are
    computed for 200 poses at once, which is the fastest way to draw with OpenCV.

    Args:
        threads: The number of threads of `all_threads`; by default every core that this
            process may use.

    Returns:
        The figures by name.
    """
    many = threads or cores()
    alone = bench_cost()
    together = bench_cost(many)
    proposals = draw_population(alone.space, np.random.default_rng(0), POSES)
    few = proposals[: POSES // 5]

    def opencv_one_by_one() -> None:
        for pose in few:
            opencv_costs(alone, pose[None])

    jobs: dict[str, Callable[[], object]] = {
        "one": lambda: alone(proposals),
        "all": lambda: together(proposals),
        "population": lambda: alone(proposals[:PARTICLES]),
        "opencv": opencv_one_by_one,
        "opencv_batched": lambda: opencv_costs(alone, few),
    }
    opencv_threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        seconds = fastest(jobs)
    finally:
        cv2.setNumThreads(opencv_threads)
    return {
        "kernel_us_per_pose_1_thread": 1e6 * seconds["one"] / POSES,
        "kernel_us_per_pose_all_threads": 1e6 * seconds["all"] / POSES,
        "kernel_us_per_pose_in_populations": 1e6 * seconds["population"] / PARTICLES,
        "opencv_us_per_pose": 1e6 * seconds["opencv"] / len(few),
        "opencv_batched_us_per_pose": 1e6 * seconds["opencv_batched"] / len(few),
        "ask_and_tell_us_per_proposal": ask_and_tell(alone.space),
        "threads": many,
        "size": list(SIZE),
        "cpu": processor(),
    }


def ask_and_tell(space: SearchSpace) -> dict[str, float]:
    """Return the microseconds per proposal of each installed optimiser by itself.

    The cost function is trivial. Populations have `PARTICLES` members if their size can
    be set. The fastest of several searches counts, on one thread.
    """
    figures = {}
    # as in a track: for small matrices BLAS is slower with more threads
    with threadpool_limits(1):
        for name, offer in registry().offers["optimiser"].items():
            if offer.missing:
                continue
            ended = time.perf_counter() + SLOW_SECONDS
            seconds = [search_seconds(space, offer, 0)]
            while len(seconds) < SEARCHES and time.perf_counter() < ended:
                seconds.append(search_seconds(space, offer, len(seconds)))
            figures[name] = 1e6 * min(seconds)
    return figures


def search_seconds(space: SearchSpace, offer: Offer, seed: int) -> float:
    """Return the seconds per proposal of one search.

    For a filter, they are of ten frames, with the steps between them.
    """
    sizes = {}
    if any(setting.name == "population_size" for setting in offer.settings):
        sizes["population_size"] = PARTICLES
    carries = offer.next_frame == "carry"
    frames = 10 if carries else 1
    evaluations = EVALUATIONS // frames
    values = planned(offer.factory, sizes, evaluations)
    optimiser = offer.factory(space, np.random.default_rng(seed), **values)
    count = 0
    began = time.perf_counter()
    for _ in range(frames):
        problem = minimise(Problem(_cost, space, evaluations), optimiser)
        count += problem.evaluations
        if carries:
            cast(Filter, optimiser).advance(space)
    return (time.perf_counter() - began) / count


def _cost(proposals: Array) -> Array:
    return np.asarray(50.0 * (proposals**2).mean(axis=1))
