"""Checks the spec of a cell before anything runs.

The options of a track are checked as `posefit.tracking.options` declares them. All
other fields are checked here.
"""

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from functools import lru_cache
from math import inf
from pathlib import Path
from typing import Any

from posefit import settings
from posefit.errors import InputError
from posefit.fitting.check import between, whole
from posefit.motion import built_in, recorded
from posefit.motion.clips import FPS, MOTIONS, load_motion, training_clips
from posefit.options import Check, choice, declared, within
from posefit.reading import SHOWN, quoted, suggestion
from posefit.registry import Offer, registry, version_of
from posefit.silhouette.corruption import CORRUPTIONS
from posefit.suites.functions import DIMENSIONS, SUITES, checked_address, suite_function
from posefit.suites.problem import INFEASIBLE
from posefit.sweep.cell import (
    ALL_AROUND,
    DROPPED,
    SearchCell,
    TrackCell,
    digest_of,
    json_of,
)
from posefit.sweep.versions import installed
from posefit.tracking.method import method_names, parsed_settings, places_of
from posefit.tracking.options import TrackOptions
from posefit.version import source_digest

# the fields of a track that a plan may set; posefit adds `files` and `version`
FIELDS = tuple(
    field.name for field in fields(TrackCell) if field.name not in ("files", "version")
)
# limits of one cell
MAX_VIEWS = 100
MAX_FRAMES = 100_000
MAX_BODY_OFF = 50.0  # percent, the largest error of the body given to a method


def cell_of(spec: Mapping[str, Any]) -> TrackCell:
    """Return the track that a spec describes.

    Settings are converted to their types, and default training motions are filled in.

    Args:
        spec: The fields of a `posefit.sweep.cell.TrackCell` by name, except `files` and
            `version`. `method` and `motion` are required.

    Returns:
        The complete cell.

    Raises:
        ValueError: A name is unknown or a value is invalid.
        ImportError: The method needs a library that is not installed.
    """
    values = _checked(spec, CHECKS, ("method", "motion"))
    texts = tuple(settings.settings_text(values.get("settings", {})))
    evaluations = values.get("evaluations", TrackCell.evaluations)
    chosen, version = _settings_and_version(values["method"], texts, evaluations)
    train = values.get("train") or _other_styles(values["motion"])
    if values["motion"] in train:
        raise InputError(
            f"train must not contain the motion itself, got {values['motion']}"
        )
    files: dict[str, str] = {}
    for motion in (values["motion"], *train):
        files.update(_files(motion))
    cell = TrackCell(
        **{
            **values,
            "settings": dict(chosen),
            "train": train,
            "files": files,
            "version": version,
        }
    )
    # only a motion that is read from a file has a length
    if files.get(cell.motion):
        length = _length(cell.motion, cell.fps)
        if cell.frames > length:
            raise InputError(
                f"frames must be at most {length}, the length of {cell.motion}, "
                f"got {cell.frames}"
            )
    return cell


def search_of(spec: Mapping[str, Any]) -> SearchCell | None:
    """Return the single search that a spec describes.

    Args:
        spec: The fields of a `posefit.sweep.cell.SearchCell` by name, but with a
            `budget`, in evaluations per dimension, instead of `evaluations`.

    Returns:
        The complete cell, or None if the function does not exist in that dimension.

    Raises:
        ValueError: A name is unknown or a value is invalid.
        ImportError: The method needs a library that is not installed.
    """
    required = ("method", "function", "dimension", "instance", "budget")
    values = _checked(spec, SEARCH_CHECKS, required)
    dimension = values["dimension"]
    if dimension not in suite_function(values["function"]).dimensions:
        return None
    checked_address(
        *(values[name] for name in ("suite", "function", "instance", "dimension"))
    )
    evaluations = values.pop("budget") * dimension
    version = _search_version(
        values["method"], json_of(values.get("settings", {})), evaluations
    )
    return SearchCell(**{**values, "evaluations": evaluations, "version": version})


