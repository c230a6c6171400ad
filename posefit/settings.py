"""The settings of a plugin: read from its signature, so that a mistake is reported before anything runs."""

import inspect
import re
import textwrap
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Union, get_args, get_origin

from posefit.errors import InputError
from posefit.reading import quoted, suggestion

# a docstring's list of settings: an indented line for each, which may go on in lines that are indented more
_LIST = re.compile(r"^( *)Settings:\n((?:\1 +.*(?:\n|$)|\s*\n)*)", re.MULTILINE)
_ENTRY = re.compile(
    r"^([A-Za-z_]\w*)(?: \(([^()]*)\))?: (.*(?:\n[ \n].*)*)", re.MULTILINE
)
POPULATION_SIZE = 40  # where none is chosen: N of the SAPSO paper, section 5.2


@dataclass(frozen=True)
class Setting:
    """A keyword-only parameter of a factory."""

    name: str
    annotation: Any
    default: Any  # inspect.Parameter.empty where it must be given

    @property
    def type(self) -> str:
        """The type as it is shown: `float`, or the choices there are."""
        return _shown(self.annotation, self.default)


def settings_of(factory: Callable[..., Any]) -> tuple[Setting, ...]:
    """Return the settings that a factory takes, in the order of its signature."""
    try:
        signature = inspect.signature(factory, eval_str=True)
    # an annotation that cannot be resolved is no annotation
    except (NameError, TypeError, ValueError):
        signature = inspect.signature(factory)
    return tuple(
        Setting(parameter.name, parameter.annotation, parameter.default)
        for parameter in signature.parameters.values()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY
    )


def settings_in(text: str) -> dict[str, tuple[str, str]]:
    """Return what the list of settings of a docstring says, by the settings' names; empty where it has no list.

    That is the source's letter, "" where it has none, and the meaning. Such a list is a line `Settings:`, then an
    indented line `name (symbol): meaning` for each, which may go on in lines that are indented more.
    """
    listed = _LIST.search(text)
    entries = _ENTRY.findall(textwrap.dedent(listed[2])) if listed else []
    return {
        name: (symbol, " ".join(meaning.split())) for name, symbol, meaning in entries
    }


def without_settings(text: str) -> str:
    """Return a docstring without its list of settings."""
    return _LIST.sub("", text).strip()


def names(factory: Callable[..., Any]) -> list[str]:
    """Return the names of a factory's settings."""
    return [setting.name for setting in settings_of(factory)]


def check(
    plugin: str, factory: Callable[..., Any], chosen: Mapping[str, Any]
) -> dict[str, Any]:
    """Return settings, numbers of NumPy as Python's own.

    Raises ValueError where one is unknown, listing the known, or its type is wrong.
    """
    known = {setting.name: setting for setting in settings_of(factory)}
    values = {}
    for name, value in chosen.items():
        setting = _known(plugin, name, known)
        plain = _plain(value)
        if not accepts(setting.annotation, plain):
            raise InputError(
                f"{plugin}.{name} must be {setting.type}, got {quoted(value)}"
            )
        values[name] = plain
    return values


