#!/bin/sh
# pymomentum-cpu 0.1.114.post0: load_markers takes a marker's name up to its last _ for the name of a person.
#
# Of a .c3d file with the markers head_top, head_base, left_hip, right_hip and pelvis, it returns two by default, `top`
# and `base` of the person "head": left_hip and right_hip are exempt (momentum/io/marker/c3d_io.cpp), and among several
# people the one with a name and the most markers is taken to be meant. With main_subject_only=False all markers come,
# as persons "head" and "". Names without _, such as HeadTop, or `walker:head_top`, are read as one person.
#
# It needs Python 3.12 or 3.13. Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3.12}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet numpy==2.4.6 c3d==0.6.0
# without torch, which its readers of files do not use
"$folder/venv/bin/python" -m pip install --quiet --no-deps pymomentum-cpu==0.1.114.post0
cd "$folder"
venv/bin/python -W ignore - <<'PYTHON'
from importlib.metadata import version

import c3d
import numpy as np
from pymomentum.geometry import load_markers

print("pymomentum-cpu", version("pymomentum-cpu"))
plain = ["head_top", "head_base", "left_hip", "right_hip", "pelvis"]


def read(labels, **options):
    """Return the markers of each person whom it finds in a file."""
    writer = c3d.Writer(point_rate=100.0, analog_rate=0.0)
    writer.set_point_labels(labels)
    point = np.hstack([np.random.default_rng(0).uniform(100, 900, (5, 3)), np.zeros((5, 2))])
    writer.add_frames([(point, np.zeros((0, 0)))] * 3)
    with open("walk.c3d", "wb") as file:
        writer.write(file)
    people = load_markers("walk.c3d", **options)
    return {person.name: [marker.name for marker in person.frames[0]] for person in people}


found = {
    "default": read(plain),
    "all people": read(plain, main_subject_only=False),
    "with a person": read([f"walker:{name}" for name in plain]),
}
for words, people in found.items():
    print(words, people)
everyone = {"head": ["top", "base"], "": ["left_hip", "right_hip", "pelvis"]}
wanted = {
    "default": {"head": ["top", "base"]},
    "all people": everyone,
    "with a person": {"walker": plain},
}
raise SystemExit(found != wanted)
PYTHON
