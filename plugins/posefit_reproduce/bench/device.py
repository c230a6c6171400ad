"""How fast is a GPU, and does it count the same? Beside the CPU in the same run: `posefit bench --device cuda`."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import draw_population
from posefit.fitting.optimiser import minimise
from posefit.fitting.problem import PoseProblem
from posefit.silhouette.cost import areas
from posefit.silhouette.cuda.device import check_device, moved_to
from posefit.sweep.pool import cores
from posefit_reproduce.bench.experiment import seen_at
from posefit_reproduce.bench.kernel import bench_problem, fastest, processor
from posefit_swarm.sapso import SAPSO

SIZES = ((320, 240), (1280, 720))
POSES = (40, 4_000, 400_000)
FRAME = (10_000, 9)  # particles and iterations: 100,000 evaluations with the first population
DRAWN = 4_000  # to draw proposals that are poses takes long


def device_figures(
    device: str, sizes: Sequence[tuple[int, int]] = SIZES, poses: Sequence[int] = POSES, frame: tuple[int, int] = FRAME
) -> dict[str, Any]:
    """Return poses a second on a device and on the CPU, whether both count the same, a large frame, and memory.

    Of every size and number of poses: `cpu_per_second` on all threads; on the device `proposals_per_second`, decoded
    there; `poses_per_second`, which come from the CPU; and `resident_per_second`, which are there already, areas copied
    back in all of them. `differing` are poses whose areas are not the CPU's, and `off_by` the most pixels of one.
    """
    check_device(device)
    cases = [_case(seen_at(bench_problem(cores()), size), device, count) for size in sizes for count in poses]
    return {
        "cases": cases,
        "frame": _frame(bench_problem(cores()), device, *frame),
        **_memory(),
        "cpu": processor(),
        "threads": cores(),
    }


def device_lines(figures: Mapping[str, Any]) -> Iterator[str]:
    """Yield `device_figures` as lines of text."""
    yield f"{figures['gpu']} beside {figures['threads']} threads of {figures['cpu']}"
    names = ("cpu", "proposals", "poses", "resident")
    yield f"{'size':>10} {'poses':>8} " + " ".join(f"{name + ' /s':>13}" for name in names) + "  areas"
    for case in figures["cases"]:
        same = "equal" if not case["differing"] else f"{case['differing']} differ, by {case['off_by']} pixels at most"
        rates = " ".join(f"{case[f'{name}_per_second']:13,.0f}" for name in names)
        yield f"{case['size']:>10} {case['poses']:8,} {rates}  {same}"
    frame = figures["frame"]
    yield f"a frame of {frame['evaluations']:,} evaluations: {frame['ms']:.1f} ms, {frame['cpu_ms']:.1f} ms on the CPU"
    yield f"memory of the GPU in use: {figures['megabytes_held']:,.0f} MB"


def _case(problem: PoseProblem, device: str, count: int) -> dict[str, Any]:
    from numba import cuda

    from posefit.silhouette.cuda.areas import drawing_on_device, launched

    proposals = _proposals(problem, count)
    poses, places = problem.decode(proposals)
    there = _on(problem, device)
    body, camera, observed = there.body, there.cameras[0], there.silhouettes[0]
    drawing = drawing_on_device(body, camera, observed)
    moved = cuda.to_device(poses), cuda.to_device(places)
    jobs: dict[str, Callable[[], Any]] = {
        "cpu": lambda: problem.cost_and_areas(poses, places)[1],
        "proposals": lambda: there.evaluate(proposals),
        "poses": lambda: areas(body, camera, observed, poses, places),
        "resident": lambda: launched(drawing, *moved).copy_to_host(),
    }
    seconds = fastest(jobs)
    away = np.abs(jobs["poses"]() - jobs["cpu"]()[0]).max(axis=1)
    return {
        "size": "x".join(map(str, observed.size)),
        "poses": count,
        **{f"{name}_per_second": count / took for name, took in seconds.items()},
        "equal": not away.any(),
        "differing": int(np.count_nonzero(away)),
        "off_by": int(away.max()),
        "proposals_differing": int(np.count_nonzero(jobs["proposals"]() - problem.evaluate(proposals))),
    }


def _proposals(problem: PoseProblem, count: int) -> Array:
    """Return so many proposals (count, d) that are poses, or nearly so."""
    rng = np.random.default_rng(0)
    drawn = draw_population(problem.space, rng, min(count, DRAWN))
    return np.ascontiguousarray(np.resize(drawn, (count, drawn.shape[1])) + rng.normal(0.0, 1e-3, (count, 1)))


def _on(problem: PoseProblem, device: str) -> PoseProblem:
    return replace(problem, silhouettes=[moved_to(one, device) for one in problem.silhouettes])


def _frame(problem: PoseProblem, device: str, particles: int, iterations: int) -> dict[str, Any]:
    """Return the milliseconds of a search of one frame by SAPSO, and the CPU's time of the same."""
    there = _on(problem, device)

    def search(where: PoseProblem) -> float:
        optimiser = SAPSO(where.space, np.random.default_rng(0), population_size=particles, iterations=iterations)
        return minimise(where.evaluate, optimiser, particles * (iterations + 1), budget_known=True).cost

    seconds = fastest({"device": lambda: search(there), "cpu": lambda: search(problem)})
    return {
        "evaluations": particles * (iterations + 1),
        "ms": 1e3 * seconds["device"],
        "cpu_ms": 1e3 * seconds["cpu"],
        "cost": search(there),
        "cpu_cost": search(problem),
    }


def _memory() -> dict[str, Any]:
    from numba import cuda

    free, total = cuda.current_context().get_memory_info()
    name = cuda.get_current_device().name
    return {"megabytes_held": (total - free) / 1e6, "gpu": name.decode() if isinstance(name, bytes) else str(name)}
