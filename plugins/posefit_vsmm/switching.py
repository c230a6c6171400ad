"""The variable structure: which models are active in each cycle. VSMM steps 7 to 9.

The field's term is model-set adaptation. When the limbs change their speed, a second
group is activated next to the present one; a test then ends one of the two. Only
`Switching` changes which models are active.

There are two forms, the default and the patent's letter. A form decides how the filter
represents states and how a new group's models start. It changes nothing itself: it
takes a `Union` of both groups and returns a `Belief` over it.

| | `DefaultForm` | `PatentForm` |
|---|---|---|
| covariances of | errors (33) | the state's numbers (43), Interpretation V4 |
| residuals at | predicted states | mixed states, Interpretation V3 |
| cycles over all models, step 5 | a second, Interpretation V19 | ten |
| a new model's state | mixed, by the transitions | the nearest captured pose, 8.3 |
| its probability | by the transitions, V11 | that of the most probable model, 8.1 |
| its first covariance | predicted, as any | the model's noise, 8.2 |
| the ratio of step 9 begins | in the frame after | in the frame of the request, k0 |

The active models go through these states, frame by frame:

                  after the first cycles           if the limbs ask for it
    all models  -------------------------> one group --------------------> two groups
                         step 5                ^         steps 7 and 8          |
                                               |                                |
                                               +---- when one group ends -------+
                                                            step 9
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

# the upper and lower ends of the left thigh, right thigh, left shank and right shank
_UPPER = [AT["left hip"], AT["right hip"], AT["left knee"], AT["right knee"]]
_LOWER = [AT["left knee"], AT["right knee"], AT["left foot"], AT["right foot"]]
Structure = Literal["variable", "all"]
MIN_LIMBS = 3  # most of the four thighs and shanks. Interpretation V15
FIRST_CYCLES = 10  # the patent's cycles over all models before a group is chosen
# the same for the default, for which ten cycles are too few: the filter has not
# converged. Interpretation V19
FIRST_SECONDS = 1.0
MIN_RATIO = 0.9  # of the new group to the old one; below it the new one ends


def requested_group(points: Sequence[Array]) -> int | None:
    """Return which group, 0 to 2, the latest three frames ask for; None if none.

    `points` are (17, 2) for each frame. The third group comes before the second and the
    first (Interpretation V10). Rule a needs both hips; a hip's angle is between its
    thigh and the vertical (Interpretation V15). A change from zero does not count as
    doubling.
    """
    if len(points) < 3:
        return None
    angles = [limb_angles(frame) for frame in points[-3:]]
    before, now = np.abs(wrapped(np.diff(angles, axis=0)))
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
    """Return the angles (4,) of thighs and shanks to the vertical in the image.

    The order is left thigh, right thigh, left shank, right shank.
    """
    limbs = points[_LOWER] - points[_UPPER]
    return np.asarray(np.arctan2(limbs[:, 0], limbs[:, 1]))


def regrouped(
    belief: Belief,
    old: Sequence[str],
    models: Sequence[str],
    new: Mapping[str, tuple[Array, Array, float]],
) -> Belief:
    """Return a belief over other models.

    Args:
        belief: The belief over the models `old`.
        old: Names of models.
        models: Names of the models of the result.
        new: State, covariance and log-probability of each model that is not in `old`.

    Returns:
        The belief, with likelihoods of 1.
    """
    states = []
    covariances = []
    log_probabilities = []
    for name in models:
        if name in old:
            row = old.index(name)
            state = belief.states[row]
            covariance = belief.covariances[row]
            log_probability = belief.log_probabilities[row]
        else:
            state, covariance, log_probability = new[name]
        states.append(state)
        covariances.append(covariance)
        log_probabilities.append(log_probability)
    return Belief(
        np.array(states),
        np.array(covariances),
        np.array(log_probabilities),
        np.zeros(len(models)),
    )


def normalised(belief: Belief) -> Belief:
    """Return a belief with probabilities that sum to 1, equal if all were 0."""
    # finite numbers instead of -inf: if all were -inf, their differences would be nan
    probabilities = np.maximum(belief.log_probabilities, -1e9)
    return replace(
        belief, log_probabilities=probabilities - np.logaddexp.reduce(probabilities)
    )


class Union(NamedTuple):
    """The present group and a new one, together."""

    old_names: tuple[str, ...]  # the models of the present group
    old_filter: IMM  # over the present group
    names: tuple[str, ...]  # the models of both groups. VSMM 8.4
    filter: IMM  # over both groups
    models: MotionModels  # of both groups


class DefaultForm:
    """The default: covariances (33, 33) of errors. Interpretations V4 and V11."""

    # in its first cycle a new group has only the probability that transitions gave it
    judges_first_cycle: ClassVar[bool] = False

    def first_cycles(self, models: MotionModels) -> int:
        """Return the number of cycles over all models before a group is chosen."""
        return max(FIRST_CYCLES, round(FIRST_SECONDS * FPS / models.share))

    def imm(self, models: MotionModels, transition: Array) -> IMM:
        """Return the filter over some models."""
        return IMM(models.predict, transition, QUATERNIONS)

    def covariances(self, states: Array, covariance: Array) -> Array:
        """Return the filter's covariances of states (r, 43).

        `covariance` (33, 33) is the covariance of each state's error.
        """
        return np.tile(covariance, (len(states), 1, 1))

    def fused(self, state: Array, covariance: Array) -> tuple[Array, Array]:
        """Return the filter's state (43,) and the covariance (33, 33) of its error."""
        return state, covariance

    def measure(self, measure: Measure) -> Measure:
        """Return a measurement with Jacobians by errors, as the covariances are."""
        return measure

    def cycle_over_both(self, union: Union, before: Belief, measure: Measure) -> Belief:
        """Return the belief after a cycle over both groups.

        The new models start with a probability of 0.
        """
        state, covariance = union.old_filter.fused(before)
        new = dict.fromkeys(union.names, (state, covariance, -np.inf))
        both = regrouped(before, union.old_names, union.names, new)
        return union.filter.cycle(both, measure)


