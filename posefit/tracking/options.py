"""The options of a track, for `posefit.track` and the flags of the command line.

Each option is declared once, as a field of `TrackOptions`: its type and default, and
with `option(...)` its help, unit and check. Nothing slow is imported here, because
every start of the command line imports this module.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, dataclass, field, fields, replace
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Self

from posefit.errors import InputError
from posefit.fitting.check import finite_number, one_of, pair, whole
from posefit.geometry.units import UNITS
from posefit.limits import HEIGHTS, RATES
from posefit.reading import quoted

if TYPE_CHECKING:
    from posefit.fitting.optimiser import OptimiserFactory
    from posefit.fitting.prior import Prior
    from posefit.fitting.space import Translation
    from posefit.fitting.tracker import TrackerFactory
    from posefit.footage.extraction import Extraction
    from posefit.footage.people import Choice
    from posefit.footage.views import Range
    from posefit.geometry.calibration import Up
    from posefit.geometry.camera import Camera
    from posefit.geometry.units import Unit
    from posefit.motion.clips import FileOptions, Source

# per frame: N (C + 1) with N = 40 and C = 60 of the SAPSO paper, section 5.2
EVALUATIONS = 2440
LARGEST_SIDE = 16_384  # pixels of a rendered picture

# takes the name and a value that is not None; returns the value to use, or raises
# InputError
Check = Callable[[str, Any], Any]


class Option(NamedTuple):
    """The declaration of an option, except for its name, type and default.

    Attributes:
        help: One sentence for the user.
        check: The check of a value, or None for no check.
        unit: The unit or form of the value: the placeholder on the command line.
        flag: The flag on the command line: None for the option's name, "" for no flag.
        parse: Parses a string from the command line; `bool` makes a pair of flags.
        repeated: Whether the flag may be given several times.
        identifies: Whether a resumed track must have the same value.
        heading: The heading in the help, for this option and the next ones.
        live: Whether `posefit track --live` takes the option.

    """

    help: str
    check: Check | None = None
    unit: str = ""
    flag: str | None = None
    parse: Callable[[str], Any] = str
    repeated: bool = False
    identifies: bool = True
    heading: str = ""
    live: bool = True


def option(default: Any, text: str, *more: Any, **others: Any) -> Any:
    """Return the dataclass field of an option; the rest is as in `Option`."""
    return field(default=default, metadata={"option": Option(text, *more, **others)})


def declared(field: "Field[Any]") -> Option:
    """Return the declaration of a field of `TrackOptions`."""
    return field.metadata["option"]  # type: ignore[no-any-return]


def choice(*choices: object) -> Check:
    """Return a check that a value is one of the choices."""

    def check(name: str, value: Any) -> Any:
        one_of(name, value, choices)
        return value

    return check


def within(low: float, high: float, unit: str = "") -> Check:
    """Return a check that a value is a number in a range."""

    def check(name: str, value: Any) -> float:
        if not low <= finite_number(name, value) <= high:
            raise InputError(
                f"{name} must lie in {low:g} to {high:g}{unit}, got {quoted(value)}"
            )
        return float(value)

    return check


def _int(
    default: int | None, text: str, least: int, placeholder: str = "N", **others: Any
) -> Any:
    others = {"parse": int, **others}
    return option(
        default,
        text,
        lambda name, value: whole(name, value, least),
        placeholder,
        **others,
    )


def _float(
    text: str,
    ends: tuple[float, float],
    placeholder: str,
    unit: str = "",
    **others: Any,
) -> Any:
    return option(None, text, within(*ends, unit), placeholder, parse=float, **others)


def _size(name: str, value: Any) -> tuple[int, int]:
    sides = pair(name, value, "(width, height)")
    if not all(_is_whole(side) and 1 <= side <= LARGEST_SIDE for side in sides):
        largest = f"{LARGEST_SIDE}x{LARGEST_SIDE}"
        raise InputError(
            f"{name} must be from 1x1 to {largest} pixels, got {sides[0]}x{sides[1]}"
        )
    return int(sides[0]), int(sides[1])


def _range(name: str, value: Any) -> tuple[int | None, int | None]:
    start, stop = pair(name, value, "(start, stop), either of which may be None")
    if not all(end is None or _is_whole(end) for end in (start, stop)):
        raise InputError(
            f"{name} must be two whole numbers or None, got {quoted(value)}"
        )
    first = None if start is None else int(start)
    last = None if stop is None else int(stop)
    return first, last


def _person(name: str, value: Any) -> "Choice":
    if _is_whole(value):
        return whole(name, value, 1)
    across, down = pair(name, value, "a number, or (across, down) in pixels")
    return finite_number(name, across), finite_number(name, down)


def _is_whole(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool)


def _device(_name: str, value: Any) -> str:
    from posefit.footage.device import device_of

    device_of(value)
    return str(value)


def _degrees(name: str, value: Any) -> tuple[float, ...]:
    values = value.tolist() if hasattr(value, "tolist") else value  # for an array
    check = within(-360.0, 360.0, " degrees")
    if not isinstance(values, Sequence) or isinstance(values, str):
        return (check(name, values),)
    return tuple(check(name, degrees) for degrees in values)


def _flag(name: str, value: Any) -> bool:
    # NumPy's booleans are not Python's
    value = value.item() if hasattr(value, "item") else value
    if not isinstance(value, bool):
        raise InputError(f"{name} must be True or False, got {quoted(value)}")
    return value


def _path(name: str, value: Any) -> str | Path:
    if not isinstance(value, str | Path):
        raise InputError(f"{name} must be the name of a file, got {quoted(value)}")
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


def _method(name: str, value: Any) -> Any:
    is_pair = isinstance(value, tuple) and len(value) == 2
    if not (isinstance(value, str) or callable(value) or is_pair):
        raise InputError(
            f"{name} must be a name, a factory, or a pair of optimiser and prior, "
            f"got {quoted(value)}"
        )
    return value


def _sources(name: str, value: Any) -> Sequence[Any]:
    if isinstance(value, str | Path) or not isinstance(value, Sequence):
        raise InputError(f"{name} must be a list of motions, got {quoted(value)}")
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


def text_person(text: str) -> "Choice":
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
class TrackOptions:
    """The options of a track, checked.

    For an option that is None or empty, the default depends on the source.
    """

    asf: str | Path | None = option(
        None,
        "Skeleton of SOURCE. Default: the only .asf in the folder of an .amc.",
        _path,
        "FILE",
        heading="Source and camera",
    )
    camera: "Camera | str | Path | Sequence[Camera | str | Path]" = option(
        (),
        "Calibration file, one per view. Default: guessed.",
        _cameras,
        "FILE",
        repeated=True,
    )
    up: "Up | None" = option(
        None,
        "Axis that points up in the world of a calibration, or of a .bvh or .amc "
        "file. Default: recognised.",
        choice("x", "y", "z"),
        "x|y|z",
    )
    unit: "Unit | None" = option(
        None,
        "Unit of lengths in a calibration, or in a .bvh or .asf file. "
        "Default: recognised.",
        choice(*UNITS),
        "|".join(UNITS),
    )
    rate: float | None = _float(
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
    fps: float | None = _float(
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
    height: float | None = _float(
        "Height of the person in footage.", HEIGHTS, "METRES", " metres"
    )
    label: int | None = _int(
        None,
        "Value or colour of the person in masks.",
        0,
        parse=text_label,
        live=False,
    )
    holes: float | None = _float(
        "Fill holes in masks up to this share of the person. Default: 0.02.",
        (0.0, 1.0),
        "SHARE",
        ", a share of the person's area",
        live=False,
    )
    person: "Choice | None" = option(
        None,
        "Person to track if there are several: the number in the warning (1 is visible "
        "the longest), or the position X,Y given there.",
        _person,
        "N|X,Y",
        parse=text_person,
        live=False,
    )
    # `VIEW` has all options above this line
    method: "str | TrackerFactory | tuple[str | OptimiserFactory, str | Prior] | None" = option(  # noqa: E501
        None,
        "OPTIMISER@PRIOR, OPTIMISER, @PRIOR or a tracker; see `posefit plugins`. "
        "Default: exemplars, or annealed@pca for a built-in motion. In Python also a "
        "tracker's factory, or a pair of an optimiser's name or factory and a prior's "
        "name or a fitted prior.",
        _method,
        "METHOD",
        heading="Method and budget",
    )
    settings: Mapping[str, Any] | Sequence[str] = option(
        (),
        "Setting of a plugin, such as sapso.cooling=0.9, or cooling=0.9 if only one "
        "plugin has it; repeatable.",
        None,
        "[NAME.]SETTING=VALUE",
        "set",
        repeated=True,
    )
    train: "Sequence[Source]" = option(
        (),
        "Training motions: a motion, a folder, library, or library:16; repeatable. "
        "Default: library for exemplars; for other methods the other styles of a "
        "built-in motion, or walks.",
        _sources,
        "SOURCE",
        repeated=True,
    )
    evaluations: int | None = _int(
        None,
        "Budget per frame. Default: 9760 for exemplars, else N (C + 1) = 40 x 61 = "
        "2440.",
        1,
        "POSES",
    )
    translation: "Translation | None" = option(
        None,
        "Position of the root: known (the truth), searched, or aligned.",
        choice("known", "searched", "aligned"),
        "HOW",
        heading="Tracking",
    )
    first_pose: Literal["searched", "given"] = option(
        "searched",
        "First pose: searched, or given (the truth).",
        choice("searched", "given"),
        "HOW",
    )
    restarts: int | None = _int(
        None,
        "Largest number of searches for an unknown first pose. Default: 8, or 0 for "
        "a tracker that looks ahead.",
        0,
    )
    body_frames: int | None = _int(
        None,
        "Frames to which the build is fitted. Default: 12 for footage, else 0.",
        0,
        live=False,
    )
    hypotheses: int = _int(
        1,
        "Number of tracks from different initial guesses, each at the full budget. One "
        "is kept.",
        1,
        live=False,
    )
    smooth: bool | None = option(
        None,
        "Smooth the root, and keep feet from sliding. Default for footage.",
        _flag,
        parse=bool,
        identifies=False,
        live=False,
    )
    seed: int = _int(0, "Seed of all random numbers.", 0, heading="Method and budget")
    threads: int = _int(
        1, "Number of threads. Does not change the result.", 1, identifies=False
    )
    device: str = option(
        "cpu",
        "Where poses are rasterised: cpu, or a plugin's device, such as a GPU.",
        _device,
        "NAME",
        identifies=False,
    )

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            check = declared(each).check
            if value is None and isinstance(each.default, tuple):
                object.__setattr__(self, each.name, each.default)
            elif value is not each.default and check is not None:
                object.__setattr__(self, each.name, check(each.name, value))

    @property
    def view(self) -> dict[str, Any]:
        """The options of `VIEW`, for `posefit.footage.source.scene_of`."""
        return {name: getattr(self, name) for name in VIEW}

    @property
    def of_files(self) -> "FileOptions":
        """The options for the files of training motions."""
        from posefit.motion.clips import FileOptions

        return FileOptions(self.asf, rate=self.rate)

    def changed(self, **values: Any) -> Self:
        """Return these options with some replaced, and all checked again."""
        return replace(self, **values)


_NAMES = [each.name for each in fields(TrackOptions)]
VIEW = _NAMES[: _NAMES.index("method")]  # the options of the source and its cameras
