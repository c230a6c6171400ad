"""A method, by names: an optimiser and a prior, or a tracker; with its settings checked and its plugins watched.

`usual` says which one is used, and what it learns from, where nobody does.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from posefit import settings
from posefit.arrays import Array
from posefit.fitting.box import Space
from posefit.fitting.guard import Audit, BrokenRuleError, Guarded, GuardedPrior, GuardedTracker, blamed
from posefit.fitting.optimiser import NextFrame, Optimiser, OptimiserFactory
from posefit.fitting.prior import Prior
from posefit.fitting.tracker import (
    Prediction,
    SynthesisTracker,
    Task,
    Tracker,
    TrackerFactory,
)
from posefit.footage.source import Source, kind_of
from posefit.motion import built_in, recorded
from posefit.registry import Kind, Offer, registry
from posefit.searching.tracker import WeighingTracker
from posefit.silhouette.cost import BETA

FOLLOWER = "exemplars"  # the tracker of footage, where nobody names another method and it is installed
ITERATIONS = 60  # C of the SAPSO paper, section 5.2
SOME = 1000  # poses of which one at least has to be feasible in a prior

Settings = Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Choice:
    """What a user chose: names or factories, their settings, and the budget."""

    optimiser: str | OptimiserFactory = "sapso"
    prior: str | Prior = "pca"
    tracker: str | TrackerFactory | None = None
    optimiser_settings: Settings = field(default_factory=dict)
    prior_settings: Settings = field(default_factory=dict)
    tracker_settings: Settings = field(default_factory=dict)
    particles: int | None = None
    iterations: int | None = None
    evaluations: int | None = None
    ask_seconds: float | None = None

    def budget(self) -> int:
        """Return how many evaluations a frame may have: N (C + 1) where nothing else is said.

        Raises ValueError where a number makes no sense, or two of them contradict each other.
        """
        for name in ("particles", "iterations", "evaluations"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ValueError(f"{name} must be at least 1, got {value}")
        if self.ask_seconds is not None and not self.ask_seconds > 0.0:
            raise ValueError(f"ask_seconds must be above 0, got {self.ask_seconds}")
        if self.evaluations is not None and self.iterations is not None:
            raise ValueError("evaluations and iterations must not both be given: a budget has so many iterations")
        return self.evaluations or (self.particles or settings.POPULATION_SIZE) * ((self.iterations or ITERATIONS) + 1)


@dataclass(frozen=True, eq=False)
class Usual:
    """What a source is followed with, and what that learns from."""

    method: dict[str, Any]  # a tracker, or an optimiser and a prior, as `Choice` takes them
    train: Sequence[Source]


def usual(
    source: Source,
    *,
    optimiser: str | OptimiserFactory | None = None,
    prior: str | Prior | None = None,
    tracker: str | TrackerFactory | None = None,
    train: Sequence[Source] = (),
    searched: bool = False,
) -> Usual:
    """Return what a source is followed with; what a user has not said is as follows.

    A motion is followed by `sapso` with `pca`, which learns from the other styles of a built-in motion, or else from
    the built-in walks. Footage, whose truth nobody knows, is followed by the tracker `exemplars`, which learns from the
    library of recorded motions; where an optimiser, a prior or settings of theirs (`searched`) are given, by `sapso`
    with `loose`. Other trackers than `exemplars`, too, learn from the built-in walks, as they have to be told what kind
    of motion it is. Raises ValueError for a tracker beside an optimiser or a prior.
    """
    for name, value in (("optimiser", optimiser), ("prior", prior)):
        if tracker is not None and value is not None:
            raise ValueError(f"{name} must not be given beside a tracker, got {value} and {tracker}")
    footage = kind_of(source) != "motion"
    if footage and tracker is None and optimiser is None and prior is None and not searched:
        tracker = FOLLOWER if FOLLOWER in registry().offers["tracker"] else None
    method: dict[str, Any] = {"tracker": tracker}
    if tracker is None:
        method = {"optimiser": optimiser or "sapso", "prior": prior or ("loose" if footage else "pca")}
    if not train and footage and tracker == FOLLOWER:
        train = [recorded.LIBRARY]
    return Usual(method, train or built_in.other_styles(str(source) if source in built_in.names() else "walk"))


@dataclass(frozen=True, eq=False)
class Method:
    """What was chosen, ready to follow: a prior has been learned, and trackers are made of it."""

    name: str
    prior: Prior | None  # of a tracker of its own, None
    beta: float  # of the silhouette cost
    settings: dict[str, dict[str, Any]]
    audit: Audit  # of what the trackers made of it say
    look_again: int | None  # frames of a gap after which it looks all around, 0 for never; None where nobody says
    _make: Callable[[Task, float], Tracker] = field(repr=False)

    def tracker(self, task: Task, patience: float = 0.0) -> Tracker:
        """Return a tracker for a task, whose plugin may take so many seconds longer to propose a population."""
        return self._make(task, patience)

    def dimensions(self, task: Task) -> int | None:
        """Return how many coordinates a proposal has; None of a tracker of its own, which need not have any."""
        if self.prior is None:
            return None
        return 3 + 3 * (task.translation == "searched") + len(self.prior.low)


def prepare(choice: Choice, task: Task) -> Method:
    """Return the method that was chosen, its prior learned from a task's training motions.

    Raises ValueError where a name, a setting or the budget is wrong, ImportError where a library is not installed, and
    BrokenRuleError where a plugin does not do what its kind has to.
    """
    if choice.tracker is not None:
        return _tracker(choice)
    offer = _offered("optimiser", choice.optimiser)
    mine = settings.planned(offer.factory, choice.optimiser_settings, task.evaluations, choice.particles)
    settings.check(offer.name, offer.factory, mine)
    settings.check("tracker", Prediction, choice.tracker_settings)
    prior, learned = _prior(choice, task)
    # what a prior that came learned has learned from, nobody says: its tilt is not that of other motions
    usual: dict[str, Any] = {} if isinstance(choice.prior, str) else {"tilt": "box"}
    prediction = Prediction(**{**usual, **choice.tracker_settings})
    tilt = prediction.tilted(learned, task.training)

    def make(task: Task, patience: float) -> Tracker:
        limit = None if choice.ask_seconds is None else choice.ask_seconds + patience
        build = partial(_guarded, offer, mine, limit, task.evaluations)
        tracker = SynthesisTracker(task, learned, build, offer.next_frame, prediction, tilt)
        return WeighingTracker(tracker) if prediction.modes else tracker

    made_of = {"optimiser": mine, "prior": dict(choice.prior_settings), "tracker": dict(choice.tracker_settings)}
    return Method(f"{offer.name} + {prior}", learned, prediction.beta, made_of, Audit(), prediction.look_again, make)


def parse_settings(
    texts: Sequence[str],
    optimiser: str = "sapso",
    prior: str = "pca",
    tracker: str | None = None,
    segmenter: str | None = None,
) -> dict[str, dict[str, Any]]:
    """Return the settings of optimiser, prior, tracker and segmenter that texts such as `sapso.cooling=0.9` give.

    The name before the dot is the plugin's, or its family's for `family:NAME`; `tracker` stands for what drives an
    optimiser and a prior. Raises ValueError where a text has another form, names a plugin that is not in use, or a
    setting that it does not know, or where a value does not fit.
    """
    places: dict[str, tuple[str, Callable[..., Any]]] = {}
    if tracker is None:
        chosen: list[tuple[Kind, str]] = [("optimiser", optimiser), ("prior", prior)]
        places["tracker"] = "tracker", Prediction
    else:
        chosen = [("tracker", tracker)]
    if segmenter is not None:
        chosen.append(("segmenter", segmenter))
    for one, name in chosen:
        places[name.partition(":")[0]] = one, registry().offer(one, name).factory
    given: dict[str, dict[str, str]] = {name: {} for name in places}
    for text in texts:
        left, equals, value = text.partition("=")
        name, dot, setting = left.partition(".")
        if not (equals and dot):
            raise ValueError(f"--set must be NAME.SETTING=VALUE such as sapso.cooling=0.9, got {text!r}")
        if name not in places:
            raise ValueError(f"--set must name one of {', '.join(places)}, which are in use here, got {text!r}")
        given[name][setting] = value
    parsed: dict[str, dict[str, Any]] = {}
    for name, (kind, factory) in places.items():
        parsed[f"{kind}_settings"] = settings.parse(name, factory, given[name])
    return parsed


def _tracker(choice: Choice) -> Method:
    assert choice.tracker is not None
    offer, mine = _offered("tracker", choice.tracker), dict(choice.tracker_settings)
    settings.check(offer.name, offer.factory, mine)
    audit, beta = Audit(), _beta(offer, mine)

    def make(task: Task, _patience: float) -> Tracker:
        with _rules(offer):
            tracker = offer.factory(task, **mine)
        return GuardedTracker(tracker, task, offer.label, beta, audit)

    return Method(offer.name, None, beta, {"tracker": mine}, audit, None, make)


def _beta(offer: Offer, given: Settings) -> float:
    """Return the beta of the costs that a tracker gives: its setting of that name, if it has one."""
    usual = {setting.name: setting.default for setting in offer.settings}.get("beta", BETA)
    beta = given.get("beta", usual)
    return float(beta) if isinstance(beta, float | int) else BETA


def _prior(choice: Choice, task: Task) -> tuple[str, Prior]:
    """Return the prior's name, and the prior itself, fitted."""
    if not isinstance(choice.prior, str):
        return type(choice.prior).__name__, choice.prior
    offer = registry().offer("prior", choice.prior)
    settings.check(offer.name, offer.factory, choice.prior_settings)
    angles = task.angles
    with _rules(offer):
        prior: Prior = offer.factory(**choice.prior_settings).fit(angles, task.body.skeleton)
        _check_prior(prior, angles, offer)
    return offer.name, GuardedPrior(prior, offer.label)


