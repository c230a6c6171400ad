"""How time, memory and disk grow with the work, in rows of doubled sizes.

    python docs/studies/growth.py measure frames --seconds 120 --out growth.jsonl
    python docs/studies/growth.py table growth.jsonl
    python docs/studies/growth.py pose

`measure` doubles the work of a row until a size takes longer than the limit. Each size
is measured in a process of its own, which another process prepares, so that the peak of
memory is that of the work alone. A size that is in the file is not measured again.

`table` prints a line a row. Its exponent p is of the fit `a + b n^p`, where a is what
starting takes. Sizes that were not reached are extrapolated in proportion.

`look` opens a page in headless Chromium, and prints the time to its first picture and
the memory of the browser.

`cluster` runs cells that sleep on Dask workers of this machine, and prints the share of
the workers' time in which cells ran.

`pose` prints the microseconds of a pose by picture, views, dimensions and population:
the benchmark's problem with one number changed, in the fastest run on one thread.
"""

import importlib
import json
import os
import resource
import select
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
import numpy as np

from posefit.arrays import Array
from posefit.cli.output import Command
from table import markdown

FPS = 30.0
FILM_SIZE = (320, 240)  # width and height of most films
# options of a cheap method, so that the cost of everything around a search shows
CHEAP: dict[str, Any] = {"method": "sapso@pca", "evaluations": 40}
KNOWN_FRAMES = (0, 120)
STREAM_FPS = 100.0
ENVIRONMENT = "posefit_envs:posefit/FitImage-v1"
ENVIRONMENT_STEPS = 256
STEPPED_ENVIRONMENTS = 4096
FITTED_SIZES = 4  # fewest sizes for a fit
FLAT = 0.05  # what grows by less than this share is flat
# a report compares this many methods
METHODS = 10
POSES = 400
PORT = 8786  # port of a Dask scheduler
WIDTHS = (80, 160, 320, 640, 1280)
VIEWS = (1, 2, 4, 8)
COMPONENTS = (3, 6, 12, 24, 48)
POPULATIONS = (1, 4, 10, 40, 400)


def film(frames: int, size: tuple[int, int] = FILM_SIZE) -> Iterator[Array]:
    """Yield the masks of a person who walks to and fro for a number of frames."""
    from posefit.footage.options import SourceOptions
    from posefit.footage.source import scene_of

    scene = scene_of("walk", SourceOptions(size=size))
    masks = [each.silhouettes[0].mask for each in scene.observations]
    there_and_back = [*range(len(masks)), *range(len(masks) - 2, 0, -1)]
    for k in range(frames):
        yield masks[there_and_back[k % len(there_and_back)]]


def in_memory(frames: int, _: Path) -> None:
    """Track masks that an array holds."""
    import posefit

    masks = np.empty((frames, *FILM_SIZE[::-1]), dtype=bool)
    for k, mask in enumerate(film(frames)):
        masks[k] = mask
    posefit.track(masks, fps=FPS, **CHEAP)


def write_array(frames: int, folder: Path) -> None:
    """Write masks as an .npy file."""
    shape = (frames, *FILM_SIZE[::-1])
    masks = np.lib.format.open_memmap(folder / "masks.npy", "w+", bool, shape)
    for k, mask in enumerate(film(frames)):
        masks[k] = mask
    masks.flush()


def write_images(frames: int, folder: Path) -> None:
    """Write masks as a folder of pictures."""
    import cv2

    (folder / "masks").mkdir()
    for k, mask in enumerate(film(frames)):
        picture = 255 * mask.astype(np.uint8)
        cv2.imwrite(str(folder / "masks" / f"{k:06d}.png"), picture)


def track_file(name: str, options: Mapping[str, Any], _: int, folder: Path) -> None:
    """Track a film on the disk."""
    import posefit

    posefit.track(folder / name, fps=FPS, **options)


def track_and_write(frames: int, folder: Path) -> None:
    """Track a film on the disk, and write every file."""
    track_file("masks", {**CHEAP, "out": folder / "track"}, frames, folder)


