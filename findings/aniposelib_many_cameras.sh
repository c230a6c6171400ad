#!/bin/sh
# aniposelib 0.8.0: CameraGroup.load changes the order of more than ten cameras that CameraGroup.dump wrote.
#
# The file has a table for each camera, cam_0, cam_1, ... cam_11. They are read in the order of their names as text:
# cam_10 and cam_11 come after cam_1. Up to ten cameras keep their order. `project` and `triangulate` go by the number of
# the camera, so that pixels of the twelve cameras that were written are taken for those of other cameras, here up to 56
# pixels away. The names in the tables are right: put the cameras in order by `get_name()`.
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
    names = [camera.get_name() for camera in read.cameras]
    apart = read.project(point).reshape(count, 2) - written.project(point).reshape(count, 2)
    off[count] = float(np.linalg.norm(apart, axis=1).max())
    print(count, names, f"up to {off[count]:.0f} pixels off")
unchanged = names[1:4] == ["view1", "view10", "view11"]
unchanged = unchanged and off[10] < 1e-6 and 50.0 < off[12] < 60.0
raise SystemExit(not unchanged)
PYTHON