def _check_prior(prior: Prior, training: Array, offer: Offer) -> None:
    low, high = np.asarray(prior.low), np.asarray(prior.high)
    if low.ndim != 1 or low.shape != high.shape or not (np.isfinite(low).all() and np.isfinite(high).all()):
        raise BrokenRuleError(
            f"{offer.label}: low and high must be finite and of shape (m,), got {low.shape}, {high.shape}"
        )
    if (low > high).any():
        k = int((low > high).argmax())
        raise BrokenRuleError(
            f"{offer.label}: low must not be above high, got {low[k]:g} and {high[k]:g} of latent {k}"
        )
    angles = training[:3]
    latents = np.asarray(prior.transform(angles))
    back, feasible = prior.inverse_transform(latents), prior.feasible(latents)
    for name, value, shape in (
        ("transform", latents, (len(angles), len(low))),
        ("inverse_transform", back, angles.shape),
        ("feasible", feasible, (len(angles),)),
    ):
        if np.shape(value) != shape:
            raise BrokenRuleError(f"{offer.label}: {name} must return shape {shape}, got {np.shape(value)}")
        if not np.isfinite(value).all():
            raise BrokenRuleError(f"{offer.label}: {name} must return finite numbers, got some that are not")
    if not np.any(feasible):
        _check_feasible(prior, training, offer)