def track_stream(frames: int, folder: Path) -> None:
    """Track a stream of masks, of which those that come too early are skipped."""
    feeder = [sys.executable, __file__, "feed", str(frames)]
    words = ["track", "--live", "-", "--evaluations", str(CHEAP["evaluations"])]
    words += ["--fps", f"{STREAM_FPS:g}", "--out", str(folder / "live")]
    from posefit.cli import main as posefit_main

    with subprocess.Popen(feeder, stdout=subprocess.PIPE) as fed:
        assert fed.stdout is not None
        # a stream that has no frame for some seconds counts as broken
        select.select([fed.stdout], [], [])
        os.dup2(fed.stdout.fileno(), 0)
        posefit_main(words, standalone_mode=False)


def track_known(
    options: Callable[[int], Mapping[str, Any]], size: int, folder: Path
) -> None:
    """Track a known motion of some seconds, and write every file."""
    import posefit

    how = {"method": CHEAP["method"], "frames": KNOWN_FRAMES, **options(size)}
    posefit.track("walk", out=folder / "track", **how)


def cameras_around(cameras: int) -> dict[str, Any]:
    """Return the options of a track by cameras evenly around the person."""
    return {"view_degrees": [360.0 * k / cameras for k in range(cameras)]}


def pixels_high(height: int) -> dict[str, Any]:
    """Return the options of a track of pictures so many pixels high."""
    width = 64 if height == 48 else round(height * 16 / 9)
    return {"size": (width, height)}


def cost_of(proposals: int, _: Path) -> None:
    """Compute the costs of many proposals in one call."""
    from posefit.fitting.box import draw_population
    from posefit_reproduce.bench.kernel import bench_cost

    cost = bench_cost()
    cost(draw_population(cost.space, np.random.default_rng(0), proposals))


def step_environments(environments: int, steps: int, **arguments: Any) -> None:
    """Step environments side by side with random actions."""
    import gymnasium as gym

    env: Any = gym.make_vec(ENVIRONMENT, environments, errors=False, **arguments)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(steps):
        actions = rng.uniform(-1.0, 1.0, env.action_space.shape)
        env.step(actions.astype(np.float32))


def environments_side_by_side(environments: int, _: Path) -> None:
    # one instance, as many environments would have met all training instances
    step_environments(environments, ENVIRONMENT_STEPS, instance=17)


