#!/bin/sh
# ioh 0.4.2: with bounds enforced as HARD, a point just outside them is better than the optimum.
#
# `enforce_bounds(how=ConstraintEnforcement.HARD)` returns the penalty in place of the value, not added to it. The
# penalty is the squared distance from the box, so that it is small next to the bounds: the sphere of BBOB, instance 1,
# has its optimum at 79.48, and the point 5.1 in each of 5 dimensions, of which -5 to 5 are allowed, has 0.05. It becomes
# `state.current_best`, too. SOFT adds the penalty, and OVERRIDE gives infinity.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet ioh==0.4.2 numpy==2.4.6
cd "$folder"
venv/bin/python - <<'PYTHON'
from importlib.metadata import version

import ioh
import numpy as np

print("ioh", version("ioh"))
ways = ioh.ConstraintEnforcement
values = {}
for way in (ways.HARD, ways.SOFT, ways.OVERRIDE):
    problem = ioh.get_problem(1, 1, 5, ioh.ProblemClass.BBOB)
    problem.enforce_bounds(how=way)
    values[way] = problem([5.1] * 5)
    inside = problem([5.0] * 5)
    best = problem.state.current_best.y
    print(f"{way.name}: outside {values[way]:.2f}, inside {inside:.2f}, best {best:.2f}")
    if way == ways.HARD:
        hard_best = best
print("optimum", problem.optimum.y)
unchanged = np.isclose(values[ways.HARD], 0.05) and np.isclose(hard_best, 0.05)
unchanged = unchanged and np.isclose(problem.optimum.y, 79.48)
unchanged = unchanged and values[ways.SOFT] > 200.0 and np.isinf(values[ways.OVERRIDE])
raise SystemExit(not unchanged)
PYTHON
