"""How long it takes to verify 1,000 honest searches, and how many evaluations a second that is.

Five methods search 200 held-out problems each, on every function in its lowest dimension, with the usual budget. Their
bundle keeps every improvement. Problems are made again, as in a new process.
"""

import platform
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path

import click

from posefit.suites.bundles import write_bundle
from posefit.suites.functions import FUNCTIONS, HELD_OUT, SUITE
from posefit.suites.instances import suite_instance
from posefit.suites.problem import suite
from posefit.suites.running import SuiteRun, run_on
from posefit.suites.verification import verified

METHODS = ("random", "sapso", "pso", "cma", "annealed")
SEARCHES = 1000


def searched(address: tuple[str, int, int, int]) -> SuiteRun:
    method, function, instance, dimension = address
    return run_on(suite(SUITE, function, instance, dimension), method)


def processor() -> str:
    """Return the name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(": ")[2] for line in lines if line.startswith("model name")), platform.processor())


@click.command()
@click.option("--searches", default=SEARCHES, show_default=True, help="How many are verified.")
def main(searches: int) -> None:
    """Measure how long honest searches take to verify."""
    problems = [(one.number, instance, one.dimensions[0]) for instance, one in product(HELD_OUT, FUNCTIONS)]
    addresses = [(method, *problem) for problem, method in product(problems[:searches], METHODS)][:searches]
    with ProcessPoolExecutor() as pool:
        runs = list(pool.map(searched, addresses, chunksize=8))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "honest.zip"
        write_bundle(runs, path)
        size = path.stat().st_size
        verified(path)  # compiled loops are loaded
        suite_instance.cache_clear()
        began, cpu = time.perf_counter(), time.process_time()
        bundle = verified(path)
        seconds, cpu = time.perf_counter() - began, time.process_time() - cpu
    made = len({(run.function, run.instance, run.dimension) for run in runs})
    click.echo(f"{len(bundle.runs):,} searches on {made:,} problems, {bundle.evaluated:,} points, {size / 1e6:.2f} MB")
    click.echo(f"verified in {seconds:.2f} s, {cpu:.2f} s of the processor")
    click.echo(f"{bundle.evaluated / seconds:,.0f} points a second")
    click.echo(processor())


if __name__ == "__main__":
    main()
