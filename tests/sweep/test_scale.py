"""A ledger of 100,000 rows opens in little memory, and a row more costs no more than the first."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from posefit.sweep.cell import CellResult, TrackCell
from posefit.sweep.driver import Driver
from posefit.sweep.ledger import ROWS, Ledger
from posefit.sweep.log import Writer
from tests.effort import Effort, effort
from tests.report.browser import row_of
from tests.sweep.fake import cells, leased

ROOT = Path(__file__).parents[2]
COUNT = 100_000
counted = pytest.mark.skipif(not Path("/proc/self/io").exists(), reason="reads what it took from /proc")
OPEN = """
import json, sys, time
from posefit.sweep.ledger import Ledger
began = time.perf_counter()
ledger = Ledger(sys.argv[1])
opened = time.perf_counter() - began
table = ledger.frame()
traces = sum(len(row["trace"]["cost"]) for row in ledger.rows())
taken = time.perf_counter() - began
status = dict(line.split(":", 1) for line in open("/proc/self/status"))  # a child's ru_maxrss is its parent's at least
print(json.dumps([len(table), traces, opened, taken, 1024 * int(status["VmHWM"].split()[0])]))
"""


def real(cell: TrackCell) -> CellResult:
    """Return a result as large as that of a real cell."""
    trace = {"evaluations": list(range(40, 2480, 40)), "cost": [float(f"{20.0 / k:.6g}") for k in range(1, 62)]}
    return CellResult(row_of(cell, cell.seed / 7.0, trace=trace), b"\0" * 1000)


def filled(folder: Path, count: int) -> Path:
    """Return a ledger with so many rows, in four logs."""
    first = cells(1)[0]
    with Driver(folder):
        for part in range(4):
            writer = Writer(folder / ROWS)
            for seed in range(part * count // 4, (part + 1) * count // 4):
                result = real(replace(first, seed=seed))
                writer.append(result.row["key"], result.row, result.joints)
            writer.close()
    return folder


def one_more(folder: Path) -> Effort:
    """Return the least that leasing and finishing a cell takes, of some."""
    with Driver(folder) as driver:
        efforts = [effort(lambda cell=cell: driver.finish(leased(driver, cell), real(cell))) for cell in cells(5, 1)]  # type: ignore[misc]
    return Effort(min(one.calls for one in efforts), min(one.read for one in efforts))


@counted
def test_twice_the_rows_take_twice_the_calls_and_every_byte_is_read_twice(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    efforts = []
    for count in (100, 400, 800, 1600):  # the first imports what the others need
        folder = filled(tmp_path / f"{count}", count)
        efforts.append(effort(lambda folder=folder: Ledger(folder).frame()))  # type: ignore[misc]
        size = sum(path.stat().st_size for path in (folder / ROWS).glob("*.jsonl"))
        assert count == 100 or efforts[-1].read < 2.1 * size  # once to find the rows, once for the table
    calls = [one.calls for one in efforts]
    assert calls[3] - calls[2] == pytest.approx(2.0 * (calls[2] - calls[1]), rel=0.1)


@counted
def test_a_row_more_takes_no_more_calls_and_reads_no_more_however_long_the_ledger(tmp_path: Path) -> None:
    efforts = []
    for count in (4, 4, 2000):  # all in four logs; the first one warms up
        efforts.append(one_more(filled(tmp_path / f"{len(efforts)}", count)))
    _, at_first, later = efforts
    assert later.calls == at_first.calls
    assert later.read <= at_first.read + 100


@pytest.mark.slow
@counted
def test_100_000_rows_open_in_2_gigabytes(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    words = [sys.executable, "-c", OPEN, str(filled(tmp_path / "ledger", COUNT))]
    printed = subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    rows, points, opened, taken, peak = json.loads(printed)
    print(f"{rows} rows: opened in {opened:.1f} s, read in {taken:.1f} s, {peak / 1e9:.2f} GB")
    assert rows == COUNT
    assert points == 61 * rows
    assert peak < 2e9
