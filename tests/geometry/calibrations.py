"""One calibration in every format: 640 x 480 pixels, a lens that bends, 4 m from the origin and 1 m up.

`KINDS` are another one, as other programs write it.
"""

import json
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
    storage.write(
        "camera_matrix", np.array([[500.0, 0, 319.5], [0, 510.0, 239.5], [0, 0, 1]])
    )
    storage.write("distortion_coefficients", np.array([[0.1, 0.0, 0.0, 0.0, 0.0]]))
    if placed:
        storage.write("rvec", np.array([np.pi / 2, 0.0, 0.0]))
        storage.write("tvec", np.array([[0.0], [1.0], [4.0]]))
    storage.release()
    return path


# a camera that looks along a z-up world's ground
ROTATION = cv2.Rodrigues(np.array([1.4, 0.3, -0.2]))[0]
TRANSLATION = np.array([0.3, 1.1, 4.2])
POSE = ROTATION, TRANSLATION
K = [[500.0, 0.0, 319.5], [0.0, 510.0, 239.5], [0.0, 0.0, 1.0]]
LENS = [0.12, -0.05, 0.001, 0.002, 0.01]


def matrix_text(name: str, values: object) -> str:
    array = np.atleast_2d(np.asarray(values, dtype=float))
    shape = f"   rows: {array.shape[0]}\n   cols: {array.shape[1]}\n   dt: d\n"
    return f"{name}: !!opencv-matrix\n{shape}   data: {array.ravel().tolist()}\n"


# columns
PLACED = {
    "rotation": cv2.Rodrigues(ROTATION)[0].tolist(),
    "translation": TRANSLATION[:, None].tolist(),
}
ENTRY = f"size = [640, 480]\nmatrix = {K}\ndistortions = {LENS}\nrotation = {PLACED['rotation']}\ntranslation = {PLACED['translation']}\nfisheye = false\n"
LEFT_RIGHT = '%YAML:1.0\n---\nnames:\n   - "left"\n   - "right"\n'
WRITTEN = {"R": PLACED["rotation"], "Rot": ROTATION, "T": PLACED["translation"]}


def matrices(**values: object) -> str:
    return "".join(matrix_text(name, value) for name, value in values.items())


YAML_24 = "%YAML:1.0\nimage_Width: 640\nimage_Height: 480\n" + matrices(
    Camera_Matrix=K, Distortion_Coefficients=LENS
)
INTRI = LEFT_RIGHT + matrices(
    K_left=K, dist_left=LENS, K_right=K, dist_right=np.zeros(5)
)
EXTRI = LEFT_RIGHT + "".join(
    matrix_text(f"{kind}_{name}", value)
    for name in ("left", "right")
    for kind, value in WRITTEN.items()
)
ROS = (
    "image_width: 640\nimage_height: 480\ncamera_name: narrow\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
    f"  data: {np.ravel(K).tolist()}\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n"
    f"  data: {LENS}\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
    f"projection_matrix:\n  rows: 3\n  cols: 4\n  data: {np.ravel(np.eye(3, 4)).tolist()}\n"
)
ROS_MESSAGE = (
    "header:\n  seq: 1\n  frame_id: narrow\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\n"
    f"D: {LENS}\nK: {np.ravel(K).tolist()}\nR: [0, 1, 0, 1, 0, 0, 0, 0, -1]\nP: {np.ravel(np.eye(3, 4)).tolist()}\n"
)
KINDS = {
    "caliscope.toml": f"[charuco]\ncolumns = 4\n[cameras.0]\ncam_id = 0\n{ENTRY}[cameras.1]\nignore = true\n",
    "pose2sim.toml": f"[cam_01]\nname = 'cam_01'\n{ENTRY}[metadata]\nadjusted = false\n",
    "opencv24.yml": YAML_24 + matrices(R=ROTATION, T=PLACED["translation"]),
    "tutorial.json": json.dumps({"mtx": K, "dist": [LENS], "R": ROTATION.tolist(), "tvec": PLACED["translation"]}),
    "several.json": json.dumps({"cameras": [{"name": "a", "K": K, "dist_coeff": LENS, "image_size": [640, 480], "R": ROTATION.tolist(), "t": TRANSLATION.tolist()}]}),
    "numbered.yaml": "w: 640\nh: 480\nfx: 500\nfy: 510\ncx: 319.5\ncy: 239.5\nk1: 0.12\nk2: -0.05\np1: 0.001\np2: 0.002\nk3: 0.01\n" + matrix_text("R", ROTATION) + matrix_text("T", TRANSLATION),
    "kalibr.yaml": f"cam0:\n  camera_model: pinhole\n  intrinsics: [500, 510, 319.5, 239.5]\n  distortion_model: radtan\n  distortion_coeffs: {LENS}\n  resolution: [640, 480]\n  rvec: {PLACED['rotation']}\n  tvec: {PLACED['translation']}\n",
    "intri.yml": INTRI,
    "ros.yaml": ROS,
    "ros_message.yaml": ROS_MESSAGE,
}  # fmt: skip


def kind_written(folder: Path, name: str) -> Path:
    (folder / "extri.yml").write_text(EXTRI)
    (folder / name).write_text(KINDS[name])
    return folder / name
