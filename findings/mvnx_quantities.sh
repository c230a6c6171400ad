#!/bin/sh
# mvnx 0.2: of an .mvnx file that has only some quantities, it returns one under the name of another.
#
# Who exports from Xsens MVN chooses the quantities. MVNX takes them by their place among all fourteen, not by the
# names of the elements: in a file with orientation, position and jointAngle, `velocity` has the joint angles in
# degrees, and `jointAngle` is empty. (Issue 1 says that the parser is for files with all quantities, and that others
# give an error; they do not.) Export all of them, or set `mapping` and call `parse_modality`.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet mvnx==0.2 numpy==2.4.6
cd "$folder"
cat > walk.mvnx <<'MVNX'
<?xml version="1.0" encoding="UTF-8"?>
<mvnx version="4">
  <mvn version="2021.0" build="0"/>
  <comment/>
  <subject label="walker" frameRate="60" segmentCount="2" recDate="" configuration="FullBody" userScenario="singleLevel">
    <comment/>
    <segments segmentCount="2">
      <segment label="Pelvis" id="1"/>
      <segment label="RightUpperLeg" id="2"/>
    </segments>
    <sensors/>
    <joints>
      <joint label="jRightHip">
        <connector1>Pelvis/jRightHip</connector1>
        <connector2>RightUpperLeg/jRightHip</connector2>
      </joint>
    </joints>
    <ergonomicJointAngles/>
    <footContactDefinition/>
    <frames segmentCount="2" sensorCount="0" jointCount="1">
      <frame time="0" index="" tc="" ms="0" type="identity"/>
      <frame time="0" index="" tc="" ms="0" type="tpose"/>
      <frame time="0" index="" tc="" ms="0" type="tpose-isb"/>
      <frame time="0" index="0" tc="00:00:00:00" ms="0" type="normal">
        <orientation>1 0 0 0 1 0 0 0</orientation>
        <position>0 0 1 0 -0.1 0.9</position>
        <jointAngle>5 10 35</jointAngle>
      </frame>
      <frame time="17" index="1" tc="00:00:00:01" ms="17" type="normal">
        <orientation>1 0 0 0 1 0 0 0</orientation>
        <position>0 0 1 0 -0.1 0.9</position>
        <jointAngle>5 10 36</jointAngle>
      </frame>
    </frames>
  </subject>
  <securityCode code="0"/>
</mvnx>
MVNX
venv/bin/python - <<'PYTHON'
from importlib.metadata import version

from mvnx import MVNX

print("mvnx", version("mvnx"))
read = MVNX("walk.mvnx")
for name in ("orientation", "position", "velocity", "jointAngle"):
    print(name, getattr(read, name).tolist())
read.mapping["jointAngle"] = 2
put_right = read.parse_modality("jointAngle").tolist()
print("with a mapping of its own:", put_right)
angles = [[5.0, 10.0, 35.0], [5.0, 10.0, 36.0]]
unchanged = read.velocity.tolist() == angles and read.jointAngle.size == 0
unchanged = unchanged and read.position.shape == (2, 6) and put_right == angles
raise SystemExit(not unchanged)
PYTHON
