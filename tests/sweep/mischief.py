"""A plugin whose optimisers misbehave beside good cells: `python -m tests.sweep.mischief --engine pool`.

This module is the plugin: each function of `MISCHIEF` is what one of its optimisers does in a cell. 97 cells of posefit's
own methods run in the same sweep, and must give the rows that they give alone, to the bit. Prints one JSON object; its
exit status is 1 if a good cell is lost, quarantined or changed, or a process is left.
"""

import argparse
import builtins
import gc
import json
import locale
import math
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from posefit import SearchSpace, hookimpl
from posefit.suites.functions import SUITE
from posefit.sweep.cell import Cell, run_cell
from posefit.sweep.engine import Engine, Limits
from posefit.sweep.plan import Plan
from tests.sweep.fake import quarantined_in, rows_in, scheduler, swept

LEFT = "POSEFIT_LEFT"  # the file that lists the processes that are left
SLEEP = [sys.executable, "-c", "import time; time.sleep(900)"]
END_SECONDS = 20.0  # a worker of Dask takes a while to notice that its parent ended
LIMITS = Limits(seconds=20.0, gigabytes=1.0)
# the figures that two runs of a cell differ by
TIMES = ("seconds", "seconds_per_frame", "cpu_seconds_per_frame")
OWN = ("random", "sapso", "cma", "pso")  # posefit's own optimisers, of good cells


def _note(process: int) -> None:
    with open(os.environ[LEFT], "a", encoding="utf-8") as file:
        file.write(f"{process}\n")


def changes_the_folder() -> None:
    os.chdir("/")


def leaves_a_process() -> None:
    _note(subprocess.Popen(SLEEP).pid)


def leaves_a_fork() -> None:
    process = os.fork()
    if process == 0:
        time.sleep(900.0)
        os._exit(0)
    _note(process)


def forks_and_goes_on() -> None:
    # once: each process that goes on would fork again
    if "FORKED" not in os.environ:
        os.environ["FORKED"] = "yes"
        os.fork()


def leaves_a_session() -> None:
    _note(subprocess.Popen(SLEEP, start_new_session=True).pid)


def leaves_a_thread() -> None:
    def change() -> None:
        while True:
            np.random.seed(1)  # noqa: NPY002
            time.sleep(0.001)

    threading.Thread(target=change).start()


def replaces_a_function() -> None:
    np.linalg.norm = json.dumps = np.random.Generator = print  # type: ignore[assignment,misc]


def replaces_a_builtin() -> None:
    builtins.sum = builtins.sorted = lambda *_, **__: []  # type: ignore[assignment]


def replaces_a_method() -> None:
    from posefit.fitting.problem import Problem

    Problem.__init__ = lambda *_, **__: None  # type: ignore[method-assign]


def replaces_the_clock() -> None:
    time.time = time.perf_counter = time.monotonic = lambda: 0.0


def writes_into_arrays() -> None:
    from posefit.suites import instances

    instances.PLACE += 1.0


def forgets_modules() -> None:
    for name in [name for name in sys.modules if name.startswith("posefit")]:
        del sys.modules[name]


def handles_signals() -> None:
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGALRM):
        signal.signal(number, lambda *_: None)


def sets_an_alarm() -> None:
    signal.setitimer(signal.ITIMER_REAL, 0.5, 0.5)


def seeds_random_numbers() -> None:
    random.seed(1)
    np.random.seed(1)  # noqa: NPY002


def clears_the_environment() -> None:
    os.environ.clear()


def closes_descriptors() -> None:
    os.closerange(3, 256)


def closes_output() -> None:
    sys.stdout.close()
    sys.stderr.close()


def prints_much() -> None:
    print("mischief " * 100_000)


def raises() -> None:
    raise ZeroDivisionError("mischief")


def exits() -> None:
    sys.exit(3)


def ends_its_process() -> None:
    os._exit(0)


def kills_itself() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def stops_itself() -> None:
    os.kill(os.getpid(), signal.SIGSTOP)


