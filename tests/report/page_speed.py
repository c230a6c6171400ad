"""How fast a report is made and opened: `python -m tests.report.page_speed` prints a line a size.

Times of making are CPU seconds of a process of its own; a page is opened three times, and the quickest counts, until
its script has drawn everything.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.report.browser import browser, ledger, opened
from tests.report.test_report_scale import ROOT, rows

SIZES = {168: (8, 3, 7), 5_000: (100, 5, 10), 100_000: (100, 100, 10)}  # rows: instances, seeds, methods
TIMES = 3
MADE = """
import json, sys, time
from posefit.report.write import write_report
write_report(sys.argv[1], sys.argv[2], warn=print)
print(json.dumps([time.process_time(), time.perf_counter()]))
"""
_LOADED = "performance.getEntriesByType('navigation')[0].loadEventEnd"


def main(sizes: list[int]) -> None:
    """Print of each number of rows what making and opening the page takes."""
    print(f"{'rows':>7} {'made, CPU s':>12} {'page, MB':>9} {'opened, s':>10}")
    for size in sizes:
        with tempfile.TemporaryDirectory() as folder:
            page = Path(folder) / "report.html"
            made = ledger(Path(folder) / "ledger", rows(*SIZES[size]))
            words = [sys.executable, "-c", MADE, str(made), str(page)]
            printed = subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True).stdout
            taken = json.loads(printed.splitlines()[-1])[0]
            shown = min(_opened(page) for _ in range(TIMES))
            print(f"{size:>7,} {taken:>12.1f} {page.stat().st_size / 1e6:>9.2f} {shown:>10.2f}", flush=True)


def _opened(page: Path) -> float:
    """Return the seconds until a page is loaded."""
    with browser() as chromium, opened(chromium, page) as watched:
        watched.page.wait_for_function(f"{_LOADED} > 0")
        return float(watched.page.evaluate(_LOADED)) / 1000.0


if __name__ == "__main__":
    main([int(word) for word in sys.argv[1:]] or list(SIZES))