class PatentForm:
    """The patent's letter: covariances (43, 43) of numbers, new models by step 8."""

    judges_first_cycle: ClassVar[bool] = True  # the ratio of likelihoods starts at k0

    def first_cycles(self, models: MotionModels) -> int:
        """Return ten for any models."""
        return FIRST_CYCLES

    def imm(self, models: MotionModels, transition: Array) -> IMM:
        """Return the filter over some models, with residuals at their mixed states."""
        return IMM(models.predict_numbers, transition, at_mixed=True)

    def covariances(self, states: Array, covariance: Array) -> Array:
        """Return the covariances (r, 43, 43) of the states' numbers."""
        return lifted(states, covariance)

    def fused(self, state: Array, covariance: Array) -> tuple[Array, Array]:
        """Return the state with unit quaternions, and the covariance of its error."""
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
        """Return the belief after a cycle over both groups, the new one's first."""
        both = self.joined(union, before)
        return self.first_filter(union).cycle(both, measure)

    def joined(self, union: Union, belief: Belief) -> Belief:
        """Return a belief over the models of both groups. VSMM 8."""
        state, _ = self.fused(*union.old_filter.fused(belief))
        top = belief.log_probabilities.max()  # VSMM 8.1
        new = {}
        for name, noise in zip(union.names, union.models.noises, strict=True):
            if name not in union.old_names:
                pose = union.models.captured_nearest(name, state)  # VSMM 8.3
                new[name] = pose, lifted(pose[None], noise)[0], top
        return normalised(regrouped(belief, union.old_names, union.names, new))

    def first_filter(self, union: Union) -> IMM:
        """Return the filter of a union's first cycle.

        It predicts the new models with their noise as covariance.
        """
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
    """The active models; at first all of them."""

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
        """Activate all models; a group is chosen after the first cycles."""
        self.active = self.models.names
        self.group: str | None = None
        self.candidate_group: str | None = None
        # of the likelihoods, new to old group, since the candidate was activated
        self._log_ratio = 0.0
        self._cycles = 0
        self._points: list[Array] = []

    def _filter_of(self, names: tuple[str, ...]) -> IMM:
        return self.form.imm(self.models.of(names), self.topology.transition(names))

    @property
    def imm(self) -> IMM:
        """The filter over the active models."""
        return self._filter(self.active)

    def start(self, state: Array, covariance: Array) -> Belief:
        """Return the belief in one state (43,) with a covariance (33, 33)."""
        held = self.form.covariances(state[None], covariance)[0]
        return start(state, held, len(self.active))

    def fused(self, belief: Belief) -> tuple[Array, Array]:
        """Return the mean state (43,) of all models and its error's covariance."""
        return self.form.fused(*self.imm.fused(belief))

    def predicted(self, belief: Belief) -> tuple[Array, Array]:
        """Predict the state and its error's covariance by the most probable model."""
        state, covariance = self.fused(belief)
        likely = self.models.of([self.active[int(belief.probabilities.argmax())]])
        states, covariances = likely.predict(state[None], covariance[None])
        return states[0], covariances[0]

    def widened(self, belief: Belief, variances: Array) -> Belief:
        """Return a belief with `variances` (33,) added to its errors'."""
        extra = self.form.covariances(unit(belief.states), np.diag(variances))
        return replace(belief, covariances=belief.covariances + extra)

    def cycle(self, before: Belief, measure: Measure, points: Array) -> Belief:
        """Return the belief one frame later, and switch groups.

        Args:
            before: The belief.
            measure: Returns the measurement of states.
            points: (17, 2) the joints detected in the frame, which decide about groups.

        Returns:
            The belief over the models that are then active.
        """
        self._points = [*self._points, points][-3:]
        self._cycles += 1
        measure = self.form.measure(measure)
        after = self.imm.cycle(before, measure)
        likely = most_probable(self.groups, self.active, after.probabilities)
        if self._structure == "all":
            self.group = likely
            return after
        # at first all models are active
        if self.group is None:
            if self._cycles < self.form.first_cycles(self.models):
                return after
            return self.keep_only(likely, after)  # VSMM 5
        # two groups are active: one may end
        if self.candidate_group is not None:
            return self.judged(after)
        # one group is active: another may join it, and this frame's cycle is repeated
        # over both
        requested = self._requested_group()
        if requested is None:
            return after
        union = self.union_with(requested)
        after = self.form.cycle_over_both(union, before, measure)
        self.bring_in(requested)
        return self.judged(after) if self.form.judges_first_cycle else after

    def _requested_group(self) -> str | None:
        """Return the group that the latest points ask for. VSMM 7.

        None if they ask for none, or for the present group.
        """
        number = requested_group(self._points)
        names = tuple(self.groups)
        if number is None or number >= len(names) or names[number] == self.group:
            return None
        return names[number]

    def union_with(self, candidate_group: str) -> Union:
        """Return the union of the present group and another one."""
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
        """Activate another group in addition to the present one."""
        assert self.group is not None
        self.active = self.topology.union([self.group, candidate_group])  # VSMM 8.4
        self.candidate_group = candidate_group
        self._log_ratio = 0.0

    def judged(self, after: Belief) -> Belief:
        """Return the belief after a cycle over both groups, and end one if it has lost.

        The ratio of the likelihoods covers all cycles since the new group was
        activated. Interpretation V12.
        """
        assert self.candidate_group is not None
        assert self.group is not None
        old = [self.active.index(name) for name in self.groups[self.group]]
        new = [self.active.index(name) for name in self.groups[self.candidate_group]]
        # If one of the two ratios is too low, the new group ends. If both are above 1,
        # the old one ends.
        # VSMM 9
        self._log_ratio += _log_ratio(after.log_likelihoods, old, new)
        smaller = min(_log_ratio(after.log_probabilities, old, new), self._log_ratio)
        if smaller < np.log(MIN_RATIO):
            return self.keep_only(self.group, after)
        if smaller > 0.0:
            return self.keep_only(self.candidate_group, after)
        return after

    def keep_only(self, group: str, belief: Belief) -> Belief:
        """End the other groups, and return the belief over the remaining group."""
        old = self.active
        self.active = self.groups[group]
        self.group = group
        self.candidate_group = None
        return normalised(regrouped(belief, old, self.active, {}))


def _log_ratio(logarithms: Array, old: Sequence[int], new: Sequence[int]) -> float:
    """Return the logarithm of the ratio of the new models' sum to the old ones'."""
    new_sum = np.logaddexp.reduce(logarithms[new])
    old_sum = np.logaddexp.reduce(logarithms[old])
    return float(new_sum - old_sum)
