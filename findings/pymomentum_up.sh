#!/bin/sh
# pymomentum-cpu 0.1.114.post0: load_markers with up=UpVector.Y, its default, lays a person down whose file has y up.
#
# momentum has y up, and `up` is "the up vector to use for the coordinate system". Yet a marker at (0.1, 0.9, 0.3) m
# comes, in centimetres, at (10, 30, -90) with UpVector.Y, and unchanged at (10, 90, 30) with UpVector.Z. So UpVector.Y is
# for files with z up, as of Vicon and Qualisys; for OpenSim's .trc files, with y up, give UpVector.Z. It is the same for
# .c3d files.
#
# It needs Python 3.12 or 3.13. Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3.12}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet numpy==2.4.6 c3d==0.6.0
# without torch, which its readers of files do not use
"$folder/venv/bin/python" -m pip install --quiet --no-deps pymomentum-cpu==0.1.114.post0
cd "$folder"
venv/bin/python -W ignore - <<'PYTHON'
from importlib.metadata import version

import c3d
import numpy as np
from pymomentum.geometry import UpVector, load_markers

print("pymomentum-cpu", version("pymomentum-cpu"))
head = "DataRate CameraRate NumFrames NumMarkers Units OrigDataRate OrigDataStartFrame OrigNumFrames".split()
lines = [
    "PathFileType\t4\t(X/Y/Z)\twalk.trc",
    "\t".join(head),
    "100.00\t100.00\t2\t1\tm\t100.00\t1\t2",
    "Frame#\tTime\thip\t\t",
    "\t\tX1\tY1\tZ1",
    "",
    "1\t0.00\t0.1\t0.9\t0.3",
    "2\t0.01\t0.1\t0.9\t0.3",
]
with open("walk.trc", "w") as file:
    file.write("\n".join(lines) + "\n")
writer = c3d.Writer(point_rate=100.0, analog_rate=0.0)
writer.set_point_labels(["hip"])
point = np.array([[100.0, 900.0, 300.0, 0.0, 0.0]])
writer.add_frames([(point, np.zeros((0, 0)))] * 2)
with open("walk.c3d", "wb") as file:
    writer.write(file)
unchanged = True
for name in ("walk.trc", "walk.c3d"):
    for options, wanted in (
        ({}, [10.0, 30.0, -90.0]),
        ({"up": UpVector.Y}, [10.0, 30.0, -90.0]),
        ({"up": UpVector.Z}, [10.0, 90.0, 30.0]),
    ):
        ((marker,), *_) = load_markers(name, **options)[0].frames
        print(name, options, "(100, 900, 300) mm ->", marker.pos, "cm")
        unchanged = unchanged and np.allclose(marker.pos, wanted, atol=1e-3)
raise SystemExit(not unchanged)
PYTHON
