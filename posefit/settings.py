"""Settings of plugins, read from signatures and checked before anything runs."""

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

# a docstring's list of settings: an indented line for each setting, which may continue
# in lines with more indentation
_LIST = re.compile(r"^( *)Settings:\n((?:\1 +.*(?:\n|$)|\s*\n)*)", re.MULTILINE)
_ENTRY = re.compile(
    r"^([A-Za-z_]\w*)(?: \(([^()]*)\))?: (.*(?:\n[ \n].*)*)", re.MULTILINE
)
POPULATION_SIZE = 40  # if none is chosen: N of the SAPSO paper, section 5.2


@dataclass(frozen=True)
class Setting:
    """A keyword-only parameter of a factory."""

    name: str
    annotation: Any
    default: Any  # inspect.Parameter.empty if the setting must be given

    @property
    def type(self) -> str:
        """The type as users see it: `float`, or the choices."""
        return hints.shown(self.annotation, self.default)


def settings_of(factory: Callable[..., Any]) -> tuple[Setting, ...]:
    """Return the settings that a factory takes, in the order of its signature."""
    if isinstance(factory, Hashable):
        return _settings_of(factory)
    return _settings_of.__wrapped__(factory)


@lru_cache
def _settings_of(factory: Callable[..., Any]) -> tuple[Setting, ...]:
    """Return what `settings_of` does, cached: reading a signature is slow."""
    settings = []
    for parameter in inspect.signature(factory).parameters.values():
        # only hints of settings are resolved: others may name types that are imported
        # for type checkers only
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY:
            hint = hints.resolved(factory, parameter.annotation)
            settings.append(Setting(parameter.name, hint, parameter.default))
    return tuple(settings)


def check_hints(plugin: str, factory: Callable[..., Any]) -> None:
    """Raise InputError if a setting's type is one whose values cannot be checked.

    Args:
        plugin: Name of the plugin, for the message.
        factory: Its factory.
    """
    for setting in settings_of(factory):
        if not hints.checkable(setting.annotation):
            raise InputError(
                f"{plugin}: the type of the setting {setting.name} must be "
                f"{hints.KNOWN}, got {setting.type}"
            )


def settings_in(text: str) -> dict[str, tuple[str, str]]:
    """Return symbol and meaning of each setting in a docstring's list of settings.

    Such a list is a line `Settings:`, then an indented line `name (symbol): meaning`
    for each setting, which may continue in lines with more indentation. The symbol is
    the letter in the publication, and is "" if it is missing. Without a list the result
    is empty.
    """
    listed = _LIST.search(text)
    if not listed:
        return {}
    meanings = {}
    for name, symbol, meaning in _ENTRY.findall(textwrap.dedent(listed[2])):
        meanings[name] = (symbol, " ".join(meaning.split()))
    return meanings


def without_settings(text: str) -> str:
    """Return a docstring without its list of settings."""
    return _LIST.sub("", text).strip()


def names(factory: Callable[..., Any]) -> list[str]:
    """Return the names of a factory's settings."""
    return list(_by_name(factory))


def _by_name(factory: Callable[..., Any]) -> dict[str, Setting]:
    return {setting.name: setting for setting in settings_of(factory)}


def _defaults(factory: Callable[..., Any]) -> dict[str, Any]:
    """Return the default values of a factory's settings by name."""
    return {setting.name: setting.default for setting in settings_of(factory)}


def check(
    plugin: str, factory: Callable[..., Any], chosen: Mapping[str, Any]
) -> dict[str, Any]:
    """Return settings with values as their types demand.

    Numbers of NumPy become Python's.

    Args:
        plugin: Name of the plugin, for messages.
        factory: Its factory.
        chosen: Values by the settings' names.

    Raises:
        InputError: A setting is unknown, or its value has a wrong type.
    """
    known = _by_name(factory)
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
    """Return an optimiser's settings, with settings that a search's budget decides.

    These are `evaluations` itself, and `iterations`, the populations after the first,
    if the optimiser has these settings. Given values are kept.

    Args:
        factory: The optimiser's factory.
        chosen: Given values by the settings' names.
        evaluations: Budget of one search.

    Raises:
        InputError: The population is larger than the budget. It might not fit the
            memory.
    """
    known = _defaults(factory)
    filled = dict(chosen)
    asked = filled.get("population_size")
    if isinstance(asked, int) and asked > evaluations:
        raise InputError(
            f"evaluations must be at least {asked}, one population, got {evaluations}"
        )
    if "evaluations" in known:
        filled.setdefault("evaluations", evaluations)
    if "iterations" in known:
        default_size = known.get("population_size", POPULATION_SIZE)
        size = filled.get("population_size", default_size)
        if isinstance(size, int) and size > 0:
            filled.setdefault("iterations", max(1, evaluations // size - 1))
    return filled


def population(
    factory: Callable[..., Any], chosen: Mapping[str, Any], evaluations: int
) -> int:
    """Return how many proposals an optimiser makes at a time, or 1 if unknown."""
    known = _defaults(factory)
    default_size = known.get("population_size", 1)
    filled = planned(factory, chosen, evaluations)
    size = filled.get("population_size", default_size)
    if isinstance(size, int) and size > 0:
        return size
    return 1


def parse(
    plugin: str, factory: Callable[..., Any], chosen: Mapping[str, str]
) -> dict[str, Any]:
    """Return settings that are given as text, with values of the settings' types.

    Raises:
        InputError: A setting is unknown, or its text does not fit its type.
    """
    known = _by_name(factory)
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
    """Return settings that are given as texts such as `population_size=20`.

    The plugin's name and a dot may precede the setting's name.

    Raises:
        InputError: A text has another form, a setting is unknown or given twice, or its
            value does not fit its type.
    """
    chosen: dict[str, str] = {}
    for text in texts:
        setting, equals, value = text.partition("=")
        if not equals:
            raise InputError(
                "a setting must be SETTING=VALUE such as population_size=20, "
                f"got {quoted(text)}"
            )
        if (name := setting.rpartition(".")[2]) in chosen:
            raise InputError(f"a setting must be given once, got {quoted(name)} twice")
        chosen[name] = value
    return parse(plugin, factory, chosen)


def settings_text(settings: Mapping[str, Any]) -> list[str]:
    """Return settings in the form that `--set` takes."""
    return [f"{name}={setting_text(value)}" for name, value in settings.items()]


def setting_text(value: Any) -> str:
    """Return a setting's value in the form that `--set` takes.

    Lists of numbers have commas between them; other lists are JSON.
    """
    if isinstance(value, bool) or value is None:
        return str(value).lower()
    if not isinstance(value, list | tuple):
        return str(value)
    numbers = all(type(member) in (int, float) for member in value)
    if value and numbers:
        return ",".join(map(str, value))
    return json.dumps(value)


def _plain(value: Any) -> Any:
    """Return a value, or the values in a tuple or list, with Python's numbers."""
    if type(value) in (tuple, list):
        return type(value)(map(_plain, value))
    if type(value).__module__ == "numpy" and not getattr(value, "shape", (0,)):
        return value.item()
    return value


def _known(plugin: str, name: str, known: Mapping[str, Setting]) -> Setting:
    if name not in known:
        if known:
            listed = f"one of {', '.join(known)}"
        else:
            listed = "left out, because it takes none"
        near = suggestion(name, known)
        raise InputError(
            f"a setting of {plugin} must be {listed}, got {quoted(name)}{near}"
        )
    return known[name]
