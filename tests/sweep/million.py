"""What a plan of a million cells takes: `python -m tests.sweep.million [CELLS]`.

Runs `posefit sweep PLAN --dry-run` on it and prints one JSON object: the lines that came, the processor time and the
largest memory of the command itself, without the two workers that try a cell of each kind, and the time on the clock.
"""

import json
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

PLAN = """
[product]
methods = ["sapso@pca", "random@pca", "cma@pca", "random@full"]
motions = ["walk", "run"]
views = [0, 45]
corruptions = [{{}}, {{ holes = 0.3 }}]
instances = 5
seeds = {seeds}
"""
COMMAND = """
import json, sys, time
from posefit.cli import main
try:
    main(sys.argv[1:])
finally:
    status = dict(line.split(":", 1) for line in open("/proc/self/status"))
    told = {"cpu seconds": round(time.process_time(), 1), "gigabytes": int(status["VmHWM"].split()[0]) * 1024 / 1e9}
    print(json.dumps(told), file=sys.stderr)
"""


def main() -> None:
    """Measure, and print."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    with TemporaryDirectory() as folder:
        plan = Path(folder) / "plan.toml"
        plan.write_text(PLAN.format(seeds=count // 160))
        words = [sys.executable, "-c", COMMAND, "sweep", str(plan), "--dry-run", "--workers", "2"]
        began = time.monotonic()
        with (Path(folder) / "out.txt").open("wb") as out:
            done = subprocess.run(words, stdout=out, stderr=subprocess.PIPE, text=True, check=True)
        taken = time.monotonic() - began
        with (Path(folder) / "out.txt").open("rb") as out:
            lines = sum(1 for _ in out)
    print(json.dumps({"lines": lines, **json.loads(done.stderr.splitlines()[-1]), "seconds": round(taken, 1)}))


if __name__ == "__main__":
    main()
