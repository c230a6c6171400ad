"""What plugins offer, by kind and name, and how plugins are loaded.

A plugin that cannot be imported, misspells a hook, fails inside one or takes a name that is taken is left out with a
warning that names its distribution; the others work. The environment variable POSEFIT_BLOCK_PLUGINS names those to
leave out, each by plugin or distribution and separated by commas.
"""

import os
import re
import traceback
import warnings
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from importlib.metadata import EntryPoint, PackageNotFoundError, entry_points, version
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias, get_args

import pluggy

from posefit import hooks
from posefit.errors import InputError, PluginWarning
from posefit.hooks import PROJECT
from posefit.reading import quoted, suggestion
from posefit.settings import Setting, check_hints, settings_of
from posefit.version import posefit_build, source_digest

if TYPE_CHECKING:
    import click

    from posefit.fitting.optimiser import NextFrame, OptimiserFactory
    from posefit.fitting.prior import PriorFactory

BLOCK = "POSEFIT_BLOCK_PLUGINS"

Kind = Literal["optimiser", "prior", "tracker", "start", "segmenter", "device"]
KINDS: tuple[Kind, ...] = get_args(Kind)
# those that `posefit check` has rules for, and `posefit plugins new` a template
CHECKED_KINDS = tuple(kind for kind in KINDS if kind != "device")
# instead of the distribution of an optimiser that no plugin registered
OWN = "this process"
COMMAND: Literal["command"] = "command"  # what a plugin may register besides
Registrable: TypeAlias = Kind | Literal["command"]
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_+-]*")


@dataclass(frozen=True)
class Offer:
    """One registered name."""

    kind: Kind
    name: str
    factory: Callable[..., Any] = field(repr=False)
    distribution: str
    version: str
    next_frame: "NextFrame" = "start"  # of an optimiser
    looks_ahead: bool = False  # of a tracker
    still_background: bool = True  # whether a segmenter needs one
    needs: hooks.Needs | None = None

    @property
    def label(self) -> str:
        """How an error names it."""
        return (
            f"{self.kind} {self.name!r} of {self.distribution} {self.version}".rstrip()
        )

    @property
    def origin(self) -> str:
        """What its results depend on: its distribution with its version, a digest of its package's source, its library.

        The packages of posefit's own plugins, which have one version, are distinguished by name. What such a plugin
        offers from posefit itself depends on posefit's build.
        """
        if self.distribution == OWN:
            return f"{self.name} {self.version}".rstrip()
        module = (
            self.factory.func if isinstance(self.factory, partial) else self.factory
        ).__module__
        if self.distribution == PROJECT and module.partition(".")[0] == PROJECT:
            return posefit_build()
        name = (
            module.partition(".")[0]
            if self.distribution == PROJECT
            else f"{self.distribution} {self.version}"
        )
        library = ""
        if self.needs is not None:
            with suppress(PackageNotFoundError):
                library = f" with {self.needs[0]} {version(self.needs[0])}"
        return f"{name} {source_digest(module)}".rstrip() + library

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
        return (
            None
            if self.needs is None or find_spec(self.needs[0]) is not None
            else self.needs[1]
        )


class Plugin(NamedTuple):
    """One entry point, whether it was loaded, and what it offers of the kinds that it was asked for."""

    name: str
    distribution: str
    version: str
    state: Literal["loaded", "broken", "left out"]
    cause: str = ""
    offers: tuple[Offer, ...] = ()
    commands: "tuple[click.Command, ...]" = ()
    traceback: str = ""  # of what broke it


