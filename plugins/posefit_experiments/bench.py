"""How fast is the loop? All figures from one run, so that their ratios hold on any machine."""

import os
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.fitting.optimiser import minimise
from posefit.fitting.problem import PoseProblem
from posefit.fitting.space import SearchSpace
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import PARENTS
from posefit.motion import library
from posefit.registry import Offer, registry
from posefit.settings import planned
from posefit.silhouette.cost import mismatch, project
from posefit.silhouette.mask import Silhouette

SIZE = (320, 240)
POSES = 1000
PARTICLES, ITERATIONS = 40, 60
SEEDS = 8  # a frame's time is the mean over so many
ROUNDS = 12  # of all jobs in turn; of each, the fastest run counts
POPULATIONS, SEARCHES = 30, 10  # of each optimiser
PATIENCE = 3.0  # seconds for one optimiser; a slow one has fewer searches
TURN = 0.05  # seconds; a job runs again until its turn is over


def problem(threads: int = 1) -> PoseProblem:
    """Return the benchmark's problem: one frame of the built-in walk that fills a 320 x 240 image, a PCA prior."""
    motion = library.built_in("walk", frames=1, fps=30.0)
    body = Body.of(motion.skeleton)
    styles = [library.built_in(name, frames=60, fps=30.0) for name in library.other_styles("walk")]
    prior = registry().prior("pca")().fit(np.concatenate([style.poses[:, 3:] for style in styles]))
    joints = motion.skeleton.joints(motion.poses, motion.translations)[0]
    camera = Camera.framing(joints, body.joint_radii(), motion.poses[0, 0] + np.radians(45.0), SIZE)
    space = SearchSpace(
        prior, np.array([motion.poses[0, 0], 0.0, 0.0]), np.radians([45.0, 15.0, 15.0]), motion.translations[0]
    )
    silhouette = Silhouette.of(project(body, camera, motion.poses[0], motion.translations[0]))
    return PoseProblem(body, [camera], [silhouette], space, threads=threads)


def opencv_costs(problem: PoseProblem, proposals: Array) -> Array:
    """Return the costs (n,) of proposals the usual way: OpenCV draws every cone into a byte image and counts it.

    Kinematics, prior and outlines are computed for all n poses at once in NumPy; drawing is two circles and a
    quadrilateral a bone, at 1/16 pixel.
    """
    body, camera, silhouette = problem.body, problem.cameras[0], problem.silhouettes[0]
    poses, translations = problem.decode(proposals)
    pixels, depths = camera.project(body.skeleton.joints(poses, translations))
    scale = np.sqrt(camera.focal.prod()) / depths
    parents = np.array(PARENTS[1:])
    first, second = pixels[:, parents], pixels[:, 1:]
    radius0, radius1 = scale[:, parents] * body.radii[:, 0], scale[:, 1:] * body.radii[:, 1]
    axis = second - first
    square = (axis**2).sum(axis=-1)
    along = ((radius0 - radius1) / square)[..., None]
    across = (np.sqrt(np.maximum(square - (radius0 - radius1) ** 2, 0.0)) / square)[..., None]
    normal = np.stack([-axis[..., 1], axis[..., 0]], axis=-1)
    up, down = along * axis + across * normal, along * axis - across * normal
    r0, r1 = radius0[..., None], radius1[..., None]
    corners = np.stack([first + r0 * up, second + r1 * up, second + r1 * down, first + r0 * down], axis=2)
    corners = np.rint((corners - 0.5) * 16).astype(np.int32)
    a, b = (np.rint((points - 0.5) * 16).astype(int).tolist() for points in (first, second))
    r, s = (np.rint(radii * 16).astype(int).tolist() for radii in (radius0, radius1))
    observed = silhouette.mask.view(np.uint8)
    total = cv2.countNonZero(observed)
    image = np.zeros_like(observed)
    areas = np.empty((len(proposals), 3), dtype=np.int64)
    for i in range(len(proposals)):
        image[:] = 0
        for j in range(len(parents)):
            cv2.fillConvexPoly(image, corners[i, j], 1, cv2.LINE_8, 4)
            cv2.circle(image, a[i][j], r[i][j], 1, -1, cv2.LINE_8, 4)
            cv2.circle(image, b[i][j], s[i][j], 1, -1, cv2.LINE_8, 4)
        overlap = cv2.countNonZero(cv2.bitwise_and(image, observed))
        areas[i] = total - overlap, cv2.countNonZero(image) - overlap, overlap
    return mismatch(areas)


