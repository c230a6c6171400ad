"""The tracker: its settings, the work of each frame, and the path that is reported `lag` frames later."""

import math
import time
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.check import at_least, positive
from posefit.fitting.landmarks import landmark_costs
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.geometry.rotation import wrapped
from posefit_exemplars import hypotheses
from posefit_exemplars.beam import (
    TURN,
    Beam,
    Steps,
    diverse_best,
    merged,
    next_states,
    root_deviation_costs,
    transition_costs,
)
from posefit_exemplars.exemplars import Rows, exemplars_of
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.lost_model import stored_classifier, with_failure_probabilities
from posefit_exemplars.smoothing import SMOOTHED, Estimate, smoothed
from posefit_exemplars.window import (
    FrameStates,
    SampledPaths,
    Sampler,
    frame_states,
    mean_near,
    squares_apart,
    state_weights,
    viterbi_state,
)

MIN_EVALUATIONS = 300  # of a frame, so that each stage has some
WIDTH = 400  # states of a beam
FULL = 0.6  # share of the beam's evaluations that is for full-size costs of states
FITTED = 0.8  # share of the budget that is for fitting hypotheses
AROUND = 0.25  # share of the small pictures that is for where clips go on; the rest is for a search everywhere,
SEARCHES = 10.0  # so many times a second
GROUPS_TAKEN = 40  # of those that fit best anywhere, whose poses are evaluated; in the first frame more
FIRST_GROUPS = 200
OF_A_GROUP = 20  # poses, drawn at random, that stand for a group in a search everywhere
FACING = np.radians(45.0)  # tolerance of a yaw that is given, to either side
AWAY = 4.0  # cost over the temperature of a state whose yaw is off by twice as much, at this frame rate:
PACE = 30.0


@dataclass(frozen=True, eq=False)
class _PendingFrame:
    """A frame whose pose is not reported yet."""

    states: FrameStates[Beam]
    look: FrameCosts
    evaluations: float
    seconds: float
    cpu_seconds: float


