"""How long the same work takes in two checkouts, in turns, in one run: `before_after.py BEFORE [AFTER]`.

Each round is a fresh process of each checkout, one after the other. A figure is the fastest of several runs in CPU
time, on one thread, and the median over the rounds, so that others on the machine count for little. `OpenCV` is the
cost as it is usually written; two threads are compared with one by the clock. Commands are run once each, with a
compilation cache that is empty and then with what they have left in it; their CPU time is that of all their processes.
The stages of a pose are the last checkout's.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

import click

PLACES = ("", "plugins", "envs")
FIRST_PICTURE = "from posefit_reproduce.bench.kernel import bench_problem; bench_problem()"


def fastest_of(
    jobs: dict[str, Callable[[], object]], seconds: float, clock: Callable[[], float] = process_time
) -> dict[str, float]:
    """Return the fastest run of each job in CPU seconds, all in turns for so many seconds each."""
    best, used = {}, {}
    for name, job in jobs.items():
        job()
        best[name], used[name] = float("inf"), 0.0
    while min(used.values()) < seconds:
        for name in (name for name in jobs if used[name] < seconds):
            began = clock()
            jobs[name]()
            took = clock() - began
            best[name], used[name] = min(best[name], took), used[name] + took
    return best


def measured() -> dict[str, float]:
    """Return the figures of the checkout that this process imports."""
    import numpy as np

    import posefit
    from posefit.fitting.box import draw_population
    from posefit.fitting.cma import CMAES
    from posefit.fitting.optimiser import minimise
    from posefit.silhouette.cost import areas
    from posefit_reproduce.bench.environments import CASES, _pair, _steps
    from posefit_reproduce.bench.kernel import bench_problem, opencv_costs
    from posefit_swarm.pso import PSO
    from posefit_swarm.sapso import SAPSO

    problem, particles, moves = bench_problem(), 40, 60
    space, evaluations = problem.space, particles * (moves + 1)
    proposals = draw_population(space, np.random.default_rng(0), 4000)
    some = {n: proposals[:n].copy() for n in (1, 40, 200, 1000, 4000)}
    poses, places = problem.decode(some[200])
    view = problem.body, problem.cameras[0], problem.silhouettes[0]
    jobs: dict[str, Callable[[], object]] = {f"evaluate {n}": partial(problem.evaluate, some[n]) for n in some}
    jobs |= {
        "decode": partial(problem.decode, some[200]),
        "joints": partial(problem.body.skeleton.joints, poses, places),
        "areas": partial(areas, *view, poses, places),
        "OpenCV": lambda: [opencv_costs(problem, some[40][i : i + 1]) for i in range(40)],
        "OpenCV batched": partial(opencv_costs, problem, some[200]),
    }
    sizes = {f"evaluate {n}": n for n in some} | {"OpenCV": 40} | dict.fromkeys(("decode", "joints", "areas"), 200)
    figures = {f"{name}, us": 1e6 * took / sizes.get(name, 200) for name, took in fastest_of(jobs, 0.3).items()}

    threads = {k: partial(replace(problem, threads=k).evaluate, some[4000]) for k in (1, 2)}
    by_clock = fastest_of({str(k): job for k, job in threads.items()}, 3.0, perf_counter)
    figures["two threads, times one"] = by_clock["1"] / by_clock["2"]

    def frame(make: Callable[..., object], seed: int) -> None:
        minimise(problem.evaluate, make(space, np.random.default_rng(seed)), evaluations, budget_known=True)

    searches = {
        "sapso": partial(SAPSO, population_size=particles, iterations=moves),
        "pso": partial(PSO, population_size=particles, iterations=moves),
        "cma": partial(CMAES, population_size=particles),
    }
    took = fastest_of(
        {f"{name} {k}": partial(frame, make, k) for name, make in searches.items() for k in range(4)}, 0.4
    )
    least = min(figures[f"evaluate {n}, us"] for n in (200, 1000, 4000))
    for name in searches:
        whole = sum(took[f"{name} {k}"] for k in range(4)) / 4
        figures[f"{name} frame, ms"] = 1e3 * whole
        figures[f"{name} overhead"] = 1e6 * whole / evaluations / least
    for name in ("fit_each", "race_each", "configure_each"):
        envs = _pair(*CASES[name])
        native = envs["native"].unwrapped
        count = 40 * int(getattr(native, "population_size", 1)) * int(getattr(native, "every", 1))
        took = fastest_of({kind: _steps(env, 1) for kind, env in envs.items()}, 0.5)
        figures |= {f"{name} {kind}, us": 1e6 * took[kind] / count for kind in took}
        figures[f"{name} over Sync"] = took["sync"] / took["native"]
    for method in ("sapso", "cma", "exemplars"):
        tracks = [posefit.track("walk", method=method, frames=(0, 20)) for _ in range(3)]
        figures[f"track, a frame of {method}, ms"] = 1e3 * min(each.summary["cpu_seconds_per_frame"] for each in tracks)
    return figures


def stages() -> dict[str, float]:
    """Return the nanoseconds of a pose by stage, of this checkout."""
    import numpy as np

    from posefit.arrays import jit
    from posefit.fitting.box import draw_population
    from posefit.geometry.kernels import LANES, Chain, kinematics
    from posefit.silhouette.cost import areas, view_of
    from posefit.silhouette.rasteriser import fill_pose, outline_poses, scratch, set_scene, strips_and_words
    from posefit_reproduce.bench.kernel import bench_problem

    @jit
    def drawn(address, chain, radii, view, strips, words, poses, places, filling):  # type: ignore[no-untyped-def]
        work, rows = scratch(strips, words), np.empty(LANES, np.int64)
        set_scene(work, 0, LANES, chain.offsets, radii, view)
        for first in range(0, len(poses), LANES):
            for lane in range(LANES):
                rows[lane] = first + lane
            outline_poses(address, chain, poses, places, rows, view.width, view.height, work)
            for lane in range(LANES if filling else 0):
                fill_pose(lane, work)

    problem = bench_problem()
    proposals = draw_population(problem.space, np.random.default_rng(0), 200)
    poses, places = problem.decode(proposals)
    camera, chain = problem.cameras[0], Chain(*problem.body.skeleton.chain)
    size = strips_and_words(camera.width, camera.height)
    scene = kinematics(), chain, problem.body.radii, view_of(camera), *size, poses, places
    jobs = {
        "decoding": partial(problem.decode, proposals),
        "joints": partial(problem.body.skeleton.joints, poses, places),
        "outlines": partial(drawn, *scene, False),
        "filling": partial(drawn, *scene, True),
        "counting": partial(areas, problem.body, camera, problem.silhouettes[0], poses, places),
        "all": partial(problem.evaluate, proposals),
    }
    took = {name: 5e6 * seconds for name, seconds in fastest_of(jobs, 0.3).items()}
    for later, earlier in (("counting", "filling"), ("filling", "outlines"), ("outlines", "joints")):
        took[later] -= took[earlier]
    return took


def ran(checkout: Path, what: str, **variables: str) -> str:
    """Return the output of a fresh process of a checkout."""
    path = os.pathsep.join(str(checkout / place) for place in PLACES)
    environment = {**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"} | variables
    environment |= {"PYTHONDONTWRITEBYTECODE": ""}  # modules are read from bytecode, as installed ones are
    command = [sys.executable, "-W", "ignore", *(["-c", what] if " " in what else [__file__, "--child", what])]
    return subprocess.run(command, env=environment, cwd=checkout, capture_output=True, text=True, check=True).stdout


def cpu_seconds(checkout: Path, arguments: list[str], cache: str) -> float:
    """Return the CPU seconds of a command line of posefit with all its processes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    code = f"import sys; sys.argv[1:] = {arguments}; from posefit.cli import run; run()"
    ran(checkout, code, NUMBA_CACHE_DIR=cache)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def started(checkout: Path) -> dict[str, float]:
    """Return the CPU seconds of an import, and of a first picture with a warm and with a cold cache."""
    clock = "import time; began = time.process_time(); {}; print(time.process_time() - began)"
    with tempfile.TemporaryDirectory() as cold:
        picture = clock.format(FIRST_PICTURE)
        return {
            "import posefit, ms": 1e3 * float(ran(checkout, clock.format("import posefit"))),
            "first picture, cold, s": float(ran(checkout, picture, NUMBA_CACHE_DIR=cold)),
            "first picture, warm, s": float(ran(checkout, picture, NUMBA_CACHE_DIR=cold)),
        } | commands(checkout)


