"""What is compiled once is found by later processes; a damaged cache, and none at all, cost a compilation."""

import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

LOOPS = """
from posefit.arrays import inlined, jit
from constants import FACTOR

@inlined
def doubled(x):
    return x + x

@jit
def scaled(values):
    total = 0.0
    for i in range(values.size):
        total += FACTOR * doubled(values[i])
    return total
"""
# prints the functions that this process compiled
RUN = """
import numpy as np
from numba.core import event

class Listener(event.Listener):
    def on_start(self, one):
        print("compiled", one.data["dispatcher"].py_func.__name__, flush=True)
    def on_end(self, one):
        pass

from package.loops import scaled
event.register("numba:compile", Listener())
print(scaled(np.arange(4, dtype=KIND)))
"""


def process(
    folder: Path, *words: str, **variables: str
) -> "subprocess.CompletedProcess[str]":
    """Return what came of Python in a process of its own, whose cache is in a folder."""
    own = {
        "NUMBA_CACHE_DIR": str(folder / "cache"),
        "NUMBA_DISABLE_JIT": "0",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    how = {
        "env": os.environ | own | variables,
        "capture_output": True,
        "text": True,
        "check": True,
    }
    return subprocess.run([sys.executable, *words], **how)


@pytest.fixture
def run(tmp_path: Path) -> Any:
    """Return a function that runs a process and returns the sum that it prints, and what it compiled."""
    (tmp_path / "package").mkdir()
    (tmp_path / "package/__init__.py").touch()
    (tmp_path / "package/loops.py").write_text(
        LOOPS.replace("from constants", "from package.constants")
    )

    def ran(
        factor: float = 1.0, before: str = "", kind: str = "float", **variables: str
    ) -> tuple[float, list[str]]:
        (tmp_path / "package/constants.py").write_text(f"FACTOR = {factor}\n")
        path = os.pathsep.join(
            [str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])]
        )
        words = ["-c", before + RUN.replace("KIND", kind)]
        lines = process(tmp_path, *words, PYTHONPATH=path, **variables).stdout.split(
            "\n"
        )
        return float(lines[-2]), [
            line.removeprefix("compiled ")
            for line in lines
            if line.startswith("compiled")
        ]

    return ran


def test_a_change_of_another_file_of_the_package_is_no_stale_result(run: Any) -> None:
    assert run() == (12.0, ["scaled"])
    # the file of the function itself stays
    assert run(factor=2.0) == (24.0, ["scaled"])
    assert run() == (12.0, [])


def test_a_change_of_a_module_that_is_imported_whole_is_no_stale_result(
    run: Any, tmp_path: Path
) -> None:
    loops = LOOPS.replace(
        "from constants import FACTOR", "from package import constants"
    )
    loops = loops.replace("FACTOR *", "constants.FACTOR *")
    (tmp_path / "package/loops.py").write_text(loops)
    assert run() == (12.0, ["scaled"])
    assert run(factor=2.0) == (24.0, ["scaled"])
    assert run() == (12.0, [])


def emptied(file: Path) -> None:
    file.write_bytes(b"")


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:20])


def unreadable(file: Path) -> None:  # whoever reads, the administrator too
    file.unlink()
    file.symlink_to(file.name)


def with_another_bit(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)


def test_a_damaged_file_is_a_miss(run: Any, tmp_path: Path) -> None:
    run()
    # a checksum finds any difference: each kind of file, and each kind of damage once
    for damage, pattern in (
        (cut, "*.nbi"),
        (unreadable, "*.nbc"),
        (with_another_bit, "*.nbc"),
        (emptied, "*.nb?"),
    ):
        files = list((tmp_path / "cache").rglob(pattern))
        assert files
        for file in files:
            damage(file)
        assert run() == (12.0, ["scaled"]), (damage, pattern)
    assert run() == (12.0, [])
    # as when a process was killed before it listed what it had saved
    (listed,) = (tmp_path / "cache").rglob("SHA256SUMS")
    listed.unlink()
    assert [run(), run()] == [(12.0, ["scaled"]), (12.0, [])]


ANNOUNCED = """
import logging, multiprocessing, sys
import numpy as np
from posefit_loops import scaled

if __name__ == "__main__":
    if "child" in sys.argv:
        child = multiprocessing.get_context("fork").Process(target=scaled, args=(np.arange(4.0),))
        child.start()
        child.join()
    else:
        logging.getLogger("posefit").disabled = "quiet" in sys.argv
        print(scaled(np.arange(4.0)), scaled(np.arange(4)))
"""


def test_compiling_is_announced_once_in_the_process_that_a_user_started(
    tmp_path: Path,
) -> None:
    (tmp_path / "posefit_loops.py").write_text(
        LOOPS.replace("from constants import FACTOR", "FACTOR = 1.0")
    )
    (tmp_path / "script.py").write_text(ANNOUNCED)
    announced = {}
    for word in ("child", "quiet", "", "again"):
        if word != "again":
            shutil.rmtree(tmp_path / "cache", ignore_errors=True)
        announced[word] = process(
            tmp_path, str(tmp_path / "script.py"), word
        ).stderr.splitlines()
    message = "compiling kernels for their first use on this machine; this takes ten seconds or more ..."
    assert announced == {"child": [], "quiet": [], "": [message], "again": []}


TIMED = """
from time import perf_counter
import numpy as np
from posefit.arrays.compiling import compiling_seconds
from posefit_loops import scaled

before = compiling_seconds()
began = perf_counter()
scaled(np.arange(4.0))
print(before, compiling_seconds(), perf_counter() - began)
"""


def test_the_time_of_compiling_is_counted_once_for_a_function_and_its_callees(
    tmp_path: Path,
) -> None:
    (tmp_path / "posefit_loops.py").write_text(
        LOOPS.replace("from constants import FACTOR", "FACTOR = 1.0")
    )
    (tmp_path / "script.py").write_text(TIMED)
    for compiled in (True, False):
        before, own, whole = map(
            float, process(tmp_path, str(tmp_path / "script.py")).stdout.split()[-3:]
        )
        assert before == 0.0
        assert (own > 0.0) == compiled
        assert own <= whole


@pytest.mark.parametrize("variable", ["NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME"])
def test_without_a_place_for_the_cache_every_process_compiles(
    run: Any, tmp_path: Path, variable: str
) -> None:
    (tmp_path / "file").write_text("a file where the folder should be")
    nowhere = {
        "NUMBA_CACHE_DIR": "",
        "XDG_CACHE_HOME": "",
        variable: str(tmp_path / "file"),
    }
    assert run(**nowhere) == (12.0, ["scaled"])
    assert not list((tmp_path / "package").rglob("*.nb*"))


def test_without_room_every_process_compiles(run: Any) -> None:
    full = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n"
    assert run(before=full) == (12.0, ["scaled"])
    full = "import posefit.arrays.folders as f\nf.MIN_FREE = 1 << 62\n"
    assert run(before=full) == (12.0, ["scaled"])
    assert run() == (12.0, ["scaled"])


def test_two_processes_at_once_lose_nothing(run: Any) -> None:
    with ThreadPoolExecutor(2) as pool:
        assert [
            total
            for total, _ in pool.map(lambda kind: run(kind=kind), ("float", "int"))
        ] == [12.0, 12.0]
    assert [run(kind=kind) for kind in ("float", "int")] == [(12.0, [])] * 2