def optimiser_us(space: SearchSpace) -> dict[str, float]:
    """Return what ask and tell take a proposal, in microseconds, of each optimiser that is installed.

    Populations of 40 (for `scipy:dual_annealing` 1), as the cost a distance that takes no time to speak of; of a
    filter, with the step to the next frame. The best of several searches, on one thread.
    """
    found = registry().offers["optimiser"]
    names = [name for name, offer in found.items() if not offer.missing] + ["scipy:dual_annealing"]
    return {name: 1e6 * _ask_and_tell(space, registry().offer("optimiser", name)) for name in names}


def _ask_and_tell(space: SearchSpace, offer: Offer) -> float:
    known = {setting.name for setting in offer.settings}
    populations = POPULATIONS if "layers" not in known else POPULATIONS // 10
    sizes: dict[str, Any] = {name: PARTICLES for name in ("particles", "population") if name in known}
    budget = PARTICLES * (10 if "layers" in known else 1 if offer.next_frame == "carry" else POPULATIONS + 1)
    fastest = np.inf
    began = time.perf_counter()
    for seed in range(SEARCHES):
        optimiser = offer.factory(space, np.random.default_rng(seed), **planned(offer.factory, sizes, budget))
        spent, count = 0.0, 0
        for _ in range(populations):
            spent -= time.perf_counter()
            while len(proposals := optimiser.ask()):
                spent += time.perf_counter()
                costs = 50.0 * (proposals**2).mean(axis=1)
                count += len(proposals)
                spent -= time.perf_counter()
                optimiser.tell(proposals, costs)
                if offer.next_frame != "carry":
                    break
            if offer.next_frame == "carry":
                optimiser.advance(space)
            spent += time.perf_counter()
        fastest = min(fastest, spent / max(count, 1))
        if time.perf_counter() - began > PATIENCE:
            break
    return float(fastest)


def vector_env() -> dict[str, float]:
    """Return what a step of 40 environments takes a proposal, in microseconds: natively, and one by one.

    `kernel_us` is the cost of the same proposals through the library. The environments are found by name, as by users.
    """
    import gymnasium

    arguments: dict[str, Any] = {"instance": 3, "max_evaluations": 10**9, "target_cost": -1.0}
    name = "posefit_envs:posefit/Fit-v0"
    native: Any = gymnasium.make_vec(name, PARTICLES, **arguments)
    single: Any = gymnasium.make_vec(name, PARTICLES, "sync", **arguments)
    for env in (native, single):
        env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, native.action_space.shape).astype(np.float32)
    problem = native.unwrapped.problems[0]
    proposals = actions.astype(np.float64)
    jobs: dict[str, Callable[[], object]] = {
        "kernel": lambda: problem.evaluate(proposals),
        "native": lambda: native.step(actions),
        "sync": lambda: single.step(actions),
    }
    us = {name: 1e6 * seconds / PARTICLES for name, seconds in _fastest(jobs).items()}
    native.close()
    single.close()
    return {
        "kernel_us": us["kernel"],
        "us_per_proposal": us["native"],
        "overhead_us": us["native"] - us["kernel"],
        "sync_us_per_proposal": us["sync"],
        "times_sync": us["sync"] / us["native"],
    }


def _fastest(jobs: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Return the fastest run of each job in seconds; they take turns, so that a slow moment falls on all."""
    seconds = dict.fromkeys(jobs, np.inf)
    for job in jobs.values():
        job()
    for _ in range(ROUNDS):
        for name, job in jobs.items():
            until = time.perf_counter() + TURN
            while (began := time.perf_counter()) < until:
                job()
                seconds[name] = min(seconds[name], time.perf_counter() - began)
    return seconds


def bench(threads: int | None = None) -> dict[str, Any]:
    """Return the timings; `threads` is how many "all" are, by default every core this process may use.

    `opencv` is a cost function called for one pose at a time, as it is usually written; `opencv_batched` has its
    kinematics and outlines computed for 200 poses at once, the fastest way that still draws with OpenCV.
    """
    many = threads or (len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1)
    alone, together = problem(), problem(many)
    rng = np.random.default_rng(0)
    proposals = alone.space.draw(rng, POSES)
    few = proposals[: POSES // 5]
    factory = registry().optimiser("sapso")

    def frame(seed: int) -> None:
        optimiser = factory(alone.space, np.random.default_rng(seed), particles=PARTICLES, iterations=ITERATIONS)
        minimise(alone.evaluate, optimiser, PARTICLES * (ITERATIONS + 1))

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
        seconds = _fastest(jobs)
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
        "vector_env": {name: round(value, 3) for name, value in vector_env().items()},
        "optimisers": {name: round(us, 3) for name, us in optimiser_us(alone.space).items()},
        "size": list(SIZE),
        "poses": POSES,
    }
