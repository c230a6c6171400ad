"""numba's cache forgets a compiled function when anything has changed that it is made of, wherever that stands."""

import os
import subprocess
import sys

import pytest

CALLER = """
from posefit.arrays import jit
from called import WAY, factor

@jit
def total(pair, values):
    sum = 0.0
    for i in range(values.size):
        sum += factor(values[i]) * WAY[i] * pair.left
    return sum
"""
CALLED = """
from typing import NamedTuple
import numpy as np
from posefit.arrays import inlined, jit
from deeper import deep

WAY = np.array([1.0, 1.0])

class Pair(NamedTuple):
    left: float
    right: float

@jit
def factor(x):
    return shifted(x) * deep(x)

@inlined
def shifted(x):
    return x + 1.0
"""
# what numba is told of a plain function
DEEPER = """
from numba.extending import overload

def deep(x):
    return 2.0

@overload(deep)
def _compiled(x):
    return lambda x: 2.0
"""
RUN = """
import numpy as np
from numba.core import event

class Listener(event.Listener):
    def on_start(self, one):
        if one.data["dispatcher"].py_func.__module__ in ("caller", "called"):
            print(one.data["dispatcher"].py_func.__name__)
    def on_end(self, one):
        pass

event.register("numba:compile", Listener())
from caller import total
from called import Pair
print(total(Pair(left=1.0, right=10.0), np.array([2.0, 4.0])))
"""


@pytest.fixture
def run(tmp_path):
    files = {"caller.py": CALLER, "called.py": CALLED, "deeper.py": DEEPER}
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")

    def ran(name="caller.py", before="", after=""):
        files[name] = files[name].replace(before, after) if before else files[name]
        (tmp_path / name).write_text(files[name], encoding="utf-8")
        path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
        told = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "NUMBA_DISABLE_JIT": "0", "PYTHONPATH": path}
        told["PYTHONDONTWRITEBYTECODE"] = "1"  # Python takes a file of the same second and size for the same
        done = subprocess.run([sys.executable, "-c", RUN], env=told, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        *compiled, result = done.stdout.split()
        return sorted(compiled), float(result)

    # ((2 + 1) + (4 + 1)) * 2
    assert ran() == (["factor", "total"], 16.0)
    return ran


def test_a_second_process_compiles_nothing(run):
    assert run() == ([], 16.0)


@pytest.mark.parametrize(
    ("name", "before", "after", "result"),
    [
        ("called.py", "shifted(x) * deep(x)", "shifted(x)", 8.0),  # a compiled function: 3 + 5
        ("called.py", "x + 1.0", "x + 2.0", 20.0),  # an inlined one: (4 + 6) * 2
        ("deeper.py", "lambda x: 2.0", "lambda x: 3.0", 24.0),  # what numba is told of a plain one: (3 + 5) * 3
    ],
)
def test_a_change_in_a_function_that_is_called_compiles_both_anew(run, name, before, after, result):
    assert run(name, before, after) == (["factor", "total"], result)
    assert run() == ([], result)


@pytest.mark.parametrize(
    ("before", "after", "result"),
    [
        ("np.array([1.0, 1.0])", "np.array([1.0, 0.0])", 6.0),  # a constant of another module: (2 + 1) * 2
        ("    left: float\n    right: float", "    right: float\n    left: float", 16.0),  # an argument's fields
    ],
)
def test_a_change_of_what_a_function_names_compiles_it_anew(run, before, after, result):
    compiled, found = run("called.py", before, after)
    assert "total" in compiled
    assert found == result


def test_other_ways_of_compiling_make_other_code(run, tmp_path):
    compiled, found = run("called.py", "@jit", "import numba\n@numba.njit(fastmath=True)")
    assert compiled == ["factor", "total"]
    assert found == 16.0
