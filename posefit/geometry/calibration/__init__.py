"""Calibration files of other programs, read into cameras.

| looking for | file |
|---|---|
| which program wrote a file: the table that a dialect joins by a line | read.py |
| what recognises a dialect, what it reads, which keys it knows | a file a program, such as kalibr.py |
| what a file says of one camera, its lens, and pictures without distortion | lens.py |
| which way is up in the cameras' world | world.py |
| text, numbers and tables in YAML, JSON, TOML and XML | values.py |

A file holds one camera or several; `cameras.toml:left` is one of them by its name. All become
camera_from_world in OpenCV's frame, x right, y down and z forward. Which way is up in their world
differs, and is turned to +y: the axis that the images of all cameras see pointing up, unless `up`
names one. Lengths are in the file's own unit, see `footage/cameras.py`, and metres where a program
always writes one unit.

What a dialect does not know it refuses by its name. Messages of errors complete `expected a
calibration ..., got ...`.
"""

from posefit.geometry.calibration.lens import Calibration, pinhole_matrix
from posefit.geometry.calibration.read import DIALECTS, read_calibrations
from posefit.geometry.calibration.world import TURNS, Up, guessed_up, upright

__all__ = [
    "DIALECTS",
    "TURNS",
    "Calibration",
    "Up",
    "guessed_up",
    "pinhole_matrix",
    "read_calibrations",
    "upright",
]
