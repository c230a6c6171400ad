#!/bin/sh
# aniposelib 0.8.0: CameraGroup.load changes the order of more than ten cameras that CameraGroup.dump wrote.
#
# The file has a table for each camera, cam_0, cam_1, ... cam_11. They are read in the order of their names as text:
# cam_10 and cam_11 come after cam_1. Up to ten cameras keep their order. `triangulate` takes an array by the number of
# the camera, so that points of twelve cameras, of which the file was written, come out elsewhere: here 0.8 m off, of
# exact points. The names in the tables are right, so that cameras can be put in order by `get_name()`.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet --no-deps aniposelib==0.8.0 opencv-contrib-python-headless==5.0.0.93 \
    numba==0.68.1 llvmlite==0.50.0 numpy==2.4.6 scipy==1.17.1 pandas==3.1.1 python-dateutil==2.9.0.post0 six==1.17.0 \
    tabulate==0.10.0 toml==0.10.2 tqdm==4.70.1
cd "$folder"
venv/bin/python -W ignore - <<'PYTHON'
from importlib.metadata import version

import numpy as np
from aniposelib.cameras import Camera, CameraGroup

print("aniposelib", version("aniposelib"))


def group_of(count):
    return CameraGroup(
        [
            Camera(
                name=f"view{k}",
                matrix=np.diag([500.0, 500.0, 1.0]),
                dist=np.zeros(5),
                size=(640, 480),
                rvec=[0.0, 0.02 * k, 0.0],
                tvec=[-0.1 * k, 0.0, 0.0],
            )
            for k in range(count)
        ]
    )


point = np.array([[0.1, 0.2, 3.0]])
off = {}
for count in (10, 12):
    written = group_of(count)
    written.dump("cameras.toml")
    read = CameraGroup.load("cameras.toml")
    pixels = written.project(point).reshape(count, 1, 2)
    names = [camera.get_name() for camera in read.cameras]
    off[count] = float(np.linalg.norm(read.triangulate(pixels) - point))
    print(count, names, f"off by {off[count]:.2f} m")
unchanged = names[1:4] == ["view1", "view10", "view11"]
unchanged = unchanged and off[10] < 1e-6 and 0.7 < off[12] < 0.9
raise SystemExit(not unchanged)
PYTHON
