"""A method by its one string, `sapso@pca`, `cma`, `@loose` or a tracker's name: settings checked, plugins watched."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from posefit import settings
from posefit.errors import InputError
from posefit.fitting.box import Space
from posefit.fitting.check import one_of
from posefit.fitting.driving import Audit, drive
from posefit.fitting.optimiser import NextFrame, Optimiser
from posefit.fitting.prior import Latents, Prior
from posefit.fitting.tracker import (
    RELOCALISE_GAP,
    Follow,
    InitialiserFactory,
    Prediction,
    SynthesisTracker,
    Task,
)
from posefit.fitting.validation import (
    Checked,
    check_prior,
    plugin_errors,
)
from posefit.reading import quoted
from posefit.registry import Kind, Offer, registry
from posefit.silhouette.cost import BETA
from posefit.tracking.options import TrackOptions

DEFAULT_OPTIMISER = "annealed"
DEFAULT_PRIOR = "pca"
DEFAULT_START = "lookup"  # what guesses the first pose, where it is installed
BLIND = "blind"  # the name of no such guess


class MethodNames(NamedTuple):
    """The plugins that a method names: an optimiser and a prior, or a tracker, which has neither ("")."""

    optimiser: str
    prior: str
    tracker: str | None = None

    def __str__(self) -> str:
        return self.tracker or f"{self.optimiser}@{self.prior}"


def method_names(method: str, default_prior: str = DEFAULT_PRIOR) -> MethodNames:
    """Return the plugins that a method such as `sapso@pca` names. Raises InputError listing those that are known."""
    optimiser, at, prior = method.partition("@")
    if at:
        return MethodNames(optimiser or DEFAULT_OPTIMISER, prior or default_prior)
    offers = registry().offers
    family = optimiser.partition(":")[0]
    if family in offers["tracker"]:
        return MethodNames("", "", optimiser)
    if family in offers["optimiser"]:
        return MethodNames(optimiser, default_prior)
    known = [*sorted(offers["tracker"]), *sorted(offers["optimiser"])]
    hint = (
        f"; as a prior it is @{optimiser}"
        if family in offers["prior"]
        else registry().hint(family, known)
    )
    raise InputError(
        f"method must be OPTIMISER@PRIOR, or one of {', '.join(known)}, got {quoted(method)}{hint}"
    )


def offers_of(method: Any) -> tuple[Offer, str | Prior | None]:
    """Return what a method of `TrackOptions` names: an optimiser and its prior, or a tracker and None.

    Raises InputError where a name is wrong, and ImportError where a library is not installed.
    """
    if isinstance(method, tuple):
        return _offered("optimiser", method[0]), method[1]
    if callable(method):
        return _offered("tracker", method), None
    names = method_names(method)
    if names.tracker is not None:
        return _offered("tracker", names.tracker), None
    return _offered("optimiser", names.optimiser), names.prior


@dataclass(frozen=True, eq=False)
class Method:
    """A method ready to track: its prior has learned, and `follow` yields a frame for each observation of a task."""

    name: str
    # which has learned; None for a tracker that is a plugin itself
    prior: Latents | None
    settings: dict[str, dict[str, Any]]
    # whether its tracker takes several observations before it yields a frame
    looks_ahead: bool
    # frames of a gap in footage after which it relocalises, 0 for never
    relocalise_gap: int
    audit: Audit  # what its trackers reported wrongly so far
    # see `posefit.fitting.driving.drive`, whose tracker and audit are the method's
    follow: Follow = field(repr=False)
    # guesses first poses; None for blind searches
    start: InitialiserFactory | None = field(default=None, repr=False)

    def dimensions(self, task: Task) -> int | None:
        """Return how many coordinates a proposal has; None for a tracker that is a plugin itself."""
        if self.prior is None:
            return None
        return 3 + 3 * (task.translation == "searched") + len(self.prior.low)


def prepare(options: TrackOptions, task: Task) -> Method:
    """Return the method of some options, its prior learned from a task's training motions.

    Raises InputError where a name, a setting or the budget is wrong, ImportError where a library is not installed, and
    BrokenRuleError where a plugin does not do what its kind has to.
    """
    optimiser, prior_choice = offers_of(options.method)
    if prior_choice is None:
        return _tracker_method(optimiser, options.settings)
    prior = (
        registry().offer("prior", prior_choice)
        if isinstance(prior_choice, str)
        else None
    )
    plugin_settings = parsed_settings(
        [optimiser] if prior is None else [optimiser, prior], options.settings
    )
    plugin_settings.setdefault("prior", {})
    stated = plugin_settings["optimiser"]
    planned = settings.planned(optimiser.factory, stated, task.evaluations)
    plugin_settings["optimiser"] = settings.check(
        optimiser.name, optimiser.factory, planned
    )
    if prior is not None:
        name = prior.name
        label = prior.label
        with _rules(prior):
            learned = prior.factory(**plugin_settings["prior"])
        with _rules(prior, "fit"):
            learned = learned.fit(task.angles, task.body.skeleton)
    else:
        name = type(prior_choice).__name__
        label = f"prior {name}"
        learned = prior_choice
    with plugin_errors(label, "the range, low and high,"):
        learned = Checked(learned, label)
    if task.training:
        check_prior(learned, task.angles, task.body.skeleton, label)
    # what a prior that came learned has learned from is unknown: its tilt is not that of other motions
    prediction = Prediction(
        **{
            **({} if prior is not None else {"tilt": "box"}),
            **plugin_settings["tracker"],
        }
    )
    tilt = prediction.tilted(learned, task.training)

    def make(space: Space, rng: np.random.Generator, evaluations: int) -> Optimiser:
        # schedules follow the budget
        values = settings.planned(optimiser.factory, stated, evaluations)
        with _rules(optimiser):
            made = optimiser.factory(space, rng, **values)
        return Checked(made, optimiser.label, space, evaluations)

    searching = partial(
        SynthesisTracker,
        prior=learned,
        make=make,
        next_frame=optimiser.next_frame,
        prediction=prediction,
        tilt=tilt,
    )
    label = f"{optimiser.name}@{name}"
    audit = Audit(label, prediction.beta)
    return Method(
        name=label,
        prior=learned,
        settings=plugin_settings,
        looks_ahead=False,
        relocalise_gap=prediction.relocalise_gap,
        audit=audit,
        follow=partial(drive, searching, audit),
        start=start_of(prediction.start),
    )


def start_of(name: str | None = None) -> InitialiserFactory | None:
    """Return what guesses first poses, by its name; the default one where it is installed; None for "blind"."""
    offered = registry().offers["start"]
    one_of("start", name or BLIND, [BLIND, *sorted(offered)])
    if name == BLIND or (name is None and DEFAULT_START not in offered):
        return None
    factory: InitialiserFactory = (
        registry().offer("start", name or DEFAULT_START).factory
    )
    return factory


def places_of(offers: Sequence[Offer]) -> dict[str, tuple[str, Callable[..., Any]]]:
    """Return the kind and the factory of each name that settings of a method begin with, by the plugins it names."""
    places: dict[str, tuple[str, Callable[..., Any]]] = {
        offer.name.partition(":")[0]: (offer.kind, offer.factory) for offer in offers
    }
    return (
        places
        if offers[0].kind == "tracker"
        else places | {"tracker": ("tracker", Prediction)}
    )


def parsed_settings(
    offers: Sequence[Offer], values: Mapping[str, Any] | Sequence[str]
) -> dict[str, dict[str, Any]]:
    """Return settings by the kind of plugin that they are of.

    They are given by names such as `sapso.cooling`, or as texts such as `sapso.cooling=0.9`; the plugin's name may be
    left out where it alone has such a setting. Raises InputError where a text has another form, names a plugin that is
    not among `offers` or a setting that it does not know, or where a value does not fit.
    """
    places = places_of(offers)
    by_plugin: dict[str, dict[str, Any]] = {name: {} for name in places}
    stated = isinstance(values, Mapping)  # else texts, whose values are to be parsed
    items: Iterable[tuple[str, Any]] = (
        values.items() if isinstance(values, Mapping) else map(_assignment, values)
    )
    for key, value in items:
        name, setting = _owner(key, places)
        if setting in by_plugin[name]:
            raise InputError(f"a setting must be given once, got {quoted(key)} twice")
        by_plugin[name][setting] = value
    checked = settings.check if stated else settings.parse
    return {
        kind: checked(name, factory, by_plugin[name])
        for name, (kind, factory) in places.items()
    }


def _assignment(text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not equals or key.endswith("."):
        raise InputError(
            f"a setting must be NAME.SETTING=VALUE such as sapso.cooling=0.9, got {quoted(text)}"
        )
    return key, value


def _owner(
    key: str, places: Mapping[str, tuple[str, Callable[..., Any]]]
) -> tuple[str, str]:
    """Return the plugin and the setting that a key names; the plugin may be left out where it alone has the setting."""
    plugin, dot, setting = key.partition(".")
    if dot and plugin in places:
        return plugin, setting
    if dot:
        raise InputError(
            f"a setting must name one of {', '.join(places)}, which are in use here, got {quoted(key)}"
        )
    names = {plugin: settings.names(factory) for plugin, (_, factory) in places.items()}
    owners = [plugin for plugin in names if key in names[plugin]]
    if len(owners) != 1:
        known = ", ".join(
            f"{plugin}.{setting}" for plugin in names for setting in names[plugin]
        )
        raise InputError(f"a setting must be one of {known}, got {quoted(key)}")
    return owners[0], key


def _tracker_method(offer: Offer, values: Mapping[str, Any] | Sequence[str]) -> Method:
    plugin_settings = parsed_settings([offer], values)["tracker"]
    defaults = {setting.name: setting.default for setting in offer.settings}
    # of the costs that it gives
    beta = {"beta": BETA, **defaults, **plugin_settings}["beta"]
    beta = float(beta) if isinstance(beta, float | int) else BETA

    audit = Audit(offer.label, beta)
    tracker = partial(offer.factory, **plugin_settings)
    return Method(
        name=offer.name,
        prior=None,
        settings={"tracker": plugin_settings},
        looks_ahead=offer.looks_ahead,
        relocalise_gap=0 if offer.looks_ahead else RELOCALISE_GAP,
        audit=audit,
        follow=partial(drive, tracker, audit),
        start=start_of(),
    )


def _rules(offer: Offer, what: str = "construction") -> AbstractContextManager[None]:
    """Return a context that passes ValueErrors on, and blames the plugin for whatever else a call raises."""
    return plugin_errors(offer.label, what, passed=(ValueError, ImportError))


def _offered(kind: Kind, chosen: str | Callable[..., Any]) -> Offer:
    if isinstance(chosen, str):
        return registry().offer(kind, chosen)
    frames: NextFrame = "carry" if hasattr(chosen, "advance") else "start"
    looks_ahead = bool(getattr(chosen, "looks_ahead", False))
    name = getattr(chosen, "__name__", type(chosen).__name__)
    return Offer(kind, name, chosen, "the caller", "", frames, looks_ahead)
