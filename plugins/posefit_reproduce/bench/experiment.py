"""How fast is the loop? All figures from one run, so that their ratios hold on any machine."""

from collections.abc import Callable
from functools import partial
from typing import Any

import cv2
import numpy as np

from posefit.fitting.box import draw_population
from posefit.fitting.optimiser import minimise
from posefit.sweep.command import cores
from posefit_reproduce.bench.environments import vector_env
from posefit_reproduce.bench.kernel import SIZE, bench_problem, opencv_costs
from posefit_reproduce.bench.many import many_figures
from posefit_reproduce.bench.optimisers import OURS, PARTICLES, optimiser_us, wide_space
from posefit_reproduce.bench.processor import processor
from posefit_reproduce.bench.timing import fastest
from posefit_swarm.sapso import SAPSO

POSES = 1000
ITERATIONS = 60
SEEDS = 8  # a frame's time is the mean over so many


def loop_figures(threads: int | None = None) -> dict[str, Any]:
    """Return the timings; `threads` is how many "all" are, by default every core this process may use.

    `opencv` is a cost function called for one pose at a time, as it is usually written; `opencv_batched` has its
    kinematics and outlines computed for 200 poses at once, the fastest way that still draws with OpenCV.
    """
    many = threads or cores()
    alone, together = bench_problem(), bench_problem(many)
    rng = np.random.default_rng(0)
    proposals = draw_population(alone.space, rng, POSES)
    few = proposals[: POSES // 5]

    def frame(seed: int) -> None:
        optimiser = SAPSO(alone.space, np.random.default_rng(seed), population_size=PARTICLES, iterations=ITERATIONS)
        minimise(alone.evaluate, optimiser, PARTICLES * (ITERATIONS + 1), told=True)

    jobs: dict[str, Callable[[], object]] = {
        "one": lambda: alone.evaluate(proposals),
        "all": lambda: together.evaluate(proposals),
        "opencv": lambda: [opencv_costs(alone, few[i : i + 1]) for i in range(len(few))],
        "opencv_batched": lambda: opencv_costs(alone, few),
        **{f"frame {seed}": partial(frame, seed) for seed in range(SEEDS)},
    }
    cv2_threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        seconds = fastest(jobs)
    finally:
        cv2.setNumThreads(cv2_threads)
    difference = np.abs(alone.evaluate(proposals) - opencv_costs(alone, proposals))
    one = seconds["one"] / POSES
    whole = float(np.mean([seconds[f"frame {seed}"] for seed in range(SEEDS)]))
    return {
        "kernel_us_per_pose_1_thread": 1e6 * one,
        "kernel_us_per_pose_all_threads": 1e6 * seconds["all"] / POSES,
        "opencv_us_per_pose": 1e6 * seconds["opencv"] / len(few),
        "opencv_batched_us_per_pose": 1e6 * seconds["opencv_batched"] / len(few),
        "sapso_frame_ms": 1e3 * whole,
        "sapso_overhead": whole / (PARTICLES * (ITERATIONS + 1) * one),
        "kernel_speedup": seconds["opencv"] / len(few) / one,
        "kernel_speedup_over_batched": seconds["opencv_batched"] / len(few) / one,
        "threads": many,
        "threads_speedup": seconds["one"] / seconds["all"],
        "poses_per_second_1_thread": 1.0 / one,
        "mean_cost_difference_to_opencv": float(difference.mean()),
        "vector_env": {
            case: {name: round(value, 3) for name, value in one.items()} for case, one in vector_env(many).items()
        },
        "many": {name: round(us, 3) for name, us in many_figures().items()},
        "optimisers": {name: round(us, 3) for name, us in optimiser_us(alone.space).items()},
        "optimisers_28": {name: round(us, 3) for name, us in optimiser_us(wide_space(alone.space), OURS).items()},
        "size": list(SIZE),
        "cpu": processor(),
        "poses": POSES,
    }
