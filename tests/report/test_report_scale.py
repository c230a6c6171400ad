"""A ledger of 100,000 rows is reported in little memory, on a page that a browser still takes."""

import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.report.browser import ledger, result
from tests.sweep.fake import cells

ROOT = Path(__file__).parents[2]
METHODS = 10
# of the trace of every row
PROPOSED = list(range(40, 2480, 40))
FALLING = 20.0 / np.arange(1.0, 62.0)
REPORT = """
import json, sys, time
from posefit.report.write import write_report
began = time.perf_counter()
done = write_report(sys.argv[1], sys.argv[2]).data["header"]["done"]
taken = time.perf_counter() - began
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
print(json.dumps([done, taken, 1024 * int(status["VmHWM"].split()[0])]))
"""


def rows(instances: int, seeds: int) -> Iterator[dict[str, Any]]:
    """Yield rows as large as real ones."""
    first = replace(cells(1)[0], frames=60)
    rng = np.random.default_rng(0)
    for m in range(METHODS):
        for i in range(instances):
            for s, error in enumerate(rng.gamma(2.0, 1.0, seeds).tolist()):
                trace: dict[str, Any] = {
                    "evaluations": PROPOSED,
                    "cost": np.round(FALLING + error, 4).tolist(),
                }
                cell = replace(first, method=f"m{m}@pca", instance=i, seed=s)
                yield result(cell, error, trace=trace)


@pytest.mark.slow
@pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="reads what it took from /proc"
)
@pytest.mark.parametrize(("instances", "seeds"), [(100, 100), (5000, 2)])
def test_100_000_rows_are_reported_in_2_gigabytes(
    tmp_path: Path, instances: int, seeds: int
) -> None:
    made = ledger(tmp_path / "ledger", rows(instances, seeds))
    words = [sys.executable, "-c", REPORT, str(made), str(tmp_path / "report.html")]
    printed = subprocess.run(
        words, cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    done, taken, peak = json.loads(printed.splitlines()[-1])
    size = (tmp_path / "report.html").stat().st_size
    print(
        f"{done} rows in {taken:.1f} s, {peak / 1e9:.2f} GB, a page of {size / 1e6:.1f} MB"
    )
    assert done == METHODS * instances * seeds
    assert peak < 2e9
    assert size < 100 * done + 2e5