def search_method(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return an entry of a list of optimisers, with its settings checked.

    Settings may be written `NAME.SETTING`; in the result they are named `SETTING`.
    Raises InputError if NAME is not the optimiser's, or a setting has two values.
    """
    method = _name("method", entry.get("method"))
    optimiser = method.partition(":")[0]
    chosen: dict[str, Any] = {}
    for name, value in flattened("settings", entry.get("settings", {})).items():
        owner, _, setting = name.rpartition(".")
        if owner not in ("", optimiser):
            raise InputError(
                f"settings of {method} must be named {optimiser}.SETTING, "
                f"got {quoted(name)}"
            )
        if setting in chosen:
            raise InputError(
                f"settings must name {optimiser}.{setting} once, got it twice"
            )
        chosen[setting] = value
    # as texts, like the settings of tracks, because TOML has no null
    texts = settings.settings_text(chosen)
    return {
        **entry,
        "settings": settings.parse_texts(method, registry().optimiser(method), texts),
    }


def clear_caches() -> None:
    """Clear the caches of methods and files that the cells of one plan share.

    Before the next plan a file may have changed, or a comparison may have registered
    another factory under the same name.
    """
    for cached in (
        _offers,
        _settings_and_version,
        _search_version,
        _other_styles,
        _files,
        _length,
        installed,
        source_digest,
    ):
        cached.cache_clear()


def _checked(
    spec: Mapping[str, Any], checks: "Checks", required: Iterable[str]
) -> dict[str, Any]:
    """Return the fields of a cell after checking each one separately.

    Raises InputError if a name is unknown or missing, or a value is invalid.
    """
    for name in required:
        if name not in spec:
            raise InputError(f"a cell must have a {name}, got none")
    check_names("a cell", spec, checks)
    return {name: checks[name](name, value) for name, value in spec.items()}


def check_names(
    what: str, table: Mapping[str, Any], known: Sequence[str] | Mapping[str, Any]
) -> None:
    """Raise InputError if a table has an unknown name."""
    for name in table:
        if name not in known:
            raise InputError(
                f"a key of {what} must be one of {', '.join(known)}, "
                f"got {quoted(name)}{suggestion(name, known)}"
            )


def families(method: str) -> tuple[str, ...]:
    """Return the names that a method's settings begin with, such as `sapso` and `pca`.

    Raises ValueError if the method is unknown.
    """
    return tuple(places_of(_offers(method)))


@lru_cache(maxsize=256)
def _offers(method: str) -> tuple[Offer, ...]:
    names = method_names(method)
    if names.tracker is not None:
        return (registry().offer("tracker", names.tracker),)
    optimiser = registry().offer("optimiser", names.optimiser)
    prior = registry().offer("prior", names.prior)
    return optimiser, prior


@lru_cache(maxsize=1024)
def _settings_and_version(
    method: str, texts: tuple[str, ...], evaluations: int
) -> tuple[dict[str, Any], str]:
    """Return a method's settings, sorted by name, with their types, and its version.

    `texts` are settings such as `sapso.cooling=0.9`. Raises InputError if one
    population takes more evaluations than there are.
    """
    offers = _offers(method)
    chosen = parsed_settings(offers, texts)
    named: dict[str, Any] = {}
    for name, (kind, _) in places_of(offers).items():
        for setting, value in chosen[kind].items():
            named[f"{name}.{setting}"] = value
    if offers[0].kind == "optimiser":
        _check_population(offers[0], chosen["optimiser"], evaluations)
    version = version_of(offer.origin for offer in offers)
    return dict(sorted(named.items())), version


@lru_cache(maxsize=1024)
def _search_version(method: str, chosen: str, evaluations: int) -> str:
    """Return the version of an optimiser, after a check of its population.

    `chosen` is the JSON text of its settings. Raises InputError if one population with
    these settings takes more evaluations than there are.
    """
    offer = registry().offer("optimiser", method)
    _check_population(offer, json.loads(chosen), evaluations)
    return version_of([offer.origin])


def _check_population(
    offer: Offer, chosen: Mapping[str, Any], evaluations: int
) -> None:
    """Raise InputError if one population takes more evaluations than there are."""
    size = settings.population(offer.factory, chosen, evaluations)
    if size > evaluations:
        raise InputError(
            f"evaluations must be at least {size}, one population, "
            f"got {evaluations} of {offer.name}"
        )


@lru_cache(maxsize=1024)
def _other_styles(motion: str) -> tuple[str, ...]:
    return built_in.other_styles(motion if motion in built_in.names() else "walk")


@lru_cache(maxsize=1024)
def _files(motion: str) -> tuple[tuple[str, str], ...]:
    """Return the files that a motion is read from, with their digests.

    Motions that come with posefit or with a library of people have no files here.
    """
    if (
        motion in built_in.names()
        or recorded.is_recorded(motion)
        or recorded.is_library(motion)
    ):
        return ()
    path = Path(motion)
    if path.is_dir():
        training_clips([motion])  # raises if a file cannot be read
        paths = [file for file in sorted(path.iterdir()) if file.is_file()]
    else:
        load_motion(motion, FPS)  # raises if it cannot be read
        paths = [path]
        # an .amc file has its skeleton in an .asf file of the same folder
        if path.suffix.lower() == ".amc":
            paths += sorted(path.parent.glob("*.asf"))
    return tuple((str(file), digest_of(file)) for file in paths)


@lru_cache(maxsize=1024)
def _length(motion: str, fps: float) -> int:
    return len(load_motion(motion, fps))


def _name(field: str, value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise InputError(f"{field} must be a name, got {quoted(value)}")
    return value


def _label(field: str, value: Any) -> str:
    if not isinstance(value, str) or len(value) > SHOWN or not value.isprintable():
        raise InputError(
            f"{field} must be a text of at most {SHOWN} characters, got {quoted(value)}"
        )
    return value


def _method(field: str, value: Any) -> str:
    """Return a method's full name: `sapso@pca` for `sapso`."""
    return str(method_names(_name(field, value)))


def _motion(field: str, value: Any) -> str:
    name = _name(field, value)
    if (
        name not in built_in.names()
        and not recorded.is_recorded(name)
        and Path(name).suffix.lower() not in MOTIONS
    ):
        known = built_in.names()
        raise InputError(
            f"{field} must be an .amc file, a .bvh file or one of {', '.join(known)}, "
            f"got {quoted(name)}{suggestion(name, known)}"
        )
    return name


def _train(field: str, value: Any) -> tuple[str, ...]:
    if not isinstance(value, list | tuple):
        raise InputError(f"{field} must be a list of motions, got {quoted(value)}")
    return tuple(_training_source(field, source) for source in value)


def _training_source(field: str, value: Any) -> str:
    """Return a source of training motions: a file, a folder, or names.

    The names are those of built-in motions, or of people of the library.
    """
    if recorded.is_library(value):
        recorded.named(value)  # raises if a person is unknown
        return str(value)
    if isinstance(value, str) and os.path.isdir(value):
        return value
    return _motion(field, value)


def _views(field: str, value: Any) -> tuple[float, ...]:
    degrees: tuple[float, ...] = _OPTIONS[field](field, value)
    if not 1 <= len(degrees) <= MAX_VIEWS:
        raise InputError(f"{field} must be 1 to {MAX_VIEWS} angles, got {len(degrees)}")
    return degrees


def _corruption(field: str, value: Any) -> dict[str, float]:
    if not isinstance(value, Mapping):
        raise InputError(
            f"{field} must be a table of strengths such as {{holes = 0.3}}, "
            f"got {quoted(value)}"
        )
    check_names(field, value, (*CORRUPTIONS, DROPPED))
    check = within(0.0, 1.0)
    strengths = {}
    for kind in sorted(value):
        strength = check(f"{field} {kind}", value[kind])
        # a cell with a strength of 0 is the same cell as without that corruption
        if strength > 0.0:
            strengths[kind] = strength
    return strengths


def flattened(field: str, value: Any) -> dict[str, Any]:
    """Return settings by their names NAME.SETTING.

    In the table the settings of each NAME may also be a table inside it.
    """
    if not isinstance(value, Mapping):
        raise InputError(
            f"{field} must be a table such as {{sapso.cooling = 0.9}}, "
            f"got {quoted(value)}"
        )
    flat: dict[str, Any] = {}
    for name, inner in value.items():
        if isinstance(inner, Mapping):
            flat |= {f"{name}.{setting}": chosen for setting, chosen in inner.items()}
        else:
            flat[name] = inner
    return flat


def _whole(least: int, most: float = inf) -> Check:
    def check(field: str, value: Any) -> int:
        number = whole(field, value, least)
        between(field, number, least, most)
        return number

    return check


_OPTIONS = {
    option.name: check
    for option in fields(TrackOptions)
    if (check := declared(option).check) is not None
}
Checks = Mapping[str, Check]
CHECKS: Checks = {
    **{name: _OPTIONS[name] for name in FIELDS if name in _OPTIONS},
    "method": _method,
    "motion": _motion,
    "train": _train,
    "settings": flattened,
    "view_degrees": _views,
    "corruption": _corruption,
    "instance": _whole(0),
    "name": _label,
    "frames": _whole(1, MAX_FRAMES),
    "yaw_off_degrees": within(0.0, ALL_AROUND),
    "body_off_percent": within(0.0, MAX_BODY_OFF),
}
SEARCH_CHECKS: Checks = {
    "suite": choice(*SUITES),
    "method": _name,
    "function": lambda _, value: suite_function(value).number,
    "dimension": choice(*DIMENSIONS),
    "instance": _whole(0),
    "budget": _whole(1),
    "settings": flattened,
    "infeasible": choice(*INFEASIBLE),
    "seed": _whole(0),
    "name": _label,
}
