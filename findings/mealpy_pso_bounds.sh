#!/bin/sh
# mealpy 3.0.3: OriginalPSO never tries a bound, so that it does not find an optimum that lies there.
#
# A coordinate that leaves the box is drawn again, uniformly over the whole box, where HPSO_TVAC, OriginalGWO and
# OriginalWOA of the same library put it on the bound. The sum of five numbers from 1 to 3 is least, 5, with all of them
# at 1: after 1,220 evaluations OriginalPSO has tried the value 1 never, and the others in a third of all coordinates or
# more.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet mealpy==3.0.3 opfunu==1.0.4 numpy==1.26.0
cd "$folder"
venv/bin/python -W ignore - <<'PYTHON'
from importlib.metadata import version

import numpy as np
from mealpy import FloatVar
from mealpy.swarm_based import GWO, PSO, WOA

print("mealpy", version("mealpy"))
shares = {}
best = {}
for method in (PSO.OriginalPSO, PSO.HPSO_TVAC, GWO.OriginalGWO, WOA.OriginalWOA):
    tried = []

    def total(values):
        tried.append(np.array(values))
        return float(np.sum(values))

    problem = {
        "obj_func": total,
        "bounds": FloatVar(lb=(1.0,) * 5, ub=(3.0,) * 5),
        "minmax": "min",
        "log_to": None,
    }
    found = method(epoch=60, pop_size=20).solve(problem, seed=1)
    name = method.__name__
    shares[name] = float((np.array(tried) == 1.0).mean())
    best[name] = found.target.fitness
    print(f"{name}: best {best[name]:.4f}, at the bound {100 * shares[name]:.0f} %")
unchanged = shares.pop("OriginalPSO") == 0.0 and best.pop("OriginalPSO") > 5.0
unchanged = unchanged and min(shares.values()) > 0.3
unchanged = unchanged and max(best.values()) == 5.0
raise SystemExit(not unchanged)
PYTHON
