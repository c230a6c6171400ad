"""The tracker: its settings, and the path that it reports `lag` frames later."""

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

BEAM_STATES = 400  # states that a frame keeps
# Shares of evaluations. Fits take FIT_SHARE of the budget and the beam takes the rest.
FIT_SHARE = 0.8
FULL_SHARE = 0.6  # share of the beam's evaluations for costs at full size
# Evaluations per frame, at least: the hypotheses need their minimum.
MIN_EVALUATIONS = math.ceil(hypotheses.MIN_EVALUATIONS / FIT_SHARE)
# The beam's evaluations per frame, at least, if several cameras leave less open.
MIN_BEAM_EVALUATIONS = 60.0
# Share of the small pictures for states where clips continue. The others are for a
# search everywhere.
CONTINUED_SHARE = 0.25
SEARCHES_PER_SECOND = 10.0  # searches everywhere
SEARCHED_GROUPS = 200  # best groups of a search everywhere, at most
GROUP_POSES = 20  # poses of each such group that are evaluated, drawn at random
YAW_TOLERANCE = np.radians(45.0)  # of a known yaw, to either side
POSTERIOR_TEMPERATURE = 8.0  # divides silhouette costs in the posterior
# Cost, over the temperature, of a yaw off by twice the tolerance or more, for a
# thirtieth of a second.
WRONG_YAW_COST = 4.0
# Standard deviations for the mean of the states similar to the likeliest one.
SIMILAR_DISTANCE = 0.06  # metres, of codes
SIMILAR_YAW = np.radians(20.0)


class _BeamFrame(NamedTuple):
    """The beam of a frame, the weights of its states, and its evaluations."""

    beam: Beam
    states: markov.FrameStates
    frame_costs: FrameCosts
    evaluations: float


