#!/bin/sh
# biomechzoo 0.8.25: c3d2zoo_data mixes the analog channels of a .c3d file.
#
# ezc3d returns them as (1, channels, samples). c3d2zoo_data reshapes this to (samples, channels), where it should
# transpose, so that of two channels each holds every second sample of one, then of the other: a constant Fx of 1 N and
# an Fz from 700 to 799 N come out as an "Fx" of 1 up to the middle and 700, 702, ... from there. A single channel is right.
# Take analog channels from ezc3d itself: file["data"]["analogs"][0, k].
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet ezc3d==1.7.2 numpy==2.4.6
# without its viewers and statistics, which the conversion does not use
"$folder/venv/bin/python" -m pip install --quiet --no-deps biomechzoo==0.8.25
cd "$folder"
venv/bin/python - <<'PYTHON'
import sys
from importlib.metadata import distribution, version
from types import ModuleType

import ezc3d
import numpy as np

# the packages themselves import the viewers
for name in ("biomechzoo", "biomechzoo.conversion", "biomechzoo.utils"):
    package = ModuleType(name)
    place = distribution("biomechzoo").locate_file(name.replace(".", "/"))
    package.__path__ = [str(place)]
    sys.modules[name] = package
from biomechzoo.conversion.c3d2zoo_data import c3d2zoo_data

print("biomechzoo", version("biomechzoo"))
written = {"Fx": np.ones(100), "Fz": 700.0 + np.arange(100)}


def read(names):
    """Return the channels of a file as biomechzoo has them."""
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["LABELS"]["value"] = ["hip"]
    file["data"]["points"] = np.ones((4, 1, 10))
    file["parameters"]["ANALOG"]["RATE"]["value"] = [1000.0]
    file["parameters"]["ANALOG"]["LABELS"]["value"] = names
    file["data"]["analogs"] = np.array([[written[name] for name in names]])
    file.write("step.c3d")
    again = ezc3d.c3d("step.c3d")
    assert np.allclose(again["data"]["analogs"][0], [written[name] for name in names])
    data = c3d2zoo_data(again)
    return {name: data[name]["line"].ravel() for name in names}


both, alone = read(["Fx", "Fz"]), read(["Fz"])
print("two channels: Fx", both["Fx"][[0, 49, 50, 51, 99]], "Fz", both["Fz"][[0, 49, 50, 51, 99]])
print("one channel: Fz", alone["Fz"][[0, 49, 50, 51, 99]])
mixed = np.concatenate([written["Fx"], written["Fz"]])
unchanged = np.allclose(both["Fx"], mixed[::2]) and np.allclose(both["Fz"], mixed[1::2])
unchanged = unchanged and np.allclose(alone["Fz"], written["Fz"])
raise SystemExit(not unchanged)
PYTHON
