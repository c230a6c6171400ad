"""Loads plugins, and finds their offers by kind and name.

A plugin is left out if it cannot be imported, misspells a hook, fails inside a hook, or
registers a name that is taken. A warning then names its distribution; the others work.
The environment variable POSEFIT_BLOCK_PLUGINS names plugins or distributions to leave
out, separated by commas.
"""

import os
import re
import traceback
import warnings
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
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
# `posefit check` has rules for these kinds, `posefit plugins new` a template
CHECKED_KINDS = tuple(kind for kind in KINDS if kind != "device")
# distribution of an optimiser that no plugin but the program itself has registered
OWN = "this process"
COMMAND: Literal["command"] = "command"  # plugins may register commands besides KINDS
Registrable: TypeAlias = Kind | Literal["command"]
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_+-]*")


@dataclass(frozen=True)
class Offer:
    """One registered name.

    Attributes:
        kind: The kind of plugin.
        name: The name that users give.
        factory: Takes the arguments of its kind, and keyword-only settings.
        distribution: The installed package that registered it.
        version: The version of the distribution.
        next_frame: What becomes of an optimiser in the next frame.
        looks_ahead: Whether a tracker reads later frames first.
        still_background: Whether a segmenter needs a still background.
        needs: A module that the factory imports, and what to install for it.
    """

    kind: Kind
    name: str
    factory: Callable[..., Any] = field(repr=False)
    distribution: str
    version: str
    next_frame: "NextFrame" = "start"
    looks_ahead: bool = False
    still_background: bool = True
    needs: hooks.Needs | None = None

    @property
    def label(self) -> str:
        """Its name in error messages."""
        owner = f"{self.distribution} {self.version}"
        return f"{self.kind} {self.name!r} of {owner}".rstrip()

    @property
    def origin(self) -> str:
        """The origin of its results.

        That is its distribution and version, a digest of its package's source, and its
        library. posefit's own plugins have the same version; their packages' names
        distinguish them. Their parts that are imported from posefit depend on
        posefit's build.
        """
        if self.distribution == OWN:
            return f"{self.name} {self.version}".rstrip()
        factory = self.factory
        if isinstance(factory, partial):
            factory = factory.func
        module = factory.__module__
        package = module.partition(".")[0]
        if self.distribution == PROJECT and package == PROJECT:
            return posefit_build()
        name = f"{self.distribution} {self.version}"
        if self.distribution == PROJECT:
            name = package
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
        """The settings that `--set` accepts."""
        return settings_of(self.factory)

    @property
    def missing(self) -> str | None:
        """What to install before it can be used, or None."""
        if self.needs is None or find_spec(self.needs[0]) is not None:
            return None
        return self.needs[1]


class Plugin(NamedTuple):
    """One entry point, and its offers.

    Attributes:
        name: The name of the entry point.
        distribution: The installed package.
        version: The version of the distribution.
        state: What happened when it was loaded.
        cause: Why it is not loaded.
        offers: What it registered, of the requested kinds.
        commands: The commands that it registered, if these were requested.
        traceback: The traceback of the error that broke it.
    """

    name: str
    distribution: str
    version: str
    state: Literal["loaded", "broken", "left out"]
    cause: str = ""
    offers: tuple[Offer, ...] = ()
    commands: "tuple[click.Command, ...]" = ()
    traceback: str = ""


