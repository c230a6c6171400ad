"""The interface of a reader of one program's calibration files."""

from collections.abc import Callable
from typing import NamedTuple

from posefit.geometry.calibration.lens import Calibration
from posefit.geometry.calibration.values import Stored


class Dialect(NamedTuple):
    """How one program writes calibrations."""

    program: str  # its name in messages
    # returns whether this program wrote a file
    recognises: Callable[[Stored], bool]
    # Returns a file's cameras. The message of an InputError completes `expected a
    # calibration ..., got`.
    read: Callable[[Stored], list[Calibration]]
