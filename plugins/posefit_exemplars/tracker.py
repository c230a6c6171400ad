"""The tracker: a frame's work, and the path that is told `lag` frames later."""

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
    assorted,
    joined_beams,
    jumped,
    stepped,
    strayed,
)
from posefit_exemplars.codes import Rows
from posefit_exemplars.exemplars import Exemplars
from posefit_exemplars.look import Look
from posefit_exemplars.lost import doubted, stored_judge
from posefit_exemplars.refinement import Make, refined, surroundings
from posefit_exemplars.sampling import Sampler
from posefit_exemplars.smoothing import SMOOTHED, Finding, smoothed
from posefit_exemplars.window import Seen, likeliest, mean_around, seen, weights

WIDTH = 400  # states that a beam keeps
FULL = 0.35  # share of the budget that is for full-size costs of states
REFINED = 0.45  # share that is for refining
AROUND = 0.25  # share of the small pictures that is for where clips go on; the rest looks everywhere
GROUPS_TAKEN = 40  # of those that fit best anywhere, whose poses are looked at; in the first frame more
FIRST_GROUPS = 200
OF_A_GROUP = 20  # poses, drawn at random, that stand for a group in a look everywhere
FACING = np.radians(45.0)  # how far a yaw that was told may be off, to either side
AWAY = 4.0  # cost of a state, over the temperature, that faces as far again from what is said of its frame,
PACE = 30.0  # where there are so many frames a second


@dataclass(frozen=True, eq=False)
class _Waiting:
    """A frame whose pose is not told yet."""

    seen: Seen
    look: Look
    usable: bool
    evaluations: float
    seconds: float
    cpu_seconds: float


