"""Which models are in force, cycle by cycle: the variable structure. VSMM steps 7 to 9.

The field calls it model-set adaptation. A group comes into force beside the present one where the limbs change their
speed, and a test of both ends one of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Literal, final

import numpy as np

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import Skeleton
from posefit_vsmm.groups import Topology, most_probable
from posefit_vsmm.imm import IMM, QUATERNIONS, Belief, Measure, Measurement, start
from posefit_vsmm.motion import CLIP_FPS, MotionModels, lifted
from posefit_vsmm.settings import Settings
from posefit_vsmm.state import AT, inverse_tangents, unit

_LIMBS = np.array(
    [
        [AT[f"{side} {upper}"], AT[f"{side} {lower}"]]
        for upper, lower in (("hip", "knee"), ("knee", "foot"))
        for side in ("left", "right")
    ]
)  # thighs, then shanks
TWICE, HALF = 2.0, 0.5
MOST = 3  # of the four lower limbs. Interpretation V15
FIRST_CYCLES = 10  # over all models before a group is chosen
DWELL = 10  # frames that a group stays at least; none in the patent. Interpretation V10
ENDED = 0.9  # the ratio, new to old, below which a new group ends


def requested_group(points: Sequence[Array]) -> int | None:
    """Return which group, 0 to 2, the points (17, 2) of the latest three frames ask for; None where it is no other.

    Group 3 goes before 2 and 1 (Interpretation V10). The hips of rule a are both of them, and a hip's angle is that of
    its thigh to the vertical (Interpretation V15). No change at all is not doubled by another.
    """
    if len(points) < 3:
        return None
    angles = np.array([limb_angles(frame) for frame in points[-3:]])
    before, now = np.abs(wrapped(np.diff(angles, axis=0)))
    grown, shrunk = (now >= TWICE * before) & (now > 0.0), (now <= HALF * before) & (before > 0.0)
    if grown[:2].all():  # VSMM 7a
        return 2
    if grown.sum() >= MOST:  # VSMM 7b
        return 1
    if shrunk.sum() >= MOST:  # VSMM 7c
        return 0
    return None


def limb_angles(points: Array) -> Array:
    """Return the angles (4,) to the vertical, in the image, of thighs and shanks, left and right."""
    limbs = points[_LIMBS[:, 1]] - points[_LIMBS[:, 0]]
    return np.asarray(np.arctan2(limbs[:, 0], limbs[:, 1]))


def regrouped(
    belief: Belief, old: Sequence[str], models: Sequence[str], new: Mapping[str, tuple[Array, Array, float]]
) -> Belief:
    """Return a belief over other models: `new` has state, covariance and log-probability of those not in `old`."""
    known = dict(zip(old, zip(belief.states, belief.covariances, belief.log_probabilities, strict=True), strict=True))
    parts = [known.get(name) or new[name] for name in models]
    states, covariances, probabilities = (np.array(part) for part in zip(*parts, strict=True))
    return Belief(states, covariances, probabilities, np.zeros(len(models)), belief.repairs)


def normalised(belief: Belief) -> Belief:
    """Return a belief whose probabilities sum to 1, all the same where none is above 0."""
    probabilities = belief.log_probabilities
    total = np.logaddexp.reduce(probabilities)
    even = np.full(len(probabilities), -np.log(len(probabilities)))
    return replace(belief, log_probabilities=probabilities - total if np.isfinite(total) else even)


@final
class Contest:
    """An old group of models against a new one, until one of them has to end. VSMM step 9.

    It looks at the likelihoods since the new group came. Interpretation V12.
    """

    def __init__(self, *, old: Sequence[str], new: Sequence[str]) -> None:
        self._old, self._new = old, new
        self._likelihood_ratio = 0.0  # its logarithm, new to old

    def decide(self, belief: Belief, models: Sequence[str]) -> Literal["old", "new"] | None:
        """Return which group stays, after a cycle over both; None while both do."""
        old, new = ([models.index(name) for name in group] for group in (self._old, self._new))

        def ratio(logarithms: Array) -> float:
            return float(np.logaddexp.reduce(logarithms[new]) - np.logaddexp.reduce(logarithms[old]))

        self._likelihood_ratio += ratio(belief.log_likelihoods)  # VSMM 9
        smaller = min(ratio(belief.log_probabilities), self._likelihood_ratio)
        return "old" if smaller < np.log(ENDED) else "new" if smaller > 0.0 else None


@final
class Switching:
    """The models in force; at first all of them."""

    def __init__(
        self, settings: Settings, models: MotionModels, topology: Topology, skeleton: Skeleton, fps: float
    ) -> None:
        self.topology, self.groups = topology, topology.groups
        self.every = topology.union(topology.groups)
        self._patent, self._structure = settings.patent, settings.structure
        fitted = models.of(self.every).fitted_to(skeleton, CLIP_FPS if self._patent else fps)  # Interpretation V6
        self.models = replace(fitted, noises=settings.process_noise * fitted.noises)
        self._filter = lru_cache(self._filter_of)
        self.restart()

    def restart(self) -> None:
        """Bring all models into force; a group will be chosen among them."""
        self.active = self.every
        self.group: str | None = None
        self.newcomer: str | None = None
        self._contest: Contest | None = None  # of the group and the newcomer
        self._cycles = self._cycles_of_group = 0
        self._points: list[Array] = []

    def _filter_of(self, names: tuple[str, ...]) -> IMM:
        models, transition = self.models.of(names), self.topology.transition(names)
        if self._patent:  # Interpretation V4
            return IMM(models.predict_numbers, transition)
        return IMM(models.predict, transition, QUATERNIONS)

    @property
    def imm(self) -> IMM:
        """The filter over the models in force."""
        return self._filter(self.active)

    def start(self, state: Array, covariance: Array) -> Belief:
        """Return the belief in one state (43,) with a covariance (33, 33)."""
        return start(state, self._own(state, covariance), len(self.active))

    def _own(self, states: Array, covariances: Array) -> Array:
        """Return covariances (..., 33, 33) of errors as the filter holds them: the patent's are of the numbers."""
        return lifted(states, covariances) if self._patent else covariances

    def fused(self, belief: Belief) -> tuple[Array, Array]:
        """Return the one state (43,), and the covariance (33, 33) of its error, that stand for all models."""
        state, covariance = self.imm.fused(belief)
        if not self._patent:
            return state, covariance
        state = unit(state)
        return state, inverse_tangents(state[None])[0] @ covariance @ inverse_tangents(state[None])[0].T

    def predicted(self, belief: Belief) -> tuple[Array, Array]:
        """Return the state (43,) and covariance (33, 33) a frame later, by the most probable model."""
        state, covariance = self.fused(belief)
        likely = self.models.of([self.active[int(belief.probabilities.argmax())]])
        states, covariances = likely.predict(state[None], covariance[None])
        return states[0], covariances[0]

    def widened(self, belief: Belief, variances: Array) -> Belief:
        """Return a belief whose errors have larger variances, by (33,)."""
        extra = self._own(unit(belief.states), np.tile(np.diag(variances), (len(belief.states), 1, 1)))
        return replace(belief, covariances=belief.covariances + extra)

    def updated(self, belief: Belief, measure: Measure) -> Belief:
        """Return the belief after one more measurement of the same frame; the models' probabilities stay."""
        return self.imm.updated(belief, self._measure(measure))

    def _measure(self, measure: Measure) -> Measure:
        """Return a measurement whose Jacobians are as the filter holds them: the patent's are by the numbers."""

        def measure_numbers(states: Array) -> Measurement:
            measurement = measure(unit(states))
            return measurement._replace(jacobians=measurement.jacobians @ inverse_tangents(unit(states)))

        return measure_numbers if self._patent else measure

    def cycle(self, before: Belief, measure: Measure, points: Array) -> Belief:
        """Return the belief one frame later. Groups come and go by the joints (17, 2) detected in the frame. VSMM 7."""
        self._points = [*self._points, points][-3:]
        measure = self._measure(measure)
        after = self.imm.cycle(before, measure)
        self._cycles += 1
        if self._structure == "all":
            self.group = most_probable(self.groups, self.active, after.probabilities)
            return after
        if self.group is None:
            if self._cycles < FIRST_CYCLES:
                return after
            return self._only(most_probable(self.groups, self.active, after.probabilities), after)  # VSMM 5
        if self._contest is not None:
            return self._decided(after)
        self._cycles_of_group += 1
        number = requested_group(self._points)
        dwells = not self._patent and self._cycles_of_group <= DWELL
        if dwells or number is None or number >= len(self.groups):
            return after
        newcomer = tuple(self.groups)[number]
        if newcomer == self.group:
            return after
        if self._patent:
            return self._decided(self.imm.cycle(self.joined(before, newcomer), measure))  # run again, and judged
        # Interpretation V11: the cycle is run again with both groups; new models had a probability of 0
        old, fused = self.active, self.imm.fused(before)
        self._bring_in(newcomer)
        both = regrouped(before, old, self.active, dict.fromkeys(self.active, (*fused, -np.inf)))
        return self.imm.cycle(both, measure)

    def joined(self, belief: Belief, newcomer: str) -> Belief:
        """Return a belief with another group's models beside those in force, as the patent starts them. VSMM 8."""
        old, (state, _) = self.active, self.imm.fused(belief)
        self._bring_in(newcomer)
        top = belief.log_probabilities.max()  # VSMM 8.1
        noises = dict(zip(self.models.names, self.models.noises, strict=True))  # VSMM 8.2
        poses = {name: self.models.captured_nearest(name, state) for name in self.active if name not in old}  # VSMM 8.3
        new = {name: (pose, self._own(pose, noises[name]), top) for name, pose in poses.items()}
        return normalised(regrouped(belief, old, self.active, new))

    def _bring_in(self, newcomer: str) -> None:
        """Bring another group into force beside the present one."""
        assert self.group is not None
        self._contest = Contest(old=self.groups[self.group], new=self.groups[newcomer])
        self.newcomer, self.active = newcomer, self.topology.union((self.group, newcomer))  # VSMM 8.4

    def _decided(self, after: Belief) -> Belief:
        """Return the belief after a cycle over both groups: of one of them as soon as the other has to end."""
        assert self._contest is not None
        assert self.newcomer is not None
        assert self.group is not None
        decision = self._contest.decide(after, self.active)
        return after if decision is None else self._only(self.newcomer if decision == "new" else self.group, after)

    def _only(self, group: str, belief: Belief) -> Belief:
        """Return the belief over one group, which alone stays in force."""
        models = tuple(self.groups[group])
        remaining = normalised(regrouped(belief, self.active, models, {}))
        self.active, self.group, self.newcomer, self._contest = models, group, None, None
        self._cycles_of_group = 0
        return remaining
