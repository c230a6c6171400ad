"""A method by its one string: `sapso@pca`, `cma`, `@loose`, or a tracker's name; its settings checked, plugins watched.

`resolved` fills in the method of a source, and what it learns from, where the options leave them open.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from posefit import settings
from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.box import Space
from posefit.fitting.driving import Audit, drive
from posefit.fitting.optimiser import NextFrame, Optimiser
from posefit.fitting.prior import Prior
from posefit.fitting.tracker import (
    Frame,
    InitialiserFactory,
    Observation,
    Prediction,
    SynthesisTracker,
    Task,
    Tracker,
)
from posefit.fitting.validation import BrokenRuleError, CheckedOptimiser, CheckedPrior, plugin_errors
from posefit.footage.source import Footage, kind_of
from posefit.motion import built_in, recorded
from posefit.reading import quoted
from posefit.registry import Kind, Offer, registry
from posefit.silhouette.cost import BETA
from posefit.tracking.options import TrackOptions

DEFAULT_OPTIMISER = "annealed"
DEFAULT_START, BLIND = "lookup", "blind"  # where it is installed; for none
DEFAULT_PRIOR, DEFAULT_FOOTAGE_PRIOR = "pca", "loose"
DEFAULT_TRACKER = "exemplars"  # where it is installed
DEFAULT_TRACKER_EVALUATIONS = 9760  # of a frame
FEASIBILITY_SAMPLES = 1000  # poses of which one at least has to be feasible in a prior


class MethodNames(NamedTuple):
    """The plugins that a method names: an optimiser and a prior, or a tracker, which has neither ("")."""

    optimiser: str
    prior: str
    tracker: str | None = None

    def __str__(self) -> str:
        return self.tracker or f"{self.optimiser}@{self.prior}"


def method_names(method: str | None, default_prior: str = DEFAULT_PRIOR) -> MethodNames:
    """Return the plugins that a method such as `sapso@pca` names. Raises InputError listing those that are known."""
    optimiser, at, prior = (method or "@").partition("@")
    if at:
        return MethodNames(optimiser or DEFAULT_OPTIMISER, prior or default_prior)
    offers, family = registry().offers, optimiser.partition(":")[0]
    if family in offers["tracker"]:
        return MethodNames("", "", optimiser)
    if family in offers["optimiser"]:
        return MethodNames(optimiser, default_prior)
    known = [*sorted(offers["tracker"]), *sorted(offers["optimiser"])]
    hint = f"; as a prior it is @{optimiser}" if family in offers["prior"] else registry().hint(family, known)
    raise InputError(f"method must be OPTIMISER@PRIOR, or one of {', '.join(known)}, got {quoted(method)}{hint}")


def resolved(source: Footage, options: TrackOptions) -> TrackOptions:
    """Return options whose method and training motions are known, by default those of the source.

    That is `exemplars`, which learns from the library of recorded motions and has a budget of its own. A built-in
    motion, and all else for which an optimiser, a prior or settings of theirs are given, is tracked by `annealed@pca`,
    or the optimiser that settings name; footage with the prior `loose`. These and other trackers learn from the other
    styles of a built-in motion, or else from the built-in walks.
    """
    known = isinstance(source, str) and source in built_in.names()
    prior, method = DEFAULT_FOOTAGE_PRIOR if kind_of(source) != "motion" else DEFAULT_PRIOR, options.method
    offers, set_names = registry().offers, {name.partition(".")[0] for name in options.settings}
    searched = known or set_names - {DEFAULT_TRACKER}
    if method is None and not searched and DEFAULT_TRACKER in offers["tracker"]:
        method = DEFAULT_TRACKER
    elif method is None or isinstance(method, str):
        method = str(method_names(method or next(iter(set_names & {*offers["optimiser"]}), None), prior))
    train = options.train
    if not train and method == DEFAULT_TRACKER:
        train = [recorded.LIBRARY]
    train = train or built_in.other_styles(str(source) if known else "walk")
    evaluations = options.evaluations
    if method == DEFAULT_TRACKER and evaluations is None:
        evaluations = DEFAULT_TRACKER_EVALUATIONS
    return options.changed(method=method, train=train, evaluations=evaluations)


@dataclass(frozen=True, eq=False)
class Method:
    """A method ready to track: its prior has learned, and `build` makes a tracker of a task."""

    name: str
    prior: Prior | None  # of a tracker of its own, None
    settings: dict[str, dict[str, Any]]
    looks_ahead: bool  # whether its tracker takes several observations before it yields a frame
    relocalise_gap: int | None  # frames of a gap after which it relocalises, 0 for never; None for the default
    audit: Audit  # of what its trackers report
    build: Callable[[Task], Tracker] = field(repr=False)
    start: InitialiserFactory | None = field(default=None, repr=False)  # guesses first poses; None for blind searches

    def follow(self, task: Task, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield a frame for each observation, as a task asks."""
        return drive(self.build(task), task, observations, rng, self.audit)

    def dimensions(self, task: Task) -> int | None:
        """Return how many coordinates a proposal has; None of a tracker of its own, which need not have any."""
        if self.prior is None:
            return None
        return 3 + 3 * (task.translation == "searched") + len(self.prior.low)


