"""What a reader of one program's calibration files offers."""

from collections.abc import Callable
from typing import NamedTuple

from posefit.geometry.calibration.lens import Calibration
from posefit.geometry.calibration.values import Stored


class Dialect(NamedTuple):
    """How one program writes calibrations."""

    program: str  # as messages call it
    # whether a file is of this program
    recognises: Callable[[Stored], bool]
    # its cameras; raises InputError that completes `expected a calibration ..., got`
    read: Callable[[Stored], list[Calibration]]
