"""Whatever is killed, no row is lost, none comes twice, and no healthy cell is quarantined."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.sweep.chaos import LOST, Chaos
from tests.sweep.fake import STARTS, rows_in, starts
from tests.sweep.mischief import HARM, run_installed

ROOT = Path(__file__).parents[2]


@contextmanager
def driver(folder: Path, count: int) -> Iterator[subprocess.Popen[bytes]]:
    """Start a driver of its own process group; nothing of it is left over afterwards."""
    words = [
        sys.executable,
        "-m",
        "tests.sweep.fake",
        str(folder / "results"),
        str(count),
        "300",
    ]
    environment = {
        **os.environ,
        STARTS: str(folder / "starts"),
        "PYTHONPATH": str(ROOT),
    }
    process = subprocess.Popen(words, cwd=ROOT, env=environment, start_new_session=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def wait_for(what: Callable[[], bool], seconds: float = 600.0) -> None:
    until = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < until, "waited too long"
        time.sleep(0.02)


@pytest.mark.skipif(
    not Path("/proc/self/stat").exists(), reason="finds a driver's processes in /proc"
)
@pytest.mark.slow
def test_a_sabotaged_sweep_loses_and_doubles_no_row_and_quarantines_no_healthy_cell(
    tmp_path: Path,
) -> None:
    # `python -m tests.sweep.chaos` is the long version
    result = Chaos(tmp_path, 24, 8, 1).run()
    assert [result[name] for name in LOST] == [0] * len(LOST), result


@pytest.mark.skipif(
    not Path("/proc/self/stat").exists(), reason="finds what is left in /proc"
)
@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pool", "dask"])
def test_plugins_that_misbehave_change_no_cell_of_others_and_leave_no_process(
    engine: str,
) -> None:
    if engine == "dask":
        pytest.importorskip("distributed")
    # `python -m tests.sweep.mischief` is the long version
    outcome = run_installed(engine, 12, 2)
    assert [outcome[name] for name in HARM] == [0] * len(HARM), outcome


@pytest.mark.parametrize(("times", "lost"), [(1, 0), (2, 2)])
def test_ctrl_c_finishes_the_running_cells_and_twice_stops_them_at_once(
    times: int, lost: int, tmp_path: Path
) -> None:
    noted = tmp_path / "starts"
    with driver(tmp_path, 40) as process:
        wait_for(lambda: len(starts(noted)) > 5)
        for _ in range(times):
            # as a terminal does: to the workers too
            os.killpg(process.pid, signal.SIGINT)
            time.sleep(0.05)
        assert process.wait(timeout=600) == 130
    rows = {row["key"] for row in rows_in(tmp_path / "results")}
    begun = [key for key, _ in starts(noted)]
    assert set(begun[: len(begun) - lost]) <= rows <= set(begun)
    assert len(rows) < 40
