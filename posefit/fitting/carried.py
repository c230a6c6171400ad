"""The state of a filter as plain values, so that an interrupted track can continue.

Numbers, strings, arrays, and lists and mappings of them are stored. The filter's space
and its generator are only marked as such, because the tracker has them. A filter with
any other attribute starts over when a track is resumed.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from posefit.errors import InputError
from posefit.fitting.box import Space, Start
from posefit.fitting.optimiser import Optimiser
from posefit.fitting.space import SearchSpace

# Builds an optimiser of a space, with a generator and the evaluations of its search.
OptimiserMaker = Callable[[Space, np.random.Generator, int], Optimiser]

CARRIED = "carried"  # key in the details of a frame
# Fields of a space that the tracker makes again before its first frame.
FIXED = ("prior", "tilt", "translation", "root_order")
KIND = "kind of value"
GENERATORS = ("PCG64", "PCG64DXSM", "MT19937", "Philox", "SFC64")
PLAIN = (bool, int, float, str, type(None), np.generic)


class UnknownError(Exception):
    """A filter has an attribute that is not a plain value."""


def carried(
    optimiser: Any, space: SearchSpace, rng: np.random.Generator
) -> dict[str, Any]:
    """Return the state of a filter after a frame that was searched in `space`.

    It is empty if an attribute of the filter is not a plain value.
    """
    try:
        return {
            "optimiser": _kept(vars(optimiser), space, rng),
            "space": _fields(space),
        }
    except (UnknownError, TypeError):  # `vars` needs a `__dict__`
        return {}


def revived(
    state: Mapping[str, Any],
    space: SearchSpace,
    rng: np.random.Generator,
    evaluations: int,
    make: OptimiserMaker,
) -> Optimiser:
    """Return a filter with a recorded state. The generator does not change.

    Args:
        state: The state, from `carried`.
        space: The space of another frame of the same track, for the parts that the
            state does not have.
        rng: The generator of the filter.
        evaluations: The budget of a search.
        make: Builds the filter.
    """
    known = {name: _made(value) for name, value in state["space"].items()}
    space = replace(space, **known)
    before = rng.bit_generator.state
    optimiser = make(space, rng, evaluations)
    rng.bit_generator.state = before
    vars(plugin_of(optimiser)).update(_made(state["optimiser"], space, rng))
    return optimiser


def plugin_of(optimiser: Optimiser) -> Any:
    """Return the optimiser of a plugin, without posefit's wrapper."""
    return getattr(optimiser, "plugin", optimiser)


def with_carried(frame: Any, state: Mapping[str, Any] | None) -> Any:
    """Return a frame with the state of a filter, or without one if it is None."""
    details = {name: value for name, value in frame.details.items() if name != CARRIED}
    if state is not None:
        details[CARRIED] = state
    return replace(frame, details=details)


def _fields(space: SearchSpace) -> dict[str, Any]:
    kept = {}
    for field in fields(space):
        if field.init and field.name not in FIXED:
            kept[field.name] = _kept(getattr(space, field.name), space, None)
    return kept


def _kept(value: Any, space: Any, rng: Any) -> Any:
    """Return a value in plain form. Raises UnknownError if it has none."""
    if value is space:
        return {KIND: "space"}
    if value is rng:
        return {KIND: "rng"}
    if type(value) is np.ndarray and not value.dtype.hasobject:
        return value.copy()
    if isinstance(value, PLAIN):
        return value
    if isinstance(value, np.random.Generator):
        kind = type(value.bit_generator).__name__
        if kind not in GENERATORS:
            raise UnknownError
        return {KIND: "generator", "name": kind, "state": value.bit_generator.state}
    if isinstance(value, Start):
        return {KIND: "start", "values": _kept(vars(value), space, rng)}
    if type(value) in (list, tuple):
        members = [_kept(member, space, rng) for member in value]
        return {KIND: type(value).__name__, "values": members}
    if type(value) is dict and all(type(key) is str for key in value):
        kept = {key: _kept(member, space, rng) for key, member in value.items()}
        return {KIND: "dict", "values": kept}
    raise UnknownError


def _made(kept: Any, space: Any = None, rng: Any = None) -> Any:
    """Return the value that `_kept` turned into this plain form."""
    if not isinstance(kept, Mapping):
        if isinstance(kept, np.ndarray):
            return kept.copy()
        return kept
    kind = kept[KIND]
    if kind in ("space", "rng"):
        return space if kind == "space" else rng
    if kind == "generator":
        if kept["name"] not in GENERATORS:
            raise InputError(f"a generator must be one of NumPy's, got {kept['name']}")
        bits = getattr(np.random, kept["name"])()
        bits.state = kept["state"]
        return np.random.Generator(bits)
    values = kept["values"]
    if kind in ("list", "tuple"):
        members = [_made(value, space, rng) for value in values]
        if kind == "list":
            return members
        return tuple(members)
    if kind not in ("dict", "start"):
        raise InputError(f"a stored value must be of a known kind, got {kind}")
    if kind == "start":
        values = values["values"]
    made = {name: _made(value, space, rng) for name, value in values.items()}
    if kind == "start":
        return Start(**made)
    return made
