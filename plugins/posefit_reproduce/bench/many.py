"""How long a pose takes among thousands, as limbs, and at half and quarter size."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from posefit.fitting.box import draw_population
from posefit.fitting.problem import PoseProblem
from posefit.geometry.camera import Camera
from posefit.geometry.limbs import LIMBS
from posefit.silhouette.cost import areas, project
from posefit.silhouette.limbs import LimbMasks, LimbPoses, every_combination
from posefit.silhouette.mask import Silhouette
from posefit_reproduce.bench.kernel import bench_problem
from posefit_reproduce.bench.timing import fastest

FEW, MANY = 40, 4000  # poses in a call
CANDIDATES = 6  # of each of five limbs: 7,776 combinations
LARGE = (1280, 960)  # beside the usual size
NAMES = {1: "full", 2: "half", 4: "quarter"}


def seen_at(problem: PoseProblem, size: tuple[int, int]) -> PoseProblem:
    """Return a problem of one view whose picture has another size (width, height) and as large a share of its rows."""
    usual = problem.cameras[0]
    camera = Camera(
        *size, usual.focal * size[1] / usual.height, np.array(size) / 2.0, usual.rotation, usual.translation
    )
    poses, translations = problem.decode(np.zeros((1, problem.space.dimensions)))
    seen = Silhouette.of(project(problem.body, camera, poses[0], translations[0]))
    return replace(problem, cameras=[camera], silhouettes=[seen])


def many_figures() -> dict[str, float]:
    """Return microseconds a pose on one thread: in calls of 40 and 4,000, as limbs, at every size.

    `limb_combination` are all combinations of six candidates for each of five limbs, drawing them included;
    `limb_combination_any_order` are 1,000 of them at random, drawn before.
    """
    problem = bench_problem()
    body, camera, rng = problem.body, problem.cameras[0], np.random.default_rng(0)
    proposals = draw_population(problem.space, rng, MANY)
    poses, places = problem.decode(proposals)
    few = proposals[:FEW].copy(), poses[:FEW].copy(), places[:FEW].copy()
    seen = problem.silhouettes[0]
    limbs = LimbPoses(poses[0], [poses[1 + k * CANDIDATES : 1 + (k + 1) * CANDIDATES] for k in range(len(LIMBS))])
    every = every_combination(limbs.counts)
    mixed = rng.permutation(every)[:1000]
    masks = LimbMasks.draw(body, camera, limbs, places[0])
    jobs: dict[str, tuple[Callable[[], object], int]] = {
        f"evaluate_{FEW}": (lambda: problem.evaluate(few[0]), FEW),
        f"evaluate_{MANY}": (lambda: problem.evaluate(proposals), MANY),
        f"areas_{FEW}": (lambda: areas(body, camera, seen, few[1], few[2]), FEW),
        f"areas_{MANY}": (lambda: areas(body, camera, seen, poses, places), MANY),
        "limb_combination": (
            lambda: LimbMasks.draw(body, camera, limbs, places[0]).areas(seen, every),
            len(every),
        ),
        "limb_combination_any_order": (lambda: masks.areas(seen, mixed), len(mixed)),
    }
    for one in (problem, seen_at(problem, LARGE)):
        size = "x".join(str(side) for side in one.silhouettes[0].size)
        for factor, name in NAMES.items():
            jobs[f"{size}_{name}"] = partial(one.coarser(factor).evaluate, proposals[:400]), 400
    seconds = fastest({name: job for name, (job, _) in jobs.items()})
    return {name: 1e6 * seconds[name] / poses for name, (_, poses) in jobs.items()}
