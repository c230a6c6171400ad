#!/bin/sh
# trc-data-reader 0.4.1: where a marker is missing from a row, the markers after it take its place.
#
# A .trc file leaves the three cells of a marker that was not seen empty, as Mokka and this library's own `save` do.
# `load` splits rows at any white space, so that the empty cells vanish: without the hip, the knee's coordinates are
# the hip's, the ankle's are the knee's, and the last marker is nan. A gap of the hip that is saved and read again
# moves the whole leg. Split the rows at tabs, `line.split("\t")`, or write `nan` into empty cells.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet trc-data-reader==0.4.1 c3d==0.6.0 numpy==2.4.6
cd "$folder"
venv/bin/python - <<'PYTHON'
from importlib.metadata import version

import numpy as np
from trc import TRCData

print("trc-data-reader", version("trc-data-reader"))
head = "DataRate CameraRate NumFrames NumMarkers Units OrigDataRate OrigDataStartFrame OrigNumFrames".split()
rows = {
    "blank": "2\t0.01\t\t\t\t0.1\t0.5\t0.0\t0.1\t0.1\t0.0",
    "nan": "2\t0.01\tnan\tnan\tnan\t0.1\t0.5\t0.0\t0.1\t0.1\t0.0",
}
heights = {}
for name, row in rows.items():
    lines = [
        "PathFileType\t4\t(X/Y/Z)\twalk.trc",
        "\t".join(head),
        "100\t100\t2\t3\tm\t100\t1\t2",
        "Frame#\tTime\thip\t\t\tknee\t\t\tankle\t\t",
        "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\tX3\tY3\tZ3",
        "",
        "1\t0.00\t0.1\t0.9\t0.0\t0.1\t0.5\t0.0\t0.1\t0.1\t0.0",
        row,
    ]
    with open("walk.trc", "w") as file:
        file.write("\n".join(lines) + "\n")
    read = TRCData()
    read.load("walk.trc")
    heights[name] = [read[marker][1][1] for marker in ("hip", "knee", "ankle")]
    print(f"{name}: heights of hip, knee and ankle in the second row: {heights[name]}")
read.save("again.trc")
again = TRCData()
again.load("again.trc")
heights["again"] = [again[marker][1][1] for marker in ("hip", "knee", "ankle")]
print("saved and read again:", heights["again"])
shifted, right = [0.5, 0.1, np.nan], [np.nan, 0.5, 0.1]
unchanged = np.array_equal(heights["blank"], shifted, equal_nan=True)
unchanged = unchanged and np.array_equal(heights["again"], shifted, equal_nan=True)
unchanged = unchanged and np.array_equal(heights["nan"], right, equal_nan=True)
raise SystemExit(not unchanged)
PYTHON
