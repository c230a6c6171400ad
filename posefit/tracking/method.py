"""Methods by name, such as `sapso@pca`, `cma`, `@loose` or a tracker's name.

Their settings are checked here, and errors are attributed to the plugin that made them.
"""

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
from posefit.fitting.synthesis import RELOCALISE_GAP, Prediction, SynthesisTracker
from posefit.fitting.tracker import Follow, InitialiserFactory, Task
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
DEFAULT_START = "lookup"  # guesses the first pose, if it is installed
BLIND = "blind"  # the name for no such guess


class MethodNames(NamedTuple):
    """The names of a method's plugins: an optimiser and a prior, or a tracker.

    With a tracker the other two are "".
    """

    optimiser: str
    prior: str
    tracker: str | None = None

    def __str__(self) -> str:
        return self.tracker or f"{self.optimiser}@{self.prior}"


def method_names(method: str, default_prior: str = DEFAULT_PRIOR) -> MethodNames:
    """Return the names of the plugins of a method such as `sapso@pca`.

    Args:
        method: OPTIMISER@PRIOR, OPTIMISER, @PRIOR or a tracker.
        default_prior: The prior of a method that names none.

    Returns:
        The names.

    Raises:
        InputError: The name is unknown; the message lists the known ones.
    """
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
    hint = registry().hint(family, known)
    if family in offers["prior"]:
        hint = f"; as a prior it is @{optimiser}"
    raise InputError(
        f"method must be OPTIMISER@PRIOR, or one of {', '.join(known)}, "
        f"got {quoted(method)}{hint}"
    )