@dataclass(frozen=True)
class Registry:
    """The methods that plugins registered, by kind and name."""

    plugins: tuple[Plugin, ...]

    def rivals(self, offer: Offer) -> list[Plugin]:
        """Return the plugins that are left out because they register the name of an offer, too."""
        return [
            plugin
            for plugin in self.plugins
            if _taken(f"{offer.kind} {offer.name!r}") in plugin.cause
        ]

    @property
    def offers(self) -> Mapping[Kind, Mapping[str, Offer]]:
        """The offers of all plugins that were loaded."""
        offers = [offer for plugin in self.plugins for offer in plugin.offers]
        return {
            kind: {offer.name: offer for offer in offers if offer.kind == kind}
            for kind in KINDS
        }

    def optimiser(self, name: str) -> "OptimiserFactory":
        """Return the optimiser factory of a name. Raises ValueError listing the known names."""
        return self.offer("optimiser", name).factory

    def prior(self, name: str) -> "PriorFactory":
        """Return the prior factory of a name. Raises ValueError listing the known names."""
        return self.offer("prior", name).factory

    def offer(self, kind: Kind, name: str) -> Offer:
        """Return what is offered under a name; `family:NAME` is the family with its setting `variant`.

        Raises ValueError listing the known names, and ImportError where a library it needs is not installed.
        """
        known = self.offers[kind]
        family, colon, variant = name.partition(":")
        if family not in known:
            listed = ", ".join(sorted(known)) or "none"
            raise InputError(
                f"{kind} must be one of {listed}, got {quoted(name)}{self.hint(family, known)}"
            )
        offer = known[family]
        if offer.needs is not None and offer.missing:
            needed, requirement = offer.needs
            raise ImportError(
                f"{kind} {family} needs the library {needed}: install it with python -m pip install '{requirement}'"
            )
        if not colon:
            return offer
        if all(setting.name != "variant" for setting in offer.settings):
            raise InputError(
                f"{kind} must be {family}, which has no variants, got {quoted(name)}"
            )
        factory = partial(offer.factory, variant=variant)
        factory.__doc__ = offer.factory.__doc__
        return replace(offer, name=name, factory=factory)

    def hint(self, name: str, known: Iterable[str]) -> str:
        """Return the end of a message about a name that is not known: its kind, the nearest name, or where to ask."""
        kinds = [kind for kind, offers in self.offers.items() if name in offers]
        if kinds:
            return f"; its kind is {kinds[0]}"
        broken = [plugin.name for plugin in self.plugins if plugin.state == "broken"]
        doctor = (
            f"posefit plugins doctor says why {', '.join(broken)} failed to load"
            if broken
            else ""
        )
        near = suggestion(name, known)
        if near and doctor:
            return f"{near} {doctor}"
        return (
            near
            or f"; {doctor or 'posefit plugins doctor lists what is installed, and what failed to load'}"
        )


@lru_cache(maxsize=1)
def registry() -> Registry:
    """Return the methods of all installed plugins; they are loaded once a process."""
    return Registry((*plugins_of(KINDS), *_own.values()))


_own: dict[str, Plugin] = {}


def register(factories: Mapping[str, tuple[Callable[..., Any], str]]) -> None:
    """Let this process know optimisers by their names, each with a digest of its source.

    Raises ValueError where a plugin has registered one of them.
    """
    for name, (factory, digest) in factories.items():
        if not _NAME.fullmatch(name):
            raise InputError(
                f"a factory must have a name of letters, digits, _, + and -, got {quoted(name)}"
            )
        if name not in _own and name in {
            **registry().offers["optimiser"],
            **registry().offers["tracker"],
        }:
            raise InputError(
                f"a factory must have a name of its own, got {name}, which a plugin has registered"
            )
        check_hints(f"optimiser {name!r}", factory)
        _own[name] = Plugin(
            name,
            OWN,
            digest,
            "loaded",
            offers=(Offer("optimiser", name, factory, OWN, digest),),
        )
        registry.cache_clear()


@lru_cache
def plugins_of(
    kinds: tuple[Registrable, ...], taken: tuple[str, ...] = ()
) -> tuple[Plugin, ...]:
    """Return all installed plugins with what they offer of some kinds; see `load`.

    One whose group only begins with posefit's name, however that is written, is among them, and broken.
    """
    groups = [
        group
        for group in entry_points().groups
        if re.sub("[-_. ]", "", group.lower()).startswith(PROJECT)
    ]
    return load(
        [point for group in groups for point in entry_points(group=group)],
        kinds,
        taken=taken,
    )


def version_of(origins: Iterable[str]) -> str:
    """Return the version of posefit, and of a method whose plugins have these origins: see `Offer.origin`."""
    return ", ".join([posefit_build(), *sorted(set(origins) - {posefit_build()})])


def optimiser(name: str) -> "OptimiserFactory":
    """Return the factory of an installed optimiser. Raises ValueError listing the known names."""
    return registry().optimiser(name)


def prior(name: str) -> "PriorFactory":
    """Return the factory of an installed prior. Raises ValueError listing the known names."""
    return registry().prior(name)


