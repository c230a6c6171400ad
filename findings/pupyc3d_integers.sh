#!/bin/sh
# pupyC3D 0.1.3: negative coordinates of a C3D file in integers come out as large positive ones.
#
# A file with a positive POINT:SCALE has its points as signed 16-bit integers times the scale. C3DFile reads them as
# unsigned: -10 mm at a scale of 0.5 is 32758 mm, 65,536 units more. Files in floating point are read right, and ezc3d
# reads both. Take 65,536 scales off what is above 32,767 of them.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pupyC3D==0.1.3 c3d==0.6.0 ezc3d==1.7.2 numpy==2.4.6
cd "$folder"
venv/bin/python -W ignore - <<'PYTHON'
from importlib.metadata import version

import c3d
import ezc3d
import numpy as np
from pupyC3D.c3dfile import C3DFile

print("pupyC3D", version("pupyC3D"))
read = {}
for scale in (0.5, -1.0):
    writer = c3d.Writer(point_rate=100.0, analog_rate=0.0, point_scale=scale)
    writer.set_point_labels(["knee"])
    point = np.array([[-10.0, 20.0, -30.0, 0.0, 0.0]])
    writer.add_frames([(point, np.zeros((0, 0)))] * 2)
    with open("walk.c3d", "wb") as file:
        writer.write(file)
    other = ezc3d.c3d("walk.c3d")["data"]["points"][:3, 0, 0]
    read[scale] = np.array(C3DFile("walk.c3d").get_point_data("knee"))[0, :3]
    print("scale", scale, "pupyC3D", read[scale], "ezc3d", other)
    assert np.allclose(other, [-10.0, 20.0, -30.0])
unchanged = np.allclose(read[0.5], [32758.0, 20.0, 32738.0])
unchanged = unchanged and np.allclose(read[-1.0], [-10.0, 20.0, -30.0])
raise SystemExit(not unchanged)
PYTHON
