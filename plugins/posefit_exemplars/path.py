"""The two cheapest paths: through the states of clips, and through fitted hypotheses.

Both advance frame by frame in the same way. `proposals` gives candidates, `cost_model`
their costs and those of the steps to them, and `markov` the likeliest path so far. A
frame is reported when enough later frames are known.

The poses of clips only resemble the poses of a person who is not in the library, and
a single silhouette does not show which way the person leans or faces. So the path
through the clips gives each frame several hypotheses, which are fitted to the contours
of the masks. The likeliest sequence of them is reported: a wrong pose may fit one
frame, but hardly twenty.

After Sminchisescu and Triggs, Kinematic jump processes for monocular 3D human tracking,
2003.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain, islice
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.fitting.landmarks import (
    exchanged_given,
    exchanged_next,
    landmark_costs,
    usually_exchanged,
)
from posefit.fitting.tracker import Observation, Task
from posefit_exemplars import markov
from posefit_exemplars.beam import Beam, diverse_best
from posefit_exemplars.cost_model import (
    ClipCosts,
    ClipSteps,
    HypothesisCosts,
    MaskNoise,
    Step,
)
from posefit_exemplars.estimate import Estimate
from posefit_exemplars.exemplars import Exemplars
from posefit_exemplars.fits import FrameFits
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.hypotheses import Hypotheses, same_distance
from posefit_exemplars.kernels import Rows
from posefit_exemplars.proposals import (
    BEAM_STATES,
    HypothesisProposals,
    StateProposals,
    limb_evaluations,
    next_states,
    poses_of,
)

FULL_SHARE = 0.6  # share of the path's evaluations for costs at full size
SEARCHES_PER_SECOND = 10.0  # of searches among states from anywhere


class _PathFrame(NamedTuple):
    """The beam of a frame, the likeliest paths to its states, and its evaluations."""

    beam: Beam
    paths: markov.LikeliestPaths
    frame_costs: FrameCosts
    evaluations: float


class ClipPath:
    """Finds the likeliest path through the poses of clips.

    Args:
        task: The task.
        step: The time between frames, and the usual differences.
        costs: The costs of states.
        evaluations: The budget of each frame.
        delay: How many frames later a frame is estimated.
        lag: How many frames later the tracker reports it.
    """

    def __init__(
        self,
        task: Task,
        step: Step,
        costs: ClipCosts,
        evaluations: float,
        delay: int,
        lag: int,
    ) -> None:
        self._task = task
        self._step = step
        self._costs = costs
        self._evaluations = evaluations
        self._delay = delay
        self._lag = lag
        self._proposals = StateProposals(task)
        self.exemplars = self._proposals.exemplars

    def follow(
        self,
        observations: Iterable[Observation],
        hypotheses: HypothesisProposals,
        rng: np.random.Generator,
    ) -> Iterator[Estimate]:
        """Yield the estimate of each frame, with up to `delay` later frames known.

        Args:
            observations: The silhouettes and landmarks of the frames, in order.
            hypotheses: Says how many diverse states each estimate needs.
            rng: The random numbers.
        """
        for window in markov.windows(self._frames(observations, rng), self._delay):
            row = markov.viterbi_state([frame.paths for frame in window])
            frame = window[0]
            count = hypotheses.counts(frame.frame_costs).diverse
            yield self._estimated(frame, row, count)

    def _frames(
        self, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[_PathFrame]:
        """Yield the frames with their states, joined to the frame before."""
        interval = max(round(self._task.fps / SEARCHES_PER_SECOND), 1)
        latest: _PathFrame | None = None
        coming = iter(observations)
        # without lag the second frame must not be awaited, so no frame counts as alone
        first = list(islice(coming, 2 if self._lag else 1))
        alone = len(first) == 1 and self._lag > 0 and not self._task.before
        for number, observation in enumerate(chain(first, coming)):
            frame_costs = FrameCosts(self._task, observation, alone)
            if latest is None:
                latest = self._first(frame_costs, rng)
            else:
                everywhere = number % interval == 0
                latest = self._next(frame_costs, latest, everywhere, rng)
            yield latest

    def _first(self, frame_costs: FrameCosts, rng: np.random.Generator) -> _PathFrame:
        """Return the first frame with its states, where paths begin."""
        full, small = self._counts(frame_costs, is_first=True)
        proposed, poses, used = self._proposals.first(frame_costs, small, rng)
        beam, costs, evaluations = self._best(frame_costs, proposed, poses, full, used)
        paths = markov.likeliest_paths(costs)
        beam = replace(beam, totals=paths.totals)
        return _PathFrame(beam, paths, frame_costs, evaluations)

    def _next(
        self,
        frame_costs: FrameCosts,
        latest: _PathFrame,
        everywhere: bool,
        rng: np.random.Generator,
    ) -> _PathFrame:
        """Return a frame with its states, joined to the latest frame.

        Args:
            frame_costs: The costs of the frame.
            latest: The frame before.
            everywhere: Whether states from anywhere are proposed too.
            rng: The random numbers.
        """
        steps = ClipSteps.of(self.exemplars, latest.beam, self._step)
        if frame_costs.usable:
            full, small = self._counts(frame_costs, is_first=False)
            proposed, poses, used = self._proposals.next(
                frame_costs, steps, small, everywhere, rng
            )
            beam, costs, evaluations = self._best(
                frame_costs, proposed, poses, full, used
            )
        else:
            # the frame shows nothing: clips continue, and all states cost the same
            beam = next_states(self.exemplars, steps, BEAM_STATES)
            beam = replace(beam, places=frame_costs.at_root(beam.places))
            costs = np.zeros(len(beam))
            evaluations = 0.0
        step_costs = steps.costs(
            self.exemplars,
            beam,
            frame_costs.camera_position,
            aligned=frame_costs.root is None,
        )
        paths = markov.likeliest_paths(costs, latest.paths, step_costs)
        beam = replace(beam, totals=paths.totals)
        return _PathFrame(beam, paths, frame_costs, evaluations)

    def _best(
        self, frame_costs: FrameCosts, beam: Beam, poses: Array, full: int, used: int
    ) -> tuple[Beam, Array, float]:
        """Return the best of the proposed states.

        The costs in the small picture decide which states get costs at full size, and
        these decide which states the frame keeps.

        Args:
            frame_costs: The costs of the frame.
            beam: The proposed states.
            poses: (n, 66) their poses.
            full: How many of them get costs at full size.
            used: Costs in the small picture that were computed before.

        Returns:
            The states, their costs (n,), and the evaluations used.
        """
        rough = self._costs.of_small(frame_costs, poses, beam.places)
        used += len(beam)
        rows = diverse_best(
            self.exemplars, beam.states, beam.yaws, beam.totals + rough, full
        )
        beam = beam.rows(rows)
        poses = poses[rows]
        costs = self._costs.of_poses(frame_costs, poses, beam.places)
        best = diverse_best(
            self.exemplars, beam.states, beam.yaws, beam.totals + costs, BEAM_STATES
        )
        evaluations = used * frame_costs.small_share + len(beam)
        return beam.rows(best), costs[best], evaluations

    def _counts(self, frame_costs: FrameCosts, is_first: bool) -> tuple[int, int]:
        """Return how many states get costs at full size and in the small picture."""
        # for the reported pose, its mirror images, and a fraction of a small picture
        reserve = 3 + frame_costs.camera_count
        evaluations = self._evaluations
        if not is_first:
            # several cameras leave less open, but the beam must be filled
            enough = min(evaluations, BEAM_STATES)
            evaluations = max(evaluations / frame_costs.camera_count, enough)
        # at most as many states at full size as in the small picture
        full = int(
            min(
                FULL_SHARE * evaluations,
                (evaluations - reserve) / (1.0 + frame_costs.small_share),
            )
        )
        return full, int((evaluations - full - reserve) / frame_costs.small_share)

    def _estimated(self, frame: _PathFrame, row: int, count: int) -> Estimate:
        """Return the estimate of a frame: the state on the path.

        Args:
            frame: The frame.
            row: The state on the path.
            count: How many diverse states the estimate gets as alternatives.
        """
        beam = frame.beam
        frame_costs = frame.frame_costs
        diverse = beam.rows(
            diverse_best(self.exemplars, beam.states, beam.yaws, beam.totals, count)
        )
        pose = self.exemplars.with_yaws(beam.states[[row]], beam.yaws[[row]])[0]
        place = beam.places[row]
        if frame_costs.usable:
            place = frame_costs.aligned(pose[None], place[None])[0]
        alternatives = poses_of(self.exemplars, diverse), diverse.places
        return Estimate(pose, place, frame_costs, frame.evaluations, alternatives)


class _FittedFrame(NamedTuple):
    """A frame with its fitted hypotheses."""

    estimate: Estimate  # on the path through the clips
    hypotheses: Hypotheses
    states: markov.FrameStates
    # (n, K) probabilities that groups of landmarks have left and right exchanged
    exchanged: Array


class HypothesisPath:
    """Fits the hypotheses of each frame, and reports the likeliest sequence of them.

    Args:
        task: The task.
        exemplars: The poses of clips.
        costs: The costs of hypotheses.
        evaluations: The budget of the fits in each frame.
        delay: How many frames later a frame is reported.
        sampling: How paths are sampled.
    """

    def __init__(
        self,
        task: Task,
        exemplars: Exemplars,
        costs: HypothesisCosts,
        evaluations: float,
        delay: int,
        sampling: markov.Sampling,
    ) -> None:
        self._task = task
        self._exemplars = exemplars
        self._costs = costs
        self._delay = delay
        self._sampling = sampling
        self.proposals = HypothesisProposals(task, exemplars, evaluations)

    def follow(
        self, estimates: Iterable[Estimate], rng: np.random.Generator
    ) -> Iterator[Estimate]:
        """Yield each estimate with the pose of the likeliest sequence.

        Args:
            estimates: The estimates of the frames on the path through the clips.
            rng: The random numbers.

        Yields:
            The estimates, each with up to `delay` later frames known.
        """
        sampled = None
        # separate random numbers: the sampled paths must not change the hypotheses
        frames = self._frames(estimates, rng.spawn(1)[0])
        for window in markov.windows(frames, self._delay):
            states = [frame.states for frame in window]
            row = markov.viterbi_state([frame.paths for frame in states])
            weights = markov.state_weights(states)
            estimate = window[0].estimate
            hypotheses = window[0].hypotheses
            poses = hypotheses.poses
            places = hypotheses.places
            reach = same_distance(estimate.frame_costs.camera_count)
            squares = hypotheses.squares_from(row) / reach**2
            pose, place = markov.mean_near(row, weights, squares, poses, places)
            sampled = markov.sample_states(states, sampled, self._sampling, rng)
            paths = markov.SampledPaths.of(
                self._task.body.skeleton, poses[sampled], places[sampled], pose
            )
            yield replace(estimate, pose=pose, place=place, paths=paths)

    def _frames(
        self, estimates: Iterable[Estimate], rng: np.random.Generator
    ) -> Iterator[_FittedFrame]:
        """Yield each estimate with its fitted hypotheses, joined to the frame before.

        The evaluations of the estimates include the fits.
        """
        mask_noise = MaskNoise()
        before: _FittedFrame | None = None
        latest = Hypotheses.none()
        rows = np.empty(0, dtype=np.int64)
        for estimate in estimates:
            frame_costs = estimate.frame_costs
            if before is not None:
                latest = before.hypotheses
                rows = self.proposals.continuing(
                    latest, before.states.paths.totals, frame_costs
                )
            fresh = self.proposals.fresh(estimate, latest, rows, rng)
            noise = mask_noise.of(frame_costs)
            hypotheses, used = self._fitted(estimate, fresh, latest, rows, noise)
            pose_costs = np.zeros(len(hypotheses.poses))
            if frame_costs.usable:
                pose_costs, least = self._costs.of_poses(
                    frame_costs, hypotheses.poses, hypotheses.places, noise
                )
                mask_noise.add(least)
            joined = self._joined(frame_costs, hypotheses, pose_costs, before)
            estimate = replace(estimate, evaluations=estimate.evaluations + used)
            before = _FittedFrame(estimate, hypotheses, *joined)
            yield before

    def _fitted(
        self,
        estimate: Estimate,
        fresh: tuple[Array, Array],
        latest: Hypotheses,
        rows: Rows,
        noise: float,
    ) -> tuple[Hypotheses, float]:
        """Return the fitted hypotheses of a frame, and the evaluations of the fits.

        Args:
            estimate: The estimate of the frame on the path through the clips.
            fresh: The poses and places at which fresh hypotheses begin.
            latest: The hypotheses of the frame before.
            rows: The rows of `latest` that continue.
            noise: The noise of the masks.
        """
        frame_costs = estimate.frame_costs
        continued = (latest.poses[rows], latest.places[rows])
        evaluations = 0.0
        if frame_costs.usable:
            fits = FrameFits(
                self._task, self._exemplars, frame_costs, estimate.place, noise
            )
            if frame_costs.alone:
                fresh = fits.raced(
                    fresh,
                    lambda poses, places: self._costs.of_poses(
                        frame_costs, poses, places, noise
                    )[0],
                )
            else:
                fresh = fits.fresh(fresh)
            if len(rows):
                continued = fits.continued(latest.continued(rows))
            evaluations = fits.evaluations
            # `HypothesisProposals.fresh` has searched for limbs of the earlier pose
            if frame_costs.earlier is not None:
                evaluations += limb_evaluations()
        poses, places = (
            np.concatenate(arrays) for arrays in zip(fresh, continued, strict=True)
        )
        places = frame_costs.at_root(places)
        parents = np.concatenate([np.full(len(fresh[0]), -1), rows])
        return Hypotheses.of(self._task, poses, places, parents, latest), evaluations

    def _joined(
        self,
        frame_costs: FrameCosts,
        hypotheses: Hypotheses,
        pose_costs: Array,
        before: _FittedFrame | None,
    ) -> tuple[markov.FrameStates, Array]:
        """Return the states of a frame, joined to the frame before.

        Args:
            frame_costs: The costs of the frame.
            hypotheses: Its n hypotheses.
            pose_costs: (n,) their costs without landmarks.
            before: The frame before, or None.

        Returns:
            The states, and the probabilities (n, K) that groups of landmarks have left
            and right exchanged.
        """
        likelihoods = frame_costs.landmarks(hypotheses.poses, hypotheses.places)
        exchanged = usually_exchanged(likelihoods)[None]
        if before is not None:
            exchanged = exchanged_next(before.exchanged, 1.0 / self._task.fps)
        landmarks = landmark_costs(likelihoods, exchanged[:, None])
        costs = landmarks.min(axis=0) + pose_costs
        if before is None:
            return markov.frame_states(costs), exchanged_given(likelihoods, exchanged)
        steps = self._costs.of_steps(frame_costs, before.hypotheses, hypotheses)
        # what landmarks cost depends on which groups were exchanged before
        steps += landmarks - landmarks.min(axis=0)
        states = markov.frame_states(costs, before.states, steps)
        return states, exchanged_given(likelihoods, exchanged[states.paths.parents])
