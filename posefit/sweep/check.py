"""Checks a cell's spec before anything runs.

Options of a track are checked by their one declaration, all other fields here.
"""

import json
import os
from collections.abc import Mapping
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
    installed,
    json_of,
)
from posefit.tracking.method import method_names, parsed_settings, places_of
from posefit.tracking.options import Check, TrackOptions, choice, declared, within
from posefit.version import source_digest

FIELDS = tuple(
    field.name for field in fields(TrackCell) if field.name not in ("files", "version")
)
# of a cell
MAX_VIEWS = 100
MAX_FRAMES = 100_000
MAX_BODY_OFF = 50.0  # percent that a body may be off


def cell_of(spec: Mapping[str, Any]) -> TrackCell:
    """Return the cell that a spec describes, complete: settings as their types ask, training motions by name.

    Raises ValueError where a name is not known or a value makes no sense, and ImportError where a method needs a
    library that is not installed.
    """
    for name in ("method", "motion"):
        if name not in spec:
            raise InputError(f"a cell must say its {name}, got none")
    values = _checked(spec, CHECKS)
    texts = tuple(settings.settings_text(values.get("settings", {})))
    offers, chosen = _of_method(values["method"], texts)
    train = values.get("train") or _other_styles(values["motion"])
    if values["motion"] in train:
        raise InputError(
            f"train must not contain the motion itself, got {values['motion']}"
        )
    files = {
        path: digest
        for motion in (values["motion"], *train)
        for path, digest in _files(motion)
    }
    version = version_of(offer.origin for offer in offers)
    cell = TrackCell(
        **{
            **values,
            "settings": dict(chosen),
            "train": train,
            "files": files,
            "version": version,
        }
    )
    if (size := _population(cell.method, texts, cell.evaluations)) > cell.evaluations:
        raise InputError(
            f"evaluations must hold one population of {size}, got {cell.evaluations}"
        )
    if files.get(cell.motion) and cell.frames > (
        length := _length(cell.motion, cell.fps)
    ):
        raise InputError(
            f"frames must be at most {length}, the length of {cell.motion}, got {cell.frames}"
        )
    return cell


def search_of(spec: Mapping[str, Any]) -> SearchCell | None:
    """Return the single search that a spec describes, whose evaluations are a `budget` for each dimension.

    None where its function does not have the dimension. Raises ValueError where anything is wrong, and ImportError
    where the method needs a library that is not installed.
    """
    values = _checked(spec, SEARCH_CHECKS)
    if (dimension := values["dimension"]) not in suite_function(
        values["function"]
    ).dimensions:
        return None
    checked_address(
        *(values[name] for name in ("suite", "function", "instance", "dimension"))
    )
    evaluations = values.pop("budget") * dimension
    version = _of_search(
        values["method"], json_of(values.get("settings", {})), evaluations
    )
    return SearchCell(**{**values, "evaluations": evaluations, "version": version})


