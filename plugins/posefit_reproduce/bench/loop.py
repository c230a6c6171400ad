"""How fast is the loop? All figures from one run, so that their ratios hold on any machine."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, cast

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

from posefit.arrays import Array
from posefit.fitting.box import draw_population
from posefit.fitting.optimiser import Filter, minimise, populations
from posefit.fitting.problem import PoseProblem
from posefit.fitting.space import SearchSpace
from posefit.registry import Offer, registry
from posefit.settings import planned
from posefit.sweep.pool import cores
from posefit_reproduce.bench.kernel import SIZE, bench_problem, fastest, opencv_costs, processor
from posefit_swarm.sapso import SAPSO

POSES = 1000  # in a call
PARTICLES, ITERATIONS = 40, 60
EVALUATIONS = PARTICLES * (ITERATIONS + 1)
SEEDS = 8  # a frame's time is the mean over so many
ENVIRONMENTS = 40
ENDLESS: dict[str, dict[str, Any]] = {
    "FitImage-v0": {"max_evaluations": 10**9},
    "Race-v0": {"generations": (10**9, 10**9)},
}
SEARCHES = 5  # of each optimiser, of which the fastest counts
SLOW_SECONDS = 3.0  # after which an optimiser begins no other search


def loop_figures(threads: int | None = None) -> dict[str, Any]:
    """Return the timings; `all_threads` are `threads`, by default every core that this process may use.

    `opencv` is a cost function called for one pose at a time, as it is usually written; `opencv_batched` has its
    kinematics and outlines computed for 200 poses at once, the fastest way that still draws with OpenCV.
    """
    many = threads or cores()
    alone, together = bench_problem(), bench_problem(many)
    proposals = draw_population(alone.space, np.random.default_rng(0), POSES)
    few = proposals[: POSES // 5]

    steps = {f"{name} {kind}": _step(name, kind) for name in ENDLESS for kind in ("native", "sync")}
    jobs: dict[str, Callable[[], object]] = {
        "one": lambda: alone.evaluate(proposals),
        "all": lambda: together.evaluate(proposals),
        "population": lambda: alone.evaluate(proposals[:PARTICLES]),
        "opencv": lambda: [opencv_costs(alone, few[i : i + 1]) for i in range(len(few))],
        "opencv_batched": lambda: opencv_costs(alone, few),
        **{f"frame {seed}": partial(_search_frame, alone, seed) for seed in range(SEEDS)},
        **{name: step for name, (step, _) in steps.items()},
    }
    with _single_threaded_opencv():
        seconds = fastest(jobs)
    pose_seconds = seconds["one"] / POSES
    frame_seconds = float(np.mean([seconds[f"frame {seed}"] for seed in range(SEEDS)]))
    difference = np.abs(alone.evaluate(proposals) - opencv_costs(alone, proposals))
    return {
        "kernel_us_per_pose_1_thread": 1e6 * pose_seconds,
        "kernel_us_per_pose_all_threads": 1e6 * seconds["all"] / POSES,
        "kernel_us_per_pose_in_populations": 1e6 * seconds["population"] / PARTICLES,
        "opencv_us_per_pose": 1e6 * seconds["opencv"] / len(few),
        "opencv_batched_us_per_pose": 1e6 * seconds["opencv_batched"] / len(few),
        "sapso_frame_ms": 1e3 * frame_seconds,
        "sapso_overhead": frame_seconds / (EVALUATIONS * pose_seconds),
        "mean_cost_difference_to_opencv": float(difference.mean()),
        "environments_us_per_proposal": {name: 1e6 * seconds[name] / count for name, (_, count) in steps.items()},
        "ask_and_tell_us_per_proposal": ask_and_tell(alone.space),
        "threads": many,
        "size": list(SIZE),
        "cpu": processor(),
    }


def _search_frame(problem: PoseProblem, seed: int) -> None:
    optimiser = SAPSO(problem.space, np.random.default_rng(seed), population_size=PARTICLES, iterations=ITERATIONS)
    minimise(problem.evaluate, optimiser, EVALUATIONS, budget_known=True)


@contextmanager
def _single_threaded_opencv() -> Iterator[None]:
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)


def _step(name: str, kind: str) -> tuple[Callable[[], object], int]:
    """Return a step of 40 environments, ours natively or Gymnasium's one by one, and how many proposals it takes."""
    import gymnasium

    native: Any = gymnasium.make_vec(f"posefit_envs:posefit/{name}", ENVIRONMENTS, **ENDLESS[name])
    proposals = ENVIRONMENTS * int(getattr(native.unwrapped, "population_size", 1))
    if kind == "native":
        env = native
    else:
        env = gymnasium.make_vec(f"posefit_envs:posefit/{name}", ENVIRONMENTS, kind, **ENDLESS[name])
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)
    return partial(env.step, actions), proposals


def ask_and_tell(space: SearchSpace) -> dict[str, float]:
    """Return the microseconds that each installed optimiser takes a proposal, with costs that take no time to speak of.

    Populations are of 40 where their size can be set. The best of several searches, on one thread.
    """
    figures = {}
    with threadpool_limits(1):  # as a track has it: BLAS is slower with more threads where matrices are small
        for name, offer in registry().offers["optimiser"].items():
            if not offer.missing:
                ended, seconds = time.perf_counter() + SLOW_SECONDS, [search_seconds(space, offer, 0)]
                while len(seconds) < SEARCHES and time.perf_counter() < ended:
                    seconds.append(search_seconds(space, offer, len(seconds)))
                figures[name] = 1e6 * min(seconds)
    return figures


def search_seconds(space: SearchSpace, offer: Offer, seed: int) -> float:
    """Return the seconds of a search, a proposal; of a filter, those of ten frames with the steps between them."""
    sizes = {setting.name: PARTICLES for setting in offer.settings if setting.name == "population_size"}
    carries = offer.next_frame == "carry"
    evaluations = EVALUATIONS // 10 if carries else EVALUATIONS
    optimiser = offer.factory(space, np.random.default_rng(seed), **planned(offer.factory, sizes, evaluations))
    count, began = 0, time.perf_counter()
    for _ in range(10 if carries else 1):
        count += sum(len(proposals) for proposals, _ in populations(optimiser, _cost, evaluations))
        if carries:
            cast(Filter, optimiser).advance(space)
    return (time.perf_counter() - began) / count


def _cost(proposals: Array) -> Array:
    return np.asarray(50.0 * (proposals**2).mean(axis=1))
