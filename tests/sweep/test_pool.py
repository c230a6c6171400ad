"""What a cell can do wrong ends with that cell, in processes of this machine and on Dask's workers."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from posefit.errors import InputError
from posefit.silhouette.sharing import cores
from posefit.suites.functions import SUITE
from posefit.sweep.cell import SearchCell, TrackCell, run_cell
from posefit.sweep.command import swept as sweep
from posefit.sweep.drive import Tally, drive
from posefit.sweep.engine import Engine, Limits, Outcome
from posefit.sweep.ledger import Ledger
from posefit.sweep.plan import Plan
from posefit.sweep.pool import Pool
from posefit.sweep.schema import FILE
from posefit.sweep.serve import become_worker
from posefit.sweep.worker import _Process
from posefit.sweep.writer import ATTEMPTS, Writer
from posefit.version import posefit_build
from tests.cases import each
from tests.sweep import fake
from tests.sweep.fake import (
    behave,
    cells,
    port,
    quarantined_in,
    rows_in,
    scheduler,
    swept,
)

# the figures that two runs of a cell differ by
TIMES = ("seconds", "seconds_per_frame", "cpu_seconds_per_frame")
# a slow machine takes seconds to start a worker
LIMITS = Limits(seconds=300.0, gigabytes=0.6)
# seconds for workers to come; these tests mean something else
CONNECT_TIMEOUT_SECONDS = 300.0
ROOT = Path(__file__).parents[2]
Make = Callable[..., Engine]


@pytest.fixture(params=["pool", pytest.param("dask", marks=pytest.mark.slow)])
def make(request: pytest.FixtureRequest) -> Iterator[Make]:
    """Yield what makes an engine of so many workers."""
    if request.param == "pool":
        yield lambda workers, limits=LIMITS: Pool(workers, limits, behave)
        return
    with ExitStack() as served:
        yield lambda workers, limits=LIMITS: cluster(
            served.enter_context(scheduler(workers)), limits
        )


def cluster(
    address: str,
    limits: Limits,
    run: Any = behave,
    patience: float = CONNECT_TIMEOUT_SECONDS,
) -> Engine:
    """Return Dask as an engine, or skip the test where it is not installed."""
    pytest.importorskip("distributed")
    from posefit.sweep.cluster import Cluster

    return Cluster(address, limits, run, patience)


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


def test_exceptions_exits_and_limits_of_memory_and_time_are_the_cells_own_faults(
    make: Make,
) -> None:
    reasons = {
        fake.RAISE: "ZeroDivisionError: one by none",
        fake.EXIT: "SystemExit: 0",
        fake.HOG: "it needed more memory than its limit of 0.6 GB",
    }
    ended = one_by_one(make(1), [replace(cells(1)[0], frames=n) for n in reasons])
    ended += one_by_one(
        make(1, Limits(5.0, 0.6)), [replace(cells(1)[0], frames=fake.ENDLESS)]
    )
    assert [outcome.reason for outcome in ended] == [
        *reasons.values(),
        "it ran past its limit of 5 s",
    ]
    assert all(outcome.is_own_fault for outcome in ended)


def test_a_process_that_ends_itself_or_dies_is_noticed_at_once_and_a_kill_costs_no_attempt(
    make: Make,
) -> None:
    bad = [replace(cells(1)[0], frames=n) for n in (fake.LEAVE, fake.SEGFAULT)]
    ended = one_by_one(make(1, Limits(3600.0, 0.6)), [*bad, *cells(2, fake.KILLED)])
    assert [(outcome.reason, outcome.is_own_fault) for outcome in ended] == [
        ("its process ended itself with status 0", True),
        ("its process died of SIGSEGV", True),
        ("its process died of SIGKILL", False),
        ("its process died of SIGTERM", False),
    ]


def test_the_processors_of_this_process_are_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # 0 is this process; another may have all of the machine
    monkeypatch.setattr(
        os, "sched_getaffinity", lambda pid: {3} if pid == 0 else {0, 1}, raising=False
    )
    assert cores() == 1


def test_a_bad_cell_is_quarantined_after_three_attempts_and_run_again_on_request(
    tmp_path: Path,
) -> None:
    bad = cells(1, fake.RAISE)
    folder = tmp_path / "results"
    tally = swept(folder, [*bad, *cells(3)], Pool(1, LIMITS, behave))
    assert (tally.done, tally.quarantined, tally.failed) == (3, 1, ATTEMPTS)
    assert (
        quarantined_in(folder)[0]["reasons"] == ["ZeroDivisionError: one by none"] * 3
    )
    assert swept(folder, bad, Pool(1, LIMITS, behave)).failed == 0
    again = sweep(bad, folder, Pool(1, LIMITS, behave), print, retry_quarantined=True)  # type: ignore[arg-type]
    assert again.failed == 3


def test_two_workers_run_two_cells_at_once(
    make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # each of the two ends once both have begun
    monkeypatch.setenv(fake.STARTS, str(tmp_path / "starts"))
    tally = swept(tmp_path / "results", cells(2, fake.TOGETHER), make(2))
    assert (tally.done, tally.failed) == (2, 0)
    assert len({worker for _, worker in fake.starts(tmp_path / "starts")}) == 2


def test_a_worker_keeps_the_number_of_threads_if_numba_is_loaded() -> None:
    code = """
