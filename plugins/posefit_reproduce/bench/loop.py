"""How fast is the loop? All figures from one run, so that their ratios hold on any machine."""

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
from posefit.sweep.pool import cores
from posefit_reproduce.bench.kernel import (
    SIZE,
    bench_cost,
    fastest,
    opencv_costs,
    processor,
)

POSES = 1000  # in a call
# of a search
PARTICLES = 40
EVALUATIONS = 2440
SEARCHES = 5  # of each optimiser, of which the fastest counts
SLOW_SECONDS = 3.0  # after which an optimiser begins no other search


def loop_figures(threads: int | None = None) -> dict[str, Any]:
    """Return the timings; `all_threads` are `threads`, by default every core that this process may use.

    `opencv` is a cost function called for one pose at a time, as it is usually written; `opencv_batched` has its
    kinematics and outlines computed for 200 poses at once, the fastest way that still draws with OpenCV.
    """
    many = threads or cores()
    alone = bench_cost()
    together = bench_cost(many)
    proposals = draw_population(alone.space, np.random.default_rng(0), POSES)
    few = proposals[: POSES // 5]
    jobs: dict[str, Callable[[], object]] = {
        "one": lambda: alone(proposals),
        "all": lambda: together(proposals),
        "population": lambda: alone(proposals[:PARTICLES]),
        "opencv": lambda: [
            opencv_costs(alone, few[i : i + 1]) for i in range(len(few))
        ],
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
    """Return the microseconds that each installed optimiser takes a proposal, with costs that take no time to speak of.

    Populations are of 40 where their size can be set. The best of several searches, on one thread.
    """
    figures = {}
    # as a track has it: BLAS is slower with more threads where matrices are small
    with threadpool_limits(1):
        for name, offer in registry().offers["optimiser"].items():
            if not offer.missing:
                ended = time.perf_counter() + SLOW_SECONDS
                seconds = [search_seconds(space, offer, 0)]
                while len(seconds) < SEARCHES and time.perf_counter() < ended:
                    seconds.append(search_seconds(space, offer, len(seconds)))
                figures[name] = 1e6 * min(seconds)
    return figures


def search_seconds(space: SearchSpace, offer: Offer, seed: int) -> float:
    """Return the seconds of a search, a proposal; of a filter, those of ten frames with the steps between them."""
    sizes = {
        setting.name: PARTICLES
        for setting in offer.settings
        if setting.name == "population_size"
    }
    carries = offer.next_frame == "carry"
    evaluations = EVALUATIONS // 10 if carries else EVALUATIONS
    optimiser = offer.factory(
        space, np.random.default_rng(seed), **planned(offer.factory, sizes, evaluations)
    )
    count = 0
    began = time.perf_counter()
    for _ in range(10 if carries else 1):
        problem = minimise(Problem(_cost, space, evaluations), optimiser)
        count += problem.evaluations
        if carries:
            cast(Filter, optimiser).advance(space)
    return (time.perf_counter() - began) / count


def _cost(proposals: Array) -> Array:
    return np.asarray(50.0 * (proposals**2).mean(axis=1))
