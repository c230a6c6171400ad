#!/bin/sh
# pyomeca 2026.0.2: Markers.from_c3d counts times from the first frame of the file, not of the recording.
#
# A .c3d file that was cut from a recording says so: its header has the number of its first frame, and its events keep
# their times in the recording. For frames 200 to 204 at 100 a second, `time` is 0.00 to 0.04, two seconds before the
# event at 2.02. `attrs["first_frame"]` has the number.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet \
    pyomeca==2026.0.2 ezc3d==1.7.2 pandas==3.1.1 numpy==2.4.6
cd "$folder"
venv/bin/python -W ignore - <<'PYTHON'
from importlib.metadata import version

import ezc3d
import numpy as np
import pyomeca

print("pyomeca", version("pyomeca"))
made = ezc3d.c3d()
point = made["parameters"]["POINT"]
point["RATE"]["value"] = [100.0]
point["LABELS"]["value"] = ["knee"]
point["UNITS"]["value"] = ["mm"]
made["data"]["points"] = np.ones((4, 1, 5))
made["header"]["points"]["first_frame"] = 200
made.add_event([0, 2.02], ["Right"], ["Foot Strike"])
made.write("walk.c3d")
markers = pyomeca.Markers.from_c3d("walk.c3d")
times = markers.time.values
read = ezc3d.c3d("walk.c3d")["parameters"]["EVENT"]["TIMES"]["value"]
print("times", times, "first_frame", markers.attrs["first_frame"], "event at", read[1])
unchanged = np.allclose(times, [0.0, 0.01, 0.02, 0.03, 0.04])
unchanged = unchanged and markers.attrs["first_frame"] == 200
unchanged = unchanged and np.allclose(read[1], 2.02)
raise SystemExit(not unchanged)
PYTHON
