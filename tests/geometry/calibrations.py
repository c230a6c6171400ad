"""One calibration in every format: 640 x 480 pixels, a lens that bends, 4 m from the origin and 1 m up."""

from pathlib import Path

import cv2
import numpy as np

TOML = """
[left]
name = "left"
size = [ 640, 480]
matrix = [ [ 500.0, 0.0, 319.5], [ 0.0, 510.0, 239.5], [ 0.0, 0.0, 1.0]]
distortions = [ 0.1, 0.0, 0.0, 0.0]
rotation = [ 1.5707963267948966, 0.0, 0.0]
translation = [ 0.0, 1.0, 4.0]
fisheye = false

[metadata]
adjusted = false
"""

# Written as Qualisys writes it: lengths in 64ths of a pixel and millimetres, a camera that looks along its own -z.
# This one stands 4 m down the y axis of a z-up world, 1 m up, and looks level at the origin: its x is the world's x,
# its y the world's z, its z the world's -y.
QUALISYS = """<?xml version='1.0'?><calibration><cameras><camera serial="7">
<fov_video left="10" top="20" right="649" bottom="499"/>
<transform x="0" y="-4000" z="1000" r11="1" r12="0" r13="0" r21="0" r22="0" r23="1" r31="0" r32="-1" r33="0"/>
<intrinsic focalLengthU="32000" focalLengthV="32640" centerPointU="21088" centerPointV="16608"
 radialDistortion1="-0.05" radialDistortion2="0.1" radialDistortion3="0" tangentalDistortion1="0.001"
 tangentalDistortion2="0.002"/></camera></cameras></calibration>"""


def opencv(path: Path, placed: bool = True) -> Path:
    """Write a calibration of the format that the suffix names, as OpenCV does, and return its path."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", np.array([[500.0, 0, 319.5], [0, 510.0, 239.5], [0, 0, 1]]))
    storage.write("distortion_coefficients", np.array([[0.1, 0.0, 0.0, 0.0, 0.0]]))
    if placed:
        storage.write("rvec", np.array([np.pi / 2, 0.0, 0.0]))
        storage.write("tvec", np.array([[0.0], [1.0], [4.0]]))
    storage.release()
    return path
