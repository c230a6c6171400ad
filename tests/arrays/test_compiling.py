"""numba's cache: nothing is lost between processes, what is damaged is compiled again, and nothing needs a place for it."""

import os
import shutil
import subprocess
import sys
from collections import Counter
from itertools import product

import pytest

from tests.cases import each

DEEPER = """
from numba.extending import overload
from posefit.arrays import inlined
FACTOR = 2.0

@inlined
def deep(x):
    return x + 1.0

def plain(x):
    return x

@overload(plain)
def _compiled(x):
    return lambda x: x
"""
MIDDLE = """
from package.deeper import FACTOR, deep, plain
"""
# a loop that calls another, one that calls itself, one that no type fits, and one that is to become part of others
LOOPS = """
from posefit.arrays import inlined, jit
from package.middle import FACTOR, deep, plain

@jit
def changing(x):
    return FACTOR * deep(plain(x))

@jit
def outer(values):
    total = 0.0
    for i in range(values.size):
        total += inner(values, i)
    return total

@jit
def inner(values, i):
    return values[i] * values[i]

@jit
def halved(n):
    return 0 if n < 2 else 1 + halved(n // 2)

@jit
def impossible(values):
    return values + "words"

@inlined
def doubled(x):
    return x + x
"""
# says what this process compiled, once a file tells it to begin
RUN = """
import os, time
import numpy as np
from numba.core import event

class Listener(event.Listener):
    def on_start(self, one):
        name = one.data["dispatcher"].py_func
        if name.__module__ == "package.loops":
            print("compiled", name.__name__, one.data["args"][0], flush=True)
    def on_end(self, one):
        pass

from package import loops
event.register("numba:compile", Listener())
print("ready", flush=True)
while not os.path.exists("go"):
    time.sleep(0.001)
"""
ALL = """
assert loops.outer(np.arange(4.0)) == 14.0
assert loops.outer(np.arange(4)) == 14.0
assert loops.halved(9) == 3
"""


