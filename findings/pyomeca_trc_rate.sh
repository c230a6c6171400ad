#!/bin/sh
# pyomeca 2026.0.2: Markers.from_trc rounds the frame rate to a whole number.
#
# A .trc file states its rate twice, as DataRate and by its times. For a file of 29.97 or 119.88 frames a second, both
# of them right, `attrs["rate"]` is 30.0 and 120.0: read.py takes the inverse of the first two times and rounds it.
# Times are as the file has them. (The separator is given, as the method expects commas where .trc files have tabs.)
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pyomeca==2026.0.2 ezc3d==1.7.2 pandas==3.1.1 numpy==2.4.6
cd "$folder"
venv/bin/python - <<'PYTHON'
from importlib.metadata import version

import pyomeca

print("pyomeca", version("pyomeca"))
unchanged = True
for fps, seen in ((29.97, 30.0), (119.88, 120.0), (25.0, 25.0)):
    head = "DataRate CameraRate NumFrames NumMarkers Units OrigDataRate OrigDataStartFrame OrigNumFrames".split()
    lines = [
        "PathFileType\t4\t(X/Y/Z)\twalk.trc",
        "\t".join(head),
        f"{fps}\t{fps}\t5\t1\tm\t{fps}\t1\t5",
        "Frame#\tTime\tknee\t\t",
        "\t\tX1\tY1\tZ1",
        "",
        *(f"{k + 1}\t{k / fps:.6f}\t0.1\t0.5\t{k}.0" for k in range(5)),
    ]
    with open("walk.trc", "w") as file:
        file.write("\n".join(lines) + "\n")
    markers = pyomeca.Markers.from_trc("walk.trc", pandas_kwargs={"sep": "\t"})
    rate = markers.attrs["rate"]
    print(f"DataRate {fps}: attrs['rate'] is {rate}")
    unchanged = unchanged and rate == seen and markers.shape == (4, 1, 5)
raise SystemExit(not unchanged)
PYTHON
