#!/bin/sh
# labelme2coco 0.2.6 with sahi 0.12.8: corners of polygons are cut to whole pixels, left and up.
#
# LabelMe stores where somebody clicked, to a fraction of a pixel. `convert` writes 10.9 as 10 and 30.4 as 30, so that
# a mask moves by half a pixel to the left and up on average, here a square of 20 x 20 pixels by 0.9. The box, written
# beside it, keeps its fractions. Polygons with one `group_id`, which LabelMe has for the parts of one person (its
# issues 633 and 714), become one person each. Take the corners from LabelMe's files, in the same order of images and
# shapes.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet --no-deps labelme2coco==0.2.6 sahi==0.12.8 jsonschema==4.26.0 \
    shapely==2.2.0 opencv-python-headless==5.0.0.93 pillow==11.3.0 tqdm==4.70.1 numpy==2.4.6
cd "$folder"
mkdir labels
venv/bin/python -W ignore - <<'PYTHON' 2> errors || { cat errors; exit 1; }
import json
from importlib.metadata import version
from pathlib import Path

from labelme2coco import convert

print("labelme2coco", version("labelme2coco"), "sahi", version("sahi"))


def square(left, top):
    corners = [(0, 0), (20, 0), (20, 20), (0, 20)]
    return {
        "label": "person",
        "points": [[left + x, top + y] for x, y in corners],
        "group_id": 1,
        "shape_type": "polygon",
        "flags": {},
    }


content = {
    "version": "5.4.1",
    "flags": {},
    "shapes": [square(10.9, 5.9), square(40.5, 5.0)],
    "imagePath": "a.png",
    "imageData": None,
    "imageHeight": 48,
    "imageWidth": 64,
}
Path("labels/a.json").write_text(json.dumps(content))
convert("labels", "coco")
persons = json.loads(Path("coco/dataset.json").read_text())["annotations"]
for person, shape in zip(persons, content["shapes"], strict=True):
    print(shape["points"], "->", person["segmentation"], "box", person["bbox"])
unchanged = persons[0]["segmentation"] == [[10, 5, 30, 5, 30, 25, 10, 25]]
unchanged = unchanged and persons[1]["segmentation"][0][:2] == [40, 5]
unchanged = unchanged and abs(persons[0]["bbox"][0] - 10.9) < 1e-6
raise SystemExit(not unchanged)
PYTHON
