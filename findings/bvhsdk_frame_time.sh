#!/bin/sh
# bvhsdk 0.2.1: a file that is read and written again has its frame time rounded to 5 decimals.
#
# 0.0083417 s, of 119.88 frames a second, becomes 0.00834, of 119.90: a second in 83 minutes. Each joint that had three
# channels has six afterwards, with its offset as a position in each frame. Put the line of the first file in place.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet bvhsdk==0.2.1 numpy==2.4.6
cd "$folder"
venv/bin/python -W ignore - <<'PYTHON'
from importlib.metadata import version
from pathlib import Path

import bvhsdk

print("bvhsdk", version("bvhsdk"))
Path("walk.bvh").write_text(
    """HIERARCHY
ROOT Hips
{
  OFFSET 0.0 0.0 0.0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Knee
  {
    OFFSET 0.0 -40.0 0.0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0.0 -10.0 0.0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.0083417
1 2 3 10 20 30 11 12 13
1 2 3 10 20 30 11 12 13
"""
)
bvhsdk.WriteBVH(bvhsdk.ReadFile("walk.bvh"), ".", "again")
lines = [line.strip() for line in Path("again.bvh").read_text().splitlines()]
(frame_time,) = [line for line in lines if line.startswith("Frame Time")]
channels = [line for line in lines if line.startswith("CHANNELS")]
print(frame_time, channels, sep="\n")
print(lines[-1])
unchanged = float(frame_time.partition(":")[2]) == 0.00834
unchanged = unchanged and [line.split()[1] for line in channels] == ["6", "6"]
raise SystemExit(not unchanged)
PYTHON
