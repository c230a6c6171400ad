"""How fast is a GPU, and does it count the same? Beside all threads of the CPU, in the same run.

python docs/studies/gpu.py
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import click
import numpy as np

from posefit.cli.output import Command
from posefit.fitting.box import draw_population
from posefit.fitting.problem import PoseProblem
from posefit.geometry.camera import Camera
from posefit.silhouette.cost import areas, project
from posefit.silhouette.cuda.device import check_device, moved_to
from posefit.silhouette.mask import Silhouette
from posefit.sweep.pool import cores
from posefit_reproduce.bench.kernel import bench_problem, fastest, processor

SIZES = ((320, 240), (1280, 720))
POSES = (40, 4_000, 400_000)
DRAWN = 4_000  # to draw proposals that are poses takes long


def figures_of(sizes: Sequence[tuple[int, int]] = SIZES, poses: Sequence[int] = POSES) -> dict[str, Any]:
    """Return poses a second on a device and on the CPU, and whether both count the same.

    Of every size and number of poses: `cpu_per_second` on all threads; on the device `poses_per_second`, which come
    from the CPU, and `resident_per_second`, which are there already, areas copied back in both. `differing` are poses
    whose areas are not the CPU's, and `off_by` the most pixels of one.
    """
    check_device("cuda")
    cases = [_case(seen_at(bench_problem(cores()), size), count) for size in sizes for count in poses]
    return {"cases": cases, "gpu": _gpu(), "cpu": processor(), "threads": cores()}


def lines_of(figures: Mapping[str, Any]) -> Iterator[str]:
    """Yield `figures_of` as lines of text."""
    yield f"{figures['gpu']} beside {figures['threads']} threads of {figures['cpu']}"
    names = ("cpu", "poses", "resident")
    yield f"{'size':>10} {'poses':>8} " + " ".join(f"{name + ' /s':>13}" for name in names) + "  areas"
    for case in figures["cases"]:
        same = "equal" if not case["differing"] else f"{case['differing']} differ, by {case['off_by']} pixels at most"
        rates = " ".join(f"{case[f'{name}_per_second']:13,.0f}" for name in names)
        yield f"{case['size']:>10} {case['poses']:8,} {rates}  {same}"


def seen_at(problem: PoseProblem, size: tuple[int, int]) -> PoseProblem:
    """Return a problem of one view whose picture has another size (width, height) and as large a share of its rows."""
    usual = problem.cameras[0]
    camera = Camera(
        *size, usual.focal * size[1] / usual.height, np.array(size) / 2.0, usual.rotation, usual.translation
    )
    poses, translations = problem.decode(np.zeros((1, problem.space.dimensions)))
    observed = Silhouette.of(project(problem.body, camera, poses[0], translations[0]))
    return replace(problem, cameras=[camera], silhouettes=[observed])


def _case(problem: PoseProblem, count: int) -> dict[str, Any]:
    from numba import cuda

    from posefit.silhouette.cuda.areas import drawing_on_device, launched

    rng = np.random.default_rng(0)
    drawn = draw_population(problem.space, rng, min(count, DRAWN))
    poses, places = problem.decode(np.resize(drawn, (count, drawn.shape[1])) + rng.normal(0.0, 1e-3, (count, 1)))
    body, camera, observed = problem.body, problem.cameras[0], moved_to(problem.silhouettes[0], "cuda")
    drawing, moved = drawing_on_device(body, camera, observed), (cuda.to_device(poses), cuda.to_device(places))
    jobs: dict[str, Callable[[], Any]] = {
        "cpu": lambda: problem.cost_and_areas(poses, places)[1],
        "poses": lambda: areas(body, camera, observed, poses, places),
        "resident": lambda: launched(drawing, *moved).copy_to_host(),
    }
    seconds = fastest(jobs)
    away = np.abs(jobs["poses"]() - jobs["cpu"]()[0]).max(axis=1)
    return {
        "size": "x".join(map(str, observed.size)),
        "poses": count,
        **{f"{name}_per_second": count / took for name, took in seconds.items()},
        "differing": int(np.count_nonzero(away)),
        "off_by": int(away.max()),
    }


def _gpu() -> str:
    from numba import cuda

    name = cuda.get_current_device().name
    return name.decode() if isinstance(name, bytes) else str(name)


@click.command(cls=Command)
def main() -> None:
    """Time the GPU beside the CPU, and compare counts."""
    click.echo("\n".join(lines_of(figures_of())))


if __name__ == "__main__":
    main()
