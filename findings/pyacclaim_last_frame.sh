#!/bin/sh
# pyacclaim 0.0.1: loadAMC leaves out the last frame of an .amc file.
#
# A frame is kept when the number of the next one is read, and after the last there is none: three frames are read as
# two, and a file of one frame as none, without a word. (AMCParser, another reader, did so until 2018, pull request
# 2.) Write one more number, such as 4, as the last line.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pyacclaim==0.0.1 numpy==2.4.6
cd "$folder"
cat > walk.asf <<'ASF'
:version 1.10
:name walker
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
  one leg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name femur
    direction 0 -1 0
    length 7.0
    axis 0 0 0 XYZ
    dof rx
    limits (-160.0 20.0)
  end
:hierarchy
  begin
    root femur
  end
ASF
venv/bin/python - <<'PYTHON'
from importlib.metadata import version
from pathlib import Path

import numpy as np
from pyacclaim.parser import loadAMC, loadASF

print("pyacclaim", version("pyacclaim"))
skeleton = loadASF("walk.asf", verbose=False)


def angles(count, end=""):
    """Return the femur's angles, as they are read, of a file with 10, 20, ... degrees."""
    lines = ["#!OML:ASF", ":FULLY-SPECIFIED", ":DEGREES"]
    for k in range(1, count + 1):
        lines += [str(k), "root 0 17 0 0 0 0", f"femur {10 * k}"]
    Path("walk.amc").write_text("\n".join(lines) + "\n" + end)
    frames = loadAMC(skeleton, "walk.amc")
    return [round(float(np.degrees(frame["femur"][0])), 6) for frame in frames]


read = {"three frames": angles(3), "one frame": angles(1), "three, and a 4": angles(3, "4\n")}
for name, seen in read.items():
    print(f"{name}: femur {seen}")
raise SystemExit(list(read.values()) != [[10.0, 20.0], [], [10.0, 20.0, 30.0]])
PYTHON