def commands(checkout: Path) -> dict[str, float]:
    """Return the CPU seconds of the commands that a user begins with, with a cold and with a warm cache."""
    figures = {}
    with tempfile.TemporaryDirectory() as folder:
        for state in ("cold", "warm"):
            at = f"{folder}/{state}"
            runs = {
                "sweep default": ["sweep", "default", "--out", at],
                "report": ["report", at, "--out", f"{at}.html"],
                "track walk": ["track", "walk", "--out", f"{at}-walk"],
            }
            for name, arguments in runs.items():
                figures[f"{name}, {state} cache, s"] = cpu_seconds(checkout, arguments, f"{folder}/cache")
    return figures


@click.command()
@click.argument("checkouts", nargs=-1, type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--rounds", type=click.IntRange(1), default=3, show_default=True)
@click.option("--child", type=click.Choice(["measured", "stages"]), hidden=True)
def main(checkouts: tuple[Path, ...], rounds: int, child: str | None) -> None:
    """Print a table of the figures of every checkout."""
    if child:
        click.echo(json.dumps(measured() if child == "measured" else stages()))
        return
    paths = [checkout.resolve() for checkout in checkouts or [Path()]]
    runs: dict[Path, list[dict[str, float]]] = {path: [] for path in paths}
    for _ in range(rounds):
        for path in paths:
            runs[path].append(json.loads(ran(path, "measured")))
    for path in paths:
        once = started(path)
        runs[path] = [run | once for run in runs[path]]
    for name in runs[paths[0]][0]:
        numbers = [median(run[name] for run in runs[path]) for path in paths]
        click.echo(f"| {name} | " + " | ".join(f"{number:.3g}" for number in numbers) + " |")
    for name, ns in json.loads(ran(paths[-1], "stages")).items():
        click.echo(f"| {name}, ns a pose | " + "| " * (len(paths) - 1) + f"{ns:.0f} |")


if __name__ == "__main__":
    main()
