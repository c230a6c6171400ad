"""How the time of a pose grows: with the picture's size, poses in a call, views and dimensions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from posefit.fitting.box import draw_population
from posefit.fitting.problem import PoseProblem
from posefit.fitting.space import SearchSpace, Translation
from posefit.geometry.camera import Camera
from posefit.motion import built_in
from posefit.registry import registry
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit_experiments.bench.kernel import bench_problem
from posefit_experiments.bench.many import seen_at
from posefit_experiments.bench.timing import fastest

SIZES = ((80, 60), (160, 120), (320, 240), (640, 480), (1280, 720), (1920, 1080))
POSES = (1, 4, 16, 40, 160, 640, 2500, 10_000)
VIEWS = (1, 2, 3, 4, 6, 8)
# a prior with its settings, and where the translation comes from; the last is all that this skeleton can turn
SPACES: Sequence[tuple[str, dict[str, int], Translation]] = (
    ("pca", {}, "known"),
    ("pca", {"components": 16}, "known"),
    ("loose", {}, "known"),
    ("full", {}, "searched"),
)
USUAL = 100  # poses in a call, where something else grows


@dataclass(frozen=True)
class Growth:
    """One figure: what a pose takes on one thread, in microseconds, as something grows."""

    name: str  # of its file
    what: str  # grows
    at: Sequence[float]
    labels: Sequence[str]
    us: Sequence[float]
    logarithmic: bool  # whether the figure has decades abreast


def growths() -> list[Growth]:
    """Return how the time of a pose grows with the picture's size, poses in a call, views and dimensions.

    The problem is that of `posefit bench`, kinematics, prior and cost included; one thing at a time grows.
    """
    usual = bench_problem()
    sizes = [seen_at(usual, size) for size in SIZES]
    views = [_seen_from(usual, count) for count in VIEWS]
    spaces = [_searched_in(usual, *space) for space in SPACES]
    problems = {"size": sizes, "views": views, "dimensions": spaces}
    jobs: dict[str, Callable[[], object]]
    jobs = {f"{name} {k}": _job(one, USUAL) for name, some in problems.items() for k, one in enumerate(some)}
    jobs |= {f"poses {k}": _job(usual, count) for k, count in enumerate(POSES)}
    seconds = fastest(jobs)

    def grown(name: str, what: str, at: Sequence[int], labels: Sequence[str], logarithmic: bool = False) -> Growth:
        counts = at if name == "poses" else [USUAL] * len(at)
        us = [1e6 * seconds[f"{name} {k}"] / count for k, count in enumerate(counts)]
        return Growth(name, what, at, labels, us, logarithmic)

    dimensions = [one.space.dimensions for one in spaces]
    return [
        grown("size", "pixels of the picture", [w * h for w, h in SIZES], [f"{w} x {h}" for w, h in SIZES], True),
        grown("poses", "poses in a call", POSES, [f"{count:,}" for count in POSES], True),
        grown("views", "views", VIEWS, [str(count) for count in VIEWS]),
        grown("dimensions", "dimensions", dimensions, [str(count) for count in dimensions]),
    ]


def growth_table(found: Sequence[Growth]) -> str:
    """Return a line for each point of each figure."""
    lines = [f"{'grows':24} {'to':>12} {'us a pose':>10}"]
    lines += [
        f"{one.what:24} {label:>12} {us:10.3f}" for one in found for label, us in zip(one.labels, one.us, strict=True)
    ]
    return "\n".join(lines)


def draw_growths(found: Sequence[Growth], folder: Path) -> list[Path]:
    """Write growth-size.png, growth-poses.png, ... to a folder, and return their paths."""
    from matplotlib.figure import Figure

    paths = []
    for one in found:
        figure = Figure(figsize=(4.6, 3.0), layout="constrained")
        axes = figure.subplots()
        axes.plot(one.at, one.us, marker="o", markersize=4, linewidth=1.2)
        axes.set(xscale="log" if one.logarithmic else "linear", ylim=(0.0, 1.1 * max(one.us)))
        axes.set_xticks(list(one.at), labels=[label.replace(" x ", "\nx ") for label in one.labels], fontsize=7)
        axes.minorticks_off()
        axes.set(xlabel=one.what, ylabel="µs a pose")
        axes.grid(alpha=0.3)
        paths.append(folder / f"growth-{one.name}.png")
        figure.savefig(paths[-1], dpi=110)
    return paths


def _job(problem: PoseProblem, count: int) -> Callable[[], object]:
    proposals = draw_population(problem.space, np.random.default_rng(0), count)
    return lambda: problem.evaluate(proposals)


def _seen_from(problem: PoseProblem, count: int) -> PoseProblem:
    """Return the problem with so many views, evenly all around."""
    pose, place = (rows[0] for rows in problem.decode(np.zeros((1, problem.space.dimensions))))
    body, size = problem.body, problem.silhouettes[0].size
    joints, turns = body.skeleton.joints(pose, place), np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    cameras = [Camera.framing(joints, body.joint_radii(), pose[0] + 0.8 + turn, size) for turn in turns]
    seen = [Silhouette.of(project(body, camera, pose, place)) for camera in cameras]
    return replace(problem, cameras=cameras, silhouettes=seen)


def _searched_in(problem: PoseProblem, name: str, settings: dict[str, int], translation: Translation) -> PoseProblem:
    """Return the problem with another prior."""
    styles = [built_in.motion(style, frames=60, fps=30.0) for style in built_in.other_styles("walk")]
    angles = np.concatenate([style.poses[:, 3:] for style in styles])
    prior = registry().prior(name)(**settings).fit(angles, problem.body.skeleton)
    usual = problem.space
    space = SearchSpace(prior, usual.root_centre, usual.root_range, usual.anchor, translation)
    return replace(problem, space=space)
