#!/bin/sh
# c3d 0.6.0: a Writer of integers cuts coordinates off towards zero, so that a value on the grid may lose a whole step.
#
# With a point_scale of 0.1 mm, 20.0 mm should be 200 steps. The scale is a 32-bit number a little above 0.1, the
# quotient is 199.999997, and the file has 199: 19.9 mm. -10.0 mm becomes -9.9. Rounded to the nearest step, both would be
# kept. A scale that binary numbers hold, 0.125 or 0.5, keeps what lies on its grid.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet c3d==0.6.0 ezc3d==1.7.2 numpy==2.4.6
cd "$folder"
venv/bin/python -W ignore - <<'PYTHON'
from importlib.metadata import version

import c3d
import ezc3d
import numpy as np

print("c3d", version("c3d"))
written = [-10.0, 20.0, -30.0]
read = {}
for scale in (0.1, 0.125):
    writer = c3d.Writer(point_rate=100.0, analog_rate=0.0, point_scale=scale)
    writer.set_point_labels(["knee"])
    point = np.array([[*written, 0.0, 0.0]])
    writer.add_frames([(point, np.zeros((0, 0)))] * 2)
    with open("walk.c3d", "wb") as file:
        writer.write(file)
    with open("walk.c3d", "rb") as file:
        ((_, own, _), *_) = c3d.Reader(file).read_frames()
        read[scale] = own[0, :3].copy()
    other = ezc3d.c3d("walk.c3d")["data"]["points"][:3, 0, 0]
    print("scale", scale, "of", written, "c3d", read[scale], "ezc3d", other)
    assert np.allclose(read[scale], other)
unchanged = np.allclose(read[0.1], [-9.9, 19.9, -29.9], atol=1e-4)
unchanged = unchanged and np.allclose(read[0.125], written)
raise SystemExit(not unchanged)
PYTHON
