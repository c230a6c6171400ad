"""Which type hints a setting may have, whether a value fits one, and how one is shown.

A setting may be an int, a float, a bool, a str or None; one of several by `Literal` or a union; a tuple or a list of
those; or Any. `Annotated` adds nothing to the type that it is about.
"""

import inspect
import json
import sys
import types
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Annotated, Any, Literal, Union, get_args, get_origin

NONE = inspect.Parameter.empty  # the hint of a parameter that has none
KNOWN = "int, float, bool, str, None, Literal, a union, a tuple or a list of these"
_ANYTHING = (NONE, Any, object)
_SEQUENCES = (tuple, list, Sequence)


class UnfitError(ValueError):
    """A value does not fit a hint."""


def resolved(function: Callable[..., Any], hint: Any) -> Any:
    """Return a hint of a function's parameter, or of a class's attribute, as a type where it is written as text.

    A module with postponed annotations has all of them as text. What cannot be resolved stays a text.
    """
    if not isinstance(hint, str):
        return hint
    for names in _namespaces(function):
        try:
            return eval(hint, dict(names))
        except Exception:  # a name that is not here, or no expression
            continue
    return hint


def _namespaces(function: Any) -> list[Mapping[str, Any]]:
    """Return where the names in a function's hints are looked up: the globals of what it wraps, and its module's."""
    while isinstance(function, partial):
        function = function.func
    function = inspect.unwrap(function)
    made = [function]
    if isinstance(function, type):
        # whichever of its bases has the constructor
        made = [getattr(function, name) for name in ("__init__", "__new__")]
    elif not hasattr(function, "__globals__"):
        made = [type(function).__call__]
    spaces = [getattr(inspect.unwrap(each), "__globals__", None) for each in made]
    module = sys.modules.get(getattr(function, "__module__", None) or "")
    return [space for space in (*spaces, vars(module) if module else None) if space]


def checkable(hint: Any) -> bool:
    """Return whether `fitted` can check every value against a hint."""
    hint = _plain(hint)
    if hint in _ANYTHING or hint in (int, float, bool, str, None, type(None)):
        return True
    origin = get_origin(hint)
    if origin is Literal:
        return True
    if origin in (Union, types.UnionType):
        return all(map(checkable, get_args(hint)))
    if hint in _SEQUENCES:
        return True
    if origin in _SEQUENCES:
        return all(map(checkable, _members(hint)))
    return False


def fitted(hint: Any, value: Any) -> Any:
    """Return a value as a hint has it: a list as the tuple that it asks for, and the other way round.

    Raises UnfitError where the value does not fit, or the hint is not checkable.
    """
    hint = _plain(hint)
    origin = get_origin(hint)
    if hint in _ANYTHING:
        return value
    if origin is Literal:
        # True equals 1, and is not meant by it
        if any(
            type(choice) is type(value) and choice == value for choice in get_args(hint)
        ):
            return value
    elif origin in (Union, types.UnionType):
        for member in get_args(hint):
            try:
                return fitted(member, value)
            except UnfitError:
                continue
    elif (origin or hint) in _SEQUENCES:
        if isinstance(value, tuple | list):
            return _fitted_members(hint, value, fitted)
    elif _is_one(hint, value):
        return value
    raise UnfitError


def read(hint: Any, text: str) -> Any:
    """Return what a text means to a hint: `3,4.5` are two numbers to a tuple, and a text to a str.

    Raises UnfitError where it means nothing.
    """
    for value in _values(text):
        try:
            return fitted(hint, value)
        except UnfitError:
            continue
    hint = _plain(hint)
    if get_origin(hint) in (Union, types.UnionType):
        for member in get_args(hint):
            try:
                return read(member, text)
            except UnfitError:
                continue
    elif (get_origin(hint) or hint) in _SEQUENCES:
        return _fitted_members(hint, text.split(","), read)
    raise UnfitError


def _values(text: str) -> list[Any]:
    """Return everything that a text may mean, the most special first."""
    words: dict[str, Any] = {"true": True, "false": False, "none": None}
    values: list[Any] = []
    if text.lower() in words:
        values.append(words[text.lower()])
    readers: list[Callable[[str], Any]] = [int, float]
    if text.startswith("["):
        readers.append(json.loads)
    for reader in readers:
        try:
            values.append(reader(text))
        except ValueError:
            continue
    if "," in text:
        values.append(tuple(_values(part)[0] for part in text.split(",")))
    return [*values, text]


def _is_one(hint: Any, value: Any) -> bool:
    """Return whether a value is of one of the plain types. A truth is no number, and a whole number is a float."""
    if hint is None or hint is type(None):
        return value is None
    if hint is bool or hint is str:
        return isinstance(value, hint)
    number = isinstance(value, int) and not isinstance(value, bool)
    if hint is int:
        return number
    return hint is float and (number or isinstance(value, float))


def _fitted_members(
    hint: Any, values: Sequence[Any], fit: Callable[[Any, Any], Any]
) -> Any:
    """Return values as the members of a tuple, a list or a sequence, each as `fit` returns it."""
    members = _members(hint)
    if _has_length(hint):
        if len(values) != len(members):
            raise UnfitError
    else:
        members = members * len(values)
    kind = list if (get_origin(hint) or hint) is list else tuple
    return kind(
        fit(member, value) for member, value in zip(members, values, strict=True)
    )


def _members(hint: Any) -> tuple[Any, ...]:
    """Return the hints of the members of a tuple, a list or a sequence: one, or as many as a tuple's length."""
    if hint in _SEQUENCES:
        return (Any,)
    members = get_args(hint)
    return members if _has_length(hint) else members[:1]


def _has_length(hint: Any) -> bool:
    return get_origin(hint) is tuple and Ellipsis not in get_args(hint)


def _plain(hint: Any) -> Any:
    """Return what `Annotated` is about, and what the name of a type stands for."""
    while True:
        if get_origin(hint) is Annotated:
            hint = get_args(hint)[0]
        elif type(hint).__name__ == "TypeAliasType":  # `type Name = ...`, Python 3.12
            hint = hint.__value__
        else:
            return hint


def choices_of(hint: Any) -> tuple[Any, ...]:
    """Return what a hint lists as choices: of a `Literal`, or of a union of such and None; else nothing."""
    hint = _plain(hint)
    if get_origin(hint) is Literal:
        return get_args(hint)
    if get_origin(hint) not in (Union, types.UnionType):
        return ()
    listed: list[Any] = []
    for member in get_args(hint):
        if member is type(None):
            listed.append(None)
        elif choices := choices_of(member):
            listed += choices
        else:
            return ()
    return tuple(listed)


def shown(hint: Any, default: Any = None) -> str:
    """Return a hint as it is shown: `float`, or the choices there are. One that is missing is the default's type."""
    hint = _plain(hint)
    if hint is NONE:
        return "any" if default is None or default is NONE else type(default).__name__
    if hint in (Any, object):
        return "any"
    origin = get_origin(hint)
    if origin is Literal:
        return " | ".join(map(str, get_args(hint)))
    if origin in (Union, types.UnionType):
        return " | ".join(map(shown, get_args(hint)))
    if hint in (None, type(None)):
        return "none"
    if origin in _SEQUENCES:
        inside = [
            "..." if member is Ellipsis else shown(member) for member in get_args(hint)
        ]
        return f"{origin.__name__}[{', '.join(inside)}]"
    return hint.__name__ if isinstance(hint, type) else str(hint)
