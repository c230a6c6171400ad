#!/bin/sh
# bvhtoolbox 0.1.3: `bvh2csv --scale` scales a joint once for each joint above it, too.
#
# Each joint's place is worked out from its parent's, which is already scaled, and scaled again. With 0.01, for metres
# from centimetres, the hips at (50, 92) come out at (0.5, 0.92), the knee below them, at (50, 52), at (0.005,
# -0.391), and the ankle at (0.00005, -0.424): the hips alone are right. Convert without it, and multiply the table.
# (`scale` of `bvhtoolbox.convert.bvh2csv` does the same.)
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet \
    bvhtoolbox==0.1.3 transforms3d==0.4.2 numpy==2.4.6
cd "$folder"
cat > walk.bvh <<'BVH'
HIERARCHY
ROOT Hips
{
  OFFSET 0.0 0.0 0.0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Knee
  {
    OFFSET 0.0 -40.0 0.0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT Ankle
    {
      OFFSET 0.0 -42.0 0.0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site
      {
        OFFSET 0.0 -8.0 0.0
      }
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.01
50 92 0 0 0 0 0 0 0 0 0 0
50 92 0 0 0 0 0 0 0 0 0 0
BVH
# it ends with 1 when it has succeeded
venv/bin/bvh2csv --position --out centimetres walk.bvh || true
venv/bin/bvh2csv --position --out metres --scale 0.01 walk.bvh || true
venv/bin/python - <<'PYTHON'
from importlib.metadata import version

import numpy as np

print("bvhtoolbox", version("bvhtoolbox"))
plain = np.loadtxt("centimetres/walk_pos.csv", delimiter=",", skiprows=1)[0, 1:]
scaled = np.loadtxt("metres/walk_pos.csv", delimiter=",", skiprows=1)[0, 1:]
for k, name in enumerate(("hips", "knee", "ankle")):
    print(name, plain[3 * k : 3 * k + 2], "->", scaled[3 * k : 3 * k + 2])
unchanged = np.allclose(plain, [50.0, 92.0, 0.0, 50.0, 52.0, 0.0, 50.0, 10.0, 0.0])
wanted = [0.5, 0.92, 0.0, 0.005, -0.3908, 0.0, 0.00005, -0.42391, 0.0]
unchanged = unchanged and np.allclose(scaled, wanted, atol=2e-5)
raise SystemExit(not unchanged)
PYTHON
