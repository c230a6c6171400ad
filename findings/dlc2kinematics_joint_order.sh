#!/bin/sh
# dlc2kinematics 0.0.7: compute_joint_angles takes the three points of a joint in the file's order, not in the one given.
#
# The angle of {"elbow": ["shoulder", "elbow", "wrist"]} should be the one at the elbow, which is 90 degrees here. It is the angle
# at whichever of the three is in the middle of the table's columns: with columns shoulder, elbow, wrist 90, with elbow,
# shoulder, wrist 143, between the lines that meet at the shoulder. (joint_analysis.py selects columns by a mask.) Put the
# table's columns into the joint's order first: df.reindex(columns=names, level="bodyparts").
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet numpy==1.26.4 pandas==2.3.3 scipy==1.15.3 \
    scikit-learn==1.7.2 matplotlib==3.10.9 scikit-kinematics==0.10.4 ruamel.yaml==0.19.1
# without its viewers
"$folder/venv/bin/python" -m pip install --quiet --no-deps dlc2kinematics==0.0.7
cd "$folder"
MPLBACKEND=agg venv/bin/python -W ignore - <<'PYTHON'
import sys
from importlib.metadata import distribution, version
from types import ModuleType

import numpy as np
import pandas as pd

# the package itself imports its viewers
package = ModuleType("dlc2kinematics")
package.__path__ = [str(distribution("dlc2kinematics").locate_file("dlc2kinematics"))]
sys.modules["dlc2kinematics"] = package
from dlc2kinematics.joint_analysis import compute_joint_angles

print("dlc2kinematics", version("dlc2kinematics"))
places = {"shoulder": (0.0, 0.0, 0.0), "elbow": (0.0, 400.0, 0.0), "wrist": (300.0, 400.0, 0.0)}
arm = ["shoulder", "elbow", "wrist"]


def angle(names, order=None):
    """Return the angle of the elbow, of a table with these points in this order."""
    columns = pd.MultiIndex.from_product(
        [["network"], names, ["x", "y", "z"]],
        names=["scorer", "bodyparts", "coords"],
    )
    row = np.concatenate([places[name] for name in names])
    table = pd.DataFrame(np.tile(row, (4, 1)), columns=columns)
    if order:
        table = table.reindex(columns=order, level="bodyparts")
    joints = {"elbow": arm}
    angles = compute_joint_angles(table, joints, save=False)
    return float(angles["elbow"].iloc[0])


others = ["elbow", "shoulder", "wrist"]
found = [angle(arm), angle(others), angle(others, arm)]
print("columns", arm, found[0])
print("columns", others, found[1], "in the joint's order", found[2])
raise SystemExit(not np.allclose(found, [90.0, 143.1301, 90.0], atol=0.01))
PYTHON
