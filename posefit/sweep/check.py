"""Checks a cell's spec, so that no mistake in it is reported only after hours."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from difflib import get_close_matches
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from posefit.errors import InputError
from posefit.fitting.space import TRANSLATIONS
from posefit.fitting.tracker import Prediction
from posefit.footage.masks import FPS
from posefit.footage.source import MOTIONS, motion_of
from posefit.footage.training import training_clips
from posefit.motion import built_in, recorded
from posefit.motion.motion import RATES
from posefit.reading import SHOWN, cut, quoted
from posefit.registry import Kind, Offer, registry
from posefit.settings import population
from posefit.silhouette.corruption import CORRUPTIONS
from posefit.sweep.cell import ALL_AROUND, DROPPED, TrackCell, digest_of, parts, settings_text, version_of
from posefit.tracking.method import parsed_settings

FIELDS = tuple(one.name for one in fields(TrackCell) if one.name not in ("files", "version"))
MAX_SIDE = 16_384  # pixels
MAX_BODY_OFF = 50.0  # percent that a body may be off
MAX_BITS = 1_024  # of a whole number, so that it can be written down


def cell_of(spec: Mapping[str, Any]) -> TrackCell:
    """Return the cell that a spec describes, complete: settings as their types ask, training motions by name.

    Raises ValueError where a name is not known or a value makes no sense, and ImportError where a method needs a
    library that is not installed.
    """
    for name in spec:
        if name not in FIELDS:
            raise InputError(f"a cell must say {', '.join(FIELDS)}, got {quoted(name)}{_nearest(name, FIELDS)}")
    for name in ("method", "motion"):
        if name not in spec:
            raise InputError(f"a cell must say its {name}, got none")
    values = checked(spec)
    offers = _offers(values["method"])
    texts = tuple(settings_text(values.get("settings", {})))
    settings = _settings(values["method"], texts)
    train = values.get("train") or _other_styles(values["motion"])
    if values["motion"] in train:
        raise InputError(f"train must not contain the motion itself, got {values['motion']}")
    files = {path: digest for one in (values["motion"], *train) for path, digest in _files(one)}
    version = version_of(offer.origin for offer in offers)
    cell = TrackCell(**{**values, "settings": dict(settings), "train": train, "files": files, "version": version})
    if (size := _population(cell.method, texts, cell.evaluations)) > cell.evaluations:
        raise InputError(f"evaluations must hold one population of {size}, got {cell.evaluations}")
    if files.get(cell.motion) and cell.frames > (length := _length(cell.motion, cell.fps)):
        raise InputError(f"frames must be at most {length}, the length of {cell.motion}, got {cell.frames}")
    return cell


def checked(spec: Mapping[str, Any]) -> dict[str, Any]:
    """Return fields of a cell, each by itself checked. Raises ValueError where a value makes no sense."""
    return {name: _CHECKS[name](name, value) for name, value in spec.items()}


@lru_cache(maxsize=256)
def names_of(method: str) -> tuple[str, ...]:
    """Return the names that settings of a method begin with."""
    optimiser, prior, tracker = parts(method)
    chosen = (optimiser, prior, "tracker") if tracker is None else (tracker,)
    return tuple(name.partition(":")[0] for name in chosen)


@lru_cache(maxsize=256)
def _offers(method: str) -> tuple[Offer, ...]:
    optimiser, prior, tracker = parts(method)
    if tracker is None:
        wanted: list[tuple[Kind, str]] = [("optimiser", optimiser), ("prior", prior)]
        return tuple(registry().offer(kind, name) for kind, name in wanted)
    known = registry().offers
    if tracker not in known["tracker"] and tracker.partition(":")[0] in known["optimiser"]:
        hint = f"; did you mean {quoted(f'{tracker}@pca')}?"
        raise InputError(f"method must be a tracker or OPTIMISER@PRIOR, got {quoted(tracker)}{hint}")
    if tracker.partition(":")[0] not in known["tracker"]:
        trackers = ", ".join(sorted(known["tracker"])) or "of which there are none"
        near = _nearest(tracker, [*known["tracker"], *(f"{name}@pca" for name in known["optimiser"])])
        raise InputError(f"method must be a tracker ({trackers}) or OPTIMISER@PRIOR, got {quoted(tracker)}{near}")
    return (registry().offer("tracker", tracker),)


@lru_cache(maxsize=1024)
def _settings(method: str, texts: tuple[str, ...]) -> dict[str, Any]:
    """Return the settings that texts such as `sapso.cooling=0.9` give, sorted, each of the type that it has to be."""
    tracker = parts(method)[2]
    for text in texts:
        if text.partition(".")[0] not in names_of(method):
            known = ", ".join(names_of(method))
            raise InputError(f"settings must be of {known}, which {cut(method)} uses, got {quoted(text)}")
    places: dict[str, tuple[str, Any]] = {} if tracker else {"tracker": ("tracker", Prediction)}
    for offer in _offers(method):
        family = offer.name.partition(":")[0]
        places[family] = family, offer.factory
    typed: dict[str, Any] = {}
    for family, mine in parsed_settings(places, texts).items():
        typed |= {f"{family}.{setting}": value for setting, value in mine.items()}
    return dict(sorted(typed.items()))


@lru_cache(maxsize=1024)
def _population(method: str, texts: tuple[str, ...], evaluations: int) -> int:
    """Return how many proposals an optimiser makes at a time, where its settings say so; else 1."""
    offer = _offers(method)[0]
    if offer.kind != "optimiser":
        return 1
    family = f"{offer.name.partition(':')[0]}."
    mine = {
        name.removeprefix(family): value for name, value in _settings(method, texts).items() if name.startswith(family)
    }
    return population(offer.factory, mine, evaluations)


@lru_cache(maxsize=1024)
def _other_styles(motion: str) -> tuple[str, ...]:
    return built_in.other_styles(motion if motion in built_in.names() else "walk")


@lru_cache(maxsize=1024)
def _files(motion: str) -> tuple[tuple[str, str], ...]:
    """Return the files that a motion is read from, each with its digest; none for a built-in one."""
    if motion in built_in.names() or recorded.is_recorded(motion) or recorded.is_library(motion):
        return ()
    if Path(motion).is_dir():
        training_clips([motion])  # raises where one cannot be read
        return tuple((str(one), digest_of(one)) for one in sorted(Path(motion).iterdir()) if one.is_file())
    motion_of(motion, None, FPS)  # raises where it cannot be read
    path = Path(motion)
    beside = sorted(path.parent.glob("*.asf")) if path.suffix.lower() == ".amc" else []
    return tuple((str(one), digest_of(one)) for one in (path, *beside))


@lru_cache(maxsize=1024)
def _length(motion: str, fps: float) -> int:
    return len(motion_of(motion, None, fps))


def _nearest(name: str, known: Sequence[str]) -> str:
    near = get_close_matches(name[:SHOWN], known, 1)
    return f"; did you mean {near[0]!r}?" if near else ""


def _name(field: str, value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise InputError(f"{field} must be a name, got {quoted(value)}")
    return value


def _motion(field: str, value: Any) -> str:
    name = _name(field, value)
    if name not in built_in.names() and not recorded.is_recorded(name) and Path(name).suffix.lower() not in MOTIONS:
        raise InputError(
            f"{field} must be an .amc file, a .bvh file or one of {', '.join(built_in.names())}, "
            f"got {quoted(name)}{_nearest(name, built_in.names())}"
        )
    return name


def _motions(field: str, value: Any) -> tuple[str, ...]:
    if not isinstance(value, list | tuple):
        raise InputError(f"{field} must be a list of motions, got {quoted(value)}")
    return tuple(_learned_from(field, one) for one in value)


def _learned_from(field: str, value: Any) -> str:
    """Return what a method learns from: a motion, people of the library, or a folder."""
    if recorded.is_library(value):
        recorded.named(value)  # raises where a person is unknown
        return str(value)
    return value if isinstance(value, str) and value and Path(value).is_dir() else _motion(field, value)


def _views(field: str, value: Any) -> tuple[float, ...]:
    views = value if isinstance(value, list | tuple) else [value]
    if not views:
        raise InputError(f"{field} must be at least one angle, got none")
    return tuple(_number(field, view) for view in views)


def _number(field: str, value: Any, low: float = -np.inf, high: float = np.inf) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{field} must be a finite number, got {quoted(value)}")
    try:
        number = float(value)
    except OverflowError:  # a whole number of any size
        number = np.inf
    if not np.isfinite(number):
        raise InputError(f"{field} must be a finite number, got {quoted(value)}")
    if not low <= number <= high:
        raise InputError(f"{field} must lie in {low:g} to {high:g}, got {value}")
    return number


def _rate(field: str, value: Any) -> float:
    if (rate := _number(field, value)) <= 0.0:
        raise InputError(f"{field} must be a positive number, got {value}")
    return _number(field, rate, *RATES)


def _between(low: float, high: float) -> Callable[[str, Any], float]:
    return partial(_number, low=low, high=high)


def _whole(least: int) -> Callable[[str, Any], int]:
    def check(field: str, value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or value < least or value.bit_length() > MAX_BITS:
            raise InputError(f"{field} must be a whole number of at least {least}, got {quoted(value)}")
        return value

    return check


def _size(field: str, value: Any) -> tuple[int, int]:
    sides = list(value) if isinstance(value, list | tuple) else []
    if len(sides) != 2 or not all(type(side) is int and 1 <= side <= MAX_SIDE for side in sides):
        raise InputError(f"{field} must be [width, height] in pixels, up to {MAX_SIDE}, got {quoted(value)}")
    return sides[0], sides[1]


def _corruption(field: str, value: Any) -> dict[str, float]:
    if not isinstance(value, Mapping):
        raise InputError(f"{field} must be a table of strengths such as {{holes = 0.3}}, got {quoted(value)}")
    kinds = (*CORRUPTIONS, DROPPED)
    for kind in value:
        if kind not in kinds:
            raise InputError(f"{field} must be of {', '.join(kinds)}, got {quoted(kind)}{_nearest(kind, kinds)}")
    strengths = {kind: _number(f"{field} {kind}", value[kind], 0.0, 1.0) for kind in sorted(value)}
    return {kind: strength for kind, strength in strengths.items() if strength > 0.0}


def flattened(field: str, value: Any) -> dict[str, Any]:
    """Return settings whose names are NAME.SETTING, of a table that may hold a table for each NAME."""
    if not isinstance(value, Mapping):
        raise InputError(f"{field} must be a table such as {{sapso.cooling = 0.9}}, got {quoted(value)}")
    flat: dict[str, Any] = {}
    for name, inner in value.items():
        flat |= {f"{name}.{one}": what for one, what in inner.items()} if isinstance(inner, Mapping) else {name: inner}
    return flat


def _one_of(*choices: str) -> Callable[[str, Any], str]:
    def check(field: str, value: Any) -> str:
        if value not in choices:
            raise InputError(f"{field} must be one of {', '.join(choices)}, got {quoted(value)}")
        return str(value)

    return check


_CHECKS: dict[str, Callable[[str, Any], Any]] = {
    "method": _name,
    "motion": _motion,
    "train": _motions,
    "settings": flattened,
    "view_degrees": _views,
    "corruption": _corruption,
    "instance": _whole(0),
    "frames": _whole(1),
    "fps": _rate,
    "size": _size,
    "evaluations": _whole(1),
    "translation": _one_of(*TRANSLATIONS),
    "first_pose": _one_of("searched", "given"),
    "hypotheses": _whole(1),
    "yaw_off_degrees": _between(0.0, ALL_AROUND),
    "body_off_percent": _between(0.0, MAX_BODY_OFF),
    "seed": _whole(0),
}
