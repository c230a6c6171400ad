#!/bin/sh
# sleap-io 0.9.5: load_dlc reads the predictions that DeepLabCut writes for a video as no frames, without a word.
#
# DeepLabCut has one CSV form for labelled images, with a path in each row, and one for a video, with the number of the
# frame. `load_dlc` reads the first. Of the second it keeps the skeleton, and returns no frame and no video; `load_file`
# does so, too. Write the path of an image, `labeled-data/walk/img0.png`, before each row to have the frames.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet sleap-io==0.9.5 pillow==13.0.0 numpy==2.4.6
cd "$folder"
venv/bin/python -W ignore - <<'PYTHON'
from importlib.metadata import version
from pathlib import Path

import numpy as np
import sleap_io
from PIL import Image

print("sleap-io", version("sleap-io"))
head = """scorer,net,net,net,net,net,net
bodyparts,hip,hip,hip,knee,knee,knee
coords,x,y,likelihood,x,y,likelihood
"""
plain = head.replace(",likelihood", "").replace("net,net,net,net,net,net", "net,net,net,net")
plain = plain.replace("hip,hip,hip,knee,knee,knee", "hip,hip,knee,knee")
Path("video.csv").write_text(head + "0,1.0,2.0,0.9,3.0,4.0,0.8\n1,1.5,2.5,0.9,3.5,4.5,0.8\n")
images = Path("labeled-data/walk")
images.mkdir(parents=True)
rows = []
for k in range(2):
    Image.fromarray(np.zeros((48, 64), np.uint8)).save(images / f"img{k}.png")
    rows.append(f"{images}/img{k}.png,1.0,2.0,3.0,4.0\n")
Path("labels.csv").write_text(plain + "".join(rows))
of_video = sleap_io.load_dlc("video.csv")
by_any = sleap_io.load_file("video.csv")
of_images = sleap_io.load_dlc("labels.csv")
print("frames of a video:", len(of_video), "of images:", len(of_images))
print("points:", of_video.skeleton.node_names)
unchanged = len(of_video) == len(by_any) == 0 and len(of_images) == 2
raise SystemExit(not unchanged)
PYTHON
