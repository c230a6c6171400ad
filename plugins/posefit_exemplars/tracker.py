"""The tracker: the work of each frame, and the path that is reported `lag` frames later."""

import math
import time
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import ANGLES
from posefit_exemplars.beam import (
    TURN,
    Beam,
    Steps,
    Transition,
    Transitions,
    diverse_best,
    jump_states,
    merged,
    next_states,
    root_deviation_costs,
)
from posefit_exemplars.exemplars import Exemplars, Rows
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.lost_model import stored_classifier, with_failure_probabilities
from posefit_exemplars.refinement import Make, refined, surroundings
from posefit_exemplars.smoothing import SMOOTHED, Estimate, smoothed
from posefit_exemplars.window import FrameStates, Sampler, frame_states, mean_near, state_weights, viterbi_state

WIDTH = 400  # states of a beam
FULL = 0.35  # share of the budget that is for full-size costs of states
REFINED = 0.45  # share that is for refining
AROUND = 0.25  # share of the small pictures that is for where clips go on; the rest is for a search everywhere
GROUPS_TAKEN = 40  # of those that fit best anywhere, whose poses are evaluated; in the first frame more
FIRST_GROUPS = 200
OF_A_GROUP = 20  # poses, drawn at random, that stand for a group in a search everywhere
FACING = np.radians(45.0)  # tolerance of a yaw that is given, to either side
AWAY = 4.0  # cost of a state, over the temperature, whose yaw is off by twice as much,
PACE = 30.0  # at this frame rate


@dataclass(frozen=True, eq=False)
class _PendingFrame:
    """A frame whose pose is not reported yet."""

    states: FrameStates
    look: FrameCosts
    usable: bool
    evaluations: float
    seconds: float
    cpu_seconds: float


