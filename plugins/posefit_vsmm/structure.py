"""Which models are in force, cycle by cycle: the variable structure. VSMM steps 5 to 9."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, final, get_args

import numpy as np

from posefit.arrays import Array
from posefit.geometry.skeleton import Skeleton
from posefit_imm import IMM, PLACED, Belief, Measurement
from posefit_vsmm.groups import Topology
from posefit_vsmm.motion import Library
from posefit_vsmm.switching import New, Rivalry, Rules, SequentialTest, enlarged, enlarged_literally, restricted

FIRST = 10  # cycles over all models before a group is chosen
RECENT = 5  # frames: where the median of their surprise is larger than SURPRISED, the group is chosen anew
SURPRISED = 1.2  # of the normalised innovation squared a coordinate, which is 1 on average where a filter is consistent

Structure = Literal["variable", "all"]
Measure = Callable[[Array], Measurement]


@dataclass(frozen=True, eq=False, kw_only=True)
class Switching:
    """The models, their groups and how they switch."""

    library: Library
    topology: Topology
    structure: Structure
    rules: Rules
    new: New
    test: SequentialTest

    def __post_init__(self) -> None:
        for name, choices in (("structure", Structure), ("new", New)):
            if getattr(self, name) not in get_args(choices):
                raise ValueError(f"{name} must be one of {', '.join(get_args(choices))}, got {getattr(self, name)!r}")


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
        """Return the belief one frame later. Groups come and go; `surprise` is that of what was just seen."""
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

    def drawn(self, points: Array) -> None:
        """Take where the points (17, 2) of the latest state are projected."""
        self._drawn = [*self._drawn, points][-2 * self._how.rules.smoothing - 1 :]

    def _reconsidered(self, before: Belief, measure: Measure) -> Belief:
        """Choose the group anew, as at first: the present one cannot explain what is seen, and no rule saw it come."""
        old, (state, spread) = self.active, self.imm.fused(before)
        self.restart()
        return self.imm.cycle(enlarged(before, old, self.active, state, spread), measure)

    def _activated(self, before: Belief, after: Belief, measure: Measure) -> Belief:
        """Bring the group that the rules ask for into force beside the present one, if they ask for one."""
        groups, names = self._topology.groups, tuple(self._topology.groups)
        asked = self._how.rules.wanted(self._drawn)
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
