"""`posefit bench --compile`: what compiles, when, and how long it takes."""

import json
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner

from posefit.cli import main
from posefit_experiments.bench import compiling
from posefit_experiments.bench.compiling import STAGES, compile_figures


def inner() -> None:
    """Be compiled."""


def outer() -> None:
    """Be compiled, and call the other one."""


def event_of(function: Any) -> Any:
    return SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=function), "args": ("float64", "int64")})


def test_a_functions_own_seconds_leave_out_what_is_compiled_within(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 1.0, 3.0, 7.0])  # outer begins, inner begins, inner ends, outer ends
    monkeypatch.setattr(compiling.time, "thread_time", lambda: next(clock))
    watch = compiling._Watch()
    watch.on_start(event_of(outer))
    watch.on_start(event_of(inner))
    watch.on_end(event_of(inner))
    watch.stage = STAGES[1]
    watch.on_end(event_of(outer))
    told = [(one["function"].rpartition(".")[2], one["seconds"], one["in_all"], one["stage"]) for one in watch.compiled]
    assert told == [("inner", 2.0, 2.0, STAGES[0]), ("outer", 5.0, 7.0, STAGES[1])]
    assert watch.compiled[0]["signature"] == "float64, int64"


def test_the_first_picture_is_part_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [
        {"function": "a", "signature": "", "stage": STAGES[0], "seconds": 1.0, "in_all": 1.0},
        {"function": "b", "signature": "", "stage": STAGES[1], "seconds": 3.0, "in_all": 3.5},
    ]
    monkeypatch.setattr(compiling, "CHILD", f"print({json.dumps(rows)!r})")
    figures = compile_figures()
    assert (figures["first_picture_seconds"], figures["default_sweep_seconds"]) == (1.0, 4.0)
    assert [one["function"] for one in figures["functions"]] == ["b", "a"]  # the longest first
    printed = CliRunner().invoke(main, ["bench", "--compile"]).stdout
    assert printed.splitlines()[0].split() == ["until", "the", "first", "picture", "1.00", "CPU", "s"]
    assert json.loads(CliRunner().invoke(main, ["bench", "--compile", "--json"]).stdout) == figures


def test_a_child_that_fails_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "CHILD", "raise SystemExit('no room')")
    with pytest.raises(ValueError, match="no room"):
        compile_figures()


@pytest.mark.slow
def test_every_function_compiles_for_one_signature() -> None:
    ours = [one["function"] for one in compile_figures()["functions"] if one["function"].startswith("posefit")]
    named = [name for name in ours if "<locals>" not in name]
    assert len(named) == len(set(named))
    assert "posefit.silhouette.kernels.count_areas" in named