class ExemplarTracker:
    """Follows the likeliest path through recorded clips (Toyama and Blake, 2001).

    Settings:
        spread: distance of joints from where a clip continues, metres, rms, for a
            thirtieth of a second; above 0.
        temperature: divides silhouette costs; above 0. The default is more than 1,
            because the errors of successive frames are correlated.
        lag: number of later frames used before a pose is reported, 0 or more.
        smoothing: standard deviation of the smoothing over time, thirtieths of a
            second, 0 or more.
        samples: number of tracks drawn from the posterior, 1 or more.
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
                f"evaluations must be at least {MIN_EVALUATIONS} for exemplars,"
                f" got {task.evaluations}"
            )
        self.task = task
        self.step = beams.Step.of(task, spread)
        self.lookup = Lookup(task)
        self.exemplars = self.lookup.exemplars
        # at higher frame rates each frame counts for less, as it covers less time
        self.temperature = temperature / (30.0 / task.fps)
        self.lag = lag
        self.smoothing = smoothing * task.fps / 30.0  # frames
        fit_evaluations = FIT_SHARE * task.evaluations
        self.evaluations = task.evaluations - fit_evaluations  # of the beam
        # the smoothing uses some of the later frames, the hypotheses half of the
        # others, and the path the rest
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
        """Yield a `Frame` for each observation, delayed by `lag` observations.

        Args:
            observations: The silhouettes and landmarks of the frames, in order.
            rng: The random numbers.

        """
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
            row = markov.viterbi_state(states)
            weights = markov.state_weights(states)
            yield self._estimated(window[0], row, weights)

    def _beams(
        self, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[_BeamFrame]:
        interval = max(round(self.task.fps / SEARCHES_PER_SECOND), 1)
        latest: _BeamFrame | None = None
        coming = iter(observations)
        # without lag the second frame must not be awaited, so no frame counts as alone
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
        """Return the states of a frame, their costs (n,), and the evaluations used.

        States come from where clips continue and, if `everywhere`, from a search in all
        poses. The costs at full size decide which of them the frame keeps.
        """
        if before is not None and not frame_costs.usable:
            # nothing is seen: clips continue, and all states cost the same
            beam = beams.next_states(
                self.exemplars, before, self.step, BEAM_STATES, frame_costs.root
            )
            beam = replace(beam, places=frame_costs.at_root(beam.places))
            return beam, np.zeros(len(beam)), 0.0
        full, small = self._counts(frame_costs, before is None)
        beam, small_count = self._reachable(frame_costs, before, everywhere, small, rng)
        turn_costs = yaw_costs(beam.yaws, frame_costs.yaw) * 30.0 / self.task.fps
        small_costs = frame_costs.small(self._poses(beam), beam.places)
        totals = beam.totals + turn_costs + small_costs / self.temperature
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
        evaluations = small_count * frame_costs.small_share + full_count
        return beam.rows(best), costs[best], evaluations

    def _counts(self, frame_costs: FrameCosts, is_first: bool) -> tuple[int, int]:
        """Return how many states get a cost at full size, and how many in small."""
        # for the reported pose, its mirror images, and a fraction of a small picture
        reserve = 3 + frame_costs.camera_count
        evaluations = self.evaluations
        if not is_first:  # several cameras leave less open
            evaluations = max(
                evaluations / frame_costs.camera_count, MIN_BEAM_EVALUATIONS
            )
        # at most as many states at full size as in small
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
        """Return at most `count` states that a frame may be in.

        They are where clips continue, or near the first pose of a track; and, if
        `everywhere` or in the first frame, states from anywhere that fit.

        Returns:
            The states, and the number of small pictures that the search used.

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
            room = count - nearby if parts else count
            elsewhere, small_count = self._elsewhere(frame_costs, before, room, rng)
            if before is None and parts:
                elsewhere = replace(elsewhere, totals=elsewhere.totals + JUMP_COST)
            parts.insert(0, elsewhere)
        joined = beams.joined(*parts)
        return self._placed(frame_costs, joined, before is not None), small_count

    def _elsewhere(
        self,
        frame_costs: FrameCosts,
        before: Beam | None,
        count: int,
        rng: np.random.Generator,
    ) -> tuple[Beam, int]:
        """Return at most `count` states from anywhere that fit.

        Poses and yaws are tried first by the lookup, or at random if no camera shows
        the whole person. Then the groups of the best are searched.

        Returns:
            The states, and the number of small pictures that were evaluated.

        """
        group_count = min(SEARCHED_GROUPS, max(count // (4 * GROUP_POSES), 1))
        tried = max(count - group_count * GROUP_POSES, 1)
        known = frame_costs.yaw
        if before is None and known is None:
            known = self.task.yaw
        nearest = self.lookup.nearest(frame_costs.observation, tried, known)
        if nearest is not None:
            states = np.resize(nearest[0], tried)
            yaws = np.resize(nearest[1], tried)
            yaws += YAW_STEP * rng.uniform(-0.5, 0.5, tried)
        else:  # no camera shows the whole person
            middle = 0.0 if known is None else known
            reach = np.pi if known is None else YAW_TOLERANCE
            states = self.exemplars.draw(tried, rng)
            yaws = middle + rng.uniform(-reach, reach, tried)
        beam = self._placed(frame_costs, self._started(states, yaws, before), False)
        costs = frame_costs.small(self._poses(beam), beam.places)
        room = count - tried
        members = self.exemplars.members
        starts = self.exemplars.starts
        best = list[int]()
        poses = list[Rows]()
        found = 0
        for row in np.argsort(costs, kind="stable"):
            group = self.exemplars.groups[states[row]]
            rows = members[starts[group] : starts[group + 1]]
            if len(rows) > GROUP_POSES:
                rows = rng.choice(rows, GROUP_POSES, replace=False)
            poses.append(rows[: room - found])
            found += len(poses[-1])
            best.append(row)
            if found == room:
                break
        yaws = np.repeat(yaws[best], [len(rows) for rows in poses])
        return self._started(np.concatenate(poses), yaws, before), len(beam)

    def _first_states(self, angles: Array, count: int) -> Beam:
        """Return at most `count` states nearest to a first pose with angles (63,)."""
        yaw = self.task.yaw or 0.0
        codes = self.exemplars.codes
        code = self.exemplars.coding.of_poses(np.array([[yaw, 0.0, 0.0, *angles]]))[0]
        # squared distances up to a constant, which does not change their order
        squares = (codes**2).sum(axis=1) - 2.0 * (codes @ code)
        turns = [-beams.CANDIDATE_TURN, 0.0, beams.CANDIDATE_TURN]
        room = min(count // len(turns), BEAM_STATES)
        nearest = np.argsort(squares, kind="stable")[:room]
        states = np.tile(nearest, len(turns))
        yaws = yaw + np.repeat(turns, len(nearest))
        return self._started(states, yaws, None)

    def _started(self, states: Rows, yaws: Array, before: Beam | None) -> Beam:
        """Return states that a jump from `before` reaches, or that start a track."""
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
        """Return states with aligned roots.

        If the places of the states are `expected`, as where clips continue, the
        distance from them is a cost.
        """
        places = frame_costs.aligned(self._poses(beam), beam.places)
        totals = beam.totals
        if expected and self.task.translation != "known":
            totals = totals + beams.root_deviation_costs(
                places, beam.places, frame_costs.camera_position
            )
        return replace(beam, places=places, totals=totals)

    def _estimated(self, frame: _BeamFrame, row: int, weights: Array) -> Estimate:
        """Return the estimate of a frame: the mean of the states similar to the path's.

        Args:
            frame: The beam of the frame.
            row: The state on the path.
            weights: (n,) the weights of the states.

        """
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
    """Return the squared distances (n,) of states from one, in standard deviations.

    Args:
        codes: (n, D) the codes of the states.
        code: (D,) the code of the one state.
        turns: (n,) radians, the yaws relative to its yaw.

    """
    squares = ((codes - code) ** 2).sum(axis=1) / SIMILAR_DISTANCE**2
    return np.asarray(squares + (wrapped(turns) / SIMILAR_YAW) ** 2)


def yaw_costs(yaws: Array, known: float | None) -> Array:
    """Return the costs (n,) of yaws (n,) in a frame with a yaw of about `known`.

    A yaw within the tolerance costs nothing. Without a known yaw all are free.
    """
    if known is None:
        return np.zeros(len(yaws))
    excess = np.abs(wrapped(yaws - known)) / YAW_TOLERANCE - 1.0
    return np.asarray(WRONG_YAW_COST * np.clip(excess, 0.0, 1.0))
