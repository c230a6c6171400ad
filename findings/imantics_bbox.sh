#!/bin/sh
# imantics 0.1.12: the COCO annotation of a mask has a box that is a pixel too narrow and too low.
#
# A mask of 14 x 10 pixels from column 6 and row 5 on becomes `"bbox": (6, 5, 13, 9)` beside `"area": 140`; COCO's boxes
# are left, top, width and height. The polygon runs through the middles of the outer pixels and encloses 117, so that
# readers which draw it, pycocotools for one, get 13 x 9 pixels back. pycocotools' encode and toBbox make both from the
# mask.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet imantics==0.1.12 pycocotools==2.0.11 \
    lxml==6.1.3 xmljson==0.2.1 opencv-python-headless==5.0.0.93 numpy==2.4.6
cd "$folder"
venv/bin/python -W ignore - <<'PYTHON'
from importlib.metadata import version

import numpy as np
from imantics import Annotation, Category, Image, Mask
from pycocotools import mask as coco

print("imantics", version("imantics"))
pixels = np.zeros((20, 30), dtype=bool)
pixels[5:15, 6:20] = True
image = Image(np.zeros((20, 30, 3), np.uint8), path="a.png", id=1)
person = Category("person", id=1)
written = Annotation(image=image, category=person, mask=Mask(pixels)).coco(include=False)
rles = coco.frPyObjects(written["segmentation"], 20, 30)
drawn = int(coco.area(coco.merge(rles)))
print("bbox", written["bbox"], "area", written["area"], "drawn", drawn)
unchanged = tuple(written["bbox"]) == (6, 5, 13, 9)
unchanged = unchanged and written["area"] == 140 and drawn == 117
raise SystemExit(not unchanged)
PYTHON
