#!/bin/sh
# nimblephysics 0.10.52.1: C3DLoader.loadC3D leaves out the first two frames, and counts times from the third.
#
# Of 50 frames at 100 a second there are 48. What is at time 0.0 was filmed 0.02 seconds later, so that a motion no longer
# fits a .mot or .trc file of the same recording: the markers of a person who runs at 5 m/s are 0.1 m away from there.
# (dart/biomechanics/C3DLoader.cpp starts at frame 2.) A file of two frames is read as empty. Put two copies of the
# first frame before the others, or read the file with ezc3d.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet ezc3d==1.7.2 numpy==2.4.6
# without torch, which its readers of files do not use
"$folder/venv/bin/python" -m pip install --quiet --no-deps nimblephysics==0.10.52.1
cd "$folder"
# two processes, because both libraries bring ezc3d
cat > write.py <<'PYTHON'
import ezc3d
import numpy as np

points = np.ones((4, 1, 50))
points[:3, 0] = [np.full(50, 100.0), np.full(50, 900.0), 50.0 * np.arange(50)]
file = ezc3d.c3d()
file["parameters"]["POINT"]["RATE"]["value"] = [100.0]
file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
file["parameters"]["POINT"]["LABELS"]["value"] = ["hip"]
file["data"]["points"] = points
file.write("run.c3d")
again = ezc3d.c3d("run.c3d")["data"]["points"]
print("ezc3d reads", again.shape[2], "frames, z from", again[2, 0, 0], "mm")
assert again.shape[2] == 50 and again[2, 0, 0] == 0.0
PYTHON
venv/bin/python write.py
venv/bin/python - <<'PYTHON'
from importlib.metadata import version
from pathlib import Path

from nimblephysics_libs import _nimblephysics

print("nimblephysics", version("nimblephysics"))
# it finds no file by a relative path
read = _nimblephysics.biomechanics.C3DLoader.loadC3D(str(Path("run.c3d").resolve()))
first = read.markerTimesteps[0]["hip"]
print(len(read.markerTimesteps), "frames, times", read.timestamps[:2], "first", first)
unchanged = len(read.markerTimesteps) == len(read.timestamps) == 48
unchanged = unchanged and read.timestamps[:2] == [0.0, 0.01]
unchanged = unchanged and abs(first[2] - 0.1) < 1e-6
raise SystemExit(not unchanged)
PYTHON
