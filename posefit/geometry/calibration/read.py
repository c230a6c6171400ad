"""Finds out which program wrote a calibration file, and reads its cameras."""

from pathlib import Path

import cv2
import numpy as np

from posefit.errors import InputError
from posefit.geometry.calibration.anipose import ANIPOSE
from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.easymocap import EASYMOCAP
from posefit.geometry.calibration.kalibr import KALIBR
from posefit.geometry.calibration.lens import Calibration
from posefit.geometry.calibration.metashape import METASHAPE
from posefit.geometry.calibration.nerf import NERF
from posefit.geometry.calibration.opencap import HOW, OPENCAP, PICKLES
from posefit.geometry.calibration.opencv import OPENCV
from posefit.geometry.calibration.openmvg import OPENMVG
from posefit.geometry.calibration.own import OWN
from posefit.geometry.calibration.panoptic import PANOPTIC
from posefit.geometry.calibration.qualisys import QUALISYS
from posefit.geometry.calibration.realsense import REALSENSE
from posefit.geometry.calibration.ros import ROS
from posefit.geometry.calibration.values import LARGEST_FILE, Stored, stored
from posefit.geometry.calibration.vicon import VICON
from posefit.geometry.calibration.voxelpose import VOXELPOSE
from posefit.geometry.calibration.world import misreading
from posefit.reading import cut, quoted, read_text

# To add a program, add its dialect here. The first dialect that recognises a file reads
# it. OpenCV is last, because its users choose the names of their keys.
DIALECTS: tuple[Dialect, ...] = (
    OWN,
    QUALISYS,
    VICON,
    METASHAPE,
    NERF,
    OPENMVG,
    OPENCAP,
    KALIBR,
    ROS,
    EASYMOCAP,
    PANOPTIC,
    VOXELPOSE,
    REALSENSE,
    ANIPOSE,
    OPENCV,
)
MESSAGE = 300  # most characters of the reason in a message


def file_and_name(path: str | Path) -> tuple[Path, str]:
    """Return the file of a calibration, and the name after it in `FILE:NAME`, or ""."""
    path = Path(path)
    before, colon, name = str(path).rpartition(":")
    if colon and not path.is_file():
        return Path(before), name
    return path, ""


def read_calibrations(path: str | Path) -> list[Calibration]:
    """Return the cameras of a calibration file.

    Args:
        path: The file, or `FILE:NAME` for one of its cameras.

    Returns:
        The cameras in the file's order, or only those called `NAME`.

    Raises:
        InputError: The file is not a calibration, or has no camera of that name. The
            message names the file and the mistake.
    """
    path, chosen = file_and_name(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if path.suffix.lower() in PICKLES:
        raise InputError(f"{path}: expected a calibration as text, got {HOW}")
    text = read_text(path, LARGEST_FILE)
    written_by = ""
    try:
        content = stored(path, text)
        dialect = dialect_of(content)
        written_by = f" of {dialect.program}"
        # no warnings: the checks say more about numbers that are not finite
        with np.errstate(all="ignore"):
            calibrations = dialect.read(content)
            if wrong := misreading(calibrations):
                raise InputError(wrong)
            for calibration in calibrations:
                calibration.camera(calibration.size or (1000, 1000), np.eye(3))
    except (
        ValueError,
        TypeError,
        KeyError,
        OverflowError,
        AttributeError,
        RecursionError,
        cv2.error,
    ) as error:
        cause = " ".join(str(error).split()) or type(error).__name__
        # the reader of posefit's own cameras names the file, too
        cause = cause.removeprefix(f"{path}: ")
        reason = cut(f"no {cause}" if isinstance(error, KeyError) else cause, MESSAGE)
        raise InputError(
            f"{path}: expected a calibration{written_by}, got {reason}"
        ) from None
    if not calibrations:
        among = ""
        if content.values:
            among = (
                f" among {cut(', '.join(map(quoted, content.values)))}: a camera has a "
                "camera matrix, or fx, fy, cx and cy"
            )
        raise InputError(
            f"{path}: expected a calibration with a camera, got none{among}"
        )
    if not chosen:
        return calibrations
    names = [calibration.name for calibration in calibrations]
    if chosen not in names:
        raise InputError(
            f"{path}: expected the name of a camera, {cut(', '.join(names))}, got "
            f"{quoted(chosen)}"
        )
    return [calibration for calibration in calibrations if calibration.name == chosen]


def dialect_of(file: Stored) -> Dialect:
    """Return a file's dialect. Raises InputError if no dialect recognises it."""
    for dialect in DIALECTS:
        if dialect.recognises(file):
            return dialect
    raise InputError(
        f"XML of {quoted(file.root.tag)}, which is not known: XML of OpenCV, Qualisys, "
        "Vicon and Metashape is read"
    )
