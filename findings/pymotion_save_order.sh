#!/bin/sh
# upc-pymotion 0.3.4: BVH.save writes the root's order of rotations at every joint that has six channels.
#
# A knee with `Yrotation Xrotation Zrotation` 40 50 60 is written as `Zrotation Xrotation Yrotation` 40 50 60, if the root
# has this order: the numbers are kept, and mean another rotation. The ankle below moves by 8 cm, of a shank of 42 cm.
# Joints with three channels keep their order. Call set_rotation_order before `save`, which turns all joints to one.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet upc-pymotion==0.3.4 bvhio==1.5.4 numpy==2.4.6
cd "$folder"
cat > six.bvh <<'BVH'
HIERARCHY
ROOT Hips
{
  OFFSET 0.0 0.0 0.0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Knee
  {
    OFFSET 0.0 -40.0 0.0
    CHANNELS 6 Xposition Yposition Zposition Yrotation Xrotation Zrotation
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
Frames: 1
Frame Time: 0.01
50 92 0 10 20 30 0 -40 0 40 50 60 0 0 0
BVH
sed 's/CHANNELS 6 .* Yrotation Xrotation Zrotation/CHANNELS 3 Yrotation Xrotation Zrotation/; s/30 0 -40 0 40/30 40/' six.bvh > three.bvh
venv/bin/python - <<'PYTHON'
from importlib.metadata import version
from pathlib import Path

import bvhio
import numpy as np
from pymotion.io.bvh import BVH

print("upc-pymotion", version("upc-pymotion"))


def ankle(path):
    """Return where another library finds the ankle."""
    root = bvhio.readAsHierarchy(path)
    root.loadPose(0)
    return np.array(root.filter("Ankle")[0].PositionWorld)


moved = {}
for name in ("six", "three"):
    motion = BVH()
    motion.load(f"{name}.bvh")
    motion.save(f"{name}_saved.bvh")
    lines = [line.strip() for line in Path(f"{name}_saved.bvh").read_text().splitlines()]
    (_, channels, *_) = [line for line in lines if line.startswith("CHANNELS")]
    before, after = ankle(f"{name}.bvh"), ankle(f"{name}_saved.bvh")
    moved[name] = float(np.linalg.norm(after - before))
    motion.set_rotation_order("zxy")
    motion.save(f"{name}_same.bvh")
    assert np.allclose(ankle(f"{name}_same.bvh"), before, atol=1e-3)
    print(name, "channels:", channels, "ankle:", before, "->", after, f"{moved[name]:.2f}")
unchanged = abs(moved["six"] - 8.0) < 0.1 and moved["three"] < 1e-3
raise SystemExit(not unchanged)
PYTHON
