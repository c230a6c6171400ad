"""How fast is the loop? All figures from one run, so that their ratios hold on any machine."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import cv2
import numpy as np

from posefit.fitting.box import draw_population
from posefit.fitting.optimiser import minimise
from posefit.fitting.problem import PoseProblem
from posefit.geometry.camera import Camera
from posefit.silhouette.cost import areas, project
from posefit.silhouette.mask import Silhouette
from posefit.sweep.pool import cores
from posefit_reproduce.bench.environments import vector_env
from posefit_reproduce.bench.kernel import SIZE, bench_problem, fastest, opencv_costs, processor
from posefit_reproduce.bench.optimisers import OURS, PARTICLES, optimiser_us, wide_space
from posefit_swarm.sapso import SAPSO

FEW, MANY = 40, 4000  # poses in a call
LARGE = (1280, 960)  # beside the usual size
NAMES = {1: "full", 2: "half", 4: "quarter"}


def seen_at(problem: PoseProblem, size: tuple[int, int]) -> PoseProblem:
    """Return a problem of one view whose picture has another size (width, height) and as large a share of its rows."""
    usual = problem.cameras[0]
    camera = Camera(
        *size, usual.focal * size[1] / usual.height, np.array(size) / 2.0, usual.rotation, usual.translation
    )
    poses, translations = problem.decode(np.zeros((1, problem.space.dimensions)))
    observed = Silhouette.of(project(problem.body, camera, poses[0], translations[0]))
    return replace(problem, cameras=[camera], silhouettes=[observed])


def many_figures() -> dict[str, float]:
    """Return microseconds a pose on one thread: in calls of 40 and 4,000, at every size."""
    problem = bench_problem()
    body, camera, rng = problem.body, problem.cameras[0], np.random.default_rng(0)
    proposals = draw_population(problem.space, rng, MANY)
    poses, places = problem.decode(proposals)
    few = proposals[:FEW].copy(), poses[:FEW].copy(), places[:FEW].copy()
    observed = problem.silhouettes[0]
    jobs: dict[str, tuple[Callable[[], object], int]] = {
        f"evaluate_{FEW}": (lambda: problem.evaluate(few[0]), FEW),
        f"evaluate_{MANY}": (lambda: problem.evaluate(proposals), MANY),
        f"areas_{FEW}": (lambda: areas(body, camera, observed, few[1], few[2]), FEW),
        f"areas_{MANY}": (lambda: areas(body, camera, observed, poses, places), MANY),
    }
    for one in (problem, seen_at(problem, LARGE)):
        size = "x".join(str(side) for side in one.silhouettes[0].size)
        for factor, name in NAMES.items():
            jobs[f"{size}_{name}"] = partial(one.coarser(factor).evaluate, proposals[:400]), 400
    seconds = fastest({name: job for name, (job, _) in jobs.items()})
    return {name: 1e6 * seconds[name] / poses for name, (_, poses) in jobs.items()}


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
        minimise(alone.evaluate, optimiser, PARTICLES * (ITERATIONS + 1), budget_known=True)

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
