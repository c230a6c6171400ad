"""Which program wrote a calibration file, and its cameras."""

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
from posefit.geometry.calibration.world import check_places
from posefit.reading import cut, quoted, read_text

# A program joins by a line; the first that recognises a file reads it, OpenCV's users last, who choose their names.
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
MESSAGE = 300  # characters of what is wrong


def read_calibrations(path: str | Path) -> list[Calibration]:
    """Return the cameras of a calibration file, in its order; of `FILE:NAME` that of this name.

    Raises InputError naming the file and what is wrong.
    """
    path = Path(path)
    chosen = ""
    before, colon, after = str(path).rpartition(":")
    if colon and not path.is_file():
        path = Path(before)
        chosen = after
    if not path.is_file():
        raise InputError(
            f"{path}: expected a calibration file, got nothing of that name"
        )
    if path.suffix.lower() in PICKLES:
        raise InputError(f"{path}: expected a calibration as text, got {HOW}")
    text = read_text(path, LARGEST_FILE)
    written_by = ""
    try:
        content = stored(path, text)
        dialect = dialect_of(content)
        written_by = f" of {dialect.program}"
        # of numbers that are not finite, or become so, a check says more
        with np.errstate(all="ignore"):
            calibrations = dialect.read(content)
            check_places(calibrations)
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
        reason = cut(f"no {cause}" if isinstance(error, KeyError) else cause, MESSAGE)
        raise InputError(
            f"{path}: expected a calibration{written_by}, got {reason}"
        ) from None
    if not calibrations:
        raise InputError(f"{path}: expected a calibration with a camera, got none")
    names = [calibration.name for calibration in calibrations]
    if chosen and chosen not in names:
        raise InputError(
            f"{path}: expected the name of a camera, {cut(', '.join(names))}, got {quoted(chosen)}"
        )
    return [
        calibration for calibration in calibrations if chosen in ("", calibration.name)
    ]


def dialect_of(file: Stored) -> Dialect:
    """Return how a file is written. Raises InputError where no dialect is recognised."""
    for dialect in DIALECTS:
        if dialect.recognises(file):
            return dialect
    raise InputError(f"XML of {quoted(file.root.tag)}, which is not known")
