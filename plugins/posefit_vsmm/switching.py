"""Which groups of models are in force, cycle by cycle: the variable structure. VSMM steps 5 and 7 to 9.

The field calls this model-set adaptation. Groups are numbered as in their file: the rules speak of the first, the
second and the third.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, final, get_args

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import Skeleton
from posefit_vsmm.groups import Topology
from posefit_vsmm.imm import IMM, PLACED, Belief, Measurement
from posefit_vsmm.motion import Library
from posefit_vsmm.state import AT

_LIMBS = np.array(
    [
        [AT[f"{side} {upper}"], AT[f"{side} {lower}"]]
        for upper, lower in (("hip", "knee"), ("knee", "foot"))
        for side in ("left", "right")
    ]
)  # thighs, then shanks
_TRUNK = np.array([AT["root"], AT["torso"]])
TWICE, HALF = 2.0, 0.5
MOST = 3  # of four limbs
HIPS = 1  # of two

New = Literal["rerun", "patent"]
Test = Literal["sequential", "patent"]


@dataclass(frozen=True, kw_only=True)
class Rules:
    """Step 7. Interpretation V10: `smoothing` frames a mean, changes below `floor_degrees` a frame, and `dwell` frames.

    The patent's own form has smoothing 1, floor 0 and dwell 0.
    """

    smoothing: int = 4
    floor_degrees: float = 2.0
    dwell: int = 10

    def __post_init__(self) -> None:
        if self.smoothing < 1:
            raise InputError(f"smoothing must be at least 1, got {self.smoothing}")
        if not self.floor_degrees >= 0.0:
            raise InputError(f"floor_degrees must be 0 or more, got {self.floor_degrees}")
        if self.dwell < 0:
            raise InputError(f"dwell must be 0 or more, got {self.dwell}")

    def requested_group(self, points: Sequence[Array]) -> int | None:
        """Return which group, 0 to 2, the latest projected points (17, 2) ask for; None where it is no other."""
        if len(points) < 2 * self.smoothing + 1:
            return None
        angles = np.array([limb_angles(frame) for frame in points[-2 * self.smoothing - 1 :]])
        changes = np.degrees(np.abs(wrapped(np.diff(angles, axis=0))))
        before, now = changes[: self.smoothing].mean(axis=0), changes[self.smoothing :].mean(axis=0)
        moves, moved = now >= self.floor_degrees, before >= self.floor_degrees
        grown, shrunk = (now >= TWICE * before) & moves, (now <= HALF * before) & moved
        hips, limbs = slice(4, 6), slice(0, 4)
        if grown[hips].sum() >= HIPS:  # VSMM 7a
            return 2
        if grown[limbs].sum() >= MOST:  # VSMM 7b
            return 1
        if shrunk[limbs].sum() >= MOST:  # VSMM 7c
            return 0
        return None


def limb_angles(points: Array) -> Array:
    """Return the angles (6,) in the image of thighs and shanks, left and right, and of the thighs to the trunk."""
    ways = points[_LIMBS[:, 1]] - points[_LIMBS[:, 0]]
    trunk = points[_TRUNK[0]] - points[_TRUNK[1]]
    angles = np.arctan2(ways[:, 0], ways[:, 1])
    return np.concatenate([angles, angles[:2] - np.arctan2(trunk[0], trunk[1])])


def enlarged(belief: Belief, old: Sequence[str], union: Sequence[str], fused: Array, spread: Array) -> Belief:
    """Return a belief over more models; new ones start with probability 0. Interpretation V11."""
    places = [old.index(name) if name in old else None for name in union]
    states = np.array([fused if k is None else belief.states[k] for k in places])
    covariances = np.array([spread if k is None else belief.covariances[k] for k in places])
    probabilities = np.array([-np.inf if k is None else belief.log_probabilities[k] for k in places])
    return replace(
        belief,
        states=states,
        covariances=covariances,
        log_probabilities=probabilities,
        log_likelihoods=np.zeros(len(union)),
    )


def enlarged_literally(
    belief: Belief, old: Sequence[str], union: Sequence[str], poses: dict[str, Array], noise: dict[str, Array]
) -> Belief:
    """Return a belief over more models as the patent has it: the new ones start from their own best pose."""
    top = belief.log_probabilities.max()  # VSMM 8.1
    places = [old.index(name) if name in old else None for name in union]
    probabilities = np.array([top if k is None else belief.log_probabilities[k] for k in places])
    covariances = [noise[name] if k is None else belief.covariances[k] for name, k in zip(union, places, strict=True)]
    states = [poses[name] if k is None else belief.states[k] for name, k in zip(union, places, strict=True)]
    return replace(
        belief,
        states=np.array(states),  # VSMM 8.3
        covariances=np.array(covariances),  # VSMM 8.2
        log_probabilities=probabilities - np.logaddexp.reduce(probabilities),
        log_likelihoods=np.zeros(len(union)),
    )


def restricted(belief: Belief, models: Sequence[str], kept: Sequence[str]) -> Belief:
    """Return a belief over some of its models."""
    places = [models.index(name) for name in kept]
    probabilities = belief.log_probabilities[places]
    total = np.logaddexp.reduce(probabilities)
    even = np.full(len(kept), -np.log(len(kept)))
    return replace(
        belief,
        states=belief.states[places],
        covariances=belief.covariances[places],
        log_probabilities=probabilities - total if np.isfinite(total) else even,
        log_likelihoods=belief.log_likelihoods[places],
    )


@dataclass(frozen=True, kw_only=True)
class SequentialTest:
    """How step 9 decides between an old group of models and a new one.

    `sequential` is Wald's sequential probability ratio test on the likelihoods since the new group came, with error
    rates `false_alarm`, his alpha, and `miss`, his beta; `patent` looks at the latest frame alone (Interpretation V12).
    After `longest` frames the more probable group stays.
    """

    test: Test = "sequential"
    false_alarm: float = 0.01
    miss: float = 0.01
    longest: int = 45

    def __post_init__(self) -> None:
        if self.test not in get_args(Test):
            raise InputError(f"test must be one of {', '.join(get_args(Test))}, got {self.test!r}")
        for name in ("false_alarm", "miss"):
            if not 0.0 < getattr(self, name) < 0.5:
                raise InputError(f"{name} must be between 0 and 0.5, got {getattr(self, name)}")
        if self.longest < 1:
            raise InputError(f"longest must be at least 1, got {self.longest}")


@final
class Rivalry:
    """An old group of models against a new one, as far as it has come, until one of them has to go."""

    def __init__(self, how: SequentialTest, *, old: Sequence[str], new: Sequence[str]) -> None:
        self._how, self._old, self._new = how, old, new
        self._evidence = 0.0  # log of the likelihood ratio, new to old
        self._frames = 0

    def decide(self, belief: Belief, models: Sequence[str]) -> Literal["old", "new"] | None:
        """Return which group stays, after a cycle over both; None while both do."""
        how = self._how
        old, new = ([models.index(name) for name in group] for group in (self._old, self._new))
        after = belief.log_probabilities
        before = after - belief.log_likelihoods
        odds = float(np.logaddexp.reduce(after[new]) - np.logaddexp.reduce(after[old]))
        ratio = odds - float(
            np.logaddexp.reduce(before[new]) - np.logaddexp.reduce(before[old])
        )  # of the groups' likelihoods
        self._frames += 1
        self._evidence += ratio
        if how.test == "patent":
            if min(odds, ratio) < np.log(0.9):  # VSMM 9
                return "old"
            return "new" if min(odds, ratio) > 0.0 else None
        if self._evidence >= np.log((1.0 - how.miss) / how.false_alarm):
            return "new"
        if self._evidence <= np.log(how.miss / (1.0 - how.false_alarm)):
            return "old"
        if self._frames >= how.longest:
            return "new" if odds > 0.0 else "old"
        return None


FIRST = 10  # cycles over all models before a group is chosen
RECENT = 5  # frames: where the median of their surprise is larger than SURPRISED, the group is chosen again
SURPRISED = 1.2  # of the normalised innovation squared a coordinate, which is 1 on average where a filter is consistent

Structure = Literal["variable", "all"]
Measure = Callable[[Array], Measurement]


@dataclass(frozen=True, eq=False, kw_only=True)
class Switching:
    """The models, their groups and how they switch."""

    library: Library
    topology: Topology
    structure: Structure = "variable"
    rules: Rules = Rules()
    new: New = "rerun"
    test: SequentialTest = SequentialTest()

    def __post_init__(self) -> None:
        for name, choices in (("structure", Structure), ("new", New)):
            if getattr(self, name) not in get_args(choices):
                raise InputError(f"{name} must be one of {', '.join(get_args(choices))}, got {getattr(self, name)!r}")


@final
class Models:
    """The models in force; at first all of them."""

    def __init__(self, how: Switching, skeleton: Skeleton, fps: float) -> None:
        self._how, self._topology, self.groups = how, how.topology, how.topology.groups
        self.every = self._topology.union(self._topology.groups)
        self.known = {name: how.library.models[name].fitted_to(skeleton, fps) for name in self.every}
        self._made = lru_cache(self._make)
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
        return IMM([self.known[name] for name in names], self._topology.transition(names), PLACED)

    @property
    def imm(self) -> IMM:
        """The filter over the models in force."""
        return self._made(self.active)

    def cycle(self, before: Belief, measure: Measure, surprise: float) -> Belief:
        """Return the belief one frame later. Groups come and go; `surprise` is of the latest frame."""
        after = self.imm.cycle(before, measure)
        self._surprises = [*self._surprises, surprise][-RECENT:]
        if self._how.structure == "all":
            self.group = self._topology.most_probable(self.active, after.probabilities)
            return after
        self._cycles += 1
        if self.group is None:
            if self._cycles < FIRST:
                return after
            return self._keep(self._topology.most_probable(self.active, after.probabilities), after)  # VSMM 5
        if self.newcomer is not None and self._rivalry is not None:
            decision = self._rivalry.decide(after, self.active)
            if decision is None:
                return after
            return self._keep(self.newcomer if decision == "new" else self.group, after)
        self._rested += 1
        if self._rested <= self._how.rules.dwell:
            return after
        if np.median(self._surprises) > SURPRISED:
            return self._reconsidered(before, measure)
        return self._activated(before, after, measure)

    def record(self, points: Array) -> None:
        """Take where the points (17, 2) of the latest state are projected."""
        self._drawn = [*self._drawn, points][-2 * self._how.rules.smoothing - 1 :]

    def _reconsidered(self, before: Belief, measure: Measure) -> Belief:
        """Choose the group again, as at first: the present one does not explain the measurements."""
        old, (state, spread) = self.active, self.imm.fused(before)
        self.restart()
        return self.imm.cycle(enlarged(before, old, self.active, state, spread), measure)

    def _activated(self, before: Belief, after: Belief, measure: Measure) -> Belief:
        """Bring the group that the rules ask for into force beside the present one, if they ask for one."""
        groups, names = self._topology.groups, tuple(self._topology.groups)
        asked = self._how.rules.requested_group(self._drawn)
        if self.group is None or asked is None or asked >= len(names) or names[asked] == self.group:
            return after
        old, imm = self.active, self.imm
        self.newcomer, self.active = names[asked], self._topology.union((self.group, names[asked]))  # VSMM 8.4
        self._rivalry = Rivalry(self._how.test, old=groups[self.group], new=groups[self.newcomer])
        if self._how.new == "rerun":
            state, spread = imm.fused(before)
            return self.imm.cycle(enlarged(before, old, self.active, state, spread), measure)
        state, _ = imm.fused(after)
        new = [self.known[name] for name in self.active if name not in old]
        starts = {model.name: model.nearest(state) for model in new}
        return enlarged_literally(after, old, self.active, starts, {model.name: model.noise for model in new})

    def _keep(self, group: str, belief: Belief) -> Belief:
        """Let one group alone go on."""
        kept: Sequence[str] = self._topology.groups[group]
        left = restricted(belief, self.active, kept)
        self.active, self.group, self.newcomer, self._rested = tuple(kept), group, None, 0
        self._rivalry = None
        return left