@dataclass(frozen=True, eq=False)
class ExemplarTracker:
    """Follows a person along the likeliest path through recorded clips."""

    task: Task
    exemplars: Exemplars = field(repr=False)
    steps: Steps
    transitions: Transitions
    temperature: float
    lag: int  # later frames that are used before a pose is reported
    make: Make | None  # an optimiser that refines; None where nothing does
    pull: float
    smoothing: float  # thirtieths of a second
    samples: int  # ways that are drawn; 0 is none
    power: float  # of the likelihoods, in the posterior that they are drawn from

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield a `Frame` for each observation, `lag` observations later."""
        frames = smoothed(self._refined(observations, rng), self.smoothing * self.task.fps / 30.0, self._ahead)
        yield from with_failure_probabilities(frames, self.task, stored_classifier())

    @property
    def _ahead(self) -> int:
        """The number of waiting frames that are only for smoothing."""
        return min(math.ceil(SMOOTHED * self.smoothing * self.task.fps / 30.0), self.lag)

    def _refined(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Estimate]:
        """Yield the estimate of each frame, before it is smoothed."""
        waiting: deque[_PendingFrame] = deque()
        latest: FrameStates | None = None
        off, sampler = np.zeros(ANGLES), Sampler(self.exemplars, self.samples, self.power, rng)
        for observation in observations:
            began, begun = time.perf_counter(), time.process_time()
            look = FrameCosts(self.task, observation)
            latest, used = self._evaluated(look, observation, latest, rng)
            spent = time.perf_counter() - began, time.process_time() - begun
            waiting.append(_PendingFrame(latest, look, observation.usable, used, *spent))
            if len(waiting) > self.lag - self._ahead:
                estimate, off = self._estimated(waiting, off, sampler, rng)
                yield estimate
        while waiting:
            estimate, off = self._estimated(waiting, off, sampler, rng)
            yield estimate

    def _evaluated(
        self, look: FrameCosts, observation: Observation, before: FrameStates | None, rng: np.random.Generator
    ) -> tuple[FrameStates, float]:
        """Return the states of a frame, and the evaluations that they took."""
        latest, seconds, root = None if before is None else before.beam, 1.0 / self.task.fps, look.root
        if latest is not None and not observation.usable:
            beam = next_states(self.exemplars, latest, seconds, self.steps, WIDTH, root)
            if root is not None:
                beam = replace(beam, places=np.repeat(root[None], len(beam), axis=0))
            return self._joined(beam, np.zeros(len(beam)), before, look), 0.0
        full = int(FULL * self.task.evaluations)
        last = 3 + look.cameras  # the reported pose, its twins, and what is left of a small picture's share
        small = int(((1.0 - REFINED) * self.task.evaluations - full - last) / look.share)
        around = int(AROUND * small) if latest is not None or self.task.first_pose is not None else 0
        elsewhere, looked = self._elsewhere(look, latest, small - around, rng)
        beams = [elsewhere]
        if latest is None and self.task.first_pose is not None:
            given = self._given(self.task.first_pose, around)
            beams = [replace(elsewhere, totals=elsewhere.totals + self.steps.jump), given]
        if latest is not None:
            beams.append(next_states(self.exemplars, latest, seconds, self.steps, around, root))
        beam = self._placed(look, merged(*beams), latest is not None)
        away = yaw_costs(beam.yaws, observation.yaw) * PACE / self.task.fps
        totals = beam.totals + away + look.small(self._poses(beam), beam.places) / self.temperature
        used = (looked + len(beam)) * look.share
        kept = diverse_best(self.exemplars, beam, totals, full)
        beam = beam.chosen(kept)
        fits = away[kept] + look.full(self._poses(beam), beam.places) / self.temperature
        used += len(beam)
        best = diverse_best(self.exemplars, beam, beam.totals + fits, WIDTH)
        return self._joined(beam.chosen(best), fits[best], before, look), used

    def _joined(self, beam: Beam, fits: Array, before: FrameStates | None, look: FrameCosts) -> FrameStates:
        """Return a frame, joined to the one before."""
        if before is None:
            return frame_states(beam, fits, None, None)
        transition = Transition(self.exemplars, before.beam, beam, 1.0 / self.task.fps, look.root, look.eye)
        return frame_states(beam, fits, before, self.transitions(transition))

    def _elsewhere(
        self, look: FrameCosts, before: Beam | None, most: int, rng: np.random.Generator
    ) -> tuple[Beam, int]:
        """Return states that fit, from anywhere, and the number of small pictures that were evaluated."""
        taken = min(GROUPS_TAKEN if before is not None else FIRST_GROUPS, max(most // (4 * OF_A_GROUP), 1))
        count = max(most - taken * OF_A_GROUP, 1)
        states, middle, reach = self.exemplars.drawn(count, rng), 0.0, np.pi
        known = self.task.yaw if before is None and look.yaw is None else look.yaw
        if known is not None:
            middle, reach = known, FACING
        yaws = middle + rng.uniform(-reach, reach, count)
        beam = self._placed(look, self._started(states, yaws, before), False)
        best = np.argsort(look.small(self._poses(beam), beam.places), kind="stable")[:taken]
        members = [self._members_of(int(self.exemplars.owners[states[row]]), rng) for row in best]
        states, yaws = np.concatenate(members), np.repeat(yaws[best], [len(some) for some in members])
        return self._started(states, yaws, before), len(beam)

    def _given(self, angles: Array, most: int) -> Beam:
        """Return the states, at most so many, that are most like a first pose whose angles (63,) and yaw are known."""
        yaw = self.task.yaw or 0.0
        code = self.exemplars.coding.coded(np.array([[yaw, 0.0, 0.0, *angles]]))[0]
        apart = self.exemplars.squares - 2.0 * (self.exemplars.codes @ code)
        turns = [-TURN, 0.0, TURN]
        near = np.argsort(apart, kind="stable")[: min(most // len(turns), WIDTH)]
        states, yaws = np.tile(near, len(turns)), yaw + np.repeat(turns, len(near))
        return self._started(states, yaws, None)

    def _started(self, states: Rows, yaws: Array, before: Beam | None) -> Beam:
        """Return states that are reached by a jump, or that begin a track."""
        if before is not None:
            return jump_states(states, yaws, before, self.steps)
        many = len(states)
        return Beam(states, yaws, np.full(many, -1), np.zeros(many), np.repeat(self.task.anchor[None], many, axis=0))

    def _members_of(self, group: int, rng: np.random.Generator) -> Rows:
        members = self.exemplars.of_groups(np.array([group]))
        return members if len(members) <= OF_A_GROUP else rng.choice(members, OF_A_GROUP, replace=False)

    def _poses(self, beam: Beam) -> Array:
        poses = self.exemplars.poses[beam.states]
        poses[:, 0] = beam.yaws
        return poses

    def _placed(self, look: FrameCosts, beam: Beam, begun: bool = True) -> Beam:
        """Return states with aligned roots; the distance from where they were expected adds to their costs."""
        places = look.placed(self._poses(beam), beam.places)
        if not begun or self.task.translation == "known":
            return replace(beam, places=places)
        off = root_deviation_costs(places, beam.places, look.eye, self.steps)
        return replace(beam, places=places, totals=beam.totals + off)

    def _estimated(
        self, waiting: deque[_PendingFrame], off: Array, sampler: Sampler, rng: np.random.Generator
    ) -> tuple[Estimate, Array]:
        """Return the estimate of the oldest waiting frame, refined around the path, and its offset from the path.

        The path's pose is the weighted mean of similar states. The search begins at the offset of the frame before.
        """
        began, begun = time.perf_counter(), time.process_time()
        window = [one.states for one in waiting]
        row, likely, oldest = viterbi_state(window), state_weights(window), waiting.popleft()
        drawn = sampler.drawn(window, row)
        beam, look, evaluations = oldest.states.beam, oldest.look, oldest.evaluations
        codes = self.exemplars.codes[beam.states]
        path, place, code = mean_near(row, likely, codes, self._poses(beam), beam.places)
        pose = path + off if oldest.usable else path
        if self.make is not None and oldest.usable:
            count = int(REFINED * self.task.evaluations)
            space = surroundings(self.exemplars, path, code, off)

            def cost(poses: Array) -> Array:
                return look.full(poses, look.placed(poses, np.repeat(place[None], len(poses), axis=0)))

            pose, used = refined(space, cost, self.make, self.pull, count, rng)
            evaluations += used
            off = wrapped(pose - path)
        if oldest.usable:
            place = look.placed(pose[None], place[None])[0]
        seconds = oldest.seconds + time.perf_counter() - began
        cpu_seconds = oldest.cpu_seconds + time.process_time() - begun
        return Estimate(pose, place, look, evaluations, seconds, cpu_seconds, drawn), off


def yaw_costs(yaws: Array, known: float | None) -> Array:
    """Return the costs (n,) of yaws (n,), radians, in a frame whose yaw is about `known`."""
    if known is None:
        return np.zeros(len(yaws))
    return np.asarray(AWAY * np.clip(np.abs(wrapped(yaws - known)) / FACING - 1.0, 0.0, 1.0))
