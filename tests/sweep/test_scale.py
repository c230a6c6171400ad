"""A ledger of 100,000 rows opens in seconds, in little memory, and a row more costs no more than the first."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from posefit.sweep.cell import Cell, CellResult
from posefit.sweep.driver import Claim, Driver
from posefit.sweep.ledger import ROWS
from posefit.sweep.log import Writer
from tests.sweep.fake import cells

ROOT = Path(__file__).parents[2]
COUNT = 100_000
OPEN = """
import json, sys, time
from posefit.sweep.ledger import Ledger
began = time.perf_counter()
ledger = Ledger(sys.argv[1])
opened = time.perf_counter() - began
table = ledger.frame()
traces = sum(len(cost) for _, _, cost in ledger.traces())
taken = time.perf_counter() - began
status = dict(line.split(":", 1) for line in open("/proc/self/status"))  # a child's ru_maxrss is its parent's at least
print(json.dumps([len(table), traces, opened, taken, 1024 * int(status["VmHWM"].split()[0])]))
"""


def real(cell: Cell) -> CellResult:
    """Return a result as large as that of a real cell."""
    trace = {"evaluations": list(range(40, 2480, 40)), "cost": [float(f"{20.0 / k:.6g}") for k in range(1, 62)]}
    figures = dict.fromkeys(("mpjpe_mm", "pa_mpjpe_mm", "iou", "cost", "swap_rate", "lost_rate"), cell.seed / 7.0)
    kinds = {
        name: dict.fromkeys(("mean_pose", "persistence", "nearest"), 1.0 / 3.0)
        for name in ("skill", "baselines_degrees")
    }
    row = {"key": cell.key, "spec": cell.spec, "status": "done", **figures, **kinds, "warnings": []}
    return CellResult({**row, "joint_errors_mm": [cell.seed / 3.0] * 27, "trace": trace, "seconds": 1.0}, b"\0" * 1000)


def costs(driver: Driver, chosen: Iterator[Cell]) -> float:
    """Return the least time in seconds that claiming and finishing a cell takes, of some."""
    least = float("inf")
    for cell in chosen:
        began = time.perf_counter()
        claim = driver.claim(cell)
        assert isinstance(claim, Claim)
        driver.finish(claim, real(cell))
        least = min(least, time.perf_counter() - began)
    return least


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads the memory it took from /proc")
def test_100_000_rows_open_in_30_seconds_and_2_gigabytes_and_the_next_row_costs_no_more(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    first = cells(1)[0]
    with Driver(tmp_path / "ledger") as driver:
        at_first = costs(driver, (replace(first, seed=seed, frames=1) for seed in range(200)))
    for part in range(4):
        writer = Writer(tmp_path / "ledger" / ROWS)
        for seed in range(part * COUNT // 4, (part + 1) * COUNT // 4):
            result = real(replace(first, seed=seed))
            writer.append(result.row["key"], result.row, result.joints)
        writer.close()
    words = [sys.executable, "-c", OPEN, str(tmp_path / "ledger")]
    told = subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    rows, points, opened, taken, peak = json.loads(told)
    print(f"{rows} rows: opened in {opened:.1f} s, read in {taken:.1f} s, {peak / 1e9:.2f} GB")
    assert rows == COUNT + 200
    assert points == 61 * rows
    assert taken < 30.0
    assert peak < 2e9
    with Driver(tmp_path / "ledger") as driver:
        later = costs(driver, (replace(first, seed=seed, frames=2) for seed in range(200)))
    print(f"a row: {1e6 * at_first:.0f} us at first, {1e6 * later:.0f} us later")
    assert later < 2.0 * at_first