def load(
    points: Iterable[EntryPoint],
    kinds: Iterable[Registrable] = KINDS,
    variables: Mapping[str, str] = os.environ,
    taken: Iterable[str] = (),
) -> tuple[Plugin, ...]:
    """Return the plugins behind entry points, posefit's own first: loaded, broken or left out.

    Only the hooks of `kinds` are called: some of KINDS, or COMMAND. No two offers of one name are loaded; `taken` are
    the names of posefit's own commands.
    """
    owners = {f"command {name!r}": PROJECT for name in taken}
    blocked = {word.strip().lower() for word in variables.get(BLOCK, "").split(",")}
    plugins: list[Plugin] = []
    owned = [
        (
            *((point.dist.name, point.dist.version) if point.dist else ("unknown", "")),
            point,
        )
        for point in points
    ]
    for owner, release, point in sorted(
        owned, key=lambda entry: (entry[0] != PROJECT, entry[2].name)
    ):
        plugin = Plugin(point.name, owner, release, "left out", f"{BLOCK} names it")
        if not blocked & {point.name.lower(), owner.lower()}:
            try:
                offers = _offers(point, kinds, owner, release, owners)
                owners |= dict.fromkeys(offers, owner)
                methods = tuple(
                    offer for offer in offers.values() if isinstance(offer, Offer)
                )
                commands = tuple(
                    offer for offer in offers.values() if not isinstance(offer, Offer)
                )
                plugin = plugin._replace(
                    state="loaded", cause="", offers=methods, commands=commands
                )
            # whatever a plugin does, the others must work
            except (Exception, SystemExit) as error:
                trace = "".join(traceback.format_exception(error))
                plugin = plugin._replace(
                    state="broken",
                    cause=f"{type(error).__name__}: {error}",
                    traceback=trace,
                )
        plugins.append(plugin)
        if plugin.state == "broken":
            warnings.warn(
                PluginWarning(
                    f"plugin {plugin.name!r} of {owner} {release} is left out: {plugin.cause}"
                ),
                stacklevel=2,
            )
    return tuple(plugins)


def _offers(
    point: EntryPoint,
    kinds: Iterable[Registrable],
    owner: str,
    release: str,
    owners: Mapping[str, str],
) -> "dict[str, Offer | click.Command]":
    """Return what a plugin offers, by how an error names it. Raises whatever goes wrong."""
    if point.group != PROJECT:
        raise InputError(
            f"its entry point must be in the group {PROJECT!r}, got {point.group!r}"
        )
    manager = pluggy.PluginManager(PROJECT)
    manager.add_hookspecs(hooks)
    module = point.load()
    manager.register(module, point.name)
    try:
        manager.check_pending()
    except pluggy.PluginValidationError as error:
        known = [name for name in vars(hooks) if name.startswith("posefit_register_")]
        unknown = [
            name
            for name in vars(module)
            if name.startswith("posefit_") and name not in known
        ]
        raise InputError(
            f"{error}{suggestion(unknown[0], known) if unknown else ''}"
        ) from None
    offers: dict[str, Offer | click.Command] = {}

    def add(name: str, offer: "Offer | click.Command") -> None:
        if name in owners or name in offers:
            raise ValueError(f"{_taken(name)} {owners.get(name, owner)}")
        offers[name] = offer

    def command(offer: Any) -> None:
        import click

        if not isinstance(offer, click.Command) or not offer.name:
            raise TypeError(
                f"a command must be a click.Command with a name, got {offer!r}"
            )
        add(f"command {offer.name!r}", offer)

    def method(kind: Kind, name: str, factory: Callable[..., Any], **more: Any) -> None:
        from posefit.fitting.optimiser import NextFrame

        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise InputError(
                f"a name must be letters, digits, _, + and -, got {name!r}"
            )
        if not callable(factory):
            raise TypeError(
                f"{kind} {name!r} must be a factory that can be called, got {factory!r}"
            )
        if more.get("next_frame", "start") not in get_args(NextFrame):
            raise InputError(
                f"next_frame must be one of {', '.join(get_args(NextFrame))}, got {more['next_frame']!r}"
            )
        label = f"{kind} {name!r}"
        add(label, Offer(kind, name, factory, owner, release, **more))
        check_hints(label, factory)

    for kind in kinds:
        register = command if kind == COMMAND else partial(method, kind)
        getattr(manager.hook, f"posefit_register_{kind}s")(register=register)
    return offers


def _taken(name: str) -> str:
    return f"{name} is already registered by"