def hangs() -> None:
    while True:
        pass


def wants_all_memory() -> None:
    _ = [np.ones(2**24) for _ in range(10_000)]


def sets_error_states() -> None:
    np.seterr(all="raise")


def filters_warnings() -> None:
    warnings.simplefilter("error")


def sets_the_locale() -> None:
    locale.setlocale(locale.LC_ALL, "C")


def sets_the_recursion_limit() -> None:
    sys.setrecursionlimit(150)


def sets_the_umask() -> None:
    os.umask(0o777)


def switches_collection_off() -> None:
    gc.disable()


def uses_all_threads() -> None:
    import cv2

    cv2.setNumThreads(8)
    os.environ["NUMBA_NUM_THREADS"] = "8"


def traces() -> None:
    sys.settrace(lambda *_: None)
    threading.settrace(lambda *_: None)


MISCHIEF: tuple[Callable[[], None], ...] = (
    changes_the_folder, leaves_a_process, leaves_a_fork, forks_and_goes_on, leaves_a_session, leaves_a_thread,
    replaces_a_function, replaces_a_builtin, replaces_a_method, replaces_the_clock, writes_into_arrays,
    forgets_modules, handles_signals, sets_an_alarm, seeds_random_numbers, clears_the_environment,
    closes_descriptors, closes_output, prints_much, raises, exits, ends_its_process, kills_itself, stops_itself,
    hangs, wants_all_memory, sets_error_states, filters_warnings, sets_the_locale, sets_the_recursion_limit,
    sets_the_umask, switches_collection_off, uses_all_threads, traces,
)  # fmt: skip


class Mischief:
    """An optimiser that draws at random, and misbehaves after its first poses."""

    def __init__(
        self, do: Callable[[], None], space: SearchSpace, rng: np.random.Generator
    ) -> None:
        self._do = do
        self._dimensions = space.dimensions
        self._rng = rng

    def ask(self) -> Any:
        return self._rng.random((10, self._dimensions))

    def tell(self, proposals: Any, costs: Any) -> None:
        self._do()


def _factory(do: Callable[[], None]) -> Callable[..., Mischief]:
    def make(space: SearchSpace, rng: np.random.Generator) -> Mischief:
        return Mischief(do, space, rng)

    return make


def name_of(do: Callable[[], None]) -> str:
    """Return the name of the optimiser that does it."""
    return do.__name__.replace("_", "-")


@hookimpl
def posefit_register_optimisers(register: Any) -> None:
    for do in MISCHIEF:
        register(name_of(do), _factory(do))


