"""Finds plugins and what they offer. A broken plugin costs one warning; the others work on.

Environment variables, as in other plugin hosts: POSEFIT_LOAD_PLUGINS names the only ones to load beside the built-ins
(none where it is empty), POSEFIT_BLOCK_PLUGINS those to leave out, each by plugin or distribution and separated by
commas; POSEFIT_STRICT_PLUGINS=1 turns the warning into an error.
"""

import os
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import lru_cache, partial
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Any, Literal, get_args

import pluggy

from posefit import hooks
from posefit.fitting.optimiser import NextFrame, OptimiserFactory
from posefit.fitting.prior import PriorFactory
from posefit.fitting.tracker import TrackerFactory
from posefit.settings import Setting, settings_of

Kind = Literal["optimiser", "prior", "tracker"]
KINDS: tuple[Kind, ...] = get_args(Kind)
LOAD, BLOCK, STRICT = "POSEFIT_LOAD_PLUGINS", "POSEFIT_BLOCK_PLUGINS", "POSEFIT_STRICT_PLUGINS"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_+-]*")


@dataclass(frozen=True)
class Offer:
    """One registered name."""

    kind: Kind
    name: str
    factory: Callable[..., Any] = field(repr=False)
    distribution: str
    version: str
    next_frame: NextFrame = "start"  # of an optimiser
    needs: hooks.Needs | None = None

    @property
    def label(self) -> str:
        """How an error names it."""
        return f"{self.kind} {self.name!r} of {self.distribution} {self.version}".rstrip()

    @property
    def summary(self) -> str:
        """The first line of the factory's docstring."""
        return (self.factory.__doc__ or "").strip().split("\n")[0]

    @property
    def settings(self) -> tuple[Setting, ...]:
        """What `--set` may set."""
        return settings_of(self.factory)

    @property
    def missing(self) -> str | None:
        """What to install before it can be used, if anything."""
        return None if self.needs is None or find_spec(self.needs[0]) is not None else self.needs[1]


@dataclass(frozen=True)
class Plugin:
    """One entry point, and what became of it."""

    name: str
    distribution: str
    version: str
    state: Literal["loaded", "broken", "left out"]
    cause: str = ""
    offers: tuple[Offer, ...] = ()


