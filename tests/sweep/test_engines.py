"""What a cell can do wrong ends with that cell; what runs it makes no difference."""

import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import replace
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from posefit.sweep.cell import TIMES, TrackCell, run_cell
from posefit.sweep.driver import ATTEMPTS, Driver, Tally, drive_cells
from posefit.sweep.engines.engine import Engine, EngineError, Limits, Outcome
from posefit.sweep.engines.processes import Processes
from posefit.sweep.ledger import Ledger
from posefit.sweep.plan import Plan
from tests.sweep import fake
from tests.sweep.fake import behave, cells, swept

LIMITS = Limits(seconds=300.0, gigabytes=0.6)  # a slow machine takes seconds to start a worker
PATIENCE = 300.0  # seconds for workers to come; these tests mean something else
ROOT = Path(__file__).parents[2]
Make = Callable[..., Engine]


def cluster(*address: str, workers: int | None = None, limits: Limits = LIMITS, patience: float = PATIENCE) -> Any:
    """Return an engine of Dask workers: those of a scheduler at an address, or so many of its own."""
    pytest.importorskip("distributed")
    from posefit.sweep.engines.cluster import Cluster

    return Cluster(*address, workers=workers, limits=limits, run=behave, patience=patience)


@pytest.fixture(params=["processes", pytest.param("dask", marks=pytest.mark.slow)])
def make(request: pytest.FixtureRequest) -> Make:
    """Return what makes an engine of so many workers."""
    if request.param == "processes":
        return lambda workers, limits=LIMITS: Processes(workers, limits, behave)
    return lambda workers, limits=LIMITS: cluster(workers=workers, limits=limits)


def one_by_one(engine: Engine, chosen: Sequence[TrackCell]) -> list[Outcome]:
    """Return what becomes of cells, each of which begins when the one before has ended."""
    outcomes: list[Outcome] = []
    with closing(engine):
        engine.window()
        for cell in chosen:
            engine.submit(cell)
            while not (ended := engine.wait(1.0)):
                pass
            outcomes += ended
    return outcomes


def test_a_cell_that_was_quarantined_is_tried_again_once_its_file_is_gone(tmp_path: Path) -> None:
    bad = [replace(cells(1)[0], frames=fake.RAISE)]
    assert swept(tmp_path / "ledger", bad, Processes(1, LIMITS, behave)).quarantined == 1
    assert swept(tmp_path / "ledger", bad, Processes(1, LIMITS, behave)).failed == 0
    for path in (tmp_path / "ledger" / "quarantine").iterdir():
        path.unlink()
    assert swept(tmp_path / "ledger", bad, Processes(1, LIMITS, behave)).failed == 3


