"""Calibration files of other programs, read into cameras.

| looking for | file |
|---|---|
| which program wrote a file; the list of dialects | read.py |
| how one program's files are recognised and read | one file each, such as kalibr.py |
| one camera, its lens, and pictures without distortion | lens.py |
| which way is up in the cameras' world | world.py |
| text, numbers and tables in YAML, JSON, TOML and XML | values.py |
| unknown keys: whether they may describe the lens or the place | keys.py |

A file contains one camera or several; `cameras.toml:left` is the camera named left. All
cameras become camera_from_world in OpenCV's frame: x right, y down and z forward.

The up direction of the file's world is turned to +y. It is `up` if that is given, or
else the axis that points up in the images of all cameras. Lengths are metres if the
program always writes one unit, and in the file's own unit otherwise; see
`footage/world.py`.

An unknown key is an error that names the key. The message of an error completes the
sentence `expected a calibration ..., got ...`.
"""

from posefit.geometry.calibration.lens import Calibration, pinhole_matrix
from posefit.geometry.calibration.read import DIALECTS, read_calibrations
from posefit.geometry.calibration.world import (
    TURNS,
    Up,
    guessed_up,
    misreading,
    upright,
)

__all__ = [
    "DIALECTS",
    "TURNS",
    "Calibration",
    "Up",
    "guessed_up",
    "misreading",
    "pinhole_matrix",
    "read_calibrations",
    "upright",
]
