"""The tracker: its settings, the work of each frame, and the path that is reported `lag` frames later."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain, islice
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.check import at_least, positive
from posefit.fitting.landmarks import landmark_costs
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.geometry.rotation import wrapped
from posefit_exemplars import beam as beams
from posefit_exemplars import hypotheses, markov
from posefit_exemplars.beam import JUMP_COST, Beam
from posefit_exemplars.calibration import reported
from posefit_exemplars.exemplars import Codes, Rows
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.lookup import YAW_STEP, Lookup
from posefit_exemplars.lost_model import stored_classifier, with_failure_probabilities
from posefit_exemplars.smoothing import FILTER_REACH, Estimate, smoothed

BEAM_STATES = 400
FULL_SHARE = 0.6  # of the beam's evaluations: for full-size costs of states
FIT_SHARE = 0.8  # of the budget: for fitting hypotheses
MIN_EVALUATIONS = math.ceil(hypotheses.MIN_EVALUATIONS / FIT_SHARE)  # of a frame
MIN_BEAM_EVALUATIONS = 60.0  # of a frame, where several cameras leave less open
# of the small pictures: for where clips continue; the rest is for a search everywhere
CONTINUED_SHARE = 0.25
SEARCHES_PER_SECOND = 10.0  # everywhere
SEARCHED_GROUPS = 200  # those that fit best anywhere, whose poses are evaluated
GROUP_POSES = 20  # drawn at random, that stand for a group in a search everywhere
YAW_TOLERANCE = np.radians(45.0)  # of a known yaw, to either side
POSTERIOR_TEMPERATURE = 8.0  # divides silhouette costs in the posterior
# over the temperature, of a state whose yaw is off by twice as much, for a thirtieth of
# a second
WRONG_YAW_COST = 4.0
# metres: standard deviation of the codes of states that are averaged
SIMILAR_DISTANCE = 0.06
SIMILAR_YAW = np.radians(20.0)


class _BeamFrame(NamedTuple):
    """The beam of a frame, the weights of its states, and its evaluations."""

    beam: Beam
    states: markov.FrameStates
    frame_costs: FrameCosts
    evaluations: float


class ExemplarTracker:
    """The likeliest path through recorded clips (Toyama and Blake, 2001).

    Settings:
        spread: distance of joints from where a clip continues in a thirtieth of a second, metres, rms; above 0.
        temperature: divides silhouette costs; above 0. Errors of successive frames are correlated, so more than 1.
        lag: later frames that are used before a pose is reported, 0 or more.
        smoothing: standard deviation of the smoothing of angles over time, in thirtieths of a second, 0 or more.
        samples: tracks drawn from the posterior, 1 or more.
    """

    def __init__(
        self,
        task: Task,
        *,
        spread: float = 0.03,
        temperature: float = 2.0,
        lag: int = 20,
        smoothing: float = 1.0,
        samples: int = 24,
    ) -> None:
        positive("spread", spread)
        positive("temperature", temperature)
        at_least("smoothing", smoothing, 0)
        at_least("lag", lag, 0)
        at_least("samples", samples, 1)
        if task.evaluations < MIN_EVALUATIONS:
            raise InputError(
                f"evaluations must be at least {MIN_EVALUATIONS} for exemplars, got {task.evaluations}"
            )
        self.task, self.step, self.lookup = (
            task,
            beams.Step.of(task, spread),
            Lookup(task),
        )
        self.exemplars = self.lookup.exemplars
        self.temperature = temperature / (30.0 / task.fps)
        self.lag = lag
        self.smoothing = smoothing * task.fps / 30.0  # frames
        fit_evaluations = FIT_SHARE * task.evaluations
        self.evaluations = task.evaluations - fit_evaluations  # of the beam
        # later frames that the smoothing uses; the hypotheses get half of the others, and the path the rest
        self.ahead = min(math.ceil(FILTER_REACH * self.smoothing), lag)
        fits_ahead = (lag - self.ahead) // 2
        self.path_ahead = lag - self.ahead - fits_ahead
        sampling = markov.Sampling(samples, temperature / POSTERIOR_TEMPERATURE)
        known = task, self.exemplars, self.step, self.temperature
        self.hypotheses = hypotheses.HypothesisFilter(
            *known, fit_evaluations, fits_ahead, sampling
        )

    def track(
        self, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        """Yield a `Frame` for each observation, `lag` observations later."""
        estimates = self.hypotheses.follow(
            self._path(observations, rng), rng.spawn(1)[0]
        )
        frames = map(reported, smoothed(estimates, self.smoothing, self.ahead))
        yield from with_failure_probabilities(frames, self.task, stored_classifier())

    def _path(
        self, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Estimate]:
        """Yield the estimate of each frame on the likeliest path of the beam."""
        for window in markov.windows(self._beams(observations, rng), self.path_ahead):
            states = [frame.states for frame in window]
            yield self._estimated(
                window[0], markov.viterbi_state(states), markov.state_weights(states)
            )

    def _beams(
        self, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[_BeamFrame]:
        interval = max(round(self.task.fps / SEARCHES_PER_SECOND), 1)
        latest: _BeamFrame | None = None
        coming = iter(observations)
        # whether there is a second frame is known only where frames are looked ahead
        first = list(islice(coming, 2 if self.lag else 1))
        alone = len(first) == 1 and self.lag > 0 and not self.task.before
        for number, observation in enumerate(chain(first, coming)):
            frame_costs = FrameCosts(self.task, observation, alone)
            before = None if latest is None else latest.beam
            beam, costs, evaluations = self._candidates(
                frame_costs, before, number % interval == 0, rng
            )
            states = markov.frame_states(costs)
            if latest is not None:
                known = frame_costs.root, frame_costs.camera_position
                steps = beams.transition_costs(
                    self.exemplars, latest.beam, beam, self.step, *known
                )
                states = markov.frame_states(costs, latest.states, steps)
            beam = replace(beam, totals=states.totals)
            latest = _BeamFrame(beam, states, frame_costs, evaluations)
            yield latest

    def _candidates(
        self,
        frame_costs: FrameCosts,
        before: Beam | None,
        everywhere: bool,
        rng: np.random.Generator,
    ) -> tuple[Beam, Array, float]:
        """Return the states of a frame, from `everywhere` or where clips continue, their costs, and the evaluations."""
        if before is not None and not frame_costs.usable:
            beam = beams.next_states(
                self.exemplars, before, self.step, BEAM_STATES, frame_costs.root
            )
            return (
                replace(beam, places=frame_costs.at_root(beam.places)),
                np.zeros(len(beam)),
                0.0,
            )
        full, small = self._counts(frame_costs, before is None)
        beam, small_count = self._reachable(frame_costs, before, everywhere, small, rng)
        turn_costs = yaw_costs(beam.yaws, frame_costs.yaw) * 30.0 / self.task.fps
        totals = (
            beam.totals
            + turn_costs
            + frame_costs.small(self._poses(beam), beam.places) / self.temperature
        )
        small_count += len(beam)
        rows = beams.diverse_best(self.exemplars, beam, totals, full)
        beam = beam.rows(rows)
        poses = self._poses(beam)
        full_count = len(beam)
        silhouette_costs = frame_costs.full(poses, beam.places) / self.temperature
        costs = (
            turn_costs[rows]
            + silhouette_costs
            + landmark_costs(frame_costs.landmarks(poses, beam.places))
        )
        best = beams.diverse_best(
            self.exemplars, beam, beam.totals + costs, BEAM_STATES
        )
        return (
            beam.rows(best),
            costs[best],
            small_count * frame_costs.small_share + full_count,
        )

    def _counts(self, frame_costs: FrameCosts, is_first: bool) -> tuple[int, int]:
        """Return how many states of a frame have a cost in the whole picture, and how many in a small one."""
        # the reported pose, its mirror images, and the fraction of a small picture's share
        reserve = 3 + frame_costs.camera_count
        evaluations = self.evaluations
        if not is_first:  # several cameras leave less open
            evaluations = max(
                evaluations / frame_costs.camera_count, MIN_BEAM_EVALUATIONS
            )
        # no more states than have a cost in a small picture
        full = int(
            min(
                FULL_SHARE * evaluations,
                (evaluations - reserve) / (1.0 + frame_costs.small_share),
            )
        )
        return full, int((evaluations - full - reserve) / frame_costs.small_share)

    def _reachable(
        self,
        frame_costs: FrameCosts,
        before: Beam | None,
        everywhere: bool,
        count: int,
        rng: np.random.Generator,
    ) -> tuple[Beam, int]:
        """Return at most `count` states: where clips continue or a track starts, and some from `everywhere`.

        With them comes the number of small pictures that the search everywhere evaluated.
        """
        parts = list[Beam]()
        nearby = int(CONTINUED_SHARE * count)
        small_count = 0
        if before is not None:
            parts.append(
                beams.next_states(
                    self.exemplars, before, self.step, nearby, frame_costs.root
                )
            )
        elif self.task.first_pose is not None:
            parts.append(self._first_states(self.task.first_pose, nearby))
        if everywhere or before is None:
            elsewhere, small_count = self._elsewhere(
                frame_costs, before, count - nearby if parts else count, rng
            )
            if before is None and parts:
                elsewhere = replace(elsewhere, totals=elsewhere.totals + JUMP_COST)
            parts.insert(0, elsewhere)
        return self._placed(
            frame_costs, beams.merged(*parts), before is not None
        ), small_count

    def _elsewhere(
        self,
        frame_costs: FrameCosts,
        before: Beam | None,
        count: int,
        rng: np.random.Generator,
    ) -> tuple[Beam, int]:
        """Return states that fit, from anywhere, and the number of small pictures that were evaluated."""
        group_count = min(SEARCHED_GROUPS, max(count // (4 * GROUP_POSES), 1))
        tried = max(count - group_count * GROUP_POSES, 1)
        known = (
            self.task.yaw
            if before is None and frame_costs.yaw is None
            else frame_costs.yaw
        )
        nearest = self.lookup.nearest(frame_costs.observation, tried, known)
        if nearest is not None:
            states = np.resize(nearest[0], tried)
            yaws = np.resize(nearest[1], tried)
            yaws += YAW_STEP * rng.uniform(-0.5, 0.5, tried)
        else:  # no camera shows the whole person
            middle, reach = (0.0, np.pi) if known is None else (known, YAW_TOLERANCE)
            states = self.exemplars.draw(tried, rng)
            yaws = middle + rng.uniform(-reach, reach, tried)
        beam = self._placed(frame_costs, self._started(states, yaws, before), False)
        best = np.argsort(
            frame_costs.small(self._poses(beam), beam.places), kind="stable"
        )[: 4 * group_count]
        members = self.exemplars.members
        starts = self.exemplars.starts
        groups = [
            members[starts[group] : starts[group + 1]]
            for group in self.exemplars.groups[states[best]]
        ]
        poses = [
            rows
            if len(rows) <= GROUP_POSES
            else rng.choice(rows, GROUP_POSES, replace=False)
            for rows in groups
        ]
        yaws = np.repeat(yaws[best], [len(rows) for rows in poses])
        # for that many poses, of more groups where they are small
        room = slice(count - tried)
        return self._started(np.concatenate(poses)[room], yaws[room], before), len(beam)

    def _first_states(self, angles: Array, count: int) -> Beam:
        """Return the states, at most `count`, nearest to a first pose whose angles (63,) and yaw are known."""
        yaw = self.task.yaw or 0.0
        codes = self.exemplars.codes
        code = self.exemplars.coding.of_poses(np.array([[yaw, 0.0, 0.0, *angles]]))[0]
        squares = (codes**2).sum(axis=1) - 2.0 * (codes @ code)  # and a constant
        turns = [-beams.CANDIDATE_TURN, 0.0, beams.CANDIDATE_TURN]
        nearest = np.argsort(squares, kind="stable")[
            : min(count // len(turns), BEAM_STATES)
        ]
        return self._started(
            np.tile(nearest, len(turns)), yaw + np.repeat(turns, len(nearest)), None
        )

    def _started(self, states: Rows, yaws: Array, before: Beam | None) -> Beam:
        """Return states that are reached by a jump, or that start a track."""
        total = 0.0
        place = self.task.anchor
        if before is not None:
            best = int(before.totals.argmin())
            total = before.totals[best] + JUMP_COST
            place = before.places[best]
        return Beam(
            states,
            yaws,
            np.full(len(states), total),
            np.repeat(place[None], len(states), axis=0),
        )

    def _poses(self, beam: Beam) -> Array:
        return self.exemplars.with_yaws(beam.states, beam.yaws)

    def _placed(self, frame_costs: FrameCosts, beam: Beam, expected: bool) -> Beam:
        """Return states with aligned roots; where they were `expected`, the distance from there adds to their costs."""
        places = frame_costs.aligned(self._poses(beam), beam.places)
        totals = beam.totals
        if expected and self.task.translation != "known":
            totals = totals + beams.root_deviation_costs(
                places, beam.places, frame_costs.camera_position
            )
        return replace(beam, places=places, totals=totals)

    def _estimated(self, frame: _BeamFrame, row: int, weights: Array) -> Estimate:
        """Return the estimate of a frame: the weighted mean of the states like that of the path."""
        beam = frame.beam
        frame_costs = frame.frame_costs
        count = self.hypotheses.counts(frame_costs).diverse
        diverse = beam.rows(
            beams.diverse_best(self.exemplars, beam, beam.totals, count)
        )
        codes = self.exemplars.codes[beam.states]
        squares = state_distances(codes, codes[row], beam.yaws - beam.yaws[row])
        pose, place = markov.mean_near(
            row, weights, squares, self._poses(beam), beam.places
        )
        if frame_costs.usable:
            place = frame_costs.aligned(pose[None], place[None])[0]
        alternatives = self._poses(diverse), diverse.places
        return Estimate(pose, place, frame_costs, frame.evaluations, alternatives)


def state_distances(codes: Codes, code: Codes, turns: Array) -> Array:
    """Return the squared distances (n,) of codes (n, D) from one, and of turns (n,) from 0, in standard deviations."""
    squares = ((codes - code) ** 2).sum(axis=1) / SIMILAR_DISTANCE**2
    return np.asarray(squares + (wrapped(turns) / SIMILAR_YAW) ** 2)


def yaw_costs(yaws: Array, known: float | None) -> Array:
    """Return the costs (n,) of yaws (n,), radians, in a frame whose yaw is about `known`."""
    if known is None:
        return np.zeros(len(yaws))
    excess = np.abs(wrapped(yaws - known)) / YAW_TOLERANCE - 1.0
    return np.asarray(WRONG_YAW_COST * np.clip(excess, 0.0, 1.0))
