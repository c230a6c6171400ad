"""Finds plugins and what they offer. A broken plugin costs one warning; the others work on."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Literal

import pluggy

from posefit import hooks
from posefit.fitting.optimiser import OptimiserFactory
from posefit.fitting.prior import PriorFactory

Kind = Literal["optimiser", "prior"]


@dataclass(frozen=True)
class Offer:
    """One registered name."""

    kind: Kind
    name: str
    factory: Callable[..., Any] = field(repr=False)
    distribution: str
    version: str

    @property
    def summary(self) -> str:
        """The first line of the factory's docstring."""
        return (self.factory.__doc__ or "").strip().split("\n")[0]


@dataclass(frozen=True)
class Registry:
    """Everything that plugins registered, by kind and name."""

    offers: Mapping[Kind, Mapping[str, Offer]]

    def optimiser(self, name: str) -> OptimiserFactory:
        """Return the optimiser factory of a name. Raises ValueError listing the known names."""
        return self._find("optimiser", name)

    def prior(self, name: str) -> PriorFactory:
        """Return the prior factory of a name. Raises ValueError listing the known names."""
        return self._find("prior", name)

    def _find(self, kind: Kind, name: str) -> Any:
        known = self.offers[kind]
        if name not in known:
            near = get_close_matches(name, known, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise ValueError(f"{kind} must be one of {', '.join(sorted(known))}, got {name!r}{hint}")
        return known[name].factory


@lru_cache(maxsize=1)
def registry() -> Registry:
    """Return what all installed plugins offer; they are loaded once a process."""
    return load(entry_points(group=hooks.PROJECT))


def load(points: "tuple[EntryPoint, ...] | Any") -> Registry:
    """Return what the plugins behind these entry points offer.

    Each plugin that cannot be imported, misspells a hook, fails inside one or takes a name that is taken is warned
    of, with its distribution, and left out.
    """
    offers: dict[Kind, dict[str, Offer]] = {"optimiser": {}, "prior": {}}
    for point in sorted(points, key=lambda point: (point.dist is not None and point.dist.name != "posefit", point.name)):
        distribution, version = (point.dist.name, point.dist.version) if point.dist else ("unknown", "")
        mine: list[Offer] = []

        def collect(kind: Kind) -> Callable[[str, Any], None]:
            def register(name: str, factory: Any) -> None:
                if name in offers[kind]:
                    raise ValueError(f"{kind} {name!r} is already registered by {offers[kind][name].distribution}")
                mine.append(Offer(kind, name, factory, distribution, version))

            return register

        try:
            manager = pluggy.PluginManager(hooks.PROJECT)
            manager.add_hookspecs(hooks)
            manager.register(point.load(), point.name)
            manager.check_pending()
            manager.hook.posefit_register_optimisers(register=collect("optimiser"))
            manager.hook.posefit_register_priors(register=collect("prior"))
        except Exception as error:  # whatever a plugin does, the others must work
            warnings.warn(
                f"plugin {point.name!r} of {distribution} {version} is left out: {type(error).__name__}: {error}",
                stacklevel=2,
            )
            continue
        for offer in mine:
            offers[offer.kind][offer.name] = offer
    return Registry(offers)