def planned(
    factory: Callable[..., Any], chosen: Mapping[str, Any], evaluations: int
) -> dict[str, Any]:
    """Return an optimiser's settings with what follows from the budget of one search, where it takes it.

    These are `evaluations` itself, and `iterations`, the populations after the first. What is given stays as it is.
    Raises InputError if the population that is asked for is larger than the budget: it may be larger than the memory.
    """
    known = {setting.name: setting.default for setting in settings_of(factory)}
    filled = dict(chosen)
    asked = filled.get("population_size")
    if isinstance(asked, int) and asked > evaluations:
        raise InputError(
            f"evaluations must hold one population of {asked}, got {evaluations}"
        )
    if "evaluations" in known:
        filled.setdefault("evaluations", evaluations)
    if "iterations" in known:
        size = filled.get(
            "population_size", known.get("population_size", POPULATION_SIZE)
        )
        if isinstance(size, int) and size > 0:
            filled.setdefault("iterations", max(1, evaluations // size - 1))
    return filled


def population(
    factory: Callable[..., Any], chosen: Mapping[str, Any], evaluations: int
) -> int:
    """Return how many proposals an optimiser makes at a time, where its settings say so; else 1."""
    known = {setting.name: setting.default for setting in settings_of(factory)}
    size = planned(factory, chosen, evaluations).get(
        "population_size", known.get("population_size", 1)
    )
    return size if isinstance(size, int) and size > 0 else 1


def parse(
    plugin: str, factory: Callable[..., Any], chosen: Mapping[str, str]
) -> dict[str, Any]:
    """Return settings that were given as text, as the values their types ask for.

    Raises ValueError where one is unknown or its text does not fit its type.
    """
    known = {setting.name: setting for setting in settings_of(factory)}
    values = {}
    for name, text in chosen.items():
        setting = _known(plugin, name, known)
        readings = [
            value for value in _readings(text) if accepts(setting.annotation, value)
        ]
        if not readings:
            raise InputError(
                f"{plugin}.{name} must be {setting.type}, got {quoted(text)}"
            )
        values[name] = readings[0]
    return values


def parse_texts(
    plugin: str, factory: Callable[..., Any], texts: Sequence[str]
) -> dict[str, Any]:
    """Return settings that texts such as `population_size=20` give; the plugin's name and a dot may stand before.

    Raises ValueError where a text has another form, or `parse` does.
    """
    chosen: dict[str, str] = {}
    for text in texts:
        setting, equals, value = text.partition("=")
        if not equals:
            raise InputError(
                f"a setting must be SETTING=VALUE such as population_size=20, got {quoted(text)}"
            )
        if (name := setting.rpartition(".")[2]) in chosen:
            raise InputError(f"a setting must be given once, got {quoted(name)} twice")
        chosen[name] = value
    return parse(plugin, factory, chosen)


def settings_text(settings: Mapping[str, Any]) -> list[str]:
    """Return settings as `--set` takes them."""
    return [f"{name}={setting_text(value)}" for name, value in settings.items()]


def setting_text(value: Any) -> str:
    """Return a setting's value as `--set` takes it."""
    if isinstance(value, bool) or value is None:
        return str(value).lower()
    if isinstance(value, list | tuple):
        return ",".join(map(setting_text, value))
    return str(value)


def accepts(annotation: Any, value: Any) -> bool:
    """Return whether a value fits an annotation; one that is not understood accepts everything."""
    origin = get_origin(annotation)
    if origin is Literal:
        return value in get_args(annotation)
    if origin in (Union, types.UnionType):
        return any(accepts(member, value) for member in get_args(annotation))
    if origin is tuple:
        parts: tuple[Any, ...] = get_args(annotation)
        return (
            isinstance(value, tuple)
            and len(value) == len(parts)
            and all(map(accepts, parts, value))
        )
    if annotation in (None, type(None)):
        return value is None
    if annotation is float:
        return isinstance(value, float | int) and not isinstance(value, bool)
    if annotation is int:
        return isinstance(value, int) and not isinstance(value, bool)
    return not (annotation in (bool, str) and not isinstance(value, annotation))


def _plain(value: Any) -> Any:
    """Return a number of NumPy as Python's own, in a tuple too; anything else as it is."""
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    return (
        value.item()
        if type(value).__module__ == "numpy" and not getattr(value, "shape", (0,))
        else value
    )


def _known(plugin: str, name: str, known: Mapping[str, Setting]) -> Setting:
    if name not in known:
        listed = f"one of {', '.join(known)}" if known else "none, it takes none"
        raise InputError(
            f"a setting of {plugin} must be {listed}, got {quoted(name)}{suggestion(name, known)}"
        )
    return known[name]


def _readings(text: str) -> list[Any]:
    """Return everything a text may mean, the most special first."""
    words: dict[str, Any] = {"true": True, "false": False, "none": None}
    numbers: list[Any] = []
    for kind in (int, float):
        try:
            numbers.append(kind(text))
        except ValueError:
            continue
    if "," in text:
        numbers.append(tuple(_readings(part)[0] for part in text.split(",")))
    return [*([words[text.lower()]] if text.lower() in words else []), *numbers, text]


def _shown(annotation: Any, default: Any) -> str:
    if annotation is inspect.Parameter.empty:
        return (
            "any"
            if default in (None, inspect.Parameter.empty)
            else type(default).__name__
        )
    origin = get_origin(annotation)
    if origin is Literal:
        return " | ".join(map(str, get_args(annotation)))
    if origin in (Union, types.UnionType):
        return " | ".join(_shown(member, default) for member in get_args(annotation))
    if annotation is type(None):
        return "none"
    return annotation.__name__ if isinstance(annotation, type) else str(annotation)