@pytest.mark.slow
def test_a_plan_gives_the_same_rows_twice_on_both_engines_and_in_another_order(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    from posefit.sweep.engines.cluster import Cluster

    corruptions = [{}, {"holes": 0.5, "dropped": 0.5}]
    methods = ["sapso@pca", "cma@pca", "particle@full"]
    product = {"methods": methods, "motions": ["walk"], "corruptions": corruptions, "views": [[0, 90]], "seeds": 2}
    plan = Plan.of({"defaults": {"frames": 3, "size": [80, 60], "evaluations": 200, "instance": 1}, "product": product})
    runs: list[tuple[str, Any, Engine]] = [
        ("processes", list(plan), Processes(2, Limits(), run_cell)),
        ("again", list(plan)[::-1], Processes(1, Limits(), run_cell)),
        ("dask", list(plan)[::-1], Cluster(workers=2, patience=PATIENCE)),
    ]
    results = []
    for name, chosen, engine in runs:
        assert swept(tmp_path / name, chosen, engine).done == len(plan)
        ledger = Ledger(tmp_path / name)
        rows = {row["key"]: row for row in ledger.rows()}
        for row in rows.values():
            assert row.pop("joints")[1] > 0
            for column in TIMES:
                assert row.pop(column) > 0.0
        joints = {key: {k: v.tobytes() for k, v in ledger.joints(key).items()} for key in rows}
        results.append((rows, joints))
    assert results[0] == results[1] == results[2]
    first = next(iter(results[0][0].values()))
    assert first["trace"]["evaluations"][-1] <= 200
    assert first["trace"]["cost"] == sorted(first["trace"]["cost"], reverse=True)


def test_a_cell_that_ends_its_process_with_status_0_is_noticed_at_once(make: Make, tmp_path: Path) -> None:
    # the limit is an hour: a sweep that waits for it takes three, and no test here does
    bad = [replace(cells(1)[0], frames=n) for n in (fake.LEAVE, fake.EXIT)]
    tally = swept(tmp_path / "ledger", [*bad, *cells(3)], make(1, Limits(3600.0, 0.6)))
    assert (tally.done, tally.quarantined, tally.failed) == (3, 2, 2 * ATTEMPTS)
    reasons = {row["spec"]["frames"]: row["reasons"] for row in Ledger(tmp_path / "ledger").quarantined()}
    assert reasons[fake.LEAVE] == ["its process ended itself with status 0"] * 3
    assert reasons[fake.EXIT] == ["SystemExit: 0"] * 3


def test_a_process_that_something_outside_kills_costs_its_cell_no_attempt(make: Make) -> None:
    ended = one_by_one(make(1), cells(2, fake.KILLED))
    reasons = ["its process died of SIGKILL", "its process died of SIGTERM"]
    assert [(outcome.reason, outcome.own) for outcome in ended] == [(reason, False) for reason in reasons]


def test_limits_of_memory_and_time_segfaults_and_exceptions_are_the_cells_own_faults(make: Make) -> None:
    reasons = {
        fake.SEGFAULT: "its process died of SIGSEGV",
        fake.HOG: "it wanted more memory than its limit of 0.6 GB",
        fake.RAISE: "ZeroDivisionError: one by none",
    }
    ended = one_by_one(make(1, Limits(600.0, 0.6)), [replace(cells(1)[0], frames=n) for n in reasons])
    assert [(outcome.reason, outcome.own) for outcome in ended] == [(reason, True) for reason in reasons.values()]
    (endless,) = one_by_one(make(1, Limits(3.0, 0.6)), [replace(cells(1)[0], frames=fake.ENDLESS)])
    assert (endless.reason, endless.own) == ("it ran past its limit of 3 s", True)


def test_where_numba_is_loaded_already_a_worker_leaves_its_number_of_threads_alone() -> None:
    # as in a worker that `--preload numba` started, or where a script's top imports it before the pool's initialiser
    code = """
import os
os.environ["NUMBA_NUM_THREADS"] = "2"
import numba
from tests.sweep.fake import compiled
compiled()
from posefit.sweep.engines.processes import become_worker
become_worker()
assert os.environ["NUMBA_NUM_THREADS"] == "2", os.environ["NUMBA_NUM_THREADS"]
assert compiled() == 1
"""
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


@pytest.mark.slow
def test_a_cell_changes_nothing_for_other_tasks_on_a_shared_worker(served: "Served", tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.Client(served.address) as client:
        client.wait_for_workers(1, timeout=PATIENCE)
        before = client.submit(surroundings, pure=False).result()
        bad = [replace(cells(1)[0], frames=n) for n in (fake.SEGFAULT, fake.LEAVE, fake.HOG, fake.COMPILE)]
        engine = cluster(served.address)
        assert swept(tmp_path / "ledger", [*bad, *cells(2)], engine).quarantined == 3
        assert client.submit(surroundings, pure=False).result() == before


def surroundings() -> list[Any]:
    """Return what of a process a cell might have changed, and the process itself."""
    import os
    import resource
    import signal

    threads = {name: value for name, value in os.environ.items() if name.endswith("_THREADS")}
    handlers = [signal.getsignal(number) is signal.SIG_IGN for number in (signal.SIGINT, signal.SIGTERM)]
    return [os.getpid(), threads, handlers, resource.getrlimit(resource.RLIMIT_DATA), "numba" in sys.modules]


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="reads which ports are open from /proc")
def test_workers_of_this_machine_listen_on_the_loopback_alone_and_show_no_page_unless_asked() -> None:
    pytest.importorskip("distributed")
    from posefit.sweep.engines.cluster import Cluster

    for asked, status in ((False, 404), (True, 200)):
        with closing(Cluster(workers=1, run=behave, patience=PATIENCE, dashboard=asked)) as engine:
            engine.window()
            assert set(listening()) == {"0100007F"}  # 127.0.0.1, as the kernel writes it
            address = urlsplit(engine._local.dashboard_link)
            connection = HTTPConnection(str(address.hostname), address.port)
            connection.request("GET", "/status")
            assert connection.getresponse().status == status
            connection.close()


def listening() -> Iterator[str]:
    """Yield the addresses that this process and its descendants listen on."""
    parents = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            parents[int(path.parent.name)] = int(path.read_text().rpartition(")")[2].split()[1])
    mine = {os.getpid()}
    while more := {process for process, parent in parents.items() if parent in mine} - mine:
        mine |= more
    sockets = set()
    for process in mine:
        with suppress(OSError):
            sockets |= {os.readlink(path) for path in Path(f"/proc/{process}/fd").iterdir()}
    for name in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{name}").read_text().splitlines()[1:]:
            words = line.split()
            if words[3] == "0A" and f"socket:[{words[9]}]" in sockets:
                yield words[1].partition(":")[0]


def test_two_workers_run_two_cells_at_once(make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # each of the two ends once both have begun
    monkeypatch.setenv(fake.STARTS, str(tmp_path / "starts"))
    tally = swept(tmp_path / "ledger", cells(2, fake.TOGETHER), make(2))
    assert (tally.done, tally.failed) == (2, 0)
    assert len({worker for _, worker in fake.starts(tmp_path / "starts")}) == 2


def port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def dask(*words: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "distributed.cli." + words[0], *words[1:]],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        cwd=ROOT,
    )


class Served:
    """A Dask scheduler at an address, with one worker; it can go away and come back."""

    def __init__(self) -> None:
        self._port = port()
        self.address = f"tcp://127.0.0.1:{self._port}"
        self._started: list[subprocess.Popen[bytes]] = []

    def come(self) -> None:
        self._started = [
            dask("dask_scheduler", "--port", str(self._port), "--host", "127.0.0.1", "--no-dashboard", "--no-show"),
            dask("dask_worker", self.address, "--nthreads", "1", "--no-dashboard", "--death-timeout", "300"),
        ]

    def go(self) -> None:
        for process in self._started:
            process.kill()
            process.wait()


@pytest.fixture
def served() -> Iterator[Served]:
    pytest.importorskip("distributed")
    scheduler = Served()
    scheduler.come()
    yield scheduler
    scheduler.go()


def test_a_scheduler_that_is_not_there_is_named(tmp_path: Path) -> None:
    address = f"tcp://127.0.0.1:{port()}"
    with pytest.raises(EngineError, match=f"scheduler must be one that answers, got {address}"):
        cluster(address, patience=1.0)


@pytest.mark.slow
def test_a_scheduler_that_goes_away_leaves_all_finished_rows(served: Served, tmp_path: Path) -> None:
    engine = cluster(served.address)
    assert engine.window() == 1
    engine._patience = 1.0

    def watch(tally: Tally) -> None:
        if tally.done == 3:
            served.go()

    with (
        Driver(tmp_path / "ledger") as driver,
        pytest.raises(ValueError, match=r"127.*; \d of 20 cells are done and safe: the same command goes on"),
    ):
        drive_cells(cells(20), driver, engine, print, watch)
    assert 3 <= len(Ledger(tmp_path / "ledger")) < 20
    assert not list((tmp_path / "ledger" / "leases").iterdir())
    assert swept(tmp_path / "ledger", cells(20), Processes(2, LIMITS, behave)).done == 20


@pytest.mark.slow
def test_a_scheduler_that_comes_back_is_waited_for(served: Served, tmp_path: Path) -> None:
    engine = cluster(served.address)
    gone = []

    def watch(tally: Tally) -> None:
        if tally.done == 3 and not gone:
            served.go()
            gone.append(True)
            served.come()

    with Driver(tmp_path / "ledger") as driver:
        tally = drive_cells(cells(8), driver, engine, print, watch)
    assert (tally.done, tally.quarantined) == (8, 0)
    assert len(list(Ledger(tmp_path / "ledger").rows())) == 8
