"""Which models are in force, cycle by cycle: the variable structure. VSMM steps 7 to 9.

The field calls it model-set adaptation. A group comes into force beside the present one when the limbs change their
speed, and a test of both ends one of them. `Switching` alone changes which models are in force. The two forms, the
default and the patent's letter, differ in how the filter starts a new group's models: they get a `Union` of both groups
and return a `Belief` in it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import ClassVar, Literal, NamedTuple, final

import numpy as np

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit_vsmm.groups import Topology, most_probable
from posefit_vsmm.imm import IMM, QUATERNIONS, Belief, Measure, Measurement, start
from posefit_vsmm.motion import FPS, MotionModels, lifted
from posefit_vsmm.state import AT, inverse_tangents, unit

# where thighs and shanks begin and end
_UPPER = [AT[name] for name in ("left hip", "right hip", "left knee", "right knee")]
_LOWER = [AT[name] for name in ("left knee", "right knee", "left foot", "right foot")]
Structure = Literal["variable", "all"]
MIN_LIMBS = 3  # of thighs and shanks: most of the four. Interpretation V15
FIRST_CYCLES = 10  # over all models before a group is chosen, to the letter
# by default: within ten cycles the filter has not converged yet. Interpretation V19
FIRST_SECONDS = 1.0
MIN_RATIO = 0.9  # of a new group to the old one; below it the new one ends


def requested_group(points: Sequence[Array]) -> int | None:
    """Return which group, 0 to 2, the points (17, 2) of the latest three frames ask for; None if they ask for none.

    Group 3 goes before 2 and 1 (Interpretation V10). The hips of rule a are both of them, and a hip's angle is that of
    its thigh to the vertical (Interpretation V15). No change at all is not doubled by another.
    """
    if len(points) < 3:
        return None
    before, now = np.abs(
        wrapped(np.diff([limb_angles(frame) for frame in points[-3:]], axis=0))
    )
    doubled = (now >= 2.0 * before) & (now > 0.0)
    halved = (now <= 0.5 * before) & (before > 0.0)
    if doubled[:2].all():  # VSMM 7a
        return 2
    if doubled.sum() >= MIN_LIMBS:  # VSMM 7b
        return 1
    if halved.sum() >= MIN_LIMBS:  # VSMM 7c
        return 0
    return None


def limb_angles(points: Array) -> Array:
    """Return the angles (4,) to the vertical, in the image, of thighs and shanks, left and right."""
    limbs = points[_LOWER] - points[_UPPER]
    return np.asarray(np.arctan2(limbs[:, 0], limbs[:, 1]))


def regrouped(
    belief: Belief,
    old: Sequence[str],
    models: Sequence[str],
    new: Mapping[str, tuple[Array, Array, float]],
) -> Belief:
    """Return a belief over other models: `new` has state, covariance and log-probability of those not in `old`."""
    known = dict(
        zip(
            old,
            zip(
                belief.states, belief.covariances, belief.log_probabilities, strict=True
            ),
            strict=True,
        )
    )
    parts = zip(*({**new, **known}[name] for name in models), strict=True)
    states, covariances, probabilities = (np.array(part) for part in parts)
    return Belief(states, covariances, probabilities, np.zeros(len(models)))


def normalised(belief: Belief) -> Belief:
    """Return a belief whose probabilities sum to 1, all the same where none is above 0."""
    probabilities = np.maximum(belief.log_probabilities, -1e9)
    return replace(
        belief, log_probabilities=probabilities - np.logaddexp.reduce(probabilities)
    )


class Union(NamedTuple):
    """A group that comes into force, and the one that is."""

    old_names: tuple[str, ...]  # the models of the present group
    old_filter: IMM  # over them
    names: tuple[str, ...]  # the models of both groups. VSMM 8.4
    filter: IMM  # over these
    models: MotionModels  # the same ones


class DefaultForm:
    """The default: the filter holds covariances (33, 33) of errors. Interpretations V4 and V11."""

    # a new group has only the probability that the transitions gave it
    judges_first_cycle: ClassVar[bool] = False

    def first_cycles(self, models: MotionModels) -> int:
        """Return after how many cycles over all models a group is chosen."""
        return max(FIRST_CYCLES, round(FIRST_SECONDS * FPS / models.share))

    def imm(self, models: MotionModels, transition: Array) -> IMM:
        """Return the filter over some models."""
        return IMM(models.predict, transition, QUATERNIONS)

    def covariances(self, states: Array, covariance: Array) -> Array:
        """Return the covariances of states (r, 43), each (33, 33) of its error, as the filter holds them."""
        return np.tile(covariance, (len(states), 1, 1))

    def fused(self, state: Array, covariance: Array) -> tuple[Array, Array]:
        """Return the filter's state as a state (43,) with the covariance (33, 33) of its error."""
        return state, covariance

    def measure(self, measure: Measure) -> Measure:
        """Return a measurement whose Jacobians are by what the filter's covariances are of."""
        return measure

    def cycle_over_both(self, union: Union, before: Belief, measure: Measure) -> Belief:
        """Return the belief after a cycle over both groups; new models had a probability of 0."""
        state, covariance = union.old_filter.fused(before)
        new = dict.fromkeys(union.names, (state, covariance, -np.inf))
        both = regrouped(before, union.old_names, union.names, new)
        return union.filter.cycle(both, measure)


