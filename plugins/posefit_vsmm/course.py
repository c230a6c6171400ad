"""One track of the variable-structure filter, frame by frame. VSMM steps 5 to 9."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal, get_args

import numpy as np

from posefit.fitting import metrics
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.geometry.rotation import Array
from posefit.silhouette.cost import areas, mismatch
from posefit_vsmm.fresh import Matcher, estimated
from posefit_vsmm.groups import Topology
from posefit_vsmm.imm import IMM, Belief, Measurement, start
from posefit_vsmm.joints import errors
from posefit_vsmm.motion import Library
from posefit_vsmm.points import AT, Figure
from posefit_vsmm.preprocess import lines_of
from posefit_vsmm.shown import Shown
from posefit_vsmm.sight import Seen, Sight
from posefit_vsmm.state import ERROR, MANIFOLD, decode
from posefit_vsmm.switching import Contest, New, Rules, enlarged, joined, restricted

FIRST = 10  # cycles over all models before the first group is chosen
COAST = 15  # frames that the models go on alone when nothing is seen; then the track is lost
LOST = 0.35  # IoU: below it, for so many frames, the track is lost
LOST_FRAMES = 8
RECENT = 5  # frames: where the median of their surprise is larger than SURPRISED, the group is chosen anew
SURPRISED = 2.0
UNSURE = np.repeat([0.05, np.radians(15.0)], [3, ERROR - 3])  # metres and radians: deviations of a fresh estimation
ASTRAY = 2  # frames: a limb that is not where it is sought, while an end point is nobody's, is sought all around
ASTRAY_SPREAD = np.radians(15.0)  # deviation that each of its joints then gains a frame
# which of the nine quaternions a limb's end depends on
_LIMBS = {"left hand": (4, 5), "right hand": (6, 7), "left foot": (0, 1), "right foot": (2, 3)}

Structure = Literal["variable", "all"]
Measure = Callable[[Array], Measurement]


@dataclass(frozen=True, eq=False)
class Settings:
    """What a course is run by: the models, their groups and how they switch."""

    library: Library
    topology: Topology
    structure: Structure
    rules: Rules
    new: New
    contest: Contest  # a blank one

    def __post_init__(self) -> None:
        for name, choices in (("structure", Structure), ("new", New)):
            if getattr(self, name) not in get_args(choices):
                raise ValueError(f"{name} must be one of {', '.join(get_args(choices))}, got {getattr(self, name)!r}")


class Course:
    """One track, as far as it has come."""

    def __init__(self, task: Task, settings: Settings, rng: np.random.Generator) -> None:
        self._task, self._how, self._rng = task, settings, rng
        skeleton, carried = task.body.skeleton, settings.library
        self._topology = settings.topology
        self._every = self._topology.union(self._topology.groups)
        self._models = {name: carried.models[name].fitted_to(skeleton, task.fps) for name in self._every}
        self._sight = Sight(task.body, task.cameras, Figure(skeleton, carried.reliance), errors())
        self._imm = lru_cache(self._made)
        self._latest: Frame | None = task.before[-1] if task.before else None
        self._shown: list[Shown] = []
        self._belief: Belief | None = None
        self._forget()

    def _made(self, names: tuple[str, ...]) -> IMM:
        return IMM([self._models[name] for name in names], self._topology.transition(names), MANIFOLD)

    def _forget(self) -> None:
        """Start anew: all models, no group, nothing known of the limbs."""
        self._active = self._every
        self._group: str | None = None
        self._newcomer: str | None = None
        self._contest = self._how.contest
        self._cycles = self._rested = self._unseen = self._bad = 0
        self._astray = dict.fromkeys(_LIMBS, 0)
        self._surprises: list[float] = []  # of the latest frames
        self._drawn: list[Array] = []  # projected points (17, 2) of the latest frames

    def frame(self, observation: Observation) -> Frame:
        """Return what is found in the next frame."""
        began = time.perf_counter()
        lines = [lines_of(silhouette.mask) for silhouette in observation.silhouettes]
        blind = not observation.usable or all(one is None for one in lines)
        self._unseen = self._unseen + 1 if blind else 0
        if self._belief is not None and (self._bad >= LOST_FRAMES or self._unseen > COAST):
            self._belief = None  # lost
        if self._belief is None and blind:
            return self._told(None, observation, 0, began, {"lost": True})
        spent = self._begin(observation) if self._belief is None else 0
        belief, imm = self._belief, self._imm(self._active)
        assert belief is not None
        state, spread = imm.fused(belief)
        likely = self._models[self._active[int(belief.probabilities.argmax())]]
        expected, spread = likely.predict(state, spread)

        def look(spread: Array) -> list[Seen | None]:
            return [
                None if one is None or blind else self._sight.look(view, one, expected, spread)
                for view, one in enumerate(lines)
            ]

        seen = look(spread)
        if (extra := self._astray_spread(seen)).any():
            belief = replace(belief, covariances=belief.covariances + np.diag(extra))
            seen = look(spread + np.diag(extra))
        surprise = float(np.mean([one.surprise for one in seen if one is not None] or [0.0]))
        self._surprises = [*self._surprises, surprise][-RECENT:]
        details: dict[str, Any] = {"surprise": surprise, "lost": False, "detection_seconds": time.perf_counter() - began}

        filtering = time.perf_counter()

        def measure(one: Array) -> Measurement:
            return self._sight.measure(one, seen, observation.translation)

        self._belief = imm.cycle(belief, measure)
        if self._how.structure == "variable":
            self._restructure(belief, measure)
        state, _ = self._imm(self._active).fused(self._belief)
        points, _ = self._sight.figure.seen(self._task.cameras[0], state)
        self._drawn = [*self._drawn, points][-2 * self._how.rules.smoothing - 1 :]
        details |= {
            "filter_seconds": time.perf_counter() - filtering,
            "models": self._active,
            "probabilities": self._belief.probabilities,
            "group": self._group,
            "newcomer": self._newcomer,
            "repairs": self._belief.repairs,
        }
        return self._told(state, observation, spent, began, details | self._joints(seen, expected))

    def _begin(self, observation: Observation) -> int:
        """Estimate a pose from this frame alone, all models alike; return how many evaluations that took."""
        task, latest = self._task, self._latest
        matcher = Matcher(task, observation, self._how.library.reliance)
        yaw, anchor, given = task.yaw, task.anchor, None
        if latest is not None:
            yaw, anchor, given = float(latest.pose[0]), latest.translation, latest.pose
        elif task.first_pose is not None:
            given = np.concatenate([[yaw or 0.0, 0.0, 0.0], task.first_pose])
        models = list(self._models.values())
        state = estimated(matcher, models, yaw, np.asarray(anchor), given, task.evaluations - 1, self._rng)
        self._forget()
        self._belief = start(state, np.diag(UNSURE**2), len(self._active))
        return matcher.evaluations

    def _astray_spread(self, seen: Sequence[Seen | None]) -> Array:
        """Return the variances (33,) to add for limbs whose ends are not found though an end point is nobody's."""
        extra = np.zeros(ERROR)
        spare = any(one.spare for one in seen if one is not None)
        for limb, joints in _LIMBS.items():
            found = any(one.confidence[AT[limb]] > 0.0 for one in seen if one is not None)
            self._astray[limb] = self._astray[limb] + 1 if spare and not found else 0
            if self._astray[limb] >= ASTRAY:
                for k in joints:
                    extra[6 + 3 * k : 9 + 3 * k] = ASTRAY_SPREAD**2
        return extra

    def _restructure(self, before: Belief, measure: Measure) -> None:
        """Let groups come and go after a cycle that went on from `before`."""
        assert self._belief is not None
        topology = self._topology
        self._cycles += 1
        if self._group is None:
            if self._cycles >= FIRST:
                self._keep(topology.most_probable(self._active, self._belief.probabilities))  # VSMM 5
            return
        if self._newcomer is not None:
            decision = self._contest.decide(self._belief, self._active)  # VSMM 9
            if decision is not None:
                self._keep(self._newcomer if decision == "new" else self._group)
            return
        self._rested += 1
        if self._rested > self._how.rules.dwell and np.median(self._surprises) > SURPRISED:
            self._reconsider(before, measure)
            return
        asked = self._how.rules.wanted(self._drawn) if self._rested > self._how.rules.dwell else None
        names = tuple(topology.groups)
        if asked is None or asked >= len(names) or names[asked] == self._group:
            return
        self._activate(names[asked], before, measure)

    def _reconsider(self, before: Belief, measure: Measure) -> None:
        """Choose the group anew, as at first: the present one cannot explain what is seen, and no rule saw it come."""
        old, every = self._active, self._every
        state, spread = self._imm(old).fused(before)
        self._belief = self._imm(every).cycle(enlarged(before, old, every, state, spread), measure)
        self._active, self._group, self._cycles, self._surprises = every, None, 0, []

    def _activate(self, newcomer: str, before: Belief, measure: Measure) -> None:
        """Bring a group into force beside the present one. VSMM step 8."""
        assert self._belief is not None and self._group is not None
        old, topology = self._active, self._topology
        union = topology.union((self._group, newcomer))  # VSMM 8.4
        imm = self._imm(union)
        if self._how.new == "rerun":
            state, spread = self._imm(old).fused(before)
            self._belief = imm.cycle(enlarged(before, old, union, state, spread), measure)
        else:
            state, _ = self._imm(old).fused(self._belief)
            self._belief = joined(self._belief, old, union, *self._starts(state, set(union) - set(old)))
        self._newcomer, self._active = newcomer, union
        groups = topology.groups
        self._contest = replace(self._how.contest, old=groups[self._group], new=groups[newcomer])

    def _starts(self, state: Array, names: set[str]) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return, for new models, the typical pose nearest to a state, and their noise."""
        poses, noise = {}, {}
        for name in names:
            model = self._models[name]
            nearest = model.nearest(state)
            poses[name], noise[name] = nearest, model.noise
        return poses, noise

    def _keep(self, group: str) -> None:
        """Let one group alone go on."""
        assert self._belief is not None
        kept = self._topology.groups[group]
        self._belief = restricted(self._belief, self._active, kept)
        self._active, self._group, self._newcomer, self._rested = kept, group, None, 0

    def _joints(self, seen: Sequence[Seen | None], expected: Array) -> dict[str, Any]:
        """Return the 17 joints (views, 17, 2) as they are shown, and how sure the rules were of them (views, 17)."""
        points, confidence = [], []
        for view, (camera, one) in enumerate(zip(self._task.cameras, seen, strict=True)):
            pixels = self._sight.figure.seen(camera, expected)[0] if one is None else one.points
            if len(self._shown) == view:
                self._shown.append(Shown(pixels))
            sure = np.zeros(len(pixels)) if one is None else one.confidence
            points.append(self._shown[view].follow(pixels, sure, np.ones((len(pixels), 2)) if one is None else one.variances))
            confidence.append(sure)
        return {"joints": np.array(points), "confidence": np.array(confidence)}

    def _told(
        self, state: Array | None, observation: Observation, spent: int, began: float, details: dict[str, Any]
    ) -> Frame:
        """Return the frame of a state; without one, the latest pose once more."""
        task = self._task
        if state is not None:
            poses, places = decode(state[None], self._how.library.reliance)
            pose, place = poses[0], places[0]
        elif self._latest is not None:
            pose, place = self._latest.pose, self._latest.translation
        else:
            pose, place = np.zeros(66), np.array(task.anchor, dtype=np.float64)
            pose[0] = task.yaw or 0.0
        if observation.translation is not None:
            place = np.array(observation.translation, dtype=np.float64)
        views = zip(task.cameras, observation.silhouettes, strict=True)
        counts = np.concatenate([areas(task.body, camera, one, pose[None], place[None]) for camera, one in views])
        known = [one.known for one in observation.silhouettes]
        heard = counts[known] if any(known) else counts
        cost, iou = float(mismatch(heard).mean()), float(metrics.iou(heard).mean())
        if state is not None and not self._unseen:
            self._bad = self._bad + 1 if iou < LOST else 0
        seconds = time.perf_counter() - began
        used = spent + (state is not None)
        frame = Frame(pose, place, cost, counts, used, seconds, np.array([cost]), details=details)
        self._latest = frame
        return frame
