"""Loads plugins: modules that installed packages name as entry points, each with hooks of pluggy.

A plugin that cannot be imported, misspells a hook, fails inside one or takes a name that is taken is left out and
warned of, with its distribution; the others work. Environment variables, as in other plugin hosts:
POSEFIT_LOAD_PLUGINS names the only ones to load beside the built-ins (none where it is empty), POSEFIT_BLOCK_PLUGINS
those to leave out, each by plugin or distribution and separated by commas; POSEFIT_STRICT_PLUGINS=1 turns the warning
into an error; POSEFIT_LOAD_SECONDS is how long each may take to load, 60 where nothing is said.
"""

import os
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import EntryPoint
from typing import Any, Generic, Literal, NamedTuple, TypeVar

import pluggy

from posefit.limits import timed

PROJECT = "posefit"
LOAD, BLOCK, STRICT = "POSEFIT_LOAD_PLUGINS", "POSEFIT_BLOCK_PLUGINS", "POSEFIT_STRICT_PLUGINS"
PATIENCE = "POSEFIT_LOAD_SECONDS"
GRACE = 1.0  # seconds after the limit until somebody is told that it does not hold
SECONDS = 60.0  # as large libraries need on a slow disk

T = TypeVar("T")


class Plugin(NamedTuple, Generic[T]):
    """One entry point, and what became of it."""

    name: str
    distribution: str
    version: str
    state: Literal["loaded", "broken", "left out"]
    cause: str = ""
    offers: tuple[T, ...] = ()
    traceback: str = ""  # of what broke it


def load(
    points: Iterable[EntryPoint],
    specs: Any,
    collected: Callable[[Any, str, str], Iterable[T]],
    named: Callable[[T], str],
    variables: Mapping[str, str] = os.environ,
    taken: Mapping[str, str] | None = None,
) -> tuple[Plugin[T], ...]:
    """Return what became of the plugins behind entry points, posefit's own first.

    `specs` is the module whose hooks a plugin may have; `collected(hooks, distribution, version)` gives what a plugin
    offers, and `named` how an error names an offer. No two offers of one name are loaded; `taken` are the names that
    somebody has already. Raises ValueError where a plugin is broken and POSEFIT_STRICT_PLUGINS is set.
    """
    owners = dict(taken or {})
    plugins: list[Plugin[T]] = []
    for owner, point in sorted(_owned(points), key=_built_ins_first):
        plugin = _plugin(point, owner, specs, collected, named, variables, owners)
        plugins.append(plugin)
        if plugin.state == "broken":
            message = f"plugin {plugin.name!r} of {plugin.distribution} {plugin.version} is left out: {plugin.cause}"
            if variables.get(STRICT, "0") not in ("", "0"):
                raise ValueError(message)
            warnings.warn(message, stacklevel=2)
        owners |= {named(offer): plugin.distribution for offer in plugin.offers}
    return tuple(plugins)


def _plugin(
    point: EntryPoint,
    owner: tuple[str, str],
    specs: Any,
    collected: Callable[[Any, str, str], Iterable[T]],
    named: Callable[[T], str],
    variables: Mapping[str, str],
    owners: Mapping[str, str],
) -> Plugin[T]:
    distribution, version = owner
    reason = _left_out(point.name, distribution, variables)
    if reason:
        return Plugin(point.name, distribution, version, "left out", reason)
    mine: dict[str, T] = {}
    seconds = _seconds(variables)
    try:
        with _told_late(f"plugin {point.name!r} of {distribution} {version}", seconds), timed(seconds):
            manager = pluggy.PluginManager(PROJECT)
            manager.add_hookspecs(specs)
            manager.register(point.load(), point.name)
            manager.check_pending()
            for offer in collected(manager.hook, distribution, version):
                name = named(offer)
                if name in owners or name in mine:
                    raise ValueError(f"{name} is already registered by {owners.get(name, distribution)}")
                mine[name] = offer
    except (Exception, SystemExit) as error:  # whatever a plugin does, the others must work
        cause = f"{type(error).__name__}: {error}"
        if isinstance(error, TimeoutError) and not error.args:
            cause = f"it must load within {seconds:g} s, and did not"
        import traceback

        told = "".join(traceback.format_exception(error))
        return Plugin(point.name, distribution, version, "broken", cause, traceback=told)
    return Plugin(point.name, distribution, version, "loaded", offers=tuple(mine.values()))


def _seconds(variables: Mapping[str, str]) -> float:
    """Return how long a plugin may take to load. Raises ValueError where the variable is no number above 0."""
    text = variables.get(PATIENCE, "")
    try:
        seconds = float(text or SECONDS)
    except ValueError:
        seconds = 0.0
    if not seconds > 0.0:
        raise ValueError(f"{PATIENCE} must be a number of seconds above 0, got {text!r}")
    return seconds


@contextmanager
def _told_late(label: str, seconds: float) -> Iterator[None]:
    """Say on stderr whose loading does not end where nothing can end it: in other threads, and in compiled code."""
    message = f"posefit: {label} is still loading after {seconds + GRACE:g} s; {BLOCK} leaves it out\n"
    timer = threading.Timer(seconds + GRACE, lambda: sys.stderr.write(message))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()


def _owned(points: Iterable[EntryPoint]) -> Iterator[tuple[tuple[str, str], EntryPoint]]:
    """Yield each entry point with the name and the version of its distribution, read once."""
    known: dict[int, tuple[str, str]] = {}
    for point in points:
        dist = point.dist
        if dist is not None and id(dist) not in known:
            known[id(dist)] = dist.name, dist.version
        yield known.get(id(dist), ("unknown", "")), point


def _built_ins_first(owned: tuple[tuple[str, str], EntryPoint]) -> tuple[bool, str]:
    (distribution, _), point = owned
    return distribution != PROJECT, point.name


def _left_out(name: str, distribution: str, variables: Mapping[str, str]) -> str:
    """Return why the variables leave a plugin out, or nothing."""

    def chosen(variable: str) -> bool:
        words = {word.strip().lower() for word in variables[variable].split(",")}
        return bool(words & {name.lower(), distribution.lower()})

    if BLOCK in variables and chosen(BLOCK):
        return f"{BLOCK} names it"
    if LOAD in variables and distribution != PROJECT and not chosen(LOAD):
        return f"{LOAD} does not name it"
    return ""
