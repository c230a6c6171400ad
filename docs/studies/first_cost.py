"""How long it takes from `pip install` of posefit and a tool, in an empty environment, to the first cost there."""

import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import click

ROOT = Path(__file__).parents[2]
SUITE = "import posefit, numpy as np; posed = posefit.suite('posefit-2026.2', 1, 10_000, 9); "
BLADE = """from posefit_bridges.blade import EXAMPLE, Problem
from iohblade import Solution
problem = Problem(training_instances=[(1, 10_000, 9)], budget_factor=1)
print(problem.evaluate(Solution(code=EXAMPLE.split('```')[1].removeprefix('python'), name='RandomSearch')).fitness)"""
TOOLS = {  # the extra, and what prints a cost
    "ioh": SUITE + "print(posed.ioh()(np.zeros(9)))",
    "optunahub": SUITE
    + "from posefit_bridges.optunahub import Problem; import optuna; problem = Problem(posed); "
    + "study = optuna.create_study(); study.optimize(problem, n_trials=1); print(study.best_value)",
    "pymoo": SUITE
    + "from posefit_bridges.pymoo import Problem; print(Problem(posed).evaluate(np.zeros((1, 9)))[0, 0])",
    "nevergrad": "import numpy as np; from posefit_bridges.nevergrad import Problem; "
    + "print(Problem(1, 10_000, 9)(np.zeros(9)))",
    "evox": SUITE
    + "import torch; from posefit_bridges.evox import Problem; "
    + "print(float(Problem(posed).evaluate(torch.zeros(1, 9))))",
    "iohblade": BLADE,
    "metabox": SUITE + "from posefit_bridges.metabox import Problem; print(Problem(posed).eval(np.zeros(9)))",
}
BESIDE = {"metabox": ["--no-deps", "metaevobox", "tianshou==1.1.0"]}  # its numpy 1 is not installed


@click.command()
@click.argument("tools", nargs=-1, type=click.Choice(list(TOOLS)))
@click.option("--first", multiple=True, metavar="PACKAGE", help="Install this before, such as a torch without CUDA.")
def main(tools: Sequence[str], first: Sequence[str]) -> None:
    """Build a wheel, and print a row for each tool: seconds of the clock and of a processor, and the cost."""
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        _run(sys.executable, "-m", "pip", "wheel", "--no-deps", "--wheel-dir", work, ROOT)
        (wheel,) = work.glob("*.whl")
        for tool in tools or TOOLS:
            _run(sys.executable, "-m", "venv", work / tool)
            python = work / tool / "bin" / "python"
            began, processor = time.perf_counter(), _processor()
            if first:
                _run(python, "-m", "pip", "install", *first)
            _run(python, "-m", "pip", "install", f"{wheel}[{tool}]")
            if tool in BESIDE:
                _run(python, "-m", "pip", "install", *BESIDE[tool])
            installed = time.perf_counter()
            cost = float(_run(python, "-c", TOOLS[tool]).split()[-1])
            ended = time.perf_counter()
            seconds = {
                "install_s": installed - began,
                "first_cost_s": ended - installed,
                "total_s": ended - began,
                "processor_s": _processor() - processor,
            }
            print(json.dumps({"tool": tool, **{k: round(v, 1) for k, v in seconds.items()}, "cost": cost}), flush=True)


def _processor() -> float:
    """Return the seconds of a processor that all commands took, which other work on the machine does not lengthen."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _run(*command: object) -> str:
    return subprocess.run([*map(str, command)], check=True, stdout=subprocess.PIPE, text=True).stdout


if __name__ == "__main__":
    main()