@dataclass(frozen=True, eq=False)
class ExemplarTracker:
    """Follows a person along recorded clips: what is likely is a way through them, not a pose."""

    task: Task
    exemplars: Exemplars = field(repr=False)
    steps: Steps
    transitions: Transitions
    temperature: float
    lag: int  # frames that are seen before a pose is told
    make: Make | None  # an optimiser that refines; None where nothing does
    pull: float
    smoothing: float  # thirtieths of a second
    samples: int  # ways that are drawn; 0 is none
    power: float  # of the likelihoods, in the posterior that they are drawn from

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield a `Frame` for each observation, `lag` observations later."""
        found = smoothed(self._refined(observations, rng), self.smoothing * self.task.fps / 30.0, self._ahead)
        yield from doubted(found, self.task, stored_judge())

    @property
    def _ahead(self) -> int:
        """How many of the frames that are waited for are there to smooth with."""
        return min(math.ceil(SMOOTHED * self.smoothing * self.task.fps / 30.0), self.lag)

    def _refined(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Finding]:
        """Yield what is found in each frame, before it is smoothed."""
        waiting: deque[_Waiting] = deque()
        latest: Seen | None = None
        off, sampler = np.zeros(ANGLES), Sampler(self.exemplars, self.samples, self.power, rng)
        for observation in observations:
            began, begun = time.perf_counter(), time.process_time()
            look = Look(self.task, observation)
            latest, used = self._seen(look, observation, latest, rng)
            spent = time.perf_counter() - began, time.process_time() - begun
            waiting.append(_Waiting(latest, look, observation.usable, used, *spent))
            if len(waiting) > self.lag - self._ahead:
                found, off = self._told(waiting, off, sampler, rng)
                yield found
        while waiting:
            found, off = self._told(waiting, off, sampler, rng)
            yield found

    def _seen(
        self, look: Look, observation: Observation, before: Seen | None, rng: np.random.Generator
    ) -> tuple[Seen, float]:
        """Return what is known of a frame, and how many evaluations it took."""
        latest, seconds, root = None if before is None else before.beam, 1.0 / self.task.fps, look.root
        if latest is not None and not observation.usable:
            beam = stepped(self.exemplars, latest, seconds, self.steps, WIDTH, root)
            if root is not None:
                beam = replace(beam, places=np.repeat(root[None], len(beam), axis=0))
            return self._joined(beam, np.zeros(len(beam)), before, look), 0.0
        full = int(FULL * self.task.evaluations)
        last = 3 + look.cameras  # the pose that is told, its twins, and what is left of a small picture's share
        small = int(((1.0 - REFINED) * self.task.evaluations - full - last) / look.share)
        around = int(AROUND * small) if latest is not None or self.task.first_pose is not None else 0
        elsewhere, looked = self._elsewhere(look, latest, small - around, rng)
        beams = [elsewhere]
        if latest is None and self.task.first_pose is not None:
            given = self._given(self.task.first_pose, around)
            beams = [replace(elsewhere, totals=elsewhere.totals + self.steps.jump), given]
        if latest is not None:
            beams.append(stepped(self.exemplars, latest, seconds, self.steps, around, root))
        beam = self._at(look, joined_beams(*beams), latest is not None)
        away = turned_away(beam.yaws, observation.yaw) * PACE / self.task.fps
        totals = beam.totals + away + look.small(self._poses(beam), beam.places) / self.temperature
        used = (looked + len(beam)) * look.share
        kept = assorted(self.exemplars, beam, totals, full)
        beam = beam.chosen(kept)
        fits = away[kept] + look.full(self._poses(beam), beam.places) / self.temperature
        used += len(beam)
        best = assorted(self.exemplars, beam, beam.totals + fits, WIDTH)
        return self._joined(beam.chosen(best), fits[best], before, look), used

    def _joined(self, beam: Beam, fits: Array, before: Seen | None, look: Look) -> Seen:
        """Return a frame, joined to the one before."""
        if before is None:
            return seen(beam, fits, None, None)
        transition = Transition(self.exemplars, before.beam, beam, 1.0 / self.task.fps, look.root, look.eye)
        return seen(beam, fits, before, self.transitions(transition))

    def _elsewhere(self, look: Look, before: Beam | None, most: int, rng: np.random.Generator) -> tuple[Beam, int]:
        """Return states that fit, wherever they are; and how many small pictures were looked at."""
        taken = min(GROUPS_TAKEN if before is not None else FIRST_GROUPS, max(most // (4 * OF_A_GROUP), 1))
        count = max(most - taken * OF_A_GROUP, 1)
        states, middle, reach = self.exemplars.drawn(count, rng), 0.0, np.pi
        told = self.task.yaw if before is None and look.yaw is None else look.yaw
        if told is not None:
            middle, reach = told, FACING
        yaws = middle + rng.uniform(-reach, reach, count)
        beam = self._at(look, self._begun(states, yaws, before), False)
        best = np.argsort(look.small(self._poses(beam), beam.places), kind="stable")[:taken]
        found = [self._some(int(self.exemplars.owners[states[row]]), rng) for row in best]
        states, yaws = np.concatenate(found), np.repeat(yaws[best], [len(some) for some in found])
        return self._begun(states, yaws, before), len(beam)

    def _given(self, angles: Array, most: int) -> Beam:
        """Return the states, at most so many, that are most like a first pose whose angles (63,) and yaw are known."""
        yaw = self.task.yaw or 0.0
        code = self.exemplars.coding.coded(np.array([[yaw, 0.0, 0.0, *angles]]))[0]
        apart = self.exemplars.squares - 2.0 * (self.exemplars.codes @ code)
        turns = [-TURN, 0.0, TURN]
        near = np.argsort(apart, kind="stable")[: min(most // len(turns), WIDTH)]
        states, yaws = np.tile(near, len(turns)), yaw + np.repeat(turns, len(near))
        return self._begun(states, yaws, None)

    def _begun(self, states: Rows, yaws: Array, before: Beam | None) -> Beam:
        """Return states that nothing led to but a jump, or the beginning."""
        if before is not None:
            return jumped(states, yaws, before, self.steps)
        many = len(states)
        return Beam(states, yaws, np.full(many, -1), np.zeros(many), np.repeat(self.task.anchor[None], many, axis=0))

    def _some(self, group: int, rng: np.random.Generator) -> Rows:
        members = self.exemplars.of_groups(np.array([group]))
        return members if len(members) <= OF_A_GROUP else rng.choice(members, OF_A_GROUP, replace=False)

    def _poses(self, beam: Beam) -> Array:
        poses = self.exemplars.poses[beam.states]
        poses[:, 0] = beam.yaws
        return poses

    def _at(self, look: Look, beam: Beam, begun: bool = True) -> Beam:
        """Return states where they stand; how far that is from where they were expected costs them something."""
        places = look.placed(self._poses(beam), beam.places)
        if not begun or self.task.translation == "known":
            return replace(beam, places=places)
        off = strayed(places, beam.places, look.eye, self.steps)
        return replace(beam, places=places, totals=beam.totals + off)

    def _told(
        self, waiting: deque[_Waiting], off: Array, sampler: Sampler, rng: np.random.Generator
    ) -> tuple[Finding, Array]:
        """Return the oldest frame that waits, refined around the best way to the newest; and how far off that it is.

        The path's pose is the mean of what is likely about it. The search begins as far off it as the frame before.
        """
        began, begun = time.perf_counter(), time.process_time()
        window = [one.seen for one in waiting]
        row, likely, oldest = likeliest(window), weights(window), waiting.popleft()
        drawn = sampler.drawn(window, row)
        beam, look, evaluations = oldest.seen.beam, oldest.look, oldest.evaluations
        codes = self.exemplars.codes[beam.states]
        path, place, code = mean_around(row, likely, codes, self._poses(beam), beam.places)
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
        return Finding(pose, place, look, evaluations, seconds, cpu_seconds, drawn), off


def turned_away(yaws: Array, told: float | None) -> Array:
    """Return what it costs that states have yaws (n,), radians, where a frame's is said to be about `told`."""
    if told is None:
        return np.zeros(len(yaws))
    return np.asarray(AWAY * np.clip(np.abs(wrapped(yaws - told)) / FACING - 1.0, 0.0, 1.0))