@dataclass(frozen=True)
class Registry:
    """What plugins have registered, by kind and name."""

    plugins: tuple[Plugin, ...]

    def rivals(self, offer: Offer) -> list[Plugin]:
        """Return the plugins that are left out because an offer has their name."""
        cause = _taken(f"{offer.kind} {offer.name!r}")
        return [plugin for plugin in self.plugins if cause in plugin.cause]

    @cached_property
    def offers(self) -> Mapping[Kind, Mapping[str, Offer]]:
        """The offers of all loaded plugins."""
        offers: dict[Kind, dict[str, Offer]] = {kind: {} for kind in KINDS}
        for plugin in self.plugins:
            for offer in plugin.offers:
                offers[offer.kind][offer.name] = offer
        return offers

    def optimiser(self, name: str) -> "OptimiserFactory":
        """Return the optimiser factory with a name.

        Raises:
            InputError: There is none; the message lists the known names.
            ImportError: A library that it needs is not installed.
        """
        return self.offer("optimiser", name).factory

    def prior(self, name: str) -> "PriorFactory":
        """Return the prior factory with a name.

        Raises:
            InputError: There is none; the message lists the known names.
            ImportError: A library that it needs is not installed.
        """
        return self.offer("prior", name).factory

    def offer(self, kind: Kind, name: str) -> Offer:
        """Return the offer with a name.

        `family:NAME` is the offer `family` with its setting `variant`.

        Raises:
            InputError: There is none; the message lists the known names.
            ImportError: A library that it needs is not installed.
        """
        known = self.offers[kind]
        family, colon, variant = name.partition(":")
        if family not in known:
            listed = ", ".join(sorted(known)) or "none"
            raise InputError(
                f"{kind} must be one of {listed}, "
                f"got {quoted(name)}{self.hint(family, known)}"
            )
        offer = known[family]
        if offer.needs is not None and offer.missing:
            needed, requirement = offer.needs
            raise ImportError(
                f"{kind} {family} needs the library {needed}: "
                f"install it with python -m pip install '{requirement}'"
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
        """Return the end of a message about an unknown name.

        It names the other kind that has this name, or else the nearest known name or
        the command that lists the known names.
        """
        kinds = [kind for kind, offers in self.offers.items() if name in offers]
        if kinds:
            return f"; its kind is {kinds[0]}"
        broken = [plugin.name for plugin in self.plugins if plugin.state == "broken"]
        doctor = ""
        if broken:
            listed = ", ".join(broken)
            doctor = f"posefit plugins doctor says why {listed} failed to load"
        near = suggestion(name, known)
        if near and doctor:
            return f"{near} {doctor}"
        if near:
            return near
        if doctor:
            return f"; {doctor}"
        return (
            "; posefit plugins doctor lists what is installed, and what failed to load"
        )


@lru_cache(maxsize=1)
def registry() -> Registry:
    """Return what all installed plugins offer. They are loaded once per process."""
    return Registry((*plugins_of(KINDS), *_own.values()))


_own: dict[str, Plugin] = {}


def register(factories: Mapping[str, tuple[Callable[..., Any], str]]) -> None:
    """Register optimisers in this process only.

    Args:
        factories: Factory, and digest of its source, by name.

    Raises:
        InputError: A plugin has registered one of the names, or a name is invalid.
    """
    for name, (factory, digest) in factories.items():
        if not _NAME.fullmatch(name):
            raise InputError(
                "a factory must have a name of letters, digits, _, + and -, "
                f"got {quoted(name)}"
            )
        offers = registry().offers
        known = {**offers["optimiser"], **offers["tracker"]}
        if name not in _own and name in known:
            raise InputError(
                f"a factory must have a new name, got {name}, "
                "which a plugin has registered"
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
    """Return all installed plugins with their offers of some kinds; see `load`.

    A plugin in a group whose name only begins with posefit's is included as broken.
    """
    points = list[EntryPoint]()
    for group in entry_points().groups:
        if re.sub("[-_. ]", "", group.lower()).startswith(PROJECT):
            points += entry_points(group=group)
    return load(points, kinds, taken=taken)


def version_of(origins: Iterable[str]) -> str:
    """Return the version of posefit, and of plugins with these `Offer.origin`s."""
    return ", ".join([posefit_build(), *sorted(set(origins) - {posefit_build()})])


def optimiser(name: str) -> "OptimiserFactory":
    """Return the factory of an installed optimiser.

    Args:
        name: The optimiser's name, such as "sapso", or "nevergrad:DE".

    Returns:
        The factory, which takes a space, a generator and settings.

    Raises:
        InputError: There is no such optimiser; the message lists the known names.
        ImportError: A library that it needs is not installed.

    Example:
        >>> import posefit
        >>> posefit.optimiser("sapso").__name__
        'SAPSO'
    """
    return registry().optimiser(name)


def prior(name: str) -> "PriorFactory":
    """Return the factory of an installed prior.

    Args:
        name: The prior's name, such as "pca".

    Returns:
        The factory, which takes settings.

    Raises:
        InputError: There is no such prior; the message lists the known names.
        ImportError: A library that it needs is not installed.

    Example:
        >>> import posefit
        >>> poses = posefit.load_motion("walk-a").poses
        >>> fitted = posefit.prior("pca")(components=3).fit(poses[:, 3:])
        >>> fitted.low.shape
        (3,)
    """
    return registry().prior(name)


def load(
    points: Iterable[EntryPoint],
    kinds: Iterable[Registrable] = KINDS,
    variables: Mapping[str, str] = os.environ,
    taken: Iterable[str] = (),
) -> tuple[Plugin, ...]:
    """Return the plugins of entry points, posefit's own first.

    Of several offers with the same name, only the first is loaded.

    Args:
        points: The entry points.
        kinds: Only the hooks of these kinds are called; may include COMMAND.
        variables: Environment variables.
        taken: Names of posefit's own commands.
    """
    owners = {f"command {name!r}": PROJECT for name in taken}
    blocked = {word.strip().lower() for word in variables.get(BLOCK, "").split(",")}
    plugins: list[Plugin] = []
    owned = []
    for point in points:
        if point.dist:
            owned.append((point.dist.name, point.dist.version, point))
        else:
            owned.append(("unknown", "", point))
    own_first = sorted(owned, key=lambda entry: (entry[0] != PROJECT, entry[2].name))
    for owner, release, point in own_first:
        plugin = Plugin(point.name, owner, release, "left out", f"{BLOCK} names it")
        if not blocked & {point.name.lower(), owner.lower()}:
            try:
                offers = _offers(point, kinds, owner, release, owners)
                owners |= dict.fromkeys(offers, owner)
                methods = []
                commands = []
                for offer in offers.values():
                    if isinstance(offer, Offer):
                        methods.append(offer)
                    else:
                        commands.append(offer)
                plugin = plugin._replace(
                    state="loaded",
                    cause="",
                    offers=tuple(methods),
                    commands=tuple(commands),
                )
            # the others must work even if a plugin fails
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
                    f"plugin {plugin.name!r} of {owner} {release} is left out: "
                    f"{plugin.cause}"
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
    """Return a plugin's offers by their names in messages. Errors are not caught."""
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
        unknown = []
        for name in vars(module):
            if name.startswith("posefit_") and name not in known:
                unknown.append(name)
        near = ""
        if unknown:
            near = suggestion(unknown[0], known)
        raise InputError(f"{error}{near}") from None
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
                f"next_frame must be one of {', '.join(get_args(NextFrame))}, "
                f"got {more['next_frame']!r}"
            )
        label = f"{kind} {name!r}"
        add(label, Offer(kind, name, factory, owner, release, **more))
        check_hints(label, factory)

    # other hooks are not called, because they may import slow libraries
    for kind in kinds:
        if kind == COMMAND:
            register = command
        else:
            register = partial(method, kind)
        getattr(manager.hook, f"posefit_register_{kind}s")(register=register)
    return offers


def _taken(name: str) -> str:
    return f"{name} is already registered by"
