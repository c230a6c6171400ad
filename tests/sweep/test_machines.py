"""The handbook's two ways to have more machines, as a user types them: a Dask cluster made by hand, and a job array."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from posefit.sweep.ledger import Ledger
from tests.sweep.test_engines import TIMES

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "howto" / "cluster.md"
PLAN = """
[defaults]
frames = 2
size = [80, 60]
evaluations = 80

[product]
methods = ["sapso@pca", "random@full"]
motions = ["walk"]
instances = [0, 1]
seeds = 2
"""
SBATCH = """#!{python}
# a queue's submit command, as far as the handbook uses it: every task of an array is a process of its own
import argparse, os, subprocess
words = argparse.ArgumentParser()
words.add_argument("--array", required=True)
words.add_argument("--cpus-per-task", type=int, required=True)
words.add_argument("--wrap", required=True)
given = words.parse_args()
first, _, last = given.array.partition("-")
tasks = []
for number in range(int(first), int(last) + 1):
    told = {{**os.environ, "SLURM_ARRAY_TASK_ID": str(number), "SLURM_JOB_ID": "1"}}
    out = open(f"slurm-1_{{number}}.out", "wb")
    tasks.append(subprocess.Popen(["/bin/sh", "-c", given.wrap], env=told, stdout=out, stderr=out))
raise SystemExit(max(task.wait() for task in tasks))
"""

Spawn = Callable[..., subprocess.Popen[bytes]]


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    path = tmp_path / "plan.toml"
    path.write_text(PLAN)
    return path


@pytest.fixture
def spawn() -> Iterator[Spawn]:
    """Start a program that ends with the test, and all that it started."""
    started = []

    def one(words: list[str], folder: Path) -> subprocess.Popen[bytes]:
        folder.mkdir(exist_ok=True)
        with (folder / "said.txt").open("wb") as said:
            process = subprocess.Popen(words, cwd=folder, stdout=said, stderr=said, start_new_session=True)
        started.append(process)
        return process

    yield one
    for process in reversed(started):
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def posefit(*words: object) -> list[str]:
    return [sys.executable, "-m", "posefit", *map(str, words)]


def dask(program: str, *words: str) -> list[str]:
    return [sys.executable, "-m", f"distributed.cli.{program}", *words]


def found(ledger: Path) -> dict[str, dict[str, object]]:
    """Return each cell's row without how long it took and where in the ledger its joints stand."""
    rows = {str(row["key"]): row for row in Ledger(ledger).rows()}
    return {key: {name: row[name] for name in row if name not in (*TIMES, "joints")} for key, row in rows.items()}


@pytest.mark.slow
def test_two_workers_of_a_cluster_made_by_hand_give_the_rows_of_one_machine(
    plan: Path, tmp_path: Path, spawn: Spawn
) -> None:
    pytest.importorskip("distributed")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    head = ["dask_scheduler", "--port", str(port), "--host", "127.0.0.1", "--no-dashboard", "--no-show"]
    spawn(dask(*head), tmp_path / "head")
    for name in ("left", "right"):  # a folder each: they share no file with one another, nor with the driver
        spawn(dask("dask_worker", address, "--name", name, "--nthreads", "1", "--no-dashboard"), tmp_path / name)
    there = posefit("sweep", plan, "--out", tmp_path / "there", "--scheduler", address, "--json")
    done = subprocess.run(there, cwd=ROOT, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["ran"] == 8
    here = posefit("sweep", plan, "--out", tmp_path / "here", "--workers", 2)
    subprocess.run(here, cwd=ROOT, capture_output=True, check=True)
    assert len(found(tmp_path / "here")) == 8
    assert found(tmp_path / "there") == found(tmp_path / "here")


@pytest.mark.slow
def test_the_tasks_of_a_job_array_divide_the_cells_among_themselves(plan: Path, tmp_path: Path) -> None:
    words = re.search(r"^sbatch --array=0-15 --cpus-per-task=8 --wrap \"(.+)\"$", PAGE.read_text(), re.MULTILINE)
    assert words, "the handbook's command is what is tried here"
    ledger = tmp_path / "results"
    wrapped = words[1].replace("posefit", f"{sys.executable} -m posefit", 1)
    wrapped = wrapped.replace("plan.toml", str(plan)).replace("/shared/results", str(ledger))
    wrapped = wrapped.replace("--workers 8", "--workers 1")
    queue = tmp_path / "sbatch"
    queue.write_text(SBATCH.format(python=sys.executable))
    queue.chmod(0o755)
    command = [str(queue), "--array=0-2", "--cpus-per-task=1", "--wrap", wrapped]
    surroundings = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run(command, cwd=tmp_path, env=surroundings, check=True)
    said = [(tmp_path / f"slurm-1_{number}.out").read_text() for number in range(3)]
    ran = [int(number) for text in said for number in re.findall(r"cells done, (\d+) of them now", text)]
    assert len(ran) == 3
    assert sum(ran) == 8, "each cell was run once, by one task"
    assert len(found(ledger)) == 8
    subprocess.run(command, cwd=tmp_path, env=surroundings, check=True)
    assert "8 of 8 cells are done already" in (tmp_path / "slurm-1_0.out").read_text()
