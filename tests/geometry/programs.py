"""One camera as each program writes it: 640 x 480 pixels, 4 m down the -y axis of a z-up world, 1 m up, looking along +y.

Its x is the world's x, its y the world's -z, its z the world's y: a turn by a right angle about x. The focal length is
500 pixels, and the centre 310 and 250 where the middle of the first pixel is 0.5.
"""

import json
from collections.abc import Callable
from typing import Any

import numpy as np

K = [[500.0, 0.0, 309.5], [0.0, 500.0, 249.5], [0.0, 0.0, 1.0]]
R = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
QUARTER = float(np.pi / 2)
# to the camera: minus the rotated place, (0, -4, 1)
T = [0.0, 1.0, 4.0]
FROM_WORLD = [[1, 0, 0, 0], [0, 0, -1, 1], [0, 1, 0, 4], [0, 0, 0, 1]]
# columns: right, up, back and the place
GL_TO_WORLD = [[1, 0, 0, 0], [0, 0, -1, -4], [0, 1, 0, 1], [0, 0, 0, 1]]
# columns: right, down, ahead and the place
TO_WORLD = "1 0 0 0 0 0 1 -4 0 -1 0 1 0 0 0 1"


def nerf(**more: Any) -> str:
    frame = {"file_path": "images/left.png", "transform_matrix": GL_TO_WORLD}
    lens = {"fl_x": 500.0, "fl_y": 500.0, "cx": 310.0, "cy": 250.0, "w": 640, "h": 480}
    return json.dumps({**lens, "aabb_scale": 4, **more, "frames": [frame]})


def kalibr(**more: Any) -> str:
    table = {
        "camera_model": "pinhole",
        "intrinsics": [500.0, 500.0, 309.5, 249.5],
        "distortion_model": "radtan",
        "distortion_coeffs": [0.0, 0.0, 0.0, 0.0],
        "resolution": [640, 480],
        "rostopic": "/cam0/image_raw",
        "cam_overlaps": [],
        "T_cam_imu": FROM_WORLD,
    }
    return json.dumps({"left": {**table, **more}})


def panoptic(**more: Any) -> str:
    camera = {
        "name": "left",
        "type": "hd",
        "resolution": [640, 480],
        "panel": 0,
        "node": 1,
        "K": K,
        "distCoef": [0.0, 0.0, 0.0, 0.0, 0.0],
        "R": R,
        "t": [[0.0], [100.0], [400.0]],
    }
    return json.dumps({"calibDataSource": "a", "cameras": [{**camera, **more}]})


def voxelpose(**more: Any) -> str:
    camera = {
        "R": R,
        "T": [[0.0], [-4000.0], [1000.0]],
        "fx": 500.0,
        "fy": 500.0,
        "cx": 309.5,
        "cy": 249.5,
        "k": [[0.0], [0.0], [0.0]],
        "p": [[0.0], [0.0]],
    }
    return json.dumps({"left": {**camera, **more}})


def opencap(**more: Any) -> str:
    values = {
        "distortion": [[0.0, 0.0, 0.0, 0.0, 0.0]],
        "intrinsicMat": K,
        "imageSize": [[480.0], [640.0]],
        "rotation": R,
        "translation": [[0.0], [1000.0], [4000.0]],
        "rotation_EulerAngles": [[QUARTER], [0.0], [0.0]],
    }
    return json.dumps({**values, **more})


def openmvg(model: str = "pinhole", **more: Any) -> str:
    data = {"width": 640, "height": 480, "focal_length": 500.0}
    data |= {"principal_point": [309.5, 249.5], **more}
    lens = {"polymorphic_id": 2147483649, "polymorphic_name": model}
    lens["ptr_wrapper"] = {"id": 2147483650, "data": data}
    view = {"filename": "left.png", "id_view": 0, "id_intrinsic": 0, "id_pose": 3}
    views = [{"key": 0, "value": {"ptr_wrapper": {"id": 1, "data": view}}}]
    pose = {"rotation": R, "center": [0.0, -4.0, 1.0]}
    values = {
        "sfm_data_version": "0.3",
        "views": views,
        "intrinsics": [{"key": 0, "value": lens}],
        "extrinsics": [{"key": 3, "value": pose}],
    }
    return json.dumps(values)


