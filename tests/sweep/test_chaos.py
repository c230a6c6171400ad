"""Whatever is killed, no row is lost, none comes twice, and nothing runs again that was not killed."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from posefit.sweep.ledger import Ledger
from tests.sweep.chaos import Chaos
from tests.sweep.fake import LIMITS, STARTS, starts

ROOT = Path(__file__).parents[2]
ENGINES = ["processes", pytest.param("dask", marks=pytest.mark.slow)]


@contextmanager
def driver(folder: Path, engine: str, count: int, *more: str) -> Iterator[subprocess.Popen[bytes]]:
    """Start a driver of its own process group; nothing of it is left over afterwards."""
    words = [sys.executable, "-m", "tests.sweep.fake", str(folder / "ledger"), engine, str(count), *more]
    environment = {**os.environ, STARTS: str(folder / "starts"), "PYTHONPATH": str(ROOT)}
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


def living(process: int) -> bool:
    """Return whether a process runs, and is no zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def leased(folder: Path) -> set[str]:
    return {path.name.partition(".")[0] for path in (folder / "ledger" / "leases").glob("[!.]*")}


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds a driver's processes in /proc")
@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_a_sabotaged_sweep_loses_and_doubles_no_row_and_quarantines_no_healthy_cell(
    engine: str, tmp_path: Path
) -> None:
    # `python -m tests.sweep.chaos` is the long version
    if engine == "dask":
        pytest.importorskip("distributed")
    result = Chaos(tmp_path, engine, 24, 8, 1).run()
    assert [result[name] for name in ("lost", "doubled", "quarantined")] == [0, 0, 0]


def test_two_drivers_at_once_run_no_cell_twice(tmp_path: Path) -> None:
    with driver(tmp_path, "processes", 24, "slow") as one, driver(tmp_path, "processes", 24, "slow") as other:
        assert one.wait(timeout=600) == 0
        assert other.wait(timeout=600) == 0
    assert len(Ledger(tmp_path / "ledger")) == 24
    runs = starts(tmp_path / "starts")
    assert len(runs) == len({key for key, _ in runs}) == 24
    assert len({worker for _, worker in runs}) > 2  # both took part
    assert not leased(tmp_path)


@pytest.mark.parametrize("engine", ENGINES)
def test_ctrl_c_finishes_the_running_cells_and_the_next_sweep_goes_on(engine: str, tmp_path: Path) -> None:
    if engine == "dask":
        pytest.importorskip("distributed")
    noted = tmp_path / "starts"
    with driver(tmp_path, engine, 40, "slow") as process:
        wait_for(lambda: len(starts(noted)) > 5)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers too
        assert process.wait(timeout=600) == 130
    rows = {row["key"] for row in Ledger(tmp_path / "ledger").rows()}
    assert rows == {key for key, _ in starts(noted)}  # whatever was begun was finished
    assert len(rows) < 40
    assert not leased(tmp_path)


def test_ctrl_c_twice_stops_at_once_and_loses_no_row(tmp_path: Path) -> None:
    noted = tmp_path / "starts"
    with driver(tmp_path, "processes", 40, "slow") as process:
        wait_for(lambda: len(starts(noted)) > 5)
        for _ in range(2):
            os.killpg(process.pid, signal.SIGINT)
            time.sleep(0.05)
        assert process.wait(timeout=600) == 130
    rows = {row["key"] for row in Ledger(tmp_path / "ledger").rows()}
    begun = [key for key, _ in starts(noted)]
    assert set(begun[:-2]) <= rows <= set(begun)  # two cells ran
    assert not leased(tmp_path)
    assert LIMITS.seconds > 1.0  # it was not the limit that stopped them
