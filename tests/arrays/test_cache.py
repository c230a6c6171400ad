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
# what numba knows of a plain function
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
        environment = {
            **os.environ,
            "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
            "NUMBA_DISABLE_JIT": "0",
            "PYTHONPATH": path,
        }
        environment["PYTHONDONTWRITEBYTECODE"] = "1"  # Python takes a file of the same second and size for the same
        done = subprocess.run([sys.executable, "-c", RUN], env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        *compiled, result = done.stdout.split()
        return sorted(compiled), float(result)

    return ran


def test_every_change_of_what_a_function_is_made_of_compiles_it_again_once(run):
    assert run() == (["factor", "total"], 16.0)  # ((2 + 1) + (4 + 1)) * 2
    assert run() == ([], 16.0)
    for name, before, after, compiled, value in [
        ("called.py", "x + 1.0", "x + 2.0", ["factor", "total"], 20.0),  # an inlined function: (4 + 6) * 2
        ("deeper.py", "lambda x: 2.0", "lambda x: 3.0", ["factor", "total"], 30.0),  # what numba knows of a plain one
        ("called.py", "shifted(x) * deep(x)", "shifted(x)", ["factor", "total"], 10.0),  # a compiled one
        ("called.py", "([1.0, 1.0])", "([1.0, 0.0])", ["total"], 4.0),  # a constant of another module
        ("called.py", "left: float\n    right", "right: float\n    left", ["total"], 4.0),  # an argument's fields
        ("called.py", "@jit", "import numba\n@numba.njit(fastmath=True)", ["factor", "total"], 4.0),
    ]:
        recompiled, result = run(name, before, after)
        assert set(recompiled) >= set(compiled), after
        assert result == value, after
        assert run() == ([], value) or "njit" in after, after
