#!/bin/sh
# kineticstoolkit 0.17.0: kinematics.write_trc_file states the frame rate times the number of frames.
#
# Twelve frames of 100 a second have a DataRate of 1200, and 120 frames one of 12000, in all three places of the
# header: the number of frames is divided by the time between two. Times have three decimals, so that those of 119.88
# frames a second are 8 and 9 ms apart, and a reader that goes by them does not find the rate either. Put the rate
# into the third line, or write with ktk.write_c3d, which keeps it.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet \
    kineticstoolkit==0.17.0 ezc3d==1.7.2 pandas==3.1.1 numpy==2.4.6
cd "$folder"
MPLBACKEND=agg venv/bin/python -W ignore - <<'PYTHON'
from importlib.metadata import version
from pathlib import Path

import kineticstoolkit as ktk
import numpy as np

print("kineticstoolkit", version("kineticstoolkit"))
rates = {}
for fps, count in ((100.0, 12), (100.0, 120), (119.88, 12)):
    markers = ktk.TimeSeries(time=np.arange(count) / fps)
    markers.data["knee"] = np.tile([0.1, 0.5, 0.0, 1.0], (count, 1))
    ktk.kinematics.write_trc_file(markers, "walk.trc")
    lines = Path("walk.trc").read_text().splitlines()
    stated = dict(zip(lines[1].split(), lines[2].split(), strict=True))
    rates[fps, count] = float(stated["DataRate"])
    print(f"{count} frames of {fps} a second: DataRate {rates[fps, count]:.2f}")
    ktk.write_c3d("walk.c3d", markers)
    kept = ktk.read_c3d("walk.c3d", convert_point_unit=False)["Points"].get_sample_rate()
    assert abs(kept - fps) < 1e-3
times = [float(line.split()[1]) for line in lines[6:]]
steps = {int(step) for step in np.round(1000 * np.diff(times))}
print("steps of time in ms:", steps)
unchanged = all(np.isclose(rate, fps * count) for (fps, count), rate in rates.items())
raise SystemExit(not (unchanged and steps == {8, 9}))
PYTHON
