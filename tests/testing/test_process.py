"""`posefit check` runs in a process of its own: whatever an installed plugin does is a result and nothing else."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from posefit.testing import process, results
from posefit.testing.process import check_in_process
from tests.testing import planted
from tests.testing.sabotage import install, named

ROOT = Path(__file__).parents[2]
TRACK = ("track", "walk", "--frames", ":1", "--evaluations", "80", "--method")


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have every planted plugin installed, for this process and those that it starts."""
    monkeypatch.syspath_prepend(ROOT)
    monkeypatch.syspath_prepend(install(tmp_path / "site"))
    monkeypatch.setenv(
        "PYTHONPATH", os.pathsep.join([str(tmp_path / "site"), str(ROOT)])
    )


def posefit(*words: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", "posefit", *words], capture_output=True, text=True
    )


@pytest.mark.parametrize("bug", planted.APART, ids=named)
@pytest.mark.usefixtures("installed")
def test_the_check_that_ran_fails_when_its_process_ends(
    bug: Any, monkeypatch: Any, capfd: Any
) -> None:
    if bug is planted.NeverReturns:
        monkeypatch.setattr(results, "SECONDS", 1.0)
        monkeypatch.setattr(process, "OVERRUN_SECONDS", 1.0)
    report = check_in_process(
        "optimiser", named(bug), only=["construction", "shape", "dtype"]
    )
    assert [result.name for result in report.of("passed")] == ["construction", "shape"]
    (failed,) = report.of("failed")
    assert failed.name == "dtype"
    assert failed.detail.startswith(bug.ends)
    # where Python could not say it, the process does
    if bug in (planted.Crashes, planted.NeverReturns):
        assert f'File "{planted.__file__}"' in capfd.readouterr().err


@pytest.mark.usefixtures("installed")
def test_the_checks_continue_after_a_crash_until_another_fails_alike() -> None:
    report = check_in_process(
        "optimiser", "ends-the-process", only=["shape", "dtype", "dimensions", "speed"]
    )
    outcomes = {
        "shape": "passed",
        "dtype": "failed",
        "dimensions": "failed",
        "speed": "skipped",
    }
    assert [(result.name, result.outcome) for result in report.results] == list(
        outcomes.items()
    )
    assert (
        report.results[-1].detail == "not run: dtype and dimensions fail for one cause"
    )


def test_a_name_that_two_plugins_register_is_checked_once_one_has_another(
    monkeypatch: Any, tmp_path: Path
) -> None:
    (tmp_path / "mine.py").write_text(
        "from posefit.plugin import hookimpl\n@hookimpl\n"
        "def posefit_register_optimisers(register):\n    register('sapso', dict)\n"
    )
    install(tmp_path, "mine", "mine")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), str(ROOT)]))
    ran = posefit("check", "optimiser", "sapso")
    assert ran.returncode == 2
    assert ran.stderr.endswith(
        "posefit: optimiser 'sapso' must be registered by one plugin, got posefit, which is used, and mine "
        "(posefit-mine 1.0), which is left out: give it another name\n"
    )
    assert posefit("check", "optimiser", "pso", "--only", "shape").returncode == 0


@pytest.mark.usefixtures("installed")
def test_output_printed_by_a_plugin_is_in_no_result() -> None:
    checked = posefit(
        "check",
        "optimiser",
        "talks",
        "--only",
        "shape",
        "--only",
        "new_process",
        "--json",
    )
    assert checked.returncode == 0
    assert [result["outcome"] for result in json.loads(checked.stdout)["results"]] == [
        "passed",
        "passed",
    ]
    tracked = posefit(*TRACK, "talks", "--json")
    assert tracked.returncode == 0, tracked.stderr
    assert json.loads(tracked.stdout)["method"] == "talks@pca"
    for ran in (checked, tracked):
        assert "asked\n" in ran.stderr
        assert "asked, too\n" in ran.stderr


@pytest.mark.usefixtures("installed")
def test_a_plugin_that_exits_ends_a_track_with_status_2_and_one_line() -> None:
    for kind, name, what in (
        ("optimiser", "exits-in-tell", "tell"),
        ("tracker", "exits-in-track", "track"),
    ):
        ran = posefit(*TRACK, name)
        assert (ran.returncode, ran.stdout) == (2, "")
        (line,) = [
            line
            for line in ran.stderr.splitlines()
            if line.startswith(f"posefit: {kind} ")
        ]
        blame = f"posefit: {kind} '{name}' of posefit-sabotage 1.0: {what}"
        assert line.startswith(f"{blame} must not end the program, got SystemExit: 0")
        assert "Traceback" not in ran.stderr


@pytest.mark.usefixtures("installed")
def test_the_process_of_a_check_ends_with_its_parent(
    tmp_path: Path,
) -> None:
    words = ["check", "optimiser", "never-returns", "--only", "dtype"]
    with (tmp_path / "err").open("w") as err:
        ran = subprocess.Popen(
            [sys.executable, "-m", "posefit", *words],
            stdout=subprocess.DEVNULL,
            stderr=err,
        )
        try:
            wait_until(lambda: children(ran.pid))
            (child,) = children(ran.pid)
        finally:
            ran.kill()
            ran.wait()
    words_of = Path(f"/proc/{child}/cmdline")
    wait_until(lambda: not words_of.exists() or not words_of.read_bytes())


def children(process: int) -> list[int]:
    """Return the processes that one has started."""
    return [
        int(word)
        for word in Path(f"/proc/{process}/task/{process}/children").read_text().split()
    ]


def wait_until(condition: Callable[[], Any]) -> None:
    """Return once a condition holds. Raises AssertionError where that takes a minute."""
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.usefixtures("installed")
def test_a_thread_that_a_plugin_leaves_running_does_not_keep_a_track_from_ending() -> (
    None
):
    ran = posefit(*TRACK, "leaves-a-thread", "--threads", "2")
    assert ran.returncode == 0
    assert (
        ran.stderr.splitlines()[-1]
        == "posefit: not waiting for threads that a plugin left running: planted"
    )


@pytest.mark.usefixtures("installed")
def test_a_rule_is_checked_alone_and_an_unknown_one_is_named() -> None:
    report = check_in_process("optimiser", "sound", only=["speed"])
    assert [result.name for result in report.results] == ["speed"]
    assert report.plugin == "optimiser 'sound' of posefit-sabotage 1.0"
    with pytest.raises(
        ValueError, match="--only must be one of construction, shape, .*, got 'sped'"
    ):
        check_in_process("optimiser", "sound", only=["sped"])
