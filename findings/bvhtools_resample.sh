#!/bin/sh
# bvhTools 1.6.0: a motion that resampleFPS resampled runs at another speed.
#
# The new frames are spread evenly from the first old frame to the last, but are as many as fill the old duration, so
# that their times and their poses disagree. A second of a walk of 1.2 m/s, 120 frames, is 1.231 m/s at 30 frames a
# second; thirty frames that are brought to 120 a second become 1.170 m/s, and twelve frames of 120 a second 1.650 m/s
# at 30. The error is that of one frame, so that long clips hide it. For a whole ratio take every n-th of
# `motion.frames`; else interpolate at k / fps.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet bvhTools==1.6.0 numpy==2.4.6 scipy==1.17.1
cd "$folder"
venv/bin/python -W ignore - <<'PYTHON'
from importlib.metadata import version
from pathlib import Path

import numpy as np
from bvhTools.bvhIO import readBvh
from bvhTools.bvhMotionEditor import resampleFPS

print("bvhTools", version("bvhTools"))
head = """HIERARCHY
ROOT Hips
{
  OFFSET 0.0 0.0 0.0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  End Site
  {
    OFFSET 0.0 -0.9 0.0
  }
}
MOTION
"""


def speed(motion):
    """Return metres a second from the first frame to the last, by the frame time."""
    way = motion.frames[-1][0] - motion.frames[0][0]
    return way / (motion.frameTime * (motion.numFrames - 1))


expected = {
    (120, 120, 30): 1.231,
    (30, 30, 120): 1.170,
    (12, 120, 30): 1.650,
    (120, 120, 120): 1.200,
}
unchanged = True
for (count, fps, wanted), seen in expected.items():
    rows = [f"{1.2 * k / fps:.8f} 0 0 0 0 0" for k in range(count)]
    text = f"{head}Frames: {count}\nFrame Time: {1 / fps:.8f}\n" + "\n".join(rows)
    Path("walk.bvh").write_text(text + "\n")
    before = readBvh("walk.bvh")
    after = resampleFPS(before, wanted)
    print(
        f"{count} frames of {fps} a second, to {wanted}: {after.motion.numFrames} frames, "
        f"{speed(before.motion):.3f} m/s -> {speed(after.motion):.3f} m/s"
    )
    unchanged = unchanged and np.isclose(speed(before.motion), 1.2, atol=1e-3)
    unchanged = unchanged and np.isclose(speed(after.motion), seen, atol=1.5e-3)
raise SystemExit(not unchanged)
PYTHON
