"""Do memory, open files or latency grow while posefit runs for long?

    python docs/studies/soak.py --seconds 10800 --share 0.2

Environments are stepped, a small sweep is run again and again, and a stream of masks is
tracked live, each in a process of its own that works for a `share` of the time. Each
sample is a line of `--out`. The table compares the medians of the first and of the last
tenth, without the first hundredth, in which caches fill.
"""

import io
import json
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
import numpy as np
import psutil

from growth import ENVIRONMENT, FPS, film
from posefit.cli.output import Command
from table import markdown

SAMPLE_SECONDS = 5.0
START_SHARE = 0.01  # share of the time in which caches fill
TENTH = 0.1
LIVE_FPS = 4.0
LIVE_SIZE = (160, 120)
PLAN = {
    "defaults": {"evaluations": 40, "frames": 2},
    "product": {"methods": ["sapso@pca"], "motions": ["walk"], "seeds": 4},
}
FIGURES = ("megabytes", "handles", "threads", "latency_ms", "rounds", "steps")

Work = Iterator[dict[str, float]]


def environments(number: int) -> Work:
    """Step environments, whose episodes begin again by themselves."""
    import gymnasium as gym

    env: Any = gym.make_vec(ENVIRONMENT, number, errors=False)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for round_ in count(1):
        start = time.perf_counter()
        env.step(rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32))
        latency = 1e3 * (time.perf_counter() - start)
        yield {"latency_ms": latency, "steps": float(round_ * number)}


def sweep(_: int) -> Work:
    """Run the same small sweep in a new folder, and report it."""
    from posefit.report.write import write_report
    from posefit.sweep.cell import run_cell
    from posefit.sweep.command import swept
    from posefit.sweep.engine import Limits
    from posefit.sweep.plan import Plan
    from posefit.sweep.pool import Pool

    with TemporaryDirectory() as folder:
        ledger = Path(folder) / "ledger"
        for _ in count():
            start = time.perf_counter()
            pool = Pool(1, Limits(), run_cell)
            swept(Plan.of(PLAN), ledger, pool, print, quiet=True)
            write_report(str(ledger), f"{folder}/report.html")
            shutil.rmtree(ledger)
            yield {"latency_ms": 1e3 * (time.perf_counter() - start)}


def live(_: int) -> Work:
    """Track a stream of masks, one after the other."""
    from posefit.tracking.live import track_live

    reader, writer = os.pipe()
    os.dup2(reader, 0)
    sys.stdin = io.TextIOWrapper(os.fdopen(0, "rb"))

    def feed() -> None:
        with os.fdopen(writer, "wb") as stream:
            for mask in film(sys.maxsize, LIVE_SIZE):
                height, width = mask.shape
                stream.write(b"P5 %d %d 255\n" % (width, height))
                stream.write((255 * mask.astype(np.uint8)).tobytes())
                stream.flush()
                time.sleep(1.0 / LIVE_FPS)

    threading.Thread(target=feed, daemon=True).start()
    for frame in track_live("-", evaluations=100, fps=FPS):
        yield {"latency_ms": 1e3 * frame.latency}


WORK: dict[str, Callable[[int], Work]] = {
    "environments": environments,
    "sweep": sweep,
    "live": live,
}


@click.group(help=__doc__, invoke_without_command=True)
@click.option(
    "--seconds",
    type=click.FloatRange(min=1.0),
    default=1200.0,
    help="How long all of it runs.",
)
@click.option(
    "--share",
    type=click.FloatRange(0.0, 1.0, min_open=True),
    default=0.2,
    help="Share of the time that work may take.",
)
@click.option(
    "--environments",
    "number",
    type=click.IntRange(min=1),
    default=4096,
    help="Side by side.",
)
@click.option("--only", multiple=True, type=click.Choice(list(WORK)))
@click.option("--out", help="A file of all samples.")
@click.pass_context
def main(
    context: click.Context,
    seconds: float,
    share: float,
    number: int,
    only: tuple[str, ...],
    out: str | None,
) -> None:
    """Run everything, and print what grew."""
    if context.invoked_subcommand is not None:
        return
    words = [str(number), str(seconds), str(share)]
    samples: dict[str, list[dict[str, float]]] = {name: [] for name in only or WORK}
    workers = {
        name: subprocess.Popen(
            [sys.executable, __file__, "worker", name, *words],
            stdout=subprocess.PIPE,
            text=True,
        )
        for name in samples
    }

    def read(name: str) -> None:
        lines = workers[name].stdout
        assert lines is not None
        for line in lines:
            if not line.startswith("{"):
                continue
            samples[name].append(json.loads(line))
            if out is not None:
                with Path(out).open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"work": name, **samples[name][-1]}) + "\n")

    readers = [threading.Thread(target=read, args=(name,)) for name in workers]
    for reader in readers:
        reader.start()
    for reader in readers:
        reader.join()
    lines = [line for name, each in samples.items() for line in grown(name, each)]
    for line in markdown(["work", "figure", "first tenth", "last tenth"], lines, 2):
        click.echo(line)
    failed = [name for name, worker in workers.items() if worker.wait()]
    if failed:
        raise click.ClickException(f"ended early: {', '.join(failed)}")


def grown(name: str, samples: list[dict[str, float]]) -> Iterator[list[str]]:
    """Yield a line for each figure: its medians in the first and in the last tenth."""
    # work that ended before its first sample is named as failed
    if not samples:
        return
    length = samples[-1]["seconds"]
    for figure in FIGURES:
        known = [sample for sample in samples if figure in sample]
        if not known:
            continue
        if figure in ("rounds", "steps"):
            yield [name, figure, "", f"{known[-1][figure]:,.0f}"]
            continue
        parts = []
        for start, stop in ((START_SHARE, START_SHARE + TENTH), (1.0 - TENTH, 1.0)):
            values = [
                sample[figure]
                for sample in known
                if start * length <= sample["seconds"] <= stop * length
            ]
            parts.append(f"{np.median(values):.1f}" if values else "-")
        yield [name, figure.replace("_", " "), *parts]


@main.command(cls=Command, hidden=True)
@click.argument("name", type=click.Choice(list(WORK)))
@click.argument("number", type=int)
@click.argument("seconds", type=float)
@click.argument("share", type=float)
def worker(name: str, number: int, seconds: float, share: float) -> None:
    """Do one kind of work for a share of the time, and print samples."""
    process = psutil.Process()
    start = time.perf_counter()
    sampled = -SAMPLE_SECONDS
    latencies = list[float]()
    busy = time.perf_counter()
    for rounds, figures in enumerate(WORK[name](number), 1):
        now = time.perf_counter()
        latencies.append(figures["latency_ms"])
        if now - start - sampled >= SAMPLE_SECONDS:
            sampled = now - start
            sample = {
                "seconds": sampled,
                "megabytes": process.memory_info().rss / 1e6,
                "handles": process.num_fds(),
                "threads": process.num_threads(),
                "rounds": rounds,
                **figures,
                "latency_ms": float(np.median(latencies)),
            }
            print(json.dumps(sample), flush=True)
            latencies.clear()
        if now - start > seconds:
            break
        # a stream waits for its frames already, and the first round compiles
        if name != "live" and rounds > 1:
            time.sleep((now - busy) * (1.0 / share - 1.0))
        busy = time.perf_counter()
    # a thread that still feeds a stream must not hold the end up
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
