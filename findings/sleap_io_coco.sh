#!/bin/sh
# sleap-io 0.9.5: load_coco and save_coco lose each person's area and box, and which points are hidden.
#
# A person of 800 square pixels with two points, the second one labelled but not visible (v = 1), is written again with
# an area of 4.75 and the box of the two points, and both points visible (v = 2). COCO's measure of keypoints, OKS,
# divides squared distances by the area: a hip 2 pixels off counts 0.95 of 1 before, and 0.0001 after. Keep the first file's
# `area` and `bbox`, by the image and the order in it.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet sleap-io==0.9.5 pillow==13.0.0 numpy==2.4.6
cd "$folder"
venv/bin/python -W ignore - <<'PYTHON'
import json
from importlib.metadata import version
from pathlib import Path

import numpy as np
import sleap_io
from PIL import Image

print("sleap-io", version("sleap-io"))
Image.fromarray(np.zeros((48, 64), np.uint8)).save("a.png")
person = {
    "id": 1,
    "image_id": 1,
    "category_id": 1,
    "keypoints": [10.5, 20.5, 2, 11.0, 30.0, 1],
    "num_keypoints": 2,
    "bbox": [5.0, 5.0, 20.0, 40.0],
    "area": 800.0,
    "iscrowd": 0,
}
category = {"id": 1, "name": "person", "keypoints": ["hip", "knee"], "skeleton": [[1, 2]]}
content = {
    "images": [{"id": 1, "file_name": "a.png", "width": 64, "height": 48}],
    "categories": [category],
    "annotations": [person],
}
Path("people.json").write_text(json.dumps(content))
read = sleap_io.load_coco("people.json", dataset_root=".")
sleap_io.save_coco(read, "again.json")
(again,) = json.loads(Path("again.json").read_text())["annotations"]
for key in ("keypoints", "bbox", "area"):
    print(key, person[key], "->", again[key])
unchanged = again["area"] == 4.75 and again["bbox"] == [10.5, 20.5, 0.5, 9.5]
unchanged = unchanged and again["keypoints"][2::3] == [2, 2]
raise SystemExit(not unchanged)
PYTHON
