"""Groups of models, and which are in force, cycle by cycle: the variable structure. VSMM steps 4, 5 and 7 to 9.

The field calls this model-set adaptation. A TOML file (Interpretation V1) holds `stay`, a table `groups` of names and
their models, and a table `neighbours` of models and those that they change into. It may hold a table `activities` of
names and their models: the labels of frames. Groups are numbered as in their file: the rules speak of the first, the
second and the third.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Literal, final

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.check import one_of
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import Skeleton
from posefit.reading import parsed_toml, quoted, read_text
from posefit_vsmm.imm import IMM, PLACED, Belief, Measurement, start
from posefit_vsmm.motion import CLIP_FPS, Library, VectorModel, inverse_tangent, lifted, unit
from posefit_vsmm.settings import HipAngle, Settings
from posefit_vsmm.state import AT

SIZE_LIMIT = 100_000  # bytes
TABLES = ("groups", "neighbours", "activities")


@dataclass(frozen=True)
class Topology:
    """Groups of models, in the order in which they are numbered, and the neighbours of each model.

    The field calls them model sets, and the neighbours a digraph of models.
    """

    groups: Mapping[str, tuple[str, ...]]
    neighbours: Mapping[str, tuple[str, ...]]
    activities: Mapping[str, tuple[str, ...]]  # each model is in one at least
    stay: float

    def transition(self, models: Sequence[str]) -> Array:
        """Return how probable each of some models (r, r) is after each: `stay`, the rest among its neighbours there.

        It is the transition matrix of a Markov chain; each row sums to 1.
        A model without a neighbour there may change into any, as a group of its own can only be left that way.
        """
        matrix = np.zeros((len(models), len(models)))
        for i, name in enumerate(models):
            others = [j for j, other in enumerate(models) if other in self.neighbours[name] and j != i]
            others = others or [j for j in range(len(models)) if j != i]
            matrix[i, others] = (1.0 - self.stay) / max(1, len(others))
            matrix[i, i] = self.stay if others else 1.0
        return matrix

    def union(self, names: Collection[str]) -> tuple[str, ...]:
        """Return the models of some groups, each once, in the order of the groups."""
        return tuple(dict.fromkeys(model for name, mine in self.groups.items() if name in names for model in mine))


def most_probable(sets: Mapping[str, Sequence[str]], models: Sequence[str], probabilities: Array) -> str:
    """Return the name of the set, a group or an activity, whose models are the most probable together. VSMM step 5."""
    known = dict(zip(models, probabilities, strict=True))
    return max(sets, key=lambda name: sum(known.get(model, 0.0) for model in sets[name]))


def read_topology(path: str | Path | None, known: Collection[str]) -> Topology:
    """Return the topology of a TOML file, or the one that the package carries.

    Raises ValueError naming the file where it is not what it should be, or names a model that is not known.
    """
    label = "groups.toml" if path is None else str(path)
    try:
        text = (files("posefit_vsmm") / label).read_text("utf-8") if path is None else read_text(path, SIZE_LIMIT)
        values = parsed_toml(text)
    except FileNotFoundError:
        raise InputError(f"{label}: expected a file of groups, got none") from None
    except ValueError as error:
        raise InputError(f"{label}: expected TOML with stay, groups and neighbours, got {error}") from None
    values = {"activities": {}, **values}
    if set(values) != {"stay", *TABLES}:
        raise InputError(f"{label}: expected stay, groups and neighbours, got {sorted(values)}")
    stay = values["stay"]
    if not isinstance(stay, float) or not 0.0 < stay < 1.0:
        raise InputError(f"{label}: stay must be a number between 0 and 1, got {quoted(stay)}")
    for key in TABLES:
        if not isinstance(values[key], dict) or not all(isinstance(models, list) for models in values[key].values()):
            raise InputError(f"{label}: {key} must be a table of lists of models, got {quoted(values[key])}")
    groups, neighbours, activities = (
        {name: tuple(dict.fromkeys(models)) for name, models in values[key].items()} for key in TABLES
    )
    if not groups or not all(groups.values()):
        raise InputError(f"{label}: groups must hold at least one group of at least one model, got {values['groups']}")
    used = {model for models in groups.values() for model in models} | set(neighbours)
    for model in used.union(*neighbours.values(), *activities.values()):
        one_of(f"{label}: a model", model, known)
    alone = {model: (model,) for model in known if not any(model in models for models in activities.values())}
    return Topology(
        groups, {model: neighbours.get(model, ()) for model in used}, {**activities, **alone}, stay
    )  # VSMM 4


_LIMBS = np.array(
    [
        [AT[f"{side} {upper}"], AT[f"{side} {lower}"]]
        for upper, lower in (("hip", "knee"), ("knee", "foot"))
        for side in ("left", "right")
    ]
)  # thighs, then shanks
TWICE, HALF = 2.0, 0.5
FIRST = 10  # cycles over all models before a group is chosen
RECENT = 5  # frames: where the median of their surprise is larger than SURPRISED, the group is chosen again
SURPRISED = 1.2  # of the normalised innovation squared a coordinate, which is 1 on average where a filter is consistent

Measure = Callable[[Array], Measurement]


def requested_group(points: Sequence[Array], how: Settings) -> int | None:
    """Return which group, 0 to 2, the latest points (17, 2) in the image ask for; None where it is no other.

    Changes of angles are means over `smoothing` frames; those below `floor_degrees`, and none at all, count as none.
    Interpretation V10. The hips of rule a are both of them. Interpretation V15.
    """
    if len(points) < 2 * how.smoothing + 1:
        return None
    angles = np.array([limb_angles(frame, how.hip_angle) for frame in points[-2 * how.smoothing - 1 :]])
    changes = np.degrees(np.abs(wrapped(np.diff(angles, axis=0))))
    before, now = changes[: how.smoothing].mean(axis=0), changes[how.smoothing :].mean(axis=0)
    moves, moved = ((change >= how.floor_degrees) & (change > 0.0) for change in (now, before))
    grown, shrunk = (now >= TWICE * before) & moves, (now <= HALF * before) & moved
    hips, limbs = slice(4, 6), slice(0, 4)
    if grown[hips].all():  # VSMM 7a
        return 2
    if grown[limbs].sum() >= how.most:  # VSMM 7b
        return 1
    if shrunk[limbs].sum() >= how.most:  # VSMM 7c
        return 0
    return None


def limb_angles(points: Array, hip_angle: HipAngle = "vertical") -> Array:
    """Return the angles (6,) in the image of thighs and shanks, left and right, and of the hips. Interpretation V15.

    A hip's is that of its thigh to the trunk, or to the vertical.
    """
    ways = points[_LIMBS[:, 1]] - points[_LIMBS[:, 0]]
    trunk = points[AT["root"]] - points[AT["torso"]]
    angles = np.arctan2(ways[:, 0], ways[:, 1])
    return np.concatenate([angles, angles[:2] - (np.arctan2(trunk[0], trunk[1]) if hip_angle == "trunk" else 0.0)])


def regrouped(
    belief: Belief, old: Sequence[str], models: Sequence[str], new: Mapping[str, tuple[Array, Array, float]]
) -> Belief:
    """Return a belief over other models: `new` has state, covariance and log-probability of those not in `old`."""
    places = {name: k for k, name in enumerate(old)}
    parts = [
        (belief.states[places[name]], belief.covariances[places[name]], belief.log_probabilities[places[name]])
        if name in places
        else new[name]
        for name in models
    ]
    states, covariances, probabilities = (np.array(part) for part in zip(*parts, strict=True))
    return Belief(states, covariances, probabilities, np.zeros(len(models)), belief.repairs)


def normalised(belief: Belief) -> Belief:
    """Return a belief whose probabilities sum to 1, all the same where none is above 0."""
    probabilities = belief.log_probabilities
    total = np.logaddexp.reduce(probabilities)
    even = np.full(len(probabilities), -np.log(len(probabilities)))
    return replace(belief, log_probabilities=probabilities - total if np.isfinite(total) else even)


@final
class Rivalry:
    """An old group of models against a new one, as far as it has come, until one of them has to go. VSMM step 9.

    The test is Wald's sequential probability ratio test with error rates `false_alarm`, his alpha, and `miss`, his
    beta, or the patent's. Both look at the likelihoods since the new group came. Interpretation V12.
    """

    def __init__(self, how: Settings, *, old: Sequence[str], new: Sequence[str]) -> None:
        self._how, self._old, self._new = how, old, new
        self._evidence = 0.0  # log of the likelihood ratio, new to old
        self._frames = 0

    def decide(self, belief: Belief, models: Sequence[str]) -> Literal["old", "new"] | None:
        """Return which group stays, after a cycle over both; None while both do."""
        how = self._how
        old, new = ([models.index(name) for name in group] for group in (self._old, self._new))

        def ratio(logarithms: Array) -> float:
            return float(np.logaddexp.reduce(logarithms[new]) - np.logaddexp.reduce(logarithms[old]))

        after = belief.log_probabilities
        odds = ratio(after)
        self._frames += 1
        if how.test == "patent":
            self._evidence += ratio(belief.log_likelihoods)  # VSMM 9
            if min(odds, self._evidence) < np.log(0.9):
                return "old"
            return "new" if min(odds, self._evidence) > 0.0 else None
        self._evidence += odds - ratio(after - belief.log_likelihoods)
        if self._evidence >= np.log((1.0 - how.miss) / how.false_alarm):
            return "new"
        if self._evidence <= np.log(how.miss / (1.0 - how.false_alarm)):
            return "old"
        if self._frames >= how.longest:
            return "new" if odds > 0.0 else "old"
        return None


@final
class Models:
    """The models in force; at first all of them."""

    def __init__(self, how: Settings, library: Library, topology: Topology, skeleton: Skeleton, fps: float) -> None:
        self._how, self.topology, self.groups = how, topology, topology.groups
        self.every = topology.union(topology.groups)
        fps = fps if how.clip_rate == "video" else CLIP_FPS  # Interpretation V6
        fitted = {name: library.models[name].fitted_to(skeleton, fps) for name in self.every}
        self.known = {name: replace(one, noise=how.process_noise * one.noise) for name, one in fitted.items()}
        self._vector = how.quaternions == "vector"  # Interpretation V4
        self._made = lru_cache(self._make)
        self.restarts = 0  # because the models in force did not explain the measurements (Interpretation V14)
        self.restart()

    def restart(self) -> None:
        """Bring all models into force; a group will be chosen among them."""
        self.active = self.every
        self.group: str | None = None
        self.newcomer: str | None = None
        self._rivalry: Rivalry | None = None  # of the group and the newcomer
        self._cycles = self._rested = 0
        self._drawn: list[Array] = []
        self._surprises: list[float] = []

    def _make(self, names: tuple[str, ...]) -> IMM:
        models, transition = [self.known[name] for name in names], self.topology.transition(names)
        return (
            IMM([VectorModel(model) for model in models], transition)
            if self._vector
            else IMM(models, transition, PLACED)
        )

    def start(self, state: Array, covariance: Array) -> Belief:
        """Return the belief in one state (43,) with a covariance (33, 33)."""
        return start(state, lifted(state, covariance) if self._vector else covariance, len(self.active))

    def fused(self, belief: Belief) -> tuple[Array, Array]:
        """Return the one state (43,), and the covariance (33, 33) of its error, that stand for all models."""
        state, covariance = self.imm.fused(belief)
        if not self._vector:
            return state, covariance
        state = unit(state)
        return state, inverse_tangent(state) @ covariance @ inverse_tangent(state).T

    def widened(self, belief: Belief, variances: Array) -> Belief:
        """Return a belief whose errors have larger variances, by (33,)."""
        extra = np.diag(variances)
        more = np.array([lifted(unit(state), extra) for state in belief.states]) if self._vector else extra
        return replace(belief, covariances=belief.covariances + more)

    @property
    def imm(self) -> IMM:
        """The filter over the models in force."""
        return self._made(self.active)

    def cycle(self, before: Belief, measure: Measure, surprise: float) -> Belief:
        """Return the belief one frame later. Groups come and go by the points recorded; `surprise` is of the frame."""
        if self._vector:
            measure = _of_numbers(measure)
        after = self.imm.cycle(before, measure)
        self._surprises = [*self._surprises, surprise][-RECENT:]
        if self._how.structure == "all":
            self.group = most_probable(self.groups, self.active, after.probabilities)
            return after
        self._cycles += 1
        if self.group is None:
            if self._cycles < FIRST:
                return after
            return self._keep(most_probable(self.groups, self.active, after.probabilities), after)  # VSMM 5
        if self.newcomer is not None:
            return self._judged(after)
        self._rested += 1
        if self._rested <= self._how.dwell:
            return after
        if self._how.restart and np.median(self._surprises) > SURPRISED:
            old = self.active
            self.restart()
            self.restarts += 1
            return self._rerun(before, old, self._made(old), measure)
        return self._activated(before, after, measure)

    def _judged(self, after: Belief) -> Belief:
        """Return the belief after a cycle over both groups: of one of them as soon as the other has to go."""
        assert self._rivalry is not None
        assert self.newcomer is not None
        assert self.group is not None
        decision = self._rivalry.decide(after, self.active)
        return after if decision is None else self._keep(self.newcomer if decision == "new" else self.group, after)

    def record(self, points: Array) -> None:
        """Take where the points (17, 2) of a frame are, for the rules of step 7."""
        self._drawn = [*self._drawn, points][-2 * self._how.smoothing - 1 :]

    def _rerun(self, before: Belief, old: Sequence[str], imm: IMM, measure: Measure) -> Belief:
        """Repeat the latest cycle with the models now in force; new ones had probability 0. Interpretation V11."""
        fused = imm.fused(before)
        return self.imm.cycle(
            regrouped(before, old, self.active, dict.fromkeys(self.active, (*fused, -np.inf))), measure
        )

    def _activated(self, before: Belief, after: Belief, measure: Measure) -> Belief:
        """Bring the group that the rules ask for into force beside the present one, if they ask for one."""
        names = tuple(self.topology.groups)
        number = requested_group(self._drawn, self._how)
        if self.group is None or number is None or number >= len(names) or names[number] == self.group:
            return after
        old, imm = self.active, self.imm
        if self._how.new == "rerun":
            self._bring_in(names[number])
            return self._rerun(before, old, imm, measure)
        joined = self.joined(before, names[number])
        return self._judged(self.imm.cycle(joined, measure))  # run again, and judged

    def joined(self, belief: Belief, newcomer: str) -> Belief:
        """Return a belief with another group's models beside those in force, as the patent starts them. VSMM 8."""
        old, (state, _) = self.active, self.imm.fused(belief)
        self._bring_in(newcomer)
        top = belief.log_probabilities.max()  # VSMM 8.1
        new = {}
        for name in set(self.active) - set(old):
            pose = self.known[name].nearest(state, self._how.poses)  # VSMM 8.3
            noise = self.known[name].noise  # VSMM 8.2
            new[name] = pose, lifted(pose, noise) if self._vector else noise, top
        return normalised(regrouped(belief, old, self.active, new))

    def _bring_in(self, newcomer: str) -> None:
        """Bring another group into force beside the present one."""
        assert self.group is not None
        groups = self.topology.groups
        self.newcomer, self.active = newcomer, self.topology.union((self.group, newcomer))  # VSMM 8.4
        self._rivalry = Rivalry(self._how, old=groups[self.group], new=groups[newcomer])

    def _keep(self, group: str, belief: Belief) -> Belief:
        models = tuple(self.topology.groups[group])
        kept = normalised(regrouped(belief, self.active, models, {}))
        self.active, self.group, self.newcomer, self._rested = models, group, None, 0
        self._rivalry = None
        return kept


def _of_numbers(measure: Measure) -> Measure:
    """Return a measurement whose Jacobian is by the state's numbers (43,)."""

    def measured(state: Array) -> Measurement:
        measurement = measure(unit(state))
        return replace(measurement, jacobian=measurement.jacobian @ inverse_tangent(unit(state)))

    return measured