@pytest.fixture
def start():
    def started(script, tmp_path, deeper=DEEPER, **variables):
        (tmp_path / "package").mkdir(exist_ok=True)
        for name, text in (("__init__", ""), ("loops", LOOPS), ("middle", MIDDLE), ("deeper", deeper)):
            (tmp_path / "package" / f"{name}.py").write_text(text, encoding="utf-8")
        variables["PYTHONDONTWRITEBYTECODE"] = "1"  # Python takes a file of the same second and size for the same
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "NUMBA_DISABLE_JIT": "0", **variables}
        path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = {name: value for name, value in environment.items() if value is not None}
        return subprocess.Popen(
            [sys.executable, "-c", RUN + script],
            cwd=tmp_path,
            env={**environment, "PYTHONPATH": path},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    return started


def compiled(process):
    output, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    return [line.removeprefix("compiled ") for line in output.splitlines() if line.startswith("compiled")]


ONCE = {
    "outer array(float64, 1d, C)": 1,
    "inner array(float64, 1d, C)": 1,
    "outer array(int64, 1d, C)": 1,
    "inner array(int64, 1d, C)": 1,
    "halved int64": 1,
}


def test_two_processes_that_start_on_an_empty_cache_lose_nothing_of_each_others(start, tmp_path):
    scripts = "assert loops.outer(np.arange(4.0)) == 14.0", "assert loops.outer(np.arange(4)) == 14.0"
    for both in ((ALL, ALL), scripts):
        shutil.rmtree(tmp_path / "cache", ignore_errors=True)
        (tmp_path / "go").unlink(missing_ok=True)
        processes = [start(script, tmp_path) for script in both]
        for process in processes:
            assert process.stdout.readline() == "ready\n"
        (tmp_path / "go").touch()
        assert {*compiled(processes[0]), *compiled(processes[1])} <= ONCE.keys()
        # a third one finds both signatures of each
        assert compiled(start("\n".join(scripts), tmp_path)) == []


EACH = """
# two threads that need functions of each other
from threading import Thread
jobs = [Thread(target=loops.outer, args=(np.arange(4.0),)), Thread(target=loops.inner, args=(np.arange(4.0), 1))]
for job in jobs: job.start()
for job in jobs: job.join()
# a function that cannot be compiled
from numba.core.errors import TypingError
for _ in range(2):
    try:
        loops.impossible(np.arange(4.0))
        raise AssertionError
    except TypingError:
        pass
# a function that is inlined is in the cache as well where Python calls it
assert loops.doubled(2.0) == 4.0
"""
IMPOSSIBLE = ["impossible array(float64, 1d, C)"] * 2


def test_each_function_is_compiled_once(start, tmp_path):
    (tmp_path / "go").touch()
    loops = ["doubled float64", *(f"{name} array(float64, 1d, C)" for name in ("inner", "outer"))]
    assert sorted(compiled(start(EACH, tmp_path))) == sorted([*loops, *IMPOSSIBLE])
    assert compiled(start(EACH, tmp_path)) == IMPOSSIBLE


def test_every_change_of_the_package_compiles_it_again_once(start, tmp_path):
    (tmp_path / "go").touch()
    assert compiled(start("assert loops.changing(2.0) == 6.0", tmp_path)) == ["changing float64"]
    for before, after, value in (
        ("x + 1.0", "x + 2.0", 8.0),  # an inlined function
        ("lambda x: x", "lambda x: x + 1.0", 8.0),  # what numba knows of a plain one
        ("FACTOR = 2.0", "FACTOR = 3.0", 9.0),  # a constant
    ):
        assert before in DEEPER
        changed = start(f"assert loops.changing(2.0) == {value}", tmp_path, DEEPER.replace(before, after))
        assert compiled(changed) == ["changing float64"]
    assert compiled(start("assert loops.changing(2.0) == 9.0", tmp_path, DEEPER.replace(before, after))) == []


@each(("kind", "damaged"), product(["nbi", "nbc"], [b"", b"\x80\x04 no pickle", None]))
def test_a_damaged_file_is_compiled_again_and_written_over(start, tmp_path, kind, damaged):
    (tmp_path / "go").touch()
    assert Counter(compiled(start(ALL, tmp_path))) == ONCE
    files = [*(tmp_path / "cache").rglob(f"*.{kind}")]
    assert files
    for file in files:
        file.write_bytes(file.read_bytes()[:-9] if damaged is None else damaged)
    assert Counter(compiled(start(ALL, tmp_path))) == ONCE
    assert compiled(start(ALL, tmp_path)) == []


def test_without_a_folder_or_room_for_the_cache_every_process_compiles(start, tmp_path):
    (tmp_path / "go").touch()
    script = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n"
    assert Counter(compiled(start(script + ALL, tmp_path))) == ONCE
    (tmp_path / "file").write_text("a file where the folder should be", encoding="utf-8")
    nowhere = str(tmp_path / "file")
    for variables in (
        {"NUMBA_CACHE_DIR": nowhere},
        {"NUMBA_CACHE_DIR": None, "HOME": nowhere, "XDG_CACHE_HOME": nowhere},
    ):
        for _ in range(2):
            assert Counter(compiled(start(ALL, tmp_path, **variables))) == ONCE


def test_without_a_home_the_cache_is_that_of_the_users_entry(start, tmp_path):
    (tmp_path / "go").touch()
    script = "from posefit.arrays.compiling import cache_folder\nassert cache_folder('package.loops').is_absolute()\n"
    nothing = {"NUMBA_CACHE_DIR": None, "HOME": None, "XDG_CACHE_HOME": str(tmp_path / "caches")}
    assert Counter(compiled(start(script + ALL, tmp_path, **nothing))) == ONCE
    assert compiled(start(ALL, tmp_path, **nothing)) == []