def prepare(options: TrackOptions, task: Task) -> Method:
    """Return the method of some options, its prior learned from a task's training motions.

    Raises InputError where a name, a setting or the budget is wrong, ImportError where a library is not installed, and
    BrokenRuleError where a plugin does not do what its kind has to.
    """
    chosen = options.method
    if isinstance(chosen, tuple):
        optimiser, given_prior = _offered("optimiser", chosen[0]), chosen[1]
    else:
        names = None if callable(chosen) else method_names(chosen)
        if names is None or names.tracker is not None:
            return _tracker_method(_offered("tracker", chosen), options.settings)
        optimiser, given_prior = _offered("optimiser", names.optimiser), names.prior
    prior = registry().offer("prior", given_prior) if isinstance(given_prior, str) else None
    plugin_settings = parsed_settings([optimiser] if prior is None else [optimiser, prior], options.settings)
    plugin_settings.setdefault("prior", {})
    planned = settings.planned(optimiser.factory, plugin_settings["optimiser"], task.evaluations)
    plugin_settings["optimiser"] = settings.check(optimiser.name, optimiser.factory, planned)
    if prior is not None:
        with _rules(prior):
            learned = prior.factory(**plugin_settings["prior"]).fit(task.angles, task.body.skeleton)
            _check_prior(learned, task.angles, prior)
        learned, name = CheckedPrior(learned, prior.label), prior.name
    else:
        learned, name = given_prior, type(given_prior).__name__
    # what a prior that came learned has learned from is unknown: its tilt is not that of other motions
    prediction = Prediction(**{**({} if prior is not None else {"tilt": "box"}), **plugin_settings["tracker"]})
    tilt = prediction.tilted(learned, task.training)

    def build(task: Task) -> Tracker:
        def optimiser_of(space: Space, rng: np.random.Generator) -> Optimiser:
            with _rules(optimiser):
                made = optimiser.factory(space, rng, **plugin_settings["optimiser"])
            return CheckedOptimiser(made, space, optimiser.label, task.evaluations)

        return SynthesisTracker(task, learned, optimiser_of, optimiser.next_frame, prediction, tilt)

    label = f"{optimiser.name}@{name}"
    audit = Audit(label, prediction.beta)
    start = start_of(prediction.start)
    return Method(label, learned, plugin_settings, False, prediction.relocalise_gap, audit, build, start)


def start_of(name: str | None = None) -> InitialiserFactory | None:
    """Return what guesses first poses, by its name; the default one where it is installed; None for "blind"."""
    if name == BLIND or (name is None and DEFAULT_START not in registry().offers["start"]):
        return None
    factory: InitialiserFactory = registry().offer("start", name or DEFAULT_START).factory
    return factory


def places_of(offers: Sequence[Offer]) -> dict[str, tuple[str, Callable[..., Any]]]:
    """Return the kind and the factory of each name that settings of a method begin with, by the plugins it names."""
    places: dict[str, tuple[str, Callable[..., Any]]] = {
        offer.name.partition(":")[0]: (offer.kind, offer.factory) for offer in offers
    }
    return places if offers[0].kind == "tracker" else places | {"tracker": ("tracker", Prediction)}


