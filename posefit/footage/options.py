"""The options of a source: its cameras, its person, and how it is read.

Nothing slow is imported here, because every start of the command line imports this
module.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from posefit.errors import InputError
from posefit.fitting.check import pair
from posefit.footage.choice import Choice, checked_person
from posefit.geometry.units import UNITS
from posefit.limits import HEIGHTS, RATES
from posefit.options import (
    Options,
    choice,
    is_whole,
    number_option,
    option,
    whole_option,
    within,
)
from posefit.reading import quoted

if TYPE_CHECKING:
    from posefit.footage.extraction import Extraction
    from posefit.footage.views import Range
    from posefit.geometry.calibration import Calibration, Up
    from posefit.geometry.camera import Camera
    from posefit.geometry.units import Unit

    # a camera, a calibration, or the file of either
    OneCamera = Camera | Calibration | str | Path

LARGEST_SIDE = 16_384  # pixels of a rendered picture


def _size(name: str, value: Any) -> tuple[int, int]:
    sides = pair(name, value, "(width, height)")
    if not all(is_whole(side) and 1 <= side <= LARGEST_SIDE for side in sides):
        largest = f"{LARGEST_SIDE}x{LARGEST_SIDE}"
        raise InputError(
            f"{name} must be from 1x1 to {largest} pixels, got {sides[0]}x{sides[1]}"
        )
    return int(sides[0]), int(sides[1])


def _range(name: str, value: Any) -> tuple[int | None, int | None]:
    start, stop = pair(name, value, "(start, stop), either of which may be None")
    if not all(end is None or is_whole(end) for end in (start, stop)):
        raise InputError(
            f"{name} must be two whole numbers or None, got {quoted(value)}"
        )
    first = None if start is None else int(start)
    last = None if stop is None else int(stop)
    return first, last


def _degrees(name: str, value: Any) -> tuple[float, ...]:
    values = value.tolist() if hasattr(value, "tolist") else value  # for an array
    check = within(-360.0, 360.0, " degrees")
    if not isinstance(values, Sequence) or isinstance(values, str):
        return (check(name, values),)
    return tuple(check(name, degrees) for degrees in values)


def _path(name: str, value: Any) -> str | Path:
    if not isinstance(value, str | Path):
        raise InputError(f"{name} must be the name of a file, got {quoted(value)}")
    return value


def _category(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise InputError(f"{name} must be a name, got {quoted(value)}")
    return value


def _cameras(name: str, value: Any) -> tuple[Any, ...]:
    """Return cameras, calibrations or names of files as a tuple."""
    from posefit.geometry.calibration import Calibration
    from posefit.geometry.camera import Camera

    values = tuple(value) if isinstance(value, list | tuple) else (value,)
    for each in values:
        if not isinstance(each, Camera | Calibration | str | Path):
            raise InputError(
                f"{name} must be cameras or files of calibrations, got {quoted(each)}"
            )
    return values


def _extraction(name: str, value: Any) -> "Extraction":
    from posefit.footage.extraction import Extraction

    if not isinstance(value, Extraction):
        raise InputError(
            f"{name} must be an Extraction, such as Extraction('mixture'), "
            f"got {quoted(value)}"
        )
    return value


def text_size(text: str) -> tuple[int, int]:
    """Return the width and height in a text WxH. Raises InputError for another form."""
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise InputError(f"expected WIDTHxHEIGHT such as 320x240, got {quoted(text)}")
    return int(width), int(height)


def text_range(text: str) -> tuple[int | None, int | None]:
    """Return the ends of a range from a text A:B, either of which may be left out.

    Raises InputError for another form.
    """
    start, colon, stop = text.partition(":")
    try:
        if colon:
            return int(start) if start else None, int(stop) if stop else None
    except ValueError:
        pass
    raise InputError(f"expected A:B such as 0:50, :50 or 10:, got {quoted(text)}")


def text_label(text: str) -> int:
    """Return the number of a label such as 15, or of a colour such as 0x800000.

    Raises InputError for another form.
    """
    try:
        return int(text, 0)
    except ValueError:
        raise InputError(
            "expected a whole number such as 15, or a colour 0xRRGGBB, "
            f"got {quoted(text)}"
        ) from None


def text_person(text: str) -> Choice:
    """Return the number of a person from a text N, or a position in pixels from X,Y.

    Raises InputError for another form.
    """
    try:
        if "," not in text:
            return int(text)
        across, down = map(float, text.split(","))
        return across, down
    except ValueError:
        raise InputError(
            f"expected a number such as 2, or X,Y in pixels, got {quoted(text)}"
        ) from None


@dataclass(frozen=True, kw_only=True)
class SourceOptions(Options):
    """The options of a source, checked.

    For an option that is None or empty, the default depends on the source.
    """

    asf: str | Path | None = option(
        None,
        "Skeleton of SOURCE. Default: the only .asf in the folder of an .amc.",
        _path,
        "FILE",
        heading="Source and camera",
    )
    camera: "OneCamera | Sequence[OneCamera]" = option(
        (),
        "Calibration file, one per view. Default: guessed.",
        _cameras,
        "FILE",
        repeated=True,
    )
    up: "Up | None" = option(
        None,
        "Axis that points up in the world of a calibration, or of a .bvh or .amc "
        "file. Default: guessed.",
        choice("x", "y", "z"),
        "x|y|z",
    )
    unit: "Unit | None" = option(
        None,
        "Unit of lengths in a calibration, or in a .bvh or .asf file. "
        "Default: guessed.",
        choice(*UNITS),
        "|".join(UNITS),
    )
    rate: float | None = number_option(
        "Frame rate of .amc files that do not state it. Default: 120.", RATES, "HZ"
    )
    view_degrees: float | Sequence[float] = option(
        (),
        "Direction of a camera: 0 in front, 90 at the side; repeatable.",
        _degrees,
        "DEGREES",
        None,
        float,
        True,
    )
    size: tuple[int, int] | None = option(
        None,
        "Image size of a rendered motion. Default: 320x240.",
        _size,
        "WxH",
        parse=text_size,
        live=False,
    )
    fps: float | None = number_option(
        "Frame rate of masks, or the rate to which a motion is resampled. "
        "Default: the masks' own rate; 30 for motions.",
        RATES,
        "HZ",
    )
    frames: "Range" = option(
        (None, None),
        "Only these frames, in Python (start, stop). Footage is counted as filmed, and "
        "a motion after resampling.",
        _range,
        "A:B",
        "",  # the command `track` adds this flag; `fit` has --frame instead
        text_range,
        live=False,
    )
    extraction: "Extraction | None" = option(
        None, "How to segment the person in video.", _extraction, flag=""
    )
    height: float | None = number_option(
        "Height of the person in footage.", HEIGHTS, "METRES", " metres"
    )
    label: int | None = whole_option(
        None,
        "Value or colour of the person in masks.",
        0,
        parse=text_label,
        live=False,
    )
    category: str | None = option(
        None,
        "Category of the person in annotations. Default: person, or the only one.",
        _category,
        "NAME",
        live=False,
    )
    holes: float | None = number_option(
        "Fill holes in masks up to this share of the person. Default: 0.02.",
        (0.0, 1.0),
        "SHARE",
        ", a share of the person's area",
        live=False,
    )
    person: Choice | None = option(
        None,
        "Person to track if there are several: the number in the warning (1 is visible "
        "the longest), or the position X,Y given there.",
        checked_person,
        "N|X,Y",
        parse=text_person,
        live=False,
    )

    @property
    def cameras(self) -> "Sequence[OneCamera]":
        """The value of `camera`, always a sequence."""
        return cast("Sequence[OneCamera]", self.camera)

    @property
    def degrees(self) -> Sequence[float]:
        """The value of `view_degrees`, always a sequence."""
        return cast(Sequence[float], self.view_degrees)