import os
os.environ["NUMBA_NUM_THREADS"] = "2"
import numba
from tests.sweep.fake import compiled
compiled()
from posefit.sweep.serve import single_thread
single_thread()
assert os.environ["NUMBA_NUM_THREADS"] == "2", os.environ["NUMBA_NUM_THREADS"]
assert compiled() == 1
import cv2
assert cv2.getNumThreads() == 1
"""
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


def test_leftovers_of_a_cell_reach_no_other_cell_and_end_with_the_sweep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    noted = tmp_path / "left"
    monkeypatch.setenv(fake.LEFT, str(noted))
    tally = swept(tmp_path / "r", cells(3, fake.LEAVE_BEHIND), Pool(1, LIMITS, behave))
    assert tally.done == 3
    found = [json.loads(line) for line in noted.read_text().splitlines()]
    untouched = [os.getcwd(), None, False, True, "warn"]
    assert [states[1:-1] for states in found] == [untouched] * 3
    # the random numbers go on as if no cell had set their seed: none takes any itself
    assert len({tuple(states[-1]) for states in found}) == 1
    wait_until(lambda: not any(is_running(states[0]) for states in found))


def test_a_process_runs_jobs_of_one_tenant_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("posefit.sweep.pool.SPARE", 1)
    chosen = cells(5)
    tenants = ["", "a 1.0", "", "b 1.0", ""]
    processes: dict[str, set[int]] = {}
    with closing(Pool(1, LIMITS, process_of)) as pool:
        for cell, tenant in zip(chosen, tenants, strict=True):
            pool.submit(cell, tenant)
            while not (ended := pool.wait(1.0)):
                pass
            processes.setdefault(tenant, set()).add(ended[0].result)
    # the process that was idle for longest made room
    assert len(processes[""]) == 1
    assert len(set().union(*processes.values())) == sum(map(len, processes.values()))


def test_a_process_that_does_not_start_is_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # no process starts at once
    monkeypatch.setattr("posefit.sweep.worker.START_SECONDS", 0.0)
    with closing(Pool(1, LIMITS, process_of)) as pool:
        pool.submit(cells(1)[0])
        while not (ended := pool.wait(0.0)):
            pass
    assert ended[0].reason == "its process did not start within 0 s"


def process_of(_: TrackCell) -> int:
    return os.getpid()


def fork_or_close(cell: TrackCell) -> int:
    """Fork this process where the seed is even, else close its connection and go on."""
    if cell.seed % 2 == 0:
        os.fork()
    else:
        os.closerange(3, 256)
        time.sleep(60.0)
    return cell.seed


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks processes")
def test_a_forked_process_gives_no_second_answer_and_one_that_cannot_answer_ends() -> (
    None
):
    ended = one_by_one(Pool(1, LIMITS, fork_or_close), [cells(4)[k] for k in (0, 2, 1)])
    assert [outcome.result for outcome in ended] == [0, 2, None]
    assert ended[-1].reason == "it closed the connection of its process"


def wait_until(true: Callable[[], bool]) -> None:
    """Wait until something is true; the limit of a test ends it otherwise."""
    while not true():
        time.sleep(0.02)


def is_running(process: int) -> bool:
    """Return whether there is a process that has not ended; who has ended may wait to be noticed."""
    state = Path(f"/proc/{process}/stat")
    try:
        return state.read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def interrupts() -> list[Any]:
    """Return whether Ctrl-C is blocked in this process, and what it does."""
    return [
        signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []),
        signal.getsignal(signal.SIGINT),
    ]


def starts_deaf(path: list[str]) -> None:
    """End with status 0 where this process was deaf to Ctrl-C before it became a worker, and is afterwards."""
    before = interrupts()
    become_worker(os.getppid(), path)
    deaf = before[0] and interrupts() == [False, signal.SIG_IGN]
    sys.exit(not deaf)


def test_a_worker_is_deaf_to_ctrl_c_from_its_first_moment() -> None:
    process = _Process(target=starts_deaf, args=(sys.path,))
    process.start()
    process.join(60.0)
    assert process.exitcode == 0
    assert not interrupts()[0]


def test_a_script_may_compare_without_a_guard(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import numpy as np\n"
        "import posefit\n\n"
        "class Middle:\n"
        "    def __init__(self, space, rng):\n        self.dimensions = space.dimensions\n"
        "    def ask(self):\n        return np.zeros((1, self.dimensions))\n"
        "    def tell(self, proposals, costs):\n        pass\n\n"
        "result = posefit.compare([Middle, {'method': Middle, 'name': 'again', 'settings': {'pca.components': 4}}],\n"
        "    seeds=1, frames=1, size=(80, 60), evaluations=2, workers=1)\n"
        "print(result.tally.done, [row['spec']['method'] for row in result.rows()])\n"
    )
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == "2 ['Middle@pca', 'Middle@pca']\n", done.stderr


PRODUCT = {
    "methods": ["sapso@pca", "cma@pca", "particle@full"], "motions": ["walk"], "corruptions": [{}, {"dropped": 0.5}],
    "views": [[0, 90]], "seeds": 2,
}  # fmt: skip


def test_a_pool_gives_the_rows_of_this_process_bit_for_bit(tmp_path: Path) -> None:
    methods = ("random", "sapso")
    searches = [
        SearchCell(name, SUITE, 1, 9, 10_000, 100, seed=seed)
        for name in methods
        for seed in (0, 1)
    ]
    assert swept(tmp_path, searches, Pool(2, Limits(), run_cell)).done == len(searches)
    rows = {row["key"]: row for row in rows_in(tmp_path)}
    # no two are the same search
    assert len({json.dumps(row["trace"]) for row in rows.values()}) == len(searches)
    for search in searches:
        expected = json.loads(json.dumps(run_cell(search)))
        same = [name for name in expected if name not in TIMES]
        assert [rows[search.key][name] for name in same] == [
            expected[name] for name in same
        ]


@pytest.mark.slow
def test_shards_another_order_and_dask_give_the_rows_of_one_run_bit_for_bit(
    tmp_path: Path,
) -> None:
    plan = Plan.of(
        {
            "defaults": {
                "frames": 3,
                "size": [80, 60],
                "evaluations": 200,
                "instance": 1,
            },
            "product": PRODUCT,
        }
    )

    def content(folder: Path) -> Any:
        with Ledger(folder) as ledger:
            return {
                row["key"]: {name: row[name] for name in row if name not in TIMES}
                for row in ledger.rows()
            }

    assert sweep(
        plan, tmp_path / "one", Pool(2, Limits(), run_cell), print
    ).done == len(plan)
    for shard in ("2/3", "1/3", "3/3"):
        sweep(
            plan, tmp_path / "shards", Pool(1, Limits(), run_cell), print, shard=shard
        )
    names = sorted(path.name for path in (tmp_path / "shards").glob("*.sqlite"))
    assert names == [f"ledger-{k}-of-3.sqlite" for k in (1, 2, 3)]
    with scheduler(2) as address:
        assert swept(
            tmp_path / "dask", list(plan)[::-1], cluster(address, Limits(), run_cell)
        ).done == len(plan)
    first = content(tmp_path / "one")
    assert len(first) == len(plan)
    assert content(tmp_path / "shards") == content(tmp_path / "dask") == first


def test_a_scheduler_that_is_not_there_is_named() -> None:
    address = f"tcp://127.0.0.1:{port()}"
    with pytest.raises(
        InputError,
        match=f"cannot use the scheduler {address}",
    ):
        cluster(address, LIMITS, patience=1.0)


@each(
    ("worker", "scheduler", "message"),
    [
        (ModuleNotFoundError("No module named 'posefit'"), None, "the worker tcp://b must have posefit .*, got none .*No module"),
        ("posefit 0.0.9 a1", None, "the worker tcp://b must have posefit .*, got posefit 0.0.9 a1"),
        (posefit_build(), ModuleNotFoundError("No module named 'posefit'"), "the scheduler tcp://s cannot import posefit"),
        (posefit_build(), None, None),
    ],
)  # fmt: skip
def test_dask_workers_without_this_posefit_are_refused_before_a_cell_is_lost(
    worker: Any, scheduler: Exception | None, message: str | None
) -> None:
    distributed = pytest.importorskip("distributed")
    client = Mock(status="running")
    client.run.return_value = {"tcp://a": posefit_build(), "tcp://b": worker}
    client.run_on_scheduler.side_effect = scheduler
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(distributed, "Client", lambda *_, **__: client)
        if message is None:
            cluster("tcp://s", LIMITS)
            # a single one is enough: others may come later
            assert client.wait_for_workers.call_args.args == (1,)
            return
        with pytest.raises(InputError, match=message):
            cluster("tcp://s", LIMITS)
    client.submit.assert_not_called()
    client.close.assert_called_once()


@pytest.mark.slow
def test_a_lost_scheduler_leaves_all_rows_and_the_same_command_continues(
    tmp_path: Path,
) -> None:
    with ExitStack() as served, Writer(tmp_path / "results" / FILE) as ledger:
        engine = cluster(served.enter_context(scheduler(1)), LIMITS)

        def watch(tally: Tally) -> None:
            if tally.done >= 3:
                served.close()

        ledger.plan(cells(10))
        with pytest.raises(
            ValueError,
            match=r"lost the connection to the scheduler .*127.*; \d+ of 10 cells are done and safe: run the same",
        ):
            drive(ledger, engine, print, watch)
    assert swept(tmp_path / "results", cells(10), Pool(2, LIMITS, behave)).done == 10
