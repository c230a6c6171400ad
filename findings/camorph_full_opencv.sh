#!/bin/sh
# camorph 1.0.0: of a COLMAP camera of the model FULL_OPENCV, k2 is lost, and k3 takes its place.
#
# COLMAP writes fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6. camorph takes k1 and goes on with k3, so that -0.25 0.1 0 0 0.02
# ... is written again, by itself, as -0.25 0.02 0 0 0 ..., and as k1 -0.25, k2 0.02 into NeRF's transforms.json. Half
# a picture's width from the centre, where x is 0.8 of the focal length, that moves a point by 12 of 640 pixels.
# Cameras of the model OPENCV keep their k2: use it where k3 to k6 are 0, or put the numbers into the written file.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet camorph==1.0.0 numpy==2.4.6 pillow==11.3.0
cd "$folder"
mkdir -p colmap/sparse colmap/images
MPLBACKEND=agg venv/bin/python -W ignore - <<'PYTHON'
import json
from importlib.metadata import version
from pathlib import Path

import numpy as np
from camorph import camorph
from PIL import Image

print("camorph", version("camorph"))
lenses = {
    "FULL_OPENCV": [-0.25, 0.1, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0],
    "OPENCV": [-0.25, 0.1, 0.0, 0.0],
}
Image.fromarray(np.zeros((480, 640), np.uint8)).save("colmap/images/a.png")
Path("colmap/sparse/images.txt").write_text("1 1 0 0 0 0 0 3 1 a.png\n\n")


def radius(k1, k2, k3):
    """Return where a point at 0.8 of the focal length is seen, in pixels."""
    squared = 0.8**2
    return 400.0 * 0.8 * (1.0 + k1 * squared + k2 * squared**2 + k3 * squared**3)


written = {}
for model, lens in lenses.items():
    numbers = " ".join(str(number) for number in [400, 400, 320, 240, *lens])
    Path("colmap/sparse/cameras.txt").write_text(f"1 {model} 640 480 {numbers}\n")
    cameras = camorph.read_cameras("COLMAP", "colmap/sparse")
    Path(model).mkdir()
    camorph.write_cameras("COLMAP", model, cameras)
    line = Path(model, "cameras.txt").read_text().splitlines()[3].split()
    written[model] = [float(number) for number in line[8:]]
    camorph.write_cameras("nerf", f"{model}.json", cameras)
    transforms = json.loads(Path(f"{model}.json").read_text())
    print(model, lens, "->", line[1], written[model], "NeRF:",
          {key: transforms[key] for key in ("k1", "k2", "k3")})
    if model == "FULL_OPENCV":
        nerf = [transforms["k1"], transforms["k2"], transforms["k3"]]
off = radius(-0.25, 0.1, 0.02) - radius(*nerf)
print(f"off by {off:.1f} pixels")
unchanged = written["FULL_OPENCV"] == [-0.25, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
unchanged = unchanged and written["OPENCV"] == lenses["OPENCV"]
unchanged = unchanged and nerf == [-0.25, 0.02, 0.0] and off > 10.0
raise SystemExit(not unchanged)
PYTHON