@dataclass(frozen=True)
class Registry:
    """Everything that plugins registered, by kind and name."""

    plugins: tuple[Plugin, ...]

    @property
    def offers(self) -> Mapping[Kind, Mapping[str, Offer]]:
        """The offers of all plugins that were loaded."""
        mine = [offer for plugin in self.plugins for offer in plugin.offers]
        return {kind: {offer.name: offer for offer in mine if offer.kind == kind} for kind in KINDS}

    def optimiser(self, name: str) -> OptimiserFactory:
        """Return the optimiser factory of a name. Raises ValueError listing the known names."""
        factory: OptimiserFactory = self.offer("optimiser", name).factory
        return factory

    def prior(self, name: str) -> PriorFactory:
        """Return the prior factory of a name. Raises ValueError listing the known names."""
        factory: PriorFactory = self.offer("prior", name).factory
        return factory

    def tracker(self, name: str) -> TrackerFactory:
        """Return the tracker factory of a name. Raises ValueError listing the known names."""
        factory: TrackerFactory = self.offer("tracker", name).factory
        return factory

    def offer(self, kind: Kind, name: str) -> Offer:
        """Return what is offered under a name; `family:NAME` is the family with its setting `variant`.

        Raises ValueError listing the known names, and ImportError where a library it needs is not installed.
        """
        known = self.offers[kind]
        family, colon, variant = name.partition(":")
        if family not in known:
            near = get_close_matches(family, known, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise ValueError(f"{kind} must be one of {', '.join(sorted(known)) or 'none'}, got {name!r}{hint}")
        offer = known[family]
        if offer.needs is not None and offer.missing:
            needed, requirement = offer.needs
            raise ImportError(
                f"{kind} {family} needs the library {needed}: install it with python -m pip install '{requirement}'"
            )
        if not colon:
            return offer
        if all(setting.name != "variant" for setting in offer.settings):
            raise ValueError(f"{kind} must be {family}, which has no variants, got {name!r}")
        factory = partial(offer.factory, variant=variant)
        factory.__doc__ = offer.factory.__doc__
        return replace(offer, name=name, factory=factory)


@lru_cache(maxsize=1)
def registry() -> Registry:
    """Return what all installed plugins offer; they are loaded once a process."""
    return load(entry_points(group=hooks.PROJECT))


def load(points: Iterable[EntryPoint], variables: Mapping[str, str] = os.environ) -> Registry:
    """Return what the plugins behind these entry points offer.

    Each plugin that cannot be imported, misspells a hook, fails inside one or takes a name that is taken is warned
    of, with its distribution, and left out. Raises ValueError instead where POSEFIT_STRICT_PLUGINS is set.
    """
    plugins: list[Plugin] = []
    for point in sorted(points, key=_built_ins_first):
        plugin = _plugin(point, variables, [offer for before in plugins for offer in before.offers])
        plugins.append(plugin)
        if plugin.state == "broken":
            message = f"plugin {plugin.name!r} of {plugin.distribution} {plugin.version} is left out: {plugin.cause}"
            if variables.get(STRICT, "0") not in ("", "0"):
                raise ValueError(message)
            warnings.warn(message, stacklevel=2)
    return Registry(tuple(plugins))


def _built_ins_first(point: EntryPoint) -> tuple[bool, str]:
    return point.dist is None or point.dist.name != hooks.PROJECT, point.name


def _plugin(point: EntryPoint, variables: Mapping[str, str], taken: Iterable[Offer]) -> Plugin:
    distribution, version = (point.dist.name, point.dist.version) if point.dist else ("unknown", "")
    reason = _left_out(point.name, distribution, variables)
    if reason:
        return Plugin(point.name, distribution, version, "left out", reason)
    owners = {(offer.kind, offer.name): offer.distribution for offer in taken}
    try:
        mine = []
        for one in _registered(point):
            offer = Offer(*one[:3], distribution, version, **one[3])
            key = offer.kind, offer.name
            if key in owners:
                raise ValueError(f"{offer.kind} {offer.name!r} is already registered by {owners[key]}")
            owners[key] = distribution
            mine.append(offer)
    except (Exception, SystemExit) as error:  # whatever a plugin does, the others must work
        return Plugin(point.name, distribution, version, "broken", f"{type(error).__name__}: {error}")
    return Plugin(point.name, distribution, version, "loaded", offers=tuple(mine))


def _left_out(name: str, distribution: str, variables: Mapping[str, str]) -> str:
    """Return why the variables leave a plugin out, or nothing."""

    def chosen(variable: str) -> bool:
        words = {word.strip().lower() for word in variables[variable].split(",")}
        return bool(words & {name.lower(), distribution.lower()})

    if BLOCK in variables and chosen(BLOCK):
        return f"{BLOCK} names it"
    if LOAD in variables and distribution != hooks.PROJECT and not chosen(LOAD):
        return f"{LOAD} does not name it"
    return ""


def _registered(point: EntryPoint) -> Iterator[tuple[Kind, str, Callable[..., Any], dict[str, Any]]]:
    """Yield kind, name, factory and the rest of everything one plugin registers."""
    manager = pluggy.PluginManager(hooks.PROJECT)
    manager.add_hookspecs(hooks)
    manager.register(point.load(), point.name)
    manager.check_pending()
    mine: list[tuple[Kind, str, Callable[..., Any], dict[str, Any]]] = []

    def register(kind: Kind, name: str, factory: Callable[..., Any], **more: Any) -> None:
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise ValueError(f"a name must be letters, digits, _, + and -, got {name!r}")
        if not callable(factory):
            raise TypeError(f"{kind} {name!r} must be a factory that can be called, got {factory!r}")
        if more.get("next_frame", "start") not in get_args(NextFrame):
            raise ValueError(f"next_frame must be one of {', '.join(get_args(NextFrame))}, got {more['next_frame']!r}")
        mine.append((kind, name, factory, more))

    for kind in KINDS:
        getattr(manager.hook, f"posefit_register_{kind}s")(register=partial(register, kind))
    yield from mine