class PatentForm:
    """To the patent's letter: the filter holds covariances (43, 43) of numbers, and starts new models by step 8."""

    judges_first_cycle: ClassVar[bool] = True  # the likelihoods' ratio is from k0 on

    def first_cycles(self, models: MotionModels) -> int:
        """Return ten, whatever the models."""
        return FIRST_CYCLES

    def imm(self, models: MotionModels, transition: Array) -> IMM:
        """Return the filter over some models, with residuals at their mixed states."""
        return IMM(models.predict_numbers, transition, at_mixed=True)

    def covariances(self, states: Array, covariance: Array) -> Array:
        """Return those of the numbers (r, 43, 43)."""
        return lifted(states, covariance)

    def fused(self, state: Array, covariance: Array) -> tuple[Array, Array]:
        """Return the unit state, and what its covariance is of errors."""
        change = inverse_tangents(unit(state)[None])[0]
        return unit(state), change @ covariance @ change.T

    def measure(self, measure: Measure) -> Measure:
        """Return a measurement with Jacobians by numbers."""

        def by_numbers(states: Array) -> Measurement:
            measurement = measure(unit(states))
            return measurement._replace(
                jacobians=measurement.jacobians @ inverse_tangents(unit(states))
            )

        return by_numbers

    def cycle_over_both(self, union: Union, before: Belief, measure: Measure) -> Belief:
        """Return the belief after a cycle over both groups, of which the new one begins in this cycle."""
        both = self.joined(union, before)
        return self.begun(union).cycle(both, measure)

    def joined(self, union: Union, belief: Belief) -> Belief:
        """Return a belief with the new group's models beside the old one's. VSMM 8."""
        state, _ = self.fused(*union.old_filter.fused(belief))
        top = belief.log_probabilities.max()  # VSMM 8.1
        new = {}
        for name, noise in zip(union.names, union.models.noises, strict=True):
            if name not in union.old_names:
                pose = union.models.captured_nearest(name, state)  # VSMM 8.3
                new[name] = pose, lifted(pose[None], noise)[0], top
        return normalised(regrouped(belief, union.old_names, union.names, new))

    def begun(self, union: Union) -> IMM:
        """Return the filter in which the prediction of new models has their noise as its covariance."""
        rows = [k for k, name in enumerate(union.names) if name not in union.old_names]
        noises = union.models.noises

        def predict(states: Array, covariances: Array) -> tuple[Array, Array]:
            states, covariances = union.filter.predict(states, covariances)
            covariances[rows] = lifted(states[rows], noises[rows])  # VSMM 8.2
            return states, covariances

        return replace(union.filter, predict=predict)


Form = DefaultForm | PatentForm


