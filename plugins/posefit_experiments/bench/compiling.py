"""How long do the loops take to compile? Every function that numba compiles from an empty cache, in CPU seconds."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from numba.core import event

CHILD = "from posefit_experiments.bench.compiling import tell; tell()"
STAGES = ("first picture", "default sweep")  # `posefit track walk --out DIR`, then every method of the default plan


def compile_figures() -> dict[str, Any]:
    """Return CPU seconds of compiling: up to the first picture, for the default sweep in all, and of each function.

    A function's own seconds leave out those of the functions that it calls, which are compiled while it is. Those with
    names in numba are what our own make numba compile of its own.
    """
    with tempfile.TemporaryDirectory() as folder:
        variables = {**os.environ, "NUMBA_CACHE_DIR": folder}
        ran = subprocess.run([sys.executable, "-c", CHILD], env=variables, capture_output=True, text=True, check=False)
    if ran.returncode:
        raise ValueError(f"expected a process that compiles everything, got {ran.stderr.strip().splitlines()[-1:]}")
    functions: list[dict[str, Any]] = json.loads(ran.stdout.splitlines()[-1])
    first = [one["seconds"] for one in functions if one["stage"] == STAGES[0]]
    return {
        "first_picture_seconds": round(sum(first), 3),
        "default_sweep_seconds": round(sum(one["seconds"] for one in functions), 3),
        "functions": sorted(functions, key=lambda one: -one["seconds"]),
    }


def compile_lines(figures: dict[str, Any]) -> Iterator[str]:
    """Yield what `compile_figures` found as lines of text."""
    functions = figures["functions"]
    yield f"until the first picture    {figures['first_picture_seconds']:6.2f} CPU s"
    yield f"for the default sweep      {figures['default_sweep_seconds']:6.2f} CPU s"
    yield f"functions and signatures   {len(functions):6}"
    yield f"{'own s':>7} {'in all':>7}"
    for one in functions:
        yield f"{one['seconds']:7.3f} {one['in_all']:7.3f}  {one['function']}({one['signature']})"


def tell() -> None:
    """Print as one line of JSON what this process compiles when it follows a clip by every method of the plan."""
    from posefit import track
    from posefit.sweep.cell import run_cell
    from posefit.sweep.plan import Plan

    watch = _Watch()
    event.register("numba:compile", watch)  # type: ignore[no-untyped-call]
    with tempfile.TemporaryDirectory() as folder:
        track("walk", frames=(0, 2), out=Path(folder) / "walk")
    watch.stage = STAGES[1]
    for cell in {cell.method: cell for cell in Plan.read("default")}.values():
        run_cell(cell)
    print(json.dumps(watch.compiled))


class _Watch(event.Listener):  # type: ignore[misc]
    """Notes what is compiled; one function within another, as numba goes about it."""

    def __init__(self) -> None:
        self.stage = STAGES[0]
        self.compiled: list[dict[str, Any]] = []
        self._open: list[list[float]] = []  # when each began, and the seconds of what was compiled within

    def on_start(self, _: Any) -> None:
        self._open.append([time.thread_time(), 0.0])

    def on_end(self, happened: Any) -> None:
        began, within = self._open.pop()
        seconds = time.thread_time() - began
        if self._open:
            self._open[-1][1] += seconds
        function = happened.data["dispatcher"].py_func
        self.compiled.append(
            {
                "function": f"{function.__module__}.{function.__qualname__}",
                "signature": ", ".join(str(one) for one in happened.data["args"]),
                "stage": self.stage,
                "seconds": round(seconds - within, 4),
                "in_all": round(seconds, 4),
            }
        )
