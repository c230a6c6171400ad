"""transforms.json of instant-ngp, nerfstudio and similar programs.

Each frame has a camera. Lengths have no unit. `transform_matrix` (4, 4) is
camera_to_world of a camera that looks along -z with y up, as in OpenGL. The centre of
the first pixel is 0.5, as in COLMAP, from which these files are made.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.keys import check_others, unread
from posefit.geometry.calibration.lens import (
    HALF,
    OPENGL,
    Calibration,
    numbers_of,
    pinhole_matrix,
    seen_from,
    stated,
)
from posefit.geometry.calibration.values import (
    Stored,
    counts,
    has_table,
    matrix_of,
    number_of,
    numbers_at,
    plain,
)
from posefit.reading import quoted

MATRIX = "transform_matrix"
LENSES = {
    **dict.fromkeys(("", "opencv", "pinhole", "simplepinhole", "simpleradial"), False),
    **dict.fromkeys(("radial", "perspective"), False),
    "opencvfisheye": True,
}
LENS_KEYS = ("k1", "k2", "k3", "k4", "p1", "p2")
# keys of a frame, or of the file for all frames
VIEW_KEYS = {
    *("w", "h", "fl_x", "fl_y", "cx", "cy", "camera_angle_x", "camera_angle_y", "K"),
    *("camera_model", "is_fisheye", *LENS_KEYS),
}
FRAME_KEYS = {
    *(MATRIX, "file_path", *VIEW_KEYS),
    # the picture's identity, and the files that belong to it
    *("sharpness", "depth_file_path", "depth_path", "mask_path", "colmap_im_id"),
    *("time", "timestamp", "timestep_index", "camera_index", "camera_id", "cam_id"),
    # Blender's example scenes: the turntable's angle from one frame to the next
    *("rotation",),
}
FILE_KEYS = {
    *("frames", *VIEW_KEYS),
    # how a radiance field is trained, and what was already applied to the matrices
    *("aabb_scale", "scale", "offset", "aabb", "render_aabb", "up"),
    *("applied_transform", "applied_scale", "orientation_override"),
    *("ply_file_path", "fps", "white_transparent", "black_transparent"),
    *("enable_depth_loading", "integer_depth_scale", "n_extra_learnable_dims"),
    *("train_filenames", "val_filenames", "test_filenames"),
}


def _recognises(stored: Stored) -> bool:
    frames = stored.values.get("frames")
    return isinstance(frames, list) and has_table(frames, {MATRIX})


def _read(stored: Stored) -> list[Calibration]:
    values = stored.values
    check_others(stored.path.stem, unread(values, FILE_KEYS))
    frames = values["frames"]
    paths = list[str]()
    for number, frame in enumerate(frames):
        paths.append(str(frame.get("file_path", number)))
    names = _names(paths)
    shared = {key: value for key, value in values.items() if key in VIEW_KEYS}
    calibrations = list[Calibration]()
    for name, frame in zip(names, frames, strict=True):
        calibrations.append(_camera(name, frame, shared))
    return calibrations


def _names(paths: Sequence[str]) -> list[str]:
    """Return file names without folder and suffix, or the path if two are equal."""
    stems = [PurePosixPath(path).stem for path in paths]
    seen = Counter(stems)
    names = list[str]()
    for stem, path in zip(stems, paths, strict=True):
        # two folders may have a file of the same name
        names.append(stem if seen[stem] == 1 else path)
    return names


def _camera(
    name: str, frame: Mapping[str, Any], shared: Mapping[str, Any]
) -> Calibration:
    check_others(name, unread(frame, FRAME_KEYS))
    if MATRIX not in frame:
        raise InputError(f"the frame {quoted(name)} without {MATRIX}")
    values = {**shared, **frame}
    model = plain(values.get("camera_model", ""))
    if model not in LENSES:
        raise InputError(
            f"the camera model {quoted(values['camera_model'])}, which is not known"
        )
    fisheye = LENSES[model] or str(values.get("is_fisheye")).lower() in ("true", "1")
    k1, k2, k3, k4, p1, p2 = (number_of(values.get(key, 0.0)) for key in LENS_KEYS)
    # OpenCV's polynomial has no k4, and its fisheye has no p1 and p2
    for key in ("p1", "p2") if fisheye else ("k4",):
        if counts(values.get(key, 0.0)):
            raise InputError(f"the lens key {quoted(key)}, which is not read")
    size = None
    if "w" in values and "h" in values:
        size = numbers_at(values, "w", "h")
    return stated(
        name,
        size,
        _matrix(values, size),
        [k1, k2, k3, k4] if fisheye else [k1, k2, p1, p2, k3],
        seen_from(matrix_of(frame[MATRIX]), OPENGL),
        fisheye=fisheye,
        scale="free",
    )


def _matrix(values: Mapping[str, Any], size: Sequence[float] | None) -> Array:
    if "K" in values:
        matrix = numbers_of(matrix_of(values["K"]), (3, 3)).copy()
        matrix[:2, 2] -= HALF
        return matrix
    if size is None:
        raise InputError("transforms without w and h, the size of their pictures")
    focal = list[float | None]()
    for axis, side in zip("xy", size, strict=True):
        if f"fl_{axis}" in values:
            focal.append(number_of(values[f"fl_{axis}"]))
        elif f"camera_angle_{axis}" in values:
            angle = number_of(values[f"camera_angle_{axis}"])
            if not 0.0 < angle < math.pi:
                raise InputError(
                    f"a camera_angle_{axis} of {angle:g}, which must be radians "
                    "between 0 and pi"
                )
            focal.append(0.5 * side / math.tan(0.5 * angle))
        else:
            focal.append(None)
    known = [length for length in focal if length is not None]
    if not known:
        raise InputError("transforms without fl_x, camera_angle_x or K")
    # a file that states one focal length has square pixels
    lengths = list[float]()
    for length in focal:
        lengths.append(known[0] if length is None else length)
    across = number_of(values.get("cx", 0.5 * size[0]))
    down = number_of(values.get("cy", 0.5 * size[1]))
    return pinhole_matrix(lengths, np.array([across - HALF, down - HALF]))


NERF = Dialect("NeRF's programs", _recognises, _read)
