"""What a pose costs as a function of the picture's size, the views, the dimensions and the population.

Each is the benchmark's problem with one number changed, on one thread, in microseconds a pose: the fastest run.
"""

from dataclasses import replace
from functools import partial

import click
import numpy as np

from posefit.fitting.box import draw_population
from posefit.fitting.problem import PoseProblem
from posefit.geometry.camera import Camera
from posefit.motion import built_in
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit.testing.problem import walking_angles
from posefit_priors.pca import PCA
from posefit_reproduce.bench.kernel import bench_problem, fastest

POSES = 400
WIDTHS, VIEWS = (80, 160, 320, 640, 1280), (1, 2, 4, 8)
COMPONENTS, POPULATIONS = (3, 6, 12, 24, 48), (1, 4, 10, 40, 400)


def viewed(problem: PoseProblem, width: int = 320, views: int = 1) -> PoseProblem:
    """Return the problem in pictures of another width, from several sides."""
    motion = built_in.motion("walk", frames=1, fps=30.0)
    joints = motion.skeleton.joints(motion.poses, motion.translations)[0]
    yaws = motion.poses[0, 0] + np.radians(45.0 + 360.0 / views * np.arange(views))
    radii, size = problem.body.joint_radii(), (width, 3 * width // 4)
    cameras = [Camera.framing(joints, radii, yaw, size) for yaw in yaws]
    masks = [project(problem.body, camera, motion.poses[0], motion.translations[0]) for camera in cameras]
    return PoseProblem(problem.body, cameras, [Silhouette.of(mask) for mask in masks], problem.space)


@click.command()
def main() -> None:
    """Print the four curves."""
    problem = bench_problem()
    priors = {m: PCA(components=m).fit(walking_angles()) for m in COMPONENTS}
    curves = {
        "width, pixels": {width: viewed(problem, width=width) for width in WIDTHS},
        "views": {views: viewed(problem, views=views) for views in VIEWS},
        "dimensions": {
            m + 3: replace(problem, space=replace(problem.space, prior=prior)) for m, prior in priors.items()
        },
        "population": dict.fromkeys(POPULATIONS, problem),
    }
    for name, problems in curves.items():
        counts = {x: x if name == "population" else POSES for x in problems}
        jobs = {
            str(x): partial(own.evaluate, draw_population(own.space, np.random.default_rng(0), counts[x]))
            for x, own in problems.items()
        }
        took = fastest(jobs)
        costs = {x: 1e6 * took[str(x)] / counts[x] for x in problems}
        click.echo(f"| {name} | " + " | ".join(f"{x}: {cost:.3g}" for x, cost in costs.items()) + " |")


if __name__ == "__main__":
    main()
