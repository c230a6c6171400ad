"""What plugins offer, by kind and name: optimisers, priors, trackers and segmenters."""

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import lru_cache, partial
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Any, Literal, get_args

from posefit import entries, hooks
from posefit.entries import PROJECT, Plugin
from posefit.fitting.optimiser import NextFrame, OptimiserFactory
from posefit.fitting.prior import PriorFactory
from posefit.fitting.tracker import TrackerFactory
from posefit.settings import Setting, settings_of
from posefit.version import source_digest

Kind = Literal["optimiser", "prior", "tracker", "segmenter"]
KINDS: tuple[Kind, ...] = get_args(Kind)
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
    def origin(self) -> str:
        """What its results depend on: its distribution with its version, and a digest of its package's source.

        The packages of posefit's own plugins, which have one version, are told apart by name.
        """
        module = (self.factory.func if isinstance(self.factory, partial) else self.factory).__module__
        name = module.partition(".")[0] if self.distribution == PROJECT else f"{self.distribution} {self.version}"
        return f"{name} {source_digest(module)}".rstrip()

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
class Registry:
    """Everything that plugins registered, by kind and name."""

    plugins: tuple[Plugin[Offer], ...]

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
    return registry_of(entry_points(group=PROJECT))


def registry_of(points: Iterable[EntryPoint], variables: Mapping[str, str] = os.environ) -> Registry:
    """Return what the plugins behind these entry points offer; see `posefit.entries.load`."""
    return Registry(entries.load(points, hooks, _offers, _named, variables))


def _named(offer: Offer) -> str:
    return f"{offer.kind} {offer.name!r}"


def _offers(relay: Any, distribution: str, version: str) -> Iterator[Offer]:
    """Yield everything that one plugin registers."""
    mine: list[Offer] = []

    def register(kind: Kind, name: str, factory: Callable[..., Any], **more: Any) -> None:
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise ValueError(f"a name must be letters, digits, _, + and -, got {name!r}")
        if not callable(factory):
            raise TypeError(f"{kind} {name!r} must be a factory that can be called, got {factory!r}")
        if more.get("next_frame", "start") not in get_args(NextFrame):
            raise ValueError(f"next_frame must be one of {', '.join(get_args(NextFrame))}, got {more['next_frame']!r}")
        mine.append(Offer(kind, name, factory, distribution, version, **more))

    for kind in KINDS:
        getattr(relay, f"posefit_register_{kind}s")(register=partial(register, kind))
    yield from mine