def good_cells(count: int) -> list[Cell]:
    """Return cells of posefit's own methods: mostly searches, and every sixth a track."""
    tracked = {
        "defaults": {"frames": 2, "size": [80, 60], "evaluations": 80},
        "product": {"methods": ["sapso@pca"], "motions": ["walk"], "seeds": count // 6},
    }
    searched = _searches([*OWN], math.ceil((count - count // 6) / len(OWN)))
    return [*Plan.of(tracked), *searched][:count]


def bad_cells() -> list[Cell]:
    """Return a cell of each optimiser that misbehaves."""
    return _searches([name_of(do) for do in MISCHIEF], 1)


def _searches(methods: list[str], seeds: int) -> list[Cell]:
    tables = {
        "suite": SUITE,
        "methods": methods,
        "functions": [1],
        "dimensions": [9],
        "instances": [10_000],
        "seeds": seeds,
        "budgets": [20],
    }
    return [*Plan.of(tables)]


@contextmanager
def engine_of(name: str, workers: int) -> Iterator[Engine]:
    """Yield an engine: the processes of this machine, or a Dask scheduler's workers."""
    if name == "pool":
        from posefit.sweep.pool import Pool

        yield Pool(workers, LIMITS, run_cell)
        return
    from posefit.sweep.cluster import Cluster

    with scheduler(workers) as address:
        yield Cluster(address, LIMITS, run_cell, 300.0)


class Apart:
    """An engine for which each misbehaving optimiser is a package by itself.

    Cells of one package share processes, so the first kinds would keep the others from misbehaving.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self.window = engine.window
        self.wait = engine.wait
        self.close = engine.close

    def submit(self, cell: Cell, tenant: str = "") -> None:
        self._engine.submit(cell, f"{tenant} {cell.method}" if tenant else "")


def left(noted: Path) -> list[int]:
    """Return the processes that were noted and have not ended within some seconds."""
    numbers = noted.read_text().split() if noted.exists() else []
    processes = [int(number) for number in numbers]
    until = time.monotonic() + END_SECONDS
    while processes and time.monotonic() < until:
        time.sleep(0.1)
        processes = [process for process in processes if _runs(process)]
    return processes


def _runs(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def run(folder: Path, engine: str, count: int, workers: int) -> dict[str, Any]:
    """Return what became of the good cells beside those that misbehave."""
    noted = folder / "left"
    os.environ[LEFT] = str(noted)
    good = good_cells(count)
    alone = {cell.key: json.loads(json.dumps(run_cell(cell))) for cell in good}
    bad = bad_cells()
    mixed = []
    for k, cell in enumerate(good):
        mixed.append(cell)
        mixed += bad[k * len(bad) // count : (k + 1) * len(bad) // count]
    with engine_of(engine, workers) as started, closing(started):
        tally = swept(folder / "results", mixed, Apart(started))
    rows = {row["key"]: row for row in rows_in(folder / "results")}
    quarantined = {row["key"]: row for row in quarantined_in(folder / "results")}
    changed = []
    for key, row in alone.items():
        figures = [name for name in row if name not in TIMES]
        other = rows.get(key)
        if other is not None and any(row[name] != other[name] for name in figures):
            changed.append(key)
    processes = left(noted)
    for process in processes:
        os.kill(process, signal.SIGKILL)
    return {
        "engine": engine,
        "good cells": len(good),
        "kinds of mischief": len(bad),
        "attempts that failed": tally.failed,
        "lost": len(alone.keys() - rows.keys() - quarantined.keys()),
        "quarantined": len(alone.keys() & quarantined.keys()),
        "changed": len(changed),
        "processes left": len(processes),
        "misbehaving cells": {
            cell.method: quarantined[cell.key]["reasons"][-1]
            if cell.key in quarantined
            else "done"
            for cell in bad
        },
    }


HARM = ("lost", "quarantined", "changed", "processes left")


def main() -> None:
    """Run what the command line asks for, with this module installed as a plugin."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--engine", choices=("pool", "dask"), default="pool")
    parser.add_argument("--cells", type=int, default=97)
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    outcome = run_installed(asked.engine, asked.cells, asked.workers)
    print(json.dumps(outcome, indent=1))
    sys.exit(any(outcome[name] for name in HARM))


def run_installed(engine: str, count: int, workers: int) -> dict[str, Any]:
    """Return what `run` returns in a new process, for which this plugin is installed."""
    from tests.testing.sabotage import install

    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        site = install(folder / "site", "tests.sweep.mischief", "mischief")
        paths = [str(site), str(Path(__file__).parents[2]), *sys.path]
        code = (
            "import json, pathlib; from tests.sweep import mischief; outcome = "
            f"mischief.run(pathlib.Path({temporary!r}), {engine!r}, {count}, {workers});"
            "pathlib.Path('outcome.json').write_text(json.dumps(outcome))"
        )
        with (folder / "output").open("w") as output:
            subprocess.run(
                [sys.executable, "-c", code],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
                cwd=folder,
                stdout=output,
                stderr=subprocess.STDOUT,
                check=False,
            )
        outcome = folder / "outcome.json"
        if not outcome.exists():
            raise SystemExit((folder / "output").read_text()[-4000:])
        return json.loads(outcome.read_text())  # type: ignore[no-any-return]


if __name__ == "__main__":
    main()