def realsense(**more: Any) -> str:
    values = {"fx": 500.0, "fy": 500.0, "ppx": 309.5, "ppy": 249.5}
    values |= {"width": 640, "height": 480, "coeffs": [0.0] * 5}
    return json.dumps({**values, "model": "distortion.brown_conrady", **more})


def metashape(lens: str = "", chunk: str = "", transform: str = TO_WORLD) -> str:
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<document version="2.0.0"><chunk label="Chunk 1" enabled="true">
<sensors next_id="1"><sensor id="0" label="unknown" type="frame">
<resolution width="640" height="480"/>
<calibration type="frame" class="adjusted"><resolution width="640" height="480"/>
<f>500</f><cx>-10</cx><cy>10</cy>{lens}</calibration></sensor></sensors>
<components><component id="0">{chunk}</component></components>
<cameras><camera id="0" sensor_id="0" component_id="0" label="left">
<transform>{transform}</transform></camera>
<camera id="1" sensor_id="0" label="not aligned"/></cameras></chunk></document>"""


def vicon(lens: str = 'VICON_RADIAL="0 0"', camera: str = "") -> str:
    return f"""<?xml version="1.0"?>
<Cameras SOURCE="Nexus 2.12" VERSION="2.0">
<Camera DEVICEID="7" SYSTEM="MX" SENSOR_SIZE="4096 4096"><KeyFrames>
<KeyFrame FOCAL_LENGTH="900" PRINCIPAL_POINT="1 2"/></KeyFrames></Camera>
<Camera DEVICEID="left" SYSTEM="DV" PIXEL_ASPECT_RATIO="1" SENSOR_SIZE="640 480" {camera}>
<ThresholdGrid BIT_DEPTH="1" DATA="r 3"/><KeyFrames>
<KeyFrame FOCAL_LENGTH="500" FRAME="0" IMAGE_ERROR="0.2"
 ORIENTATION="0.70710678 0 0 0.70710678" POSITION="0 -4000 1000"
 PRINCIPAL_POINT="309.5 249.5" {lens}/></KeyFrames></Camera>
</Cameras>"""


def anipose(**more: Any) -> str:
    values = {"name": "left", "size": [640, 480], "matrix": K}
    values |= {
        "distortions": [0.0, 0.0, 0.0, 0.0, 0.0],
        "rotation": [QUARTER, 0.0, 0.0],
    }
    lines = {**values, "translation": T, **more}.items()
    return "[cam_0]\n" + "\n".join(f"{key} = {value!r}" for key, value in lines)


def ros(**more: Any) -> str:
    values = {"width": 640, "height": 480, "distortion_model": "plumb_bob"}
    values |= {"D": [0.0] * 5, "K": np.ravel(K).tolist()}
    return json.dumps({**values, "R": [0.0] * 9, "P": [0.0] * 12, **more})


def easymocap(**more: Any) -> str:
    values = {"names": ["left"], "K_left": K, "dist_left": [[0.0] * 5]}
    values |= {"H_left": 480, "W_left": 640, "R_left": [[QUARTER], [0.0], [0.0]]}
    return json.dumps(
        {**values, "Rot_left": R, "T_left": [[0.0], [1.0], [4.0]], **more}
    )


def opencv(**more: Any) -> str:
    values = {"camera_matrix": K, "dist_coeffs": [[0.0] * 5], "image_size": [640, 480]}
    return json.dumps({**values, "rvec": [QUARTER, 0.0, 0.0], "tvec": T, **more})


# of each dialect: how it is written, in a file of which suffix, and the unit of this
# sample in metres, if the program may write any
SAMPLES: dict[str, tuple[Callable[..., str], str, float]] = {
    "Vicon": (vicon, ".xcp", 1.0),
    "Metashape": (metashape, ".xml", 1.0),
    "NeRF's programs": (nerf, ".json", 1.0),
    "openMVG": (openmvg, ".json", 1.0),
    "OpenCap": (opencap, ".json", 1.0),
    "Kalibr": (kalibr, ".yaml", 1.0),
    "ROS": (ros, ".yaml", 1.0),
    "EasyMocap": (easymocap, ".yml", 1.0),
    "CMU Panoptic": (panoptic, ".json", 1.0),
    "VoxelPose": (voxelpose, ".json", 1.0),
    "RealSense": (realsense, ".json", 1.0),
    "Anipose": (anipose, ".toml", 1.0),
    "OpenCV": (opencv, ".json", 1.0),
}