def _check_feasible(prior: Prior, training: Array, offer: Offer) -> None:
    """Look farther for something feasible, as a search would, which cannot say whose prior it is."""
    some = training[np.unique(np.linspace(0, len(training) - 1, SOME).astype(np.int64))]
    drawn = np.random.default_rng(0).uniform(prior.low, prior.high, (SOME, len(prior.low)))
    for latents in (np.asarray(prior.transform(some)), drawn):
        if np.any(prior.feasible(latents)):
            return
    raise BrokenRuleError(
        f"{offer.label}: feasible must allow some poses, got none of {len(some)} training poses and {SOME} of the range"
    )


def _guarded(
    offer: Offer, mine: Settings, limit: float | None, evaluations: int, space: Space, rng: np.random.Generator
) -> Optimiser:
    with _rules(offer):
        optimiser = offer.factory(space, rng, **mine)
    return Guarded(optimiser, space, offer.label, limit, evaluations)


def _rules(offer: Offer) -> AbstractContextManager[None]:
    """Pass on what a user did wrong; whatever else a plugin raises is the plugin's fault, and the error says so."""
    return blamed(offer.label, "it", passed=(ValueError, ImportError))


def _offered(kind: Kind, chosen: str | Callable[..., Any]) -> Offer:
    if isinstance(chosen, str):
        return registry().offer(kind, chosen)
    frames: NextFrame = "carry" if hasattr(chosen, "advance") else "start"
    return Offer(kind, getattr(chosen, "__name__", type(chosen).__name__), chosen, "the caller", "", frames)
