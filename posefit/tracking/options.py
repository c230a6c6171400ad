"""The options of a track, each declared once: `posefit.track` and the flags of the command line are made of them.

An option is one line of `TrackOptions`: its type and default, and with `option(...)` its help, unit and check. Nothing
slow is imported here, as every start of the command line reads it.
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
    from posefit.footage.people import Choice
    from posefit.footage.segmentation import Extraction
    from posefit.footage.views import Range
    from posefit.geometry.calibration import Up
    from posefit.geometry.camera import Camera
    from posefit.geometry.units import Unit
    from posefit.motion.clips import FileOptions, Source

# of a frame: N (C + 1) with N = 40 and C = 60 of the SAPSO paper, section 5.2
EVALUATIONS = 2440
LARGEST_SIDE = 16_384  # pixels of a rendered picture

# of a name and a value that is not None: the value as it is used; raises InputError
Check = Callable[[str, Any], Any]


class Option(NamedTuple):
    """What is declared of an option beside its name, type and default."""

    help: str
    check: Check | None = None
    # or the form of its text; what the command line shows as a placeholder
    unit: str = ""
    # of the command line; None for the name itself, "" for none
    flag: str | None = None
    # of a text of the command line; bool for a pair of flags
    parse: Callable[[str], Any] = str
    repeated: bool = False  # whether the flag may be given several times
    identifies: bool = True  # whether a track that goes on must have the same value
    heading: str = ""  # in the help, of this option and those below it
    live: bool = True  # whether `posefit track --live` takes it


def option(default: Any, text: str, *more: Any, **others: Any) -> Any:
    """Return the dataclass field of an option; see `Option` for what else may be given."""
    return field(default=default, metadata={"option": Option(text, *more, **others)})


def declared(field: "Field[Any]") -> Option:
    """Return what is declared of a field of `TrackOptions`."""
    return field.metadata["option"]  # type: ignore[no-any-return]


def choice(*choices: object) -> Check:
    """Return the check of one of some values."""

    def check(name: str, value: Any) -> Any:
        one_of(name, value, choices)
        return value

    return check


def within(low: float, high: float, unit: str = "") -> Check:
    """Return the check of a number in a range."""

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
    return (
        None if start is None else int(start),
        None if stop is None else int(stop),
    )


def _person(name: str, value: Any) -> "Choice":
    if _is_whole(value):
        return whole(name, value, 1)
    across, down = pair(name, value, "a number, or (across, down) in pixels")
    return finite_number(name, across), finite_number(name, down)


def _is_whole(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool)


def _device(_name: str, value: Any) -> str:
    from posefit.silhouette.cuda.device import check_device

    check_device(value)
    return str(value)


def _degrees(name: str, value: Any) -> tuple[float, ...]:
    values = value.tolist() if hasattr(value, "tolist") else value  # an array
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
    """Return cameras, their calibrations and names of files."""
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
    from posefit.footage.segmentation import Extraction

    if not isinstance(value, Extraction):
        raise InputError(
            f"{name} must be an Extraction, such as Extraction('mixture'), got {quoted(value)}"
        )
    return value


def _method(name: str, value: Any) -> Any:
    if not (
        isinstance(value, str)
        or callable(value)
        or (isinstance(value, tuple) and len(value) == 2)
    ):
        raise InputError(
            f"{name} must be a name, a factory, or a pair of optimiser and prior, got {quoted(value)}"
        )
    return value


def _sources(name: str, value: Any) -> Sequence[Any]:
    if isinstance(value, str | Path) or not isinstance(value, Sequence):
        raise InputError(f"{name} must be a list of motions, got {quoted(value)}")
    return value


def text_size(text: str) -> tuple[int, int]:
    """Return the width and the height that a text WxH states. Raises InputError for any other text."""
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise InputError(f"expected WIDTHxHEIGHT such as 320x240, got {quoted(text)}")
    return int(width), int(height)


def text_range(text: str) -> tuple[int | None, int | None]:
    """Return the ends that a text A:B states; either may be left out. Raises InputError for any other text."""
    start, colon, stop = text.partition(":")
    try:
        if colon:
            return int(start) if start else None, int(stop) if stop else None
    except ValueError:
        pass
    raise InputError(f"expected A:B such as 0:50, :50 or 10:, got {quoted(text)}")


def text_label(text: str) -> int:
    """Return the number of a label such as 15, or 0x800000 for a colour. Raises InputError for any other text."""
    try:
        return int(text, 0)
    except ValueError:
        raise InputError(
            f"expected a whole number such as 15, or a colour 0xRRGGBB, got {quoted(text)}"
        ) from None


def text_person(text: str) -> "Choice":
    """Return the number of a person, for a text N, or their place, for X,Y. Raises InputError for any other text."""
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
    """The options of a track, checked; what is None or empty is decided by the source."""

    asf: str | Path | None = option(
        None,
        "Skeleton of SOURCE; by default the only .asf beside an .amc.",
        _path,
        "FILE",
        heading="What is seen",
    )
    camera: "Camera | str | Path | Sequence[Camera | str | Path]" = option(
        (),
        "Calibration, one a view; guessed where absent.",
        _cameras,
        "FILE",
        repeated=True,
    )
    up: "Up | None" = option(
        None,
        "Axis that points up: in the calibration's world, or in that of a .bvh or .amc file; recognised where absent.",
        choice("x", "y", "z"),
        "x|y|z",
    )
    unit: "Unit | None" = option(
        None,
        "Unit of lengths in a calibration, or in a .bvh or .asf file; recognised where absent.",
        choice(*UNITS),
        "|".join(UNITS),
    )
    rate: float | None = _float(
        "Rate of .amc files that do not state it; by default 120.", RATES, "HZ"
    )
    view_degrees: float | Sequence[float] = option(
        (),
        "Where a camera stands: 0 in front, 90 to the side; repeatable.",
        _degrees,
        "DEGREES",
        None,
        float,
        True,
    )
    size: tuple[int, int] | None = option(
        None,
        "Image of a rendered motion, by default 320x240.",
        _size,
        "WxH",
        parse=text_size,
        live=False,
    )
    fps: float | None = _float(
        "Rate to resample a motion to, or of masks; by default 30, or theirs.",
        RATES,
        "HZ",
    )
    frames: "Range" = option(
        (None, None),
        "Only these frames, (start, stop) in Python: of footage as filmed, of a motion after resampling.",
        _range,
        "A:B",
        "",  # `track` has it, and `fit` one frame instead
        text_range,
        live=False,
    )
    extraction: "Extraction | None" = option(
        None, "How the person is taken out of video.", _extraction, flag=""
    )
    height: float | None = _float(
        "How tall the person in the footage stands.", HEIGHTS, "METRES", " metres"
    )
    label: int | None = _int(
        None,
        "Of masks: the value or the colour that the person has.",
        0,
        parse=text_label,
        live=False,
    )
    holes: float | None = _float(
        "Of masks: fill holes up to this share of the person; by default 0.02.",
        (0.0, 1.0),
        "SHARE",
        ", a share of the person's area",
        live=False,
    )
    person: "Choice | None" = option(
        None,
        "Of several people: the number that the warning gives them, 1 the longest visible, or the X,Y there.",
        _person,
        "N|X,Y",
        parse=text_person,
        live=False,
    )
    # the options above say how a source is looked at, see `VIEW`
    method: "str | TrackerFactory | tuple[str | OptimiserFactory, str | Prior] | None" = option(
        None,
        "OPTIMISER@PRIOR, OPTIMISER, @PRIOR or a tracker, see `posefit plugins`; by default exemplars, or annealed@pca "
        "for a built-in motion. In Python also a tracker's factory, or a pair: an optimiser's name or factory, and a "
        "prior's name or one that has learned.",
        _method,
        "METHOD",
        heading="Method and budget",
    )
    settings: Mapping[str, Any] | Sequence[str] = option(
        (),
        "Of a plugin, such as sapso.cooling=0.9 or, where one alone has it, cooling=0.9; repeatable.",
        None,
        "[NAME.]SETTING=VALUE",
        "set",
        repeated=True,
    )
    train: "Sequence[Source]" = option(
        (),
        "What the method learns from: a motion, a folder, library, or library:16; repeatable. By default library for "
        "exemplars, else other styles of a built-in motion, or walks.",
        _sources,
        "SOURCE",
        repeated=True,
    )
    evaluations: int | None = _int(
        None,
        "Budget of a frame; by default 9760 of exemplars, else N (C + 1) = 40 x 61 = 2440.",
        1,
        "POSES",
    )
    translation: "Translation | None" = option(
        None,
        "Of the root: known (the truth), searched, or aligned.",
        choice("known", "searched", "aligned"),
        "HOW",
        heading="How it is followed",
    )
    first_pose: Literal["searched", "given"] = option(
        "searched",
        "searched, or given (the true one).",
        choice("searched", "given"),
        "HOW",
    )
    restarts: int | None = _int(
        None,
        "Searches of an unknown first pose, at most; by default 8, or 0 for a tracker that looks ahead.",
        0,
    )
    body_frames: int | None = _int(
        None,
        "Frames a build is fitted to; by default 12 for footage, 0 for none.",
        0,
        live=False,
    )
    hypotheses: int = _int(
        1,
        "Tracks from different initial guesses, each at the full budget; one is kept.",
        1,
        live=False,
    )
    smooth: bool | None = option(
        None,
        "The root moves smoothly, and feet do not slide; the default for footage.",
        _flag,
        parse=bool,
        identifies=False,
        live=False,
    )
    seed: int = _int(0, "Of all random numbers.", 0, heading="Method and budget")
    threads: int = _int(
        1, "The result is the same with any number.", 1, identifies=False
    )
    device: str = option(
        "cpu",
        "Where poses are drawn: cpu, or cuda with a GPU.",
        _device,
        "cpu|cuda",
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
        """The options that say how a source is looked at, as `posefit.footage.source.scene_of` takes them."""
        return {name: getattr(self, name) for name in VIEW}

    @property
    def of_files(self) -> "FileOptions":
        """What is stated of the files that are learned from."""
        from posefit.motion.clips import FileOptions

        return FileOptions(self.asf, rate=self.rate)

    def changed(self, **values: Any) -> Self:
        """Return these options with some of them replaced, checked again."""
        return replace(self, **values)


_NAMES = [each.name for each in fields(TrackOptions)]
VIEW = _NAMES[: _NAMES.index("method")]  # the options that `TrackOptions.view` holds