def steps_in_a_row(steps: int, _: Path) -> None:
    step_environments(STEPPED_ENVIRONMENTS, steps // STEPPED_ENVIRONMENTS)


def plan_of(cells: int) -> Any:
    """Return a plan of tracks by ten methods."""
    from posefit.sweep.plan import Plan

    seeds = min(10, cells // METHODS)
    populations = list(range(10, 10 + METHODS))
    return Plan.of(
        {
            "defaults": {"evaluations": 40, "frames": 60},
            "product": {
                "methods": ["sapso@pca"],
                "motions": ["walk"],
                "instances": cells // METHODS // seeds,
                "seeds": seeds,
            },
            "grid": {"sapso.population_size": populations},
        }
    )


def plan_cells(cells: int, folder: Path) -> None:
    """Plan a sweep, and write its cells to a ledger."""
    from posefit.sweep.schema import FILE
    from posefit.sweep.writer import Writer

    with Writer(folder / "ledger" / FILE) as ledger:
        ledger.plan(plan_of(cells))


class Instant:
    """An engine whose cells take no time: the rest is what a sweep itself takes."""

    def __init__(self, row: Callable[[Any, float], dict[str, Any]]) -> None:
        self._row = row
        self._jobs: list[Any] = []
        self._errors = np.random.default_rng(0)

    def window(self) -> int:
        """Return how many cells may run at a time."""
        return 64

    def submit(self, job: Any, tenant: str = "") -> None:
        """Take a cell."""
        self._jobs.append(job)

    def wait(self, _: float) -> list[Any]:
        """Return the outcomes of all cells that were taken."""
        from posefit.sweep.engine import Outcome

        jobs = self._jobs
        self._jobs = []
        errors = self._errors.gamma(2.0, 1.0, len(jobs)).tolist()
        return [
            Outcome(job, self._row(job, error))
            for job, error in zip(jobs, errors, strict=True)
        ]

    def close(self) -> None:
        """Close nothing."""


def row_maker() -> Callable[[Any, float], dict[str, Any]]:
    """Return a function that makes a cell's row with an error: a real row, changed."""
    from posefit.sweep.cell import run_cell

    model = run_cell(replace(next(iter(plan_of(METHODS))), frames=3))

    def row(cell: Any, error: float) -> dict[str, Any]:
        joints = [error * joint for joint in range(len(model["joint_errors_mm"]))]
        return {
            **model,
            "key": cell.key,
            "spec": cell.spec,
            "error_degrees": {**model["error_degrees"], "mean": error},
            "joint_errors_mm": joints,
            "warnings": [],
        }

    return row


def run_cells(cells: int, folder: Path) -> None:
    """Run a sweep whose cells take no time."""
    from posefit.sweep.command import swept

    engine = Instant(row_maker())
    swept(plan_of(cells), folder / "ledger", engine, print, quiet=True)


def report_cells(_: int, folder: Path) -> None:
    """Write the page about all runs of a ledger."""
    from posefit.report.write import write_report

    write_report(str(folder / "ledger"), str(folder / "report.html"))


def write_long_track(frames: int, folder: Path) -> None:
    """Write every file of a track that repeats a short one."""
    from posefit.output.files import write_files

    (folder / "track").mkdir()
    write_files(folder / "track", long_track(frames))


def write_page(frames: int, folder: Path) -> None:
    """Write the page of a track that repeats a short one."""
    from posefit.output.files import write_files

    (folder / "track").mkdir()
    write_files(folder / "track", long_track(frames), ("html",))


def long_track(frames: int) -> Any:
    """Return the content of a track that repeats a track of footage."""
    import posefit
    from posefit.footage.scene import LazyObservations
    from posefit.output.content import Content

    short = posefit.track(np.array([*film(60)]), fps=FPS, **CHEAP).content
    rows = np.arange(frames) % len(short.frames)
    observations = short.scene.observations
    scene = replace(
        short.scene,
        count=frames,
        observations=LazyObservations(frames, lambda k: observations[k % 60]),
    )
    table = {name: values[rows] for name, values in short.table.items()}
    table["frame"] = np.arange(frames, dtype=np.float64)
    table["seconds"] = np.arange(frames) / FPS
    return Content(
        scene=scene,
        frames=[short.frames[k] for k in rows.tolist()],
        table=table,
        gait=short.gait,
        setup=replace(short.setup, frames=frames),
        measures=short.measures,
        log=short.log,
        trust=short.trust,
    )


def nothing(_: int, folder: Path) -> None:
    """Prepare nothing."""


@dataclass(frozen=True)
class Row:
    """A kind of work that grows.

    Attributes:
        unit: What its sizes count.
        sizes: The sizes, each about twice the one before.
        work: Does the work of a size in a folder.
        prepare: Prepares the folder beforehand.
        of: An extrapolated size, and what it is called.
    """

    unit: str
    sizes: Sequence[int]
    work: Callable[[int, Path], None]
    prepare: Callable[[int, Path], None] = nothing
    of: tuple[int, str] | None = None


def doubled(first: int, last: int) -> list[int]:
    """Return sizes from the first one to the last one, each twice the one before."""
    sizes = [first]
    while 2 * sizes[-1] < last:
        sizes.append(2 * sizes[-1])
    return [*sizes, last]


HOUR = (108_000, "an hour of film")
MILLION = (1_000_000, "a million cells")
ROWS = {
    "memory": Row("frames", doubled(125, 108_000), in_memory, of=HOUR),
    "array": Row(
        "frames",
        doubled(125, 108_000),
        partial(track_file, "masks.npy", CHEAP),
        write_array,
        HOUR,
    ),
    "images": Row(
        "frames",
        doubled(125, 108_000),
        partial(track_file, "masks", CHEAP),
        write_images,
        HOUR,
    ),
    "rough": Row(
        "frames",
        doubled(125, 108_000),
        partial(track_file, "masks", {**CHEAP, "smooth": False}),
        write_images,
        HOUR,
    ),
    "default": Row(
        "frames",
        doubled(125, 108_000),
        partial(track_file, "masks", {}),
        write_images,
        HOUR,
    ),
    "outputs": Row(
        "frames", doubled(125, 108_000), track_and_write, write_images, HOUR
    ),
    "files": Row("frames", doubled(125, 108_000), write_long_track, of=HOUR),
    "page": Row("frames", doubled(1_000, 108_000), write_page, of=HOUR),
    "stream": Row("frames", doubled(250, 108_000), track_stream, of=HOUR),
    "cameras": Row("cameras", doubled(1, 32), partial(track_known, cameras_around)),
    "pixels": Row(
        "pixels high",
        (48, 90, 180, 360, 720, 1440, 2160),
        partial(track_known, pixels_high),
    ),
    "proposals": Row("proposals", doubled(1, 1_000_000), cost_of),
    "environments": Row(
        "environments", doubled(512, 16_384), environments_side_by_side
    ),
    "steps": Row("steps", (100_000, 1_000_000, 4_000_000, 10_000_000), steps_in_a_row),
    "plan": Row("cells", doubled(1_000, 1_000_000), plan_cells, of=MILLION),
    "run": Row("cells", doubled(1_000, 1_000_000), run_cells, of=MILLION),
    "resume": Row("cells", doubled(1_000, 1_000_000), run_cells, run_cells, MILLION),
    "report": Row("cells", doubled(1_000, 1_000_000), report_cells, run_cells, MILLION),
}


def measured(name: str, size: int, folder: Path) -> dict[str, Any]:
    """Return the CPU seconds, seconds, peak of memory and disk that a size takes."""
    words = [sys.executable, __file__, "work", name, str(size), str(folder)]
    subprocess.run([*words, "--prepare"], check=True, stdout=subprocess.DEVNULL)
    before = on_disk(folder)
    start = time.perf_counter()
    child = subprocess.run(words, check=True, stdout=subprocess.PIPE)
    figures = json.loads(child.stdout.splitlines()[-1])
    return {
        "row": name,
        "size": size,
        "seconds": time.perf_counter() - start,
        **figures,
        "bytes": on_disk(folder) - before,
    }


def on_disk(folder: Path) -> int:
    """Return the bytes of all files of a folder."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


def fitted_exponent(sizes: Array, values: Array) -> str:
    """Return p of the fit a + b n^p with the least relative squares, to two digits.

    a and b are not negative, and p is at most 2. It is a dash with few sizes.
    """
    from scipy.optimize import nnls

    if len(sizes) < FITTED_SIZES:
        return "-"
    best = (np.inf, 0.0, 0.0)
    for p in np.arange(0.05, 2.005, 0.01).tolist():
        columns = np.column_stack([np.ones(len(sizes)), sizes**p]) / values[:, None]
        terms, residual = nnls(columns, np.ones(len(sizes)))
        grown = terms[1] * sizes[-1] ** p / values[-1]
        best = min(best, (residual, p, grown))
    _, exponent, grown = best
    return f"{exponent:.2f}" if grown > FLAT else "flat"


@click.group(help=__doc__)
def main() -> None:
    """Measure how work grows."""


@main.command(cls=Command)
@click.argument("names", nargs=-1, type=click.Choice(list(ROWS)))
@click.option("--seconds", default=60.0, help="The longest that a size may take.")
@click.option("--gigabytes", default=8.0, help="The most memory of a size.")
@click.option("--most", type=int, help="The largest size.")
@click.option("--least", default=0, help="The smallest size.")
@click.option("--out", required=True, help="A file of rows, which is continued.")
def measure(
    names: Sequence[str],
    seconds: float,
    gigabytes: float,
    most: int | None,
    least: int,
    out: str,
) -> None:
    """Measure rows, all by default."""
    path = Path(out)
    lines = path.read_text("utf-8").splitlines() if path.exists() else []
    known = {(row["row"], row["size"]): row for row in map(json.loads, lines)}
    for name in names or ROWS:
        # the first run compiles
        compiled = any(row == name for row, _ in known)
        for size in ROWS[name].sizes:
            if size < least or (most is not None and size > most):
                continue
            key = (name, size)
            if key not in known:
                for _ in range(1 if compiled else 2):
                    with TemporaryDirectory() as folder:
                        known[key] = measured(name, size, Path(folder))
                compiled = True
                with path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(known[key]) + "\n")
            figures = known[key]
            click.echo(json.dumps(figures))
            # the next size is about twice as large
            if 2.0 * figures["cpu_seconds"] > seconds:
                break
            if 2.0 * figures["peak"] > 1e9 * gigabytes:
                break


@main.command(cls=Command, hidden=True)
@click.argument("name", type=click.Choice(list(ROWS)))
@click.argument("size", type=int)
@click.argument("folder")
@click.option("--prepare", is_flag=True)
def work(name: str, size: int, folder: str, prepare: bool) -> None:
    """Do the work of a size, and print what it took."""
    if prepare:
        ROWS[name].prepare(size, Path(folder))
        return
    start = time.perf_counter()
    highest = [0]
    threading.Thread(target=watch_memory, args=(highest,), daemon=True).start()
    ROWS[name].work(size, Path(folder))
    own = resource.getrusage(resource.RUSAGE_SELF)
    figures = {
        "cpu_seconds": own.ru_utime + own.ru_stime,
        "work_seconds": time.perf_counter() - start,
        # Linux counts in kilobytes
        "peak": 1024 * own.ru_maxrss,
        "without_files": 1024 * highest[0],
    }
    click.echo("\n" + json.dumps(figures))


def watch_memory(highest: list[int]) -> None:
    """Note the highest memory, in kilobytes, that is not of files on the disk.

    The operating system may take back the pages of files at any time.
    """
    while True:
        for line in Path("/proc/self/status").read_text("ascii").splitlines():
            if line.startswith("RssAnon:"):
                highest[0] = max(highest[0], int(line.split()[1]))
        time.sleep(0.2)


@main.command(cls=Command, hidden=True)
@click.argument("frames", type=int)
def feed(frames: int) -> None:
    """Write a film's masks to standard output, as a camera would."""
    start = time.perf_counter()
    with suppress(BrokenPipeError):
        for k, mask in enumerate(film(frames)):
            time.sleep(max(start + k / STREAM_FPS - time.perf_counter(), 0.0))
            height, width = mask.shape
            sys.stdout.buffer.write(b"P5 %d %d 255\n" % (width, height))
            sys.stdout.buffer.write((255 * mask.astype(np.uint8)).tobytes())
            sys.stdout.buffer.flush()


@main.command("table", cls=Command)
@click.argument("path")
def print_table(path: str) -> None:
    """Print a line a row: its largest size, the exponents, and what is extrapolated."""
    rows: dict[str, list[dict[str, Any]]] = {}
    for line in Path(path).read_text("utf-8").splitlines():
        figures = json.loads(line)
        rows.setdefault(figures["row"], []).append(figures)
    lines = []
    sentences = []
    for name, each in rows.items():
        each.sort(key=lambda figures: figures["size"])
        sizes = np.array([figures["size"] for figures in each], dtype=float)
        cpu = np.array([figures["cpu_seconds"] for figures in each])
        peak = np.array([figures["peak"] for figures in each], dtype=float)
        last = each[-1]
        lines.append(
            [
                name,
                f"{each[0]['size']:,} to {last['size']:,} {ROWS[name].unit}",
                f"{last['cpu_seconds']:.1f}",
                fitted_exponent(sizes, cpu),
                f"{last['peak'] / 1e6:,.0f}",
                fitted_exponent(sizes, peak),
                f"{last['bytes'] / 1e6:,.1f}",
            ]
        )
        goal = ROWS[name].of
        if goal is not None and len(each) > 1 and last["size"] < goal[0]:
            sentences.append(extrapolated(name, goal, sizes, cpu, peak))
    head = ["row", "sizes", "CPU s", "exponent", "MB", "exponent", "MB on disk"]
    for line in markdown(head, lines, 2):
        click.echo(line)
    click.echo("\n" + "\n".join(sentences))


def extrapolated(
    name: str, goal: tuple[int, str], sizes: Array, cpu: Array, peak: Array
) -> str:
    """Return a sentence about a size that was not measured."""
    values = []
    for known in (cpu, peak):
        rise = (known[-1] - known[0]) / (sizes[-1] - sizes[0])
        values.append(known[-1] + rise * (goal[0] - sizes[-1]))
    return (
        f"{name}: {goal[1]} takes {values[0]:,.0f} CPU s and "
        f"{values[1] / 1e9:.2f} GB, extrapolated in proportion from "
        f"{sizes[-1]:,.0f}."
    )


@main.command(cls=Command)
@click.argument("page", type=click.Path(exists=True, path_type=Path))
@click.option("--browser", default="/usr/bin/chromium", help="Its program.")
def look(page: Path, browser: str) -> None:
    """Print how long a page takes to its first picture, and the browser's memory."""
    library: Any = importlib.import_module("playwright.sync_api")
    with library.sync_playwright() as driver:
        chromium = driver.chromium.launch(
            executable_path=browser, args=["--no-sandbox"]
        )
        opened = chromium.new_page()
        start = time.perf_counter()
        opened.goto(page.absolute().as_uri())
        # two frames of the browser's: the first was then on the screen
        opened.evaluate(
            "() => new Promise(done => requestAnimationFrame("
            "() => requestAnimationFrame(done)))"
        )
        seconds = time.perf_counter() - start
        megabytes = sum(map(own_megabytes, children_of(os.getpid())))
        click.echo(
            f"{page.stat().st_size / 1e6:.1f} MB: first picture after {seconds:.2f} s; "
            f"the browser's processes have {megabytes:.0f} MB"
        )
        chromium.close()


def children_of(process: int) -> list[int]:
    """Return the processes that a process has started, directly or not."""
    children = []
    for task in Path(f"/proc/{process}/task").glob("*/children"):
        for child in map(int, task.read_text("ascii").split()):
            children += [child, *children_of(child)]
    return children


def own_megabytes(process: int) -> float:
    """Return a process' memory, of which shared parts are divided among its users."""
    for line in Path(f"/proc/{process}/smaps_rollup").read_text("ascii").splitlines():
        if line.startswith("Pss:"):
            return int(line.split()[1]) / 1e3
    return 0.0


@main.command(cls=Command)
@click.option("--workers", default="1,2,4,8", help="Numbers of workers.")
@click.option("--naps", default="0.1,1", help="Seconds of a cell.")
@click.option("--seconds", default=10.0, help="How long the cells of a worker take.")
@click.option("--namespaces", default=0, help="Network namespaces; they need root.")
def cluster(workers: str, naps: str, seconds: float, namespaces: int) -> None:
    """Print the share of the time of Dask's workers in which cells ran."""
    from posefit.sweep.cluster import Cluster
    from posefit.sweep.command import swept
    from posefit.sweep.engine import Limits

    row = row_maker()
    for count in map(int, workers.split(",")):
        with ExitStack() as opened:
            hosts: list[tuple[str, list[str]]] = [("127.0.0.1", [])]
            if namespaces:
                hosts = opened.enter_context(networks(namespaces))
            address, prefix = hosts[0]
            own = ["--host", address, "--no-dashboard"]
            program = [*prefix, sys.executable, "-m", "distributed.cli.dask_scheduler"]
            opened.enter_context(ended([*program, *own, "--port", str(PORT)]))
            scheduler = f"tcp://{address}:{PORT}"
            for k in range(count):
                address, prefix = hosts[k % len(hosts)]
                program = [*prefix, sys.executable, "-m", "distributed.cli.dask_worker"]
                own = ["--host", address, "--nthreads", "1", "--no-dashboard"]
                opened.enter_context(ended([*program, scheduler, *own, "--no-nanny"]))
            for nap in map(float, naps.split(",")):
                run = partial(slept, row, nap)
                engine = Cluster(scheduler, Limits(), run, 300.0)
                while len(engine._client.nthreads()) < count:
                    time.sleep(0.1)
                # a worker's first cell starts the process in which all of them run
                for k, cell in zip(range(4 * count), plan_of(1000), strict=False):
                    engine.submit(replace(cell, seed=1000 + k))
                left = 4 * count
                while left:
                    left -= len(engine.wait(0.2))
                plan = plan_of(METHODS * max(round(count * seconds / nap / METHODS), 1))
                folder = opened.enter_context(TemporaryDirectory())
                began = time.perf_counter()
                swept(plan, Path(folder), engine, print, quiet=True)
                took = time.perf_counter() - began
                click.echo(
                    f"{count} workers, {len(plan):,} cells of {nap:g} s: {took:.2f} s, "
                    f"{len(plan) * nap / (count * took):.2f}"
                )


def slept(
    row: Callable[[Any, float], dict[str, Any]], seconds: float, cell: Any
) -> dict[str, Any]:
    """Sleep for a time, and return a cell's row."""
    time.sleep(seconds)
    return row(cell, 1.0)


@contextmanager
def ended(words: Sequence[str]) -> Iterator[None]:
    """Run a program during the body."""
    quiet = subprocess.DEVNULL
    with subprocess.Popen(words, stdout=quiet, stderr=quiet) as process:
        try:
            yield
        finally:
            process.terminate()


@contextmanager
def networks(count: int) -> Iterator[list[tuple[str, list[str]]]]:
    """Make network namespaces that a bridge connects, as if they were machines.

    Yields the address of each, and the beginning of commands that run there.
    """

    def ip(words: str) -> None:
        subprocess.run(["ip", *words.split()], check=True)

    with ExitStack() as made:
        ip("link add posefit type bridge")
        made.callback(ip, "link del posefit")
        ip("addr add 10.77.0.254/24 dev posefit")
        ip("link set posefit up")
        hosts = []
        for k in range(1, count + 1):
            name = f"posefit{k}"
            ip(f"netns add {name}")
            made.callback(ip, f"netns del {name}")
            ip(f"link add {name} type veth peer name eth0 netns {name}")
            ip(f"link set {name} master posefit up")
            ip(f"-n {name} addr add 10.77.0.{k}/24 dev eth0")
            ip(f"-n {name} link set eth0 up")
            ip(f"-n {name} link set lo up")
            hosts.append((f"10.77.0.{k}", ["ip", "netns", "exec", name]))
        yield hosts


@main.command(cls=Command)
def pose() -> None:
    """Print the four curves of a pose's cost."""
    from posefit.fitting.box import draw_population
    from posefit_reproduce.bench.kernel import bench_cost, fastest

    usual = bench_cost()
    curves = {
        "width, pixels": {width: bench_cost(width=width) for width in WIDTHS},
        "views": {views: bench_cost(views=views) for views in VIEWS},
        "dimensions": {m + 3: bench_cost(components=m) for m in COMPONENTS},
        "population": dict.fromkeys(POPULATIONS, usual),
    }
    for name, costs_of in curves.items():
        counts = {x: x if name == "population" else POSES for x in costs_of}
        jobs = {
            str(x): partial(
                own,
                draw_population(own.space, np.random.default_rng(0), counts[x]),
            )
            for x, own in costs_of.items()
        }
        took = fastest(jobs)
        costs = {x: 1e6 * took[str(x)] / counts[x] for x in costs_of}
        click.echo(
            f"| {name} | "
            + " | ".join(f"{x}: {cost:.3g}" for x, cost in costs.items())
            + " |"
        )


if __name__ == "__main__":
    main()
