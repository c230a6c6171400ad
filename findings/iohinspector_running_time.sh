#!/bin/sh
# iohinspector 0.0.8: aggregate_running_time gives an expected running time (ERT) that is too low, or too high.
#
# Three runs of 20, 50 and 30 evaluations reach the target after 5, never, and after 10: 5 + 50 + 10 evaluations for
# two successes are 32.5. As `load` leaves out what does not improve, the largest evaluation in the data is the 10 of
# the last improvement, which counts as the budget of the run that failed: 12.5. With `monotonic=False` the last of
# several equal values counts as the first hit, here the end of the run: 50. PAR-10 errs alike. Load monotonic data,
# and set `eval_max` to the budget.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet iohinspector==0.0.8 ioh==0.4.2 \
    polars==2.1.0 pandas==3.1.1 numpy==2.4.6
cd "$folder"
MPLBACKEND=agg venv/bin/python -W ignore - <<'PYTHON'
from importlib.metadata import version

import ioh
import iohinspector
import numpy as np

print("iohinspector", version("iohinspector"), "ioh", version("ioh"))
sphere = ioh.get_problem(1, 1, 2, ioh.ProblemClass.BBOB)
logger = ioh.logger.Analyzer(root=".", folder_name="runs", algorithm_name="steps")
sphere.attach_logger(logger)
best = np.array(sphere.optimum.x)
for budget, hit in ((20, 5), (50, None), (30, 10)):
    for count in range(1, budget + 1):
        reached = hit is not None and count >= hit
        sphere(best + np.array([0.0 if reached else 2.0, 0.0]))
    sphere.reset()
logger.close()
manager = iohinspector.DataManager()
manager.add_folder("runs")


def expected(**limits):
    """Return the ERT of the target 0.01, and the least running time."""
    data = manager.load(limits.pop("monotonic", True), include_meta_data=True)
    table = iohinspector.metrics.aggregate_running_time(
        data, f_min=0.01, f_max=1.0, **limits
    )
    row = table.iloc[0]
    return float(row["ERT"]), float(row["min"])


seen = {
    "as loaded": expected(),
    "monotonic=False": expected(monotonic=False),
    "eval_max=50": expected(eval_max=50),
}
for name, (time, least) in seen.items():
    print(f"{name}: ERT {time}, the first hit of all after {least:.0f}")
print("budgets of the runs:", manager.overview["evals"].to_list())
wanted = [(12.5, 5.0), (50.0, 20.0), (32.5, 5.0)]
raise SystemExit(list(seen.values()) != wanted)
PYTHON