class ExemplarTracker:
    """The likeliest path through recorded clips (Toyama and Blake, 2001).

    Distances and turns in the settings are for a thirtieth of a second, whatever the frame rate.

    Settings:
        spread: distance of joints from where a clip goes on, metres, root mean square; above 0.
        turning_degrees: standard deviation of turns away from the clip; above 0.
        jump: cost of a step to any other pose, in units of cost over the temperature; 0 or more.
        temperature: divides silhouette costs; above 0. Errors of successive frames are correlated, so more than 1.
        straying: distance of an aligned root from where its clip goes on, to the side or up, metres; above 0.
        depth: the same towards or away from a single camera, metres; above 0.
        pace: distance of a known root from where its clip goes on, metres; above 0.
        lag: later frames that are used before a pose is reported, 0 or more.
        mirrored: whether the mirror images of all clips are learned from as well.
        fitted: whether several hypotheses of each frame are fitted to its contours; else the path alone is followed.
        smoothing: standard deviation of the smoothing of angles over time, in thirtieths of a second, 0 or more.
        samples: tracks drawn from the posterior, 0 or more; with 0 frames have no probability of being lost.
        posterior_temperature: divides silhouette costs in that posterior; above 0.
    """

    def __init__(
        self,
        task: Task,
        *,
        spread: float = 0.03,
        turning_degrees: float = 4.0,
        jump: float = 12.0,
        temperature: float = 2.0,
        straying: float = 0.01,
        depth: float = 0.03,
        pace: float = 0.008,
        lag: int = 20,
        mirrored: bool = True,
        fitted: bool = True,
        smoothing: float = 1.0,
        samples: int = 24,
        posterior_temperature: float = 8.0,
    ) -> None:
        distances = {"spread": spread, "straying": straying, "depth": depth, "pace": pace}
        temperatures = {"temperature": temperature, "posterior_temperature": posterior_temperature}
        for name, value in {**distances, "turning_degrees": turning_degrees, **temperatures}.items():
            positive(name, value)
        for name, value in {"jump": jump, "smoothing": smoothing, "lag": lag, "samples": samples}.items():
            at_least(name, value, 0)
        if task.evaluations < MIN_EVALUATIONS:
            raise InputError(f"evaluations must be at least {MIN_EVALUATIONS} for exemplars, got {task.evaluations}")
        intervals = 30.0 / task.fps  # of a thirtieth of a second, for which the settings are meant, in a frame
        slack, turning = math.sqrt(intervals), math.radians(turning_degrees)
        fastest = math.inf if task.fastest_turn is None else task.fastest_turn / task.fps
        # one set of states serves both directions
        training = [motion.reversed() for motion in task.training] if task.backwards else task.training
        self.task, self.exemplars = task, exemplars_of(training, task.body.skeleton, mirrored)
        self.seconds = (-1.0 if task.backwards else 1.0) / task.fps  # from a frame to the next one
        self.steps = Steps(spread * slack, turning * slack, jump, straying, depth, pace * intervals, fastest)
        self.temperature = temperature / intervals
        self.smoothing = smoothing * task.fps / 30.0  # frames
        # the number of waiting frames that are only for smoothing
        self.ahead = min(math.ceil(SMOOTHED * self.smoothing), lag)
        self.lag, self.evaluations = lag, float(task.evaluations)  # for the beam, of a frame
        self.hypotheses: hypotheses.HypothesisFilter | None = None
        self.samples, self.power = samples, temperature / posterior_temperature  # of likelihoods in the posterior
        share = FITTED * task.evaluations
        if fitted and share >= hypotheses.MIN_EVALUATIONS:
            self.evaluations -= share
            delay = (lag - self.ahead) // 2
            self.hypotheses = hypotheses.HypothesisFilter(
                task, self.exemplars, self.steps, self.temperature, share, delay, samples, self.power
            )

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield a `Frame` for each observation, `lag` observations later."""
        estimates = self._path(observations, rng)
        if self.hypotheses is not None:
            estimates = self.hypotheses.follow(estimates, rng.spawn(1)[0])
        frames = smoothed(estimates, self.smoothing, self.ahead)
        yield from with_failure_probabilities(frames, self.task, stored_classifier())

    def _path(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Estimate]:
        """Yield the estimate of each frame on the likeliest path of the beam."""
        waiting: deque[_PendingFrame] = deque()
        latest: FrameStates[Beam] | None = None
        delay, sampler = self.lag - self.ahead, None
        if self.hypotheses is None:
            sampler = Sampler(self.samples, self.power, rng.spawn(1)[0])
        else:
            delay -= self.hypotheses.delay
        every = max(round(self.task.fps / SEARCHES), 1)
        for number, observation in enumerate(observations):
            start, cpu_start = time.perf_counter(), time.process_time()
            look = FrameCosts(self.task, observation)
            latest, used = self._evaluated(look, latest, number % every == 0, rng)
            seconds, cpu_seconds = time.perf_counter() - start, time.process_time() - cpu_start
            waiting.append(_PendingFrame(latest, look, used, seconds, cpu_seconds))
            if len(waiting) > delay:
                yield self._estimated(waiting, sampler)
        while waiting:
            yield self._estimated(waiting, sampler)

    def _evaluated(
        self, look: FrameCosts, before: FrameStates[Beam] | None, everywhere: bool, rng: np.random.Generator
    ) -> tuple[FrameStates[Beam], float]:
        """Return the states of a frame, searched `everywhere` or where clips go on, and the evaluations it took."""
        latest, seconds, root = None if before is None else before.beam, self.seconds, look.root
        if latest is not None and not look.usable:
            beam = next_states(self.exemplars, latest, seconds, self.steps, WIDTH, root)
            if root is not None:
                beam = replace(beam, places=np.repeat(root[None], len(beam), axis=0))
            return self._joined(beam, np.zeros(len(beam)), before, look), 0.0
        last = 3 + look.cameras  # the reported pose, its twins, and what is left of a small picture's share
        evaluations = self.evaluations
        if latest is not None and self.hypotheses is not None:
            evaluations = max(evaluations / look.cameras, (1.0 - FITTED) * MIN_EVALUATIONS)  # several leave less open
        # no more states than have a cost in a small picture
        full = int(min(FULL * evaluations, (evaluations - last) / (1.0 + look.share)))
        small = int((evaluations - full - last) / look.share)
        around = int(AROUND * small) if latest is not None or self.task.first_pose is not None else 0
        beams, looked = list[Beam](), 0
        if everywhere or latest is None:
            elsewhere, looked = self._elsewhere(look, latest, small - around, rng)
            beams.append(elsewhere)
        if latest is not None:
            beams.append(next_states(self.exemplars, latest, seconds, self.steps, around, root))
        elif self.task.first_pose is not None:
            first = self._first_states(self.task.first_pose, around)
            beams = [replace(elsewhere, totals=elsewhere.totals + self.steps.jump), first]
        beam = self._placed(look, merged(*beams), latest is not None)
        away = yaw_costs(beam.yaws, look.yaw) * PACE / self.task.fps
        totals = beam.totals + away + look.small(self._poses(beam), beam.places) / self.temperature
        used = (looked + len(beam)) * look.share
        best = diverse_best(self.exemplars, beam, totals, full)
        beam = beam.chosen(best)
        poses = self._poses(beam)
        fits = (
            away[best]
            + look.full(poses, beam.places) / self.temperature
            + landmark_costs(look.landmarks(poses, beam.places))
        )
        used += len(beam)
        best = diverse_best(self.exemplars, beam, beam.totals + fits, WIDTH)
        return self._joined(beam.chosen(best), fits[best], before, look), used

    def _joined(self, beam: Beam, fits: Array, before: FrameStates[Beam] | None, look: FrameCosts) -> FrameStates[Beam]:
        """Return a frame, joined to the one before."""
        if before is None:
            return frame_states(beam, fits, None, None)
        steps = transition_costs(self.exemplars, before.beam, beam, self.seconds, self.steps, look.root, look.eye)
        return frame_states(beam, fits, before, steps)

    def _elsewhere(
        self, look: FrameCosts, before: Beam | None, most: int, rng: np.random.Generator
    ) -> tuple[Beam, int]:
        """Return states that fit, from anywhere, and the number of small pictures that were evaluated."""
        taken = min(GROUPS_TAKEN if before is not None else FIRST_GROUPS, max(most // (4 * OF_A_GROUP), 1))
        count = max(most - taken * OF_A_GROUP, 1)
        states, middle, reach = self.exemplars.draw(count, rng), 0.0, np.pi
        known = self.task.yaw if before is None and look.yaw is None else look.yaw
        if known is not None:
            middle, reach = known, FACING
        yaws = middle + rng.uniform(-reach, reach, count)
        beam = self._placed(look, self._started(states, yaws, before), False)
        best = np.argsort(look.small(self._poses(beam), beam.places), kind="stable")[:taken]
        groups = [self.exemplars.group_members(self.exemplars.owners[states[row]]) for row in best]
        some = [rows if len(rows) <= OF_A_GROUP else rng.choice(rows, OF_A_GROUP, replace=False) for rows in groups]
        yaws = np.repeat(yaws[best], [len(rows) for rows in some])
        return self._started(np.concatenate(some), yaws, before), len(beam)

    def _first_states(self, angles: Array, most: int) -> Beam:
        """Return the states, at most `most`, nearest to a first pose whose angles (63,) and yaw are known."""
        yaw = self.task.yaw or 0.0
        code = self.exemplars.coding.coded(np.array([[yaw, 0.0, 0.0, *angles]]))[0]
        apart = self.exemplars.squares - 2.0 * (self.exemplars.codes @ code)
        turns = [-TURN, 0.0, TURN]
        near = np.argsort(apart, kind="stable")[: min(most // len(turns), WIDTH)]
        states, yaws = np.tile(near, len(turns)), yaw + np.repeat(turns, len(near))
        return self._started(states, yaws, None)

    def _started(self, states: Rows, yaws: Array, before: Beam | None) -> Beam:
        """Return states that are reached by a jump, or that begin a track."""
        parent, total, place = -1, 0.0, self.task.anchor
        if before is not None:
            parent = int(before.totals.argmin())
            total, place = before.totals[parent] + self.steps.jump, before.places[parent]
        many = len(states)
        places = np.repeat(place[None], many, axis=0)
        return Beam(states, yaws, np.full(many, parent), np.full(many, total), places)

    def _poses(self, beam: Beam) -> Array:
        return self.exemplars.turned(beam.states, beam.yaws)

    def _placed(self, look: FrameCosts, beam: Beam, expected: bool) -> Beam:
        """Return states with aligned roots; where they were `expected`, the distance from there adds to their costs."""
        places = look.placed(self._poses(beam), beam.places)
        if not expected or self.task.translation == "known":
            return replace(beam, places=places)
        off = root_deviation_costs(places, beam.places, look.eye, self.steps)
        return replace(beam, places=places, totals=beam.totals + off)

    def _estimated(self, waiting: deque[_PendingFrame], sampler: Sampler | None) -> Estimate:
        """Return the estimate of the oldest waiting frame: the weighted mean of the states like that of the path."""
        start, cpu_start = time.perf_counter(), time.process_time()
        window = [frame.states for frame in waiting]
        row, likely, oldest = viterbi_state(window), state_weights(window), waiting.popleft()
        beam, look, others, paths = oldest.states.beam, oldest.look, None, None
        if self.hypotheses is not None:
            unlike = beam.chosen(diverse_best(self.exemplars, beam, beam.totals, self.hypotheses.unlike(look.cameras)))
            others = self._poses(unlike), unlike.places
        codes, turns = self.exemplars.codes[beam.states], beam.yaws - beam.yaws[row]
        squares = squares_apart(codes, codes[row], turns)
        pose, place = mean_near(row, likely, squares, self._poses(beam), beam.places)
        if look.usable:
            place = look.placed(pose[None], place[None])[0]
        if sampler is not None and (rows := sampler.draw(window)) is not None:
            paths = SampledPaths.of(self.task.body.skeleton, self._poses(beam)[rows], beam.places[rows], pose)
        seconds = oldest.seconds + time.perf_counter() - start
        cpu_seconds = oldest.cpu_seconds + time.process_time() - cpu_start
        return Estimate(pose, place, look, oldest.evaluations, seconds, cpu_seconds, paths, others)


def yaw_costs(yaws: Array, known: float | None) -> Array:
    """Return the costs (n,) of yaws (n,), radians, in a frame whose yaw is about `known`."""
    if known is None:
        return np.zeros(len(yaws))
    return np.asarray(AWAY * np.clip(np.abs(wrapped(yaws - known)) / FACING - 1.0, 0.0, 1.0))