@final
class Switching:
    """The models in force; at first all of them."""

    def __init__(
        self,
        models: MotionModels,
        topology: Topology,
        form: Form | None = None,
        structure: Structure = "variable",
    ) -> None:
        self.topology = topology
        self.groups = topology.groups
        self.models = models.of(topology.union(topology.groups))
        self.form = form or DefaultForm()
        self._structure = structure
        self._filter = lru_cache(self._filter_of)
        self.restart()

    def restart(self) -> None:
        """Bring all models into force; a group will be chosen among them."""
        self.active = self.models.names
        self.group: str | None = None
        self.candidate_group: str | None = None
        # of the likelihoods since the candidate group came into force, new to old
        self._log_ratio = 0.0
        self._cycles = 0
        self._points: list[Array] = []

    def _filter_of(self, names: tuple[str, ...]) -> IMM:
        return self.form.imm(self.models.of(names), self.topology.transition(names))

    @property
    def imm(self) -> IMM:
        """The filter over the models in force."""
        return self._filter(self.active)

    def start(self, state: Array, covariance: Array) -> Belief:
        """Return the belief in one state (43,) with a covariance (33, 33)."""
        return start(
            state, self.form.covariances(state[None], covariance)[0], len(self.active)
        )

    def fused(self, belief: Belief) -> tuple[Array, Array]:
        """Return the one state (43,), and the covariance (33, 33) of its error, that stand for all models."""
        return self.form.fused(*self.imm.fused(belief))

    def predicted(self, belief: Belief) -> tuple[Array, Array]:
        """Return the state (43,) and covariance (33, 33) a frame later, by the most probable model."""
        state, covariance = self.fused(belief)
        likely = self.models.of([self.active[int(belief.probabilities.argmax())]])
        states, covariances = likely.predict(state[None], covariance[None])
        return states[0], covariances[0]

    def widened(self, belief: Belief, variances: Array) -> Belief:
        """Return a belief whose errors have larger variances, by (33,)."""
        extra = self.form.covariances(unit(belief.states), np.diag(variances))
        return replace(belief, covariances=belief.covariances + extra)

    def cycle(self, before: Belief, measure: Measure, points: Array) -> Belief:
        """Return the belief one frame later. Groups come and go by the joints (17, 2) detected in the frame."""
        self._points = [*self._points, points][-3:]
        self._cycles += 1
        measure = self.form.measure(measure)
        after = self.imm.cycle(before, measure)
        likely = most_probable(self.groups, self.active, after.probabilities)
        if self._structure == "all":
            self.group = likely
            return after
        if self.group is None:
            if self._cycles < self.form.first_cycles(self.models):
                return after
            return self.keep_only(likely, after)  # VSMM 5
        if self.candidate_group is not None:
            return self.judged(after)
        requested = self._requested_group()
        if requested is None:
            return after
        union = self.union_with(requested)
        after = self.form.cycle_over_both(union, before, measure)
        self.bring_in(requested)
        return self.judged(after) if self.form.judges_first_cycle else after

    def _requested_group(self) -> str | None:
        """Return the group that the latest points ask for; None if it is in force, or they ask for none. VSMM 7."""
        number = requested_group(self._points)
        names = tuple(self.groups)
        if number is None or number >= len(names) or names[number] == self.group:
            return None
        return names[number]

    def union_with(self, candidate_group: str) -> Union:
        """Return the union of the models in force and another group."""
        assert self.group is not None
        names = self.topology.union([self.group, candidate_group])
        return Union(
            self.active,
            self.imm,
            names,
            self._filter(names),
            self.models.of(names),
        )

    def bring_in(self, candidate_group: str) -> None:
        """Bring another group into force beside the present one."""
        assert self.group is not None
        self.active = self.topology.union([self.group, candidate_group])  # VSMM 8.4
        self.candidate_group = candidate_group
        self._log_ratio = 0.0

    def judged(self, after: Belief) -> Belief:
        """Return the belief after a cycle over both groups: over one of them as soon as the other has to end.

        The likelihoods' ratio is that of all cycles since the new group came. Interpretation V12.
        """
        assert self.candidate_group is not None
        assert self.group is not None
        old = [self.active.index(name) for name in self.groups[self.group]]
        new = [self.active.index(name) for name in self.groups[self.candidate_group]]
        # VSMM 9
        self._log_ratio += _log_ratio(after.log_likelihoods, old, new)
        smaller = min(_log_ratio(after.log_probabilities, old, new), self._log_ratio)
        if smaller < np.log(MIN_RATIO):
            return self.keep_only(self.group, after)
        if smaller > 0.0:
            return self.keep_only(self.candidate_group, after)
        return after

    def keep_only(self, group: str, belief: Belief) -> Belief:
        """Return the belief over one group, which alone stays in force."""
        old = self.active
        self.active = self.groups[group]
        self.group = group
        self.candidate_group = None
        return normalised(regrouped(belief, old, self.active, {}))


def _log_ratio(logarithms: Array, old: Sequence[int], new: Sequence[int]) -> float:
    """Return the logarithm of the ratio of two sums, that of new models to that of old ones."""
    total = np.logaddexp.reduce
    return float(total(logarithms[new]) - total(logarithms[old]))
