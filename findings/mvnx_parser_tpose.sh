#!/bin/sh
# mvnx-parser 0.0.5: `tpose` and `tpose_isb` are the identity pose.
#
# An .mvnx file of Xsens begins with three frames of the types identity, tpose and tpose-isb. All three attributes are
# read from the one of type identity, so that joint centres and offsets that are worked out from `tpose` have the arms
# hanging where the file has them stretched out. The frames of the motion are right. Read the frame with ElementTree:
# root.findall(".//*[@type='tpose']").
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet mvnx-parser==0.0.5
cd "$folder"
cat > walk.mvnx <<'MVNX'
<?xml version="1.0" encoding="UTF-8"?>
<mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4">
<subject label="walker" frameRate="60" segmentCount="2">
<segments><segment label="Pelvis" id="1"/><segment label="RightHand" id="2"/></segments>
<frames segmentCount="2" sensorCount="0" jointCount="0">
<frame time="0" type="identity" tc="" ms="0"><orientation>1 0 0 0 1 0 0 0</orientation><position>0 0 0 0 -0.2 -0.6</position></frame>
<frame time="0" type="tpose" tc="" ms="0"><orientation>1 0 0 0 1 0 0 0</orientation><position>0 0 1 0 -0.8 1.4</position></frame>
<frame time="0" type="tpose-isb" tc="" ms="0"><orientation>0.7071 0.7071 0 0 1 0 0 0</orientation><position>0 0 1 0 -0.8 1.4</position></frame>
<frame time="0" index="0" tc="" ms="0" type="normal"><orientation>1 0 0 0 1 0 0 0</orientation><position>0 0 0.98 0 -0.2 0.9</position></frame>
</frames>
</subject>
</mvnx>
MVNX
venv/bin/python - <<'PYTHON'
from importlib.metadata import version

from mvnx_parser import Mvnx_p

print("mvnx-parser", version("mvnx-parser"))
read = Mvnx_p("walk.mvnx")
for name in ("identity", "tpose", "tpose_isb"):
    print(name, getattr(read, name))
print("frame 0", read.frames[0])
unchanged = read.tpose == read.tpose_isb == read.identity
unchanged = unchanged and read.identity["position"] == [["0", "0", "0"], ["0", "-0.2", "-0.6"]]
unchanged = unchanged and read.position == [[["0", "0", "0.98"], ["0", "-0.2", "0.9"]]]
raise SystemExit(not unchanged)
PYTHON