def offers_of(method: Any) -> tuple[Offer, str | Prior | None]:
    """Return the plugins of a method.

    Args:
        method: A method as in `TrackOptions`.

    Returns:
        An optimiser and its prior, or a tracker and None.

    Raises:
        InputError: A name is unknown.
        ImportError: A library is not installed.
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
    """A method that is ready to track.

    Attributes:
        name: Such as `sapso@pca`.
        prior: The fitted prior, or None for a tracker from a plugin.
        settings: The settings by kind of plugin.
        looks_ahead: Whether the tracker takes several observations before it yields a
            frame.
        relocalise_gap: The length in frames of a gap in footage after which the tracker
            relocalises, or 0 for never.
        audit: The violations of rules that its trackers made so far.
        follow: Yields a frame for each observation of a task. It is
            `posefit.fitting.driving.drive` for this method's tracker and audit.
        start: Guesses first poses, or None for searches without a start.
    """

    name: str
    prior: Latents | None
    settings: dict[str, dict[str, Any]]
    looks_ahead: bool
    relocalise_gap: int
    audit: Audit
    follow: Follow = field(repr=False)
    start: InitialiserFactory | None = field(default=None, repr=False)

    def dimensions(self, task: Task) -> int | None:
        """Return the coordinates of a proposal, or None for a tracker from a plugin."""
        if self.prior is None:
            return None
        return 3 + 3 * (task.translation == "searched") + len(self.prior.low)


def prepare(options: TrackOptions, task: Task) -> Method:
    """Return the method of some options, with its prior fitted to a task's motions.

    Args:
        options: The complete options.
        task: The task, with its training motions and its budget.

    Returns:
        The method.

    Raises:
        InputError: A name, a setting or the budget is wrong.
        ImportError: A library is not installed.
        BrokenRuleError: A plugin breaks the rules of its kind.
    """
    optimiser, prior_choice = offers_of(options.method)
    if prior_choice is None:
        return _tracker_method(optimiser, options.settings)
    offers = [optimiser]
    if isinstance(prior_choice, str):
        offers.append(registry().offer("prior", prior_choice))
    plugin_settings = parsed_settings(offers, options.settings)
    plugin_settings.setdefault("prior", {})
    stated = plugin_settings["optimiser"]
    planned = settings.planned(optimiser.factory, stated, task.evaluations)
    plugin_settings["optimiser"] = settings.check(
        optimiser.name, optimiser.factory, planned
    )
    prior_name, prior = _fitted_prior(prior_choice, plugin_settings["prior"], task)

    predicting: dict[str, Any] = {}
    if not isinstance(prior_choice, str):
        # The motions from which a fitted prior has learned are unknown, so that a tilt
        # that is learned from the task's motions does not fit it.
        predicting["tilt"] = "box"
    prediction = Prediction(**{**predicting, **plugin_settings["tracker"]})
    tilt = prediction.tilted(prior, task.training)

    def make(space: Space, rng: np.random.Generator, evaluations: int) -> Optimiser:
        # schedules depend on the budget
        values = settings.planned(optimiser.factory, stated, evaluations)
        with _rules(optimiser):
            made = optimiser.factory(space, rng, **values)
        return Checked(made, optimiser.label, space, evaluations)

    searching = partial(
        SynthesisTracker,
        prior=prior,
        make=make,
        next_frame=optimiser.next_frame,
        prediction=prediction,
        tilt=tilt,
    )
    name = f"{optimiser.name}@{prior_name}"
    audit = Audit(name, prediction.beta)
    return Method(
        name=name,
        prior=prior,
        settings=plugin_settings,
        looks_ahead=False,
        relocalise_gap=prediction.relocalise_gap,
        audit=audit,
        follow=partial(drive, searching, audit),
        start=start_of(prediction.start),
    )


def _fitted_prior(
    chosen: str | Prior, values: Mapping[str, Any], task: Task
) -> tuple[str, Latents]:
    """Return a prior's name, and the prior fitted to a task's motions.

    A prior that the caller fitted is only checked.

    Args:
        chosen: The name of a plugin's prior, or a fitted one.
        values: The settings of the plugin's prior.
        task: The task.
    """
    prior: Any = chosen
    if isinstance(chosen, str):
        offer = registry().offer("prior", chosen)
        name = offer.name
        label = offer.label
        with _rules(offer):
            prior = offer.factory(**values)
        with _rules(offer, "fit"):
            prior = prior.fit(task.angles, task.body.skeleton)
    else:
        name = type(chosen).__name__
        label = f"prior {name}"
    with plugin_errors(label, "the range, low and high,"):
        checked = Checked(prior, label)
    if task.training:
        check_prior(checked, task.angles, task.body.skeleton, label)
    return name, checked


def start_of(name: str | None = None) -> InitialiserFactory | None:
    """Return the initialiser of a name, which guesses first poses.

    By default it is `DEFAULT_START`. Returns None for "blind", or if no name is given
    and the default is not installed.
    """
    offered = registry().offers["start"]
    one_of("start", name or BLIND, [BLIND, *sorted(offered)])
    if name == BLIND or (name is None and DEFAULT_START not in offered):
        return None
    offer = registry().offer("start", name or DEFAULT_START)
    factory: InitialiserFactory = offer.factory
    return factory


def places_of(offers: Sequence[Offer]) -> dict[str, tuple[str, Callable[..., Any]]]:
    """Return the kind and the factory for each name with which settings may begin."""
    places: dict[str, tuple[str, Callable[..., Any]]] = {}
    for offer in offers:
        places[offer.name.partition(":")[0]] = (offer.kind, offer.factory)
    # an optimiser and a prior are used by the synthesis tracker, which has settings too
    if offers[0].kind != "tracker":
        places["tracker"] = ("tracker", Prediction)
    return places


def parsed_settings(
    offers: Sequence[Offer], values: Mapping[str, Any] | Sequence[str]
) -> dict[str, dict[str, Any]]:
    """Return checked settings by kind of plugin.

    Args:
        offers: The plugins of the method.
        values: Values by names such as `sapso.cooling`, or strings such as
            `sapso.cooling=0.9`. The plugin's name may be left out if only one plugin
            has such a setting.

    Returns:
        The settings of each kind of plugin.

    Raises:
        InputError: A string has another form, a plugin or a setting is unknown, or a
            value is not valid.
    """
    places = places_of(offers)
    by_plugin: dict[str, dict[str, Any]] = {name: {} for name in places}
    # values in a mapping are checked, and values in strings are parsed
    read: Callable[..., dict[str, Any]] = settings.parse
    items: Iterable[tuple[str, Any]]
    if isinstance(values, Mapping):
        read = settings.check
        items = values.items()
    else:
        items = map(_assignment, values)
    for key, value in items:
        name, setting = _owner(key, places)
        if setting in by_plugin[name]:
            raise InputError(f"a setting must be given once, got {quoted(key)} twice")
        by_plugin[name][setting] = value
    checked = {}
    for name, (kind, factory) in places.items():
        checked[kind] = read(name, factory, by_plugin[name])
    return checked


def _assignment(text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not equals or key.endswith("."):
        raise InputError(
            "a setting must be NAME.SETTING=VALUE such as sapso.cooling=0.9, "
            f"got {quoted(text)}"
        )
    return key, value


def _owner(
    key: str, places: Mapping[str, tuple[str, Callable[..., Any]]]
) -> tuple[str, str]:
    """Return the plugin and the setting that a key names.

    The plugin may be left out if only one plugin has the setting.
    """
    plugin, dot, setting = key.partition(".")
    if dot and plugin in places:
        return plugin, setting
    if dot:
        raise InputError(
            f"a setting must belong to one of {', '.join(places)}, "
            f"which are in use here, got {quoted(key)}"
        )
    names = {plugin: settings.names(factory) for plugin, (_, factory) in places.items()}
    owners = [plugin for plugin in names if key in names[plugin]]
    if len(owners) != 1:
        known = []
        for plugin, settings_of in names.items():
            known += [f"{plugin}.{setting}" for setting in settings_of]
        raise InputError(
            f"a setting must be one of {', '.join(known)}, got {quoted(key)}"
        )
    return owners[0], key


def _tracker_method(offer: Offer, values: Mapping[str, Any] | Sequence[str]) -> Method:
    plugin_settings = parsed_settings([offer], values)["tracker"]
    defaults = {setting.name: setting.default for setting in offer.settings}
    # the weight in the costs that it reports
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
    """Return a context that attributes errors to a plugin.

    ValueErrors and ImportErrors are passed on.
    """
    return plugin_errors(offer.label, what, passed=(ValueError, ImportError))


def _offered(kind: Kind, chosen: str | Callable[..., Any]) -> Offer:
    if isinstance(chosen, str):
        return registry().offer(kind, chosen)
    frames: NextFrame = "carry" if hasattr(chosen, "advance") else "start"
    looks_ahead = bool(getattr(chosen, "looks_ahead", False))
    name = getattr(chosen, "__name__", type(chosen).__name__)
    return Offer(kind, name, chosen, "the caller", "", frames, looks_ahead)
