"""The settings of a plugin: read from its signature, so that a mistake is reported before anything runs."""

import inspect
import json
import re
import textwrap
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from posefit import hints
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
        return hints.shown(self.annotation, self.default)


def settings_of(factory: Callable[..., Any]) -> tuple[Setting, ...]:
    """Return the settings that a factory takes, in the order of its signature; a signature is read once."""
    if isinstance(factory, Hashable):
        return _settings_of(factory)
    return _settings_of.__wrapped__(factory)


@lru_cache
def _settings_of(factory: Callable[..., Any]) -> tuple[Setting, ...]:
    # the others may be hints of names that only a type checker imports
    return tuple(
        Setting(
            parameter.name,
            hints.resolved(factory, parameter.annotation),
            parameter.default,
        )
        for parameter in inspect.signature(factory).parameters.values()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY
    )


def check_hints(plugin: str, factory: Callable[..., Any]) -> None:
    """Raise InputError, naming the plugin and the setting, if values cannot be checked by a setting's type."""
    for setting in settings_of(factory):
        if not hints.checkable(setting.annotation):
            raise InputError(
                f"{plugin}: the type of the setting {setting.name} must be {hints.KNOWN}, got {setting.type}"
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
        try:
            values[name] = hints.fitted(setting.annotation, _plain(value))
        except hints.UnfitError:
            raise InputError(
                f"{plugin}.{name} must be {setting.type}, got {quoted(value)}"
            ) from None
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
        try:
            values[name] = hints.read(setting.annotation, text)
        except hints.UnfitError:
            raise InputError(
                f"{plugin}.{name} must be {setting.type}, got {quoted(text)}"
            ) from None
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
    """Return a setting's value as `--set` takes it: numbers with commas between them, other lists as JSON has them."""
    if isinstance(value, bool) or value is None:
        return str(value).lower()
    if not isinstance(value, list | tuple):
        return str(value)
    numbers = all(type(member) in (int, float) for member in value)
    return ",".join(map(str, value)) if value and numbers else json.dumps(value)


def _plain(value: Any) -> Any:
    """Return a number of NumPy as Python's own, in a tuple or a list too; anything else as it is."""
    if type(value) in (tuple, list):
        return type(value)(map(_plain, value))
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
