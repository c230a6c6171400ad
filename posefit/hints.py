"""Type hints of settings: which are allowed, whether a value fits, how one is shown.

A setting may be an int, a float, a bool, a str or None; one of several by `Literal` or
a union; a tuple or a list of these; or Any. `Annotated` is ignored: the type inside it
counts.
"""

import inspect
import json
import sys
import types
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Annotated, Any, Literal, Union, get_args, get_origin

NONE = inspect.Parameter.empty  # the hint of a parameter without one
KNOWN = "int, float, bool, str, None, Literal, a union, a tuple or a list of these"
_ANYTHING = (NONE, Any, object)
_SEQUENCES = (tuple, list, Sequence)


class UnfitError(ValueError):
    """A value does not fit a hint."""


def resolved(function: Callable[..., Any], hint: Any) -> Any:
    """Return a hint as a type, even if it is written as text.

    In a module with postponed annotations all hints are texts. A text that cannot be
    evaluated is returned unchanged.

    Args:
        function: The function or class that the hint belongs to.
        hint: The hint.
    """
    if not isinstance(hint, str):
        return hint
    for names in _namespaces(function):
        try:
            return eval(hint, dict(names))
        except Exception:  # an unknown name, or not an expression
            continue
    return hint


def _namespaces(function: Any) -> list[Mapping[str, Any]]:
    """Return the namespaces of a function's hints.

    They are the globals of the wrapped function and of its module.
    """
    while isinstance(function, partial):
        function = function.func
    function = inspect.unwrap(function)
    made = [function]
    if isinstance(function, type):
        # the constructor may be a base's, from another module
        made = [getattr(function, name) for name in ("__init__", "__new__")]
    elif not hasattr(function, "__globals__"):
        made = [type(function).__call__]
    spaces = []
    for each in made:
        spaces.append(getattr(inspect.unwrap(each), "__globals__", None))
    module = sys.modules.get(getattr(function, "__module__", None) or "")
    if module:
        spaces.append(vars(module))
    # a function that is written in C has no globals
    return [space for space in spaces if space]


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
    """Return a value as a hint demands it: a list as a tuple, or a tuple as a list.

    Raises:
        UnfitError: The value does not fit, or the hint is not checkable.
    """
    hint = _plain(hint)
    origin = get_origin(hint)
    if hint in _ANYTHING:
        return value
    if origin is Literal:
        for choice in get_args(hint):
            # True equals 1, but does not mean it
            if type(choice) is type(value) and choice == value:
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
    """Return the value of a text by a hint.

    With the hint of a tuple `3,4.5` is two numbers; with `str` it is a text.

    Raises:
        UnfitError: The text has no meaning.
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
    """Return everything that a text may mean, the most specific first."""
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
        members = []
        for part in text.split(","):
            members.append(_values(part)[0])
        values.append(tuple(members))
    return [*values, text]


def _is_one(hint: Any, value: Any) -> bool:
    """Return whether a value is of a plain type.

    A bool is not a number, and an int is also a float.
    """
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
    """Return values as the members of a tuple, a list or a sequence.

    `fit` converts each value.
    """
    members = _members(hint)
    if _has_length(hint):
        if len(values) != len(members):
            raise UnfitError
    else:
        members = members * len(values)
    fitted = []
    for member, value in zip(members, values, strict=True):
        fitted.append(fit(member, value))
    is_list = (get_origin(hint) or hint) is list
    return fitted if is_list else tuple(fitted)


def _members(hint: Any) -> tuple[Any, ...]:
    """Return the hints of a sequence's members: one, or one per member of a tuple."""
    if hint in _SEQUENCES:
        return (Any,)
    members = get_args(hint)
    if _has_length(hint):
        return members
    return members[:1]  # without the Ellipsis of tuple[int, ...]


def _has_length(hint: Any) -> bool:
    return get_origin(hint) is tuple and Ellipsis not in get_args(hint)


def _plain(hint: Any) -> Any:
    """Return the type inside `Annotated` and behind a type alias."""
    while True:
        if get_origin(hint) is Annotated:
            hint = get_args(hint)[0]
        elif type(hint).__name__ == "TypeAliasType":  # `type Name = ...`, Python 3.12
            hint = hint.__value__
        else:
            return hint


def choices_of(hint: Any) -> tuple[Any, ...]:
    """Return the choices of a `Literal`, or of a union of these and None; else ()."""
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
    """Return a hint in the form for users: `float`, or the choices.

    If there is no hint, the default's type is shown.
    """
    hint = _plain(hint)
    if hint is NONE:
        if default is None or default is NONE:
            return "any"
        return type(default).__name__
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
        inside = []
        for member in get_args(hint):
            inside.append("..." if member is Ellipsis else shown(member))
        return f"{origin.__name__}[{', '.join(inside)}]"
    if isinstance(hint, type):
        return hint.__name__
    return str(hint)