def search_method(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return an entry of a list of optimisers with its settings, checked, by their names alone."""
    method = _name("method", entry.get("method"))
    entered = flattened("settings", entry.get("settings", {})).items()
    chosen = {name.rpartition(".")[2]: value for name, value in entered}
    return {
        **entry,
        "settings": settings.check(method, registry().optimiser(method), chosen),
    }


def forget() -> None:
    """Forget what is kept of methods and files between the cells of a plan, for the next plan to find it again.

    In between a file may have changed, or a comparison registered another factory under the same name.
    """
    for kept in (
        _offers,
        _of_method,
        _of_search,
        _population,
        _other_styles,
        _files,
        _length,
        installed,
        source_digest,
    ):
        kept.cache_clear()


def _checked(spec: Mapping[str, Any], checks: "Checks") -> dict[str, Any]:
    """Return fields of a cell, each by itself checked. Raises ValueError where a name or a value makes no sense."""
    if unknown := [name for name in spec if name not in checks]:
        known = suggestion(unknown[0], checks)
        raise InputError(
            f"a cell must say {', '.join(checks)}, got {quoted(unknown[0])}{known}"
        )
    return {name: checks[name](name, value) for name, value in spec.items()}


def families(method: str) -> tuple[str, ...]:
    """Return the names that settings of a method begin with. Raises ValueError where it is unknown."""
    return tuple(places_of(_offers(method)))


@lru_cache(maxsize=256)
def _offers(method: str) -> tuple[Offer, ...]:
    names = method_names(method)
    if names.tracker is not None:
        return (registry().offer("tracker", names.tracker),)
    return registry().offer("optimiser", names.optimiser), registry().offer(
        "prior", names.prior
    )


@lru_cache(maxsize=1024)
def _of_method(
    method: str, texts: tuple[str, ...]
) -> tuple[tuple[Offer, ...], dict[str, Any]]:
    """Return a method's plugins, and the settings of texts such as `sapso.cooling=0.9`: sorted, as their types ask."""
    offers = _offers(method)
    names = {kind: name for name, (kind, _) in places_of(offers).items()}
    each = parsed_settings(offers, texts).items()
    named = (
        (f"{names[kind]}.{setting}", value)
        for kind, values in each
        for setting, value in values.items()
    )
    return offers, dict(sorted(named))


@lru_cache(maxsize=1024)
def _of_search(method: str, chosen: str, evaluations: int) -> str:
    """Return the version of an optimiser. Raises ValueError where its settings, a JSON text, need a larger budget."""
    offer = registry().offer("optimiser", method)
    if (
        size := settings.population(offer.factory, json.loads(chosen), evaluations)
    ) > evaluations:
        raise InputError(
            f"evaluations must hold one population of {size}, got {evaluations} of {method}"
        )
    return version_of([offer.origin])


@lru_cache(maxsize=1024)
def _population(method: str, texts: tuple[str, ...], evaluations: int) -> int:
    """Return how many proposals an optimiser makes at a time, where its settings say so; else 1."""
    offer = _offers(method)[0]
    if offer.kind != "optimiser":
        return 1
    return settings.population(
        offer.factory, parsed_settings(_offers(method), texts)["optimiser"], evaluations
    )


@lru_cache(maxsize=1024)
def _other_styles(motion: str) -> tuple[str, ...]:
    return built_in.other_styles(motion if motion in built_in.names() else "walk")


@lru_cache(maxsize=1024)
def _files(motion: str) -> tuple[tuple[str, str], ...]:
    """Return the files that a motion is read from, each with its digest; none for a built-in one."""
    if (
        motion in built_in.names()
        or recorded.is_recorded(motion)
        or recorded.is_library(motion)
    ):
        return ()
    if os.path.isdir(motion):
        training_clips([motion])  # raises where one cannot be read
        return tuple(
            (str(file), digest_of(file))
            for file in sorted(Path(motion).iterdir())
            if file.is_file()
        )
    load_motion(motion, FPS)  # raises where it cannot be read
    path = Path(motion)
    beside = sorted(path.parent.glob("*.asf")) if path.suffix.lower() == ".amc" else []
    return tuple((str(file), digest_of(file)) for file in (path, *beside))


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
    """Return a method by its whole name: `sapso` is `sapso@pca`."""
    return str(method_names(_name(field, value)))


def _motion(field: str, value: Any) -> str:
    name = _name(field, value)
    if (
        name not in built_in.names()
        and not recorded.is_recorded(name)
        and Path(name).suffix.lower() not in MOTIONS
    ):
        raise InputError(
            f"{field} must be an .amc file, a .bvh file or one of {', '.join(built_in.names())}, "
            f"got {quoted(name)}{suggestion(name, built_in.names())}"
        )
    return name


def _train(field: str, value: Any) -> tuple[str, ...]:
    if not isinstance(value, list | tuple):
        raise InputError(f"{field} must be a list of motions, got {quoted(value)}")
    return tuple(_learned_from(field, source) for source in value)


def _learned_from(field: str, value: Any) -> str:
    """Return what a method learns from: a motion, people of the library, or a folder."""
    if recorded.is_library(value):
        recorded.named(value)  # raises where a person is unknown
        return str(value)
    return (
        value
        if isinstance(value, str) and os.path.isdir(value)
        else _motion(field, value)
    )


def _views(field: str, value: Any) -> tuple[float, ...]:
    degrees: tuple[float, ...] = _OPTIONS[field](field, value)
    if not 1 <= len(degrees) <= MAX_VIEWS:
        raise InputError(f"{field} must be 1 to {MAX_VIEWS} angles, got {len(degrees)}")
    return degrees


def _corruption(field: str, value: Any) -> dict[str, float]:
    if not isinstance(value, Mapping):
        raise InputError(
            f"{field} must be a table of strengths such as {{holes = 0.3}}, got {quoted(value)}"
        )
    kinds = (*CORRUPTIONS, DROPPED)
    for kind in value:
        if kind not in kinds:
            raise InputError(
                f"{field} must be of {', '.join(kinds)}, got {quoted(kind)}{suggestion(kind, kinds)}"
            )
    strengths = {
        kind: within(0.0, 1.0)(f"{field} {kind}", value[kind]) for kind in sorted(value)
    }
    return {kind: strength for kind, strength in strengths.items() if strength > 0.0}


def flattened(field: str, value: Any) -> dict[str, Any]:
    """Return settings whose names are NAME.SETTING, of a table that may hold a table for each NAME."""
    if not isinstance(value, Mapping):
        raise InputError(
            f"{field} must be a table such as {{sapso.cooling = 0.9}}, got {quoted(value)}"
        )
    flat: dict[str, Any] = {}
    for name, inner in value.items():
        flat |= (
            {f"{name}.{setting}": chosen for setting, chosen in inner.items()}
            if isinstance(inner, Mapping)
            else {name: inner}
        )
    return flat


def _whole(least: int, most: float = inf) -> Check:
    def check(field: str, value: Any) -> int:
        between(field, number := whole(field, value, least), least, most)
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