def parsed_settings(offers: Sequence[Offer], given: Mapping[str, Any] | Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return settings by the kind of plugin that they are of.

    They are given by names such as `sapso.cooling`, or as texts such as `sapso.cooling=0.9`; the plugin's name may be
    left out where it alone has such a setting. Raises InputError where a text has another form, names a plugin that is
    not among `offers` or a setting that it does not know, or where a value does not fit.
    """
    places = places_of(offers)
    each: dict[str, dict[str, Any]] = {name: {} for name in places}
    for item in given:
        left, equals, value = (item, "=", given[item]) if isinstance(given, Mapping) else item.partition("=")
        name, dot, setting = left.partition(".")
        if not dot:  # the name may be left out where one plugin alone has the setting
            offered = [f"{name}.{each}" for name, (_, factory) in places.items() for each in settings.names(factory)]
            having = [each.partition(".")[0] for each in offered if each.partition(".")[2] == left]
            if equals and len(having) != 1:
                raise InputError(f"a setting must be one of {', '.join(offered)}, got {quoted(left)}")
            name, setting = (having or [""])[0], left
        if not (equals and setting):
            raise InputError(f"a setting must be NAME.SETTING=VALUE such as sapso.cooling=0.9, got {quoted(item)}")
        if name not in places:
            known = ", ".join(places)
            raise InputError(f"a setting must name one of {known}, which are in use here, got {quoted(item)}")
        if setting in each[name]:
            raise InputError(f"a setting must be given once, got {quoted(left)} twice")
        each[name][setting] = value
    for name, (_, factory) in places.items():
        if isinstance(given, Mapping):
            each[name] = settings.check(name, factory, each[name])
        else:
            each[name] = settings.parse(name, factory, each[name])
    return {kind: each[name] for name, (kind, _) in places.items()}


def _tracker_method(offer: Offer, given: Mapping[str, Any] | Sequence[str]) -> Method:
    plugin_settings = parsed_settings([offer], given)["tracker"]
    defaults = {setting.name: setting.default for setting in offer.settings}
    beta = {"beta": BETA, **defaults, **plugin_settings}["beta"]  # of the costs that it gives
    beta = float(beta) if isinstance(beta, float | int) else BETA

    def build(task: Task) -> Tracker:
        with _rules(offer):
            tracker: Tracker = offer.factory(task, **plugin_settings)
        return tracker

    gap = 0 if offer.looks_ahead else None
    audit = Audit(offer.label, beta)
    return Method(offer.name, None, {"tracker": plugin_settings}, offer.looks_ahead, gap, audit, build, start_of())


def _check_prior(prior: Prior, training: Array, offer: Offer) -> None:
    """Return nothing. Raises BrokenRuleError where a prior's range, shapes or numbers are wrong."""

    def broken(rule: str) -> BrokenRuleError:
        return BrokenRuleError(f"{offer.label}: {rule}")

    low, high = np.asarray(prior.low), np.asarray(prior.high)
    if low.ndim != 1 or low.shape != high.shape or not (np.isfinite(low).all() and np.isfinite(high).all()):
        raise broken(f"low and high must be finite and of shape (m,), got {low.shape}, {high.shape}")
    for k in np.flatnonzero(low > high):
        raise broken(f"low must not be above high, got {low[k]:g} and {high[k]:g} of latent {k}")
    angles = training[:3]
    latents = np.asarray(prior.transform(angles))
    back, feasible = prior.inverse_transform(latents), prior.feasible(latents)
    for name, value, shape in (
        ("transform", latents, (len(angles), len(low))),
        ("inverse_transform", back, angles.shape),
        ("feasible", feasible, (len(angles),)),
    ):
        if np.shape(value) != shape:
            raise broken(f"{name} must return shape {shape}, got {np.shape(value)}")
        if not np.isfinite(value).all():
            raise broken(f"{name} must return finite numbers, got some that are not")
    sample = training[np.unique(np.linspace(0, len(training) - 1, FEASIBILITY_SAMPLES).astype(np.int64))]
    drawn = np.random.default_rng(0).uniform(low, high, (FEASIBILITY_SAMPLES, len(low)))
    if not (np.any(feasible) or any(np.any(prior.feasible(some)) for some in (prior.transform(sample), drawn))):
        came = f"none of {len(sample)} training poses and {FEASIBILITY_SAMPLES} of the range"
        raise broken(f"feasible must allow some poses, got {came}")


def _rules(offer: Offer) -> AbstractContextManager[None]:
    """Return a context that passes ValueErrors on, and blames the plugin for whatever else it raises."""
    return plugin_errors(offer.label, "it", passed=(ValueError, ImportError))


def _offered(kind: Kind, chosen: "str | Callable[..., Any] | None") -> Offer:
    assert chosen is not None
    if isinstance(chosen, str):
        return registry().offer(kind, chosen)
    frames: NextFrame = "carry" if hasattr(chosen, "advance") else "start"
    looks_ahead = bool(getattr(chosen, "looks_ahead", False))
    name = getattr(chosen, "__name__", type(chosen).__name__)
    return Offer(kind, name, chosen, "the caller", "", frames, looks_ahead)
