"""A plugin that is broken costs one line of a command, whatever is wrong with it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cases import each
from tests.testing.sabotage import install

ROOT = Path(__file__).parents[2]
BROKEN = {
    "raise ImportError('no module named lost,\\n  nor here')": (
        "ImportError: no module named lost, nor here"
    ),
    """
from posefit.plugin import hookimpl
class Mine:
    def __init__(self, space, rng, *, table: dict[str, int] = {}): ...
@hookimpl
def posefit_register_optimisers(register):
    register('mine', Mine)
""": (
        "InputError: optimiser 'mine': the type of the setting table must be int, float, bool, str, None, Literal, a "
        "union, a tuple or a list of these, got dict[str, int]"
    ),
}


@each("source, cause", BROKEN.items())
def test_a_broken_plugin_is_reported_in_one_line(
    source: str, cause: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.py").write_text(source)
    install(tmp_path, "mine", "mine")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", str(ROOT))])
    monkeypatch.setenv("PYTHONPATH", path)
    for words in (["plugins"], ["check", "optimiser", "random", "--only", "shape"]):
        ran = subprocess.run(
            [sys.executable, "-m", "posefit", *words], capture_output=True, text=True
        )
        assert ran.returncode == 0, ran.stderr
        lines = set(ran.stderr.splitlines())
        wanted = f"posefit: plugin 'mine' of posefit-mine 1.0 is left out: {cause}"
        assert lines == {wanted}
