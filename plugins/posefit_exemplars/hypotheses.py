"""Several hypotheses of each frame, fitted to the contours of its masks, and the likeliest sequence of them.

The poses of clips are only near those of a person whom no clip shows, and one silhouette leaves open which way the
person leans or faces. So each frame has several hypotheses. Some are fresh: the pose of the path, diverse states of the
beam, and reflections of these. The others continue those of the frame before at their speed. Each is fitted to the
contours by a few steps of Gauss and Newton, which may turn every joint. A hypothesis costs what its silhouette does,
and its distance from the poses of clips; a step costs the distance of the trunk and of each limb from where their
motion leads. The likeliest sequence is Viterbi's: a wrong pose may fit one frame, but hardly twenty.

Masks of a camera and a fitted body are less precise than clean ones. Where even the best frames cost more, the contours
of a single view count for less against the poses that a fit starts with and those of clips: nothing else keeps a body
from leaning to where the mask is wrong.

After Sminchisescu and Triggs, Kinematic jump processes for monocular 3D human tracking, 2003.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from posefit.arrays import Array
from posefit.fitting.contours import (
    STEP_EVALUATIONS,
    contour_race,
    fitted,
    precisions,
    race_count,
)
from posefit.fitting.landmarks import (
    exchanged_given,
    exchanged_next,
    landmark_costs,
    usually_exchanged,
)
from posefit.fitting.tracker import Task
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import ANGLES, JOINTS, LIMBS, angles_of, root_centred
from posefit.geometry.symmetry import exchanged_limbs
from posefit_exemplars import markov
from posefit_exemplars.beam import Step, root_deviation_costs, squared_distances
from posefit_exemplars.exemplars import Exemplars, Rows
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.smoothing import Estimate

# metres, of the steps of a fit: contours that are farther off count less
FRESH_REACHES = (0.09, 0.09, 0.065, 0.065, 0.045, 0.045, 0.033, 0.033)
CONTINUED_REACHES = (0.15, 0.09, 0.065, 0.045, 0.033)
FRESH_EVALUATIONS = len(FRESH_REACHES) * STEP_EVALUATIONS + 1.0
# two of them are of places to start at
CONTINUED_EVALUATIONS = len(CONTINUED_REACHES) * STEP_EVALUATIONS + 3.0
MIN_EVALUATIONS = 2 * FRESH_EVALUATIONS + CONTINUED_EVALUATIONS  # of a frame
FRESH_SHARE = 0.45  # of the evaluations
REFLECTED_SHARE = 0.25  # of the fresh hypotheses: reflections of the others
ALONE_REFLECTED_SHARE = 0.5  # of those of the only frame of a track
# of clips, whose limbs are tried in turn, and how often each limb is
LIMB_POSES = 16
LIMB_ROUNDS = 2
LIMB_ANGLES = [angles_of(bones) for bones in LIMBS.values()]
LIMB_EVALUATIONS = LIMB_ROUNDS * len(LIMBS) * (LIMB_POSES + 1.0)
# that an angle is off where a fit starts: standard deviation, as all that follow
START_TURN = np.radians(8.0)
LIBRARY_TURN = np.radians(15.0)  # that it is off similar poses of clips
# metres that a known root, and an aligned one, is off
KNOWN_SHIFT = 0.003
ALIGNED_SHIFT = 0.05
SIMILAR_POSES = 8  # of clips, whose mean pulls a hypothesis that continues
SIMILAR_SPREAD = 0.03  # metres: that they are off the nearest of them
# metres: d times that off the clips costs LIBRARY_COST log(1 + d^2 / 2)
LIBRARY_DISTANCE = 0.05
LIBRARY_COST = 4.0  # for a thirtieth of a second
# the same of the only frame of a track, whose hypotheses are fitted longer
ALONE_LIBRARY_COST = 1.0
# times the cost of a silhouette on the path, as fitted poses are nearer
SHARPNESS = 2.0
STEP_SPREAD = 4.0 / 3.0  # times the spread of the path's steps
# of a fitted pose; where even the best frames cost more, masks and the body are less
# precise
CLEAN_COST = 3.0
BEST_SHARE = 0.2  # of the frames, which are the best
MEMORY_SECONDS = 10.0  # of frames
FITTED_COST_SHARE = 0.4  # of a cost, after a fit: before any is made
# metres: nearer hypotheses continue as one; standard deviation of those averaged
SAME_DISTANCE = 0.03
_LIMBS = [np.array([JOINTS.index(bone) for bone in bones]) for bones in LIMBS.values()]
_TRUNK = np.setdiff1d(np.arange(len(JOINTS)), np.concatenate(_LIMBS))
PARTS: Sequence[Rows] = [_TRUNK, *_LIMBS]  # joints
# of speeds at which a part continues
SPEED_COSTS: Mapping[float, float] = {0.0: 0.3, 0.5: 0.1, 1.0: 0.0, 1.4: 0.15}
MAX_PART_COST = 4.0  # of a step of one part, between clean masks
# at most, by which noisy masks multiply it: the square of their noise
MAX_JUMP_FACTOR = 3.0


class Hypotheses(NamedTuple):
    """The hypotheses of one frame."""

    poses: Array  # (n, 66)
    places: Array  # (n, 3)
    joints: Array  # (n, 27, 3) metres, the root at the origin
    # (n, 66) radians since the frame before; 0 for fresh ones, as what follows
    turns: Array
    shifts: Array  # (n, 3) metres
    rates: Array  # (n, 27, 3) metres

    @classmethod
    def none(cls) -> Self:
        """Return the hypotheses of no frame."""
        poses = np.empty((0, ANGLES))
        places = np.empty((0, 3))
        joints = np.empty((0, len(JOINTS), 3))
        return cls(poses, places, joints, poses, places, joints)

    @classmethod
    def of(
        cls,
        task: Task,
        poses: Array,
        places: Array,
        parents: Rows,
        before: "Hypotheses",
    ) -> Self:
        """Return hypotheses with their motion since the frame `before`, in which their `parents` (n,) are, or -1."""
        joints = root_centred(task.body.skeleton.joints(poses))
        turns = np.zeros_like(poses)
        shifts = np.zeros_like(places)
        rates = np.zeros_like(joints)
        continued = parents >= 0
        rows = parents[parents >= 0]
        turns[continued] = wrapped(poses[continued] - before.poses[rows])
        shifts[continued] = places[continued] - before.places[rows]
        rates[continued] = joints[continued] - before.joints[rows]
        return cls(poses, places, joints, turns, shifts, rates)

    def continued(self, rows: Rows) -> tuple[Array, Array]:
        """Return the poses (n, 66) and places (n, 3) of some hypotheses a frame later, at their speed."""
        return self.poses[rows] + self.turns[rows], self.places[rows] + self.shifts[
            rows
        ]


class Counts(NamedTuple):
    """How many hypotheses of a frame are fresh, how many of these start at diverse states, and how many continue."""

    fresh: int
    diverse: int  # the others are the path's, and reflections
    continued: int


class _FittedFrame(NamedTuple):
    estimate: Estimate  # on the path of the beam
    hypotheses: Hypotheses
    states: markov.FrameStates
    # (n, K) how likely left and right of groups of landmarks are exchanged
    exchanged: Array


def step_costs(
    spread: float, limit: float, before: Hypotheses, after: Hypotheses
) -> Array:
    """Return the costs (n, m) of steps between hypotheses of successive frames.

    For the trunk and each limb, half the square, over the `spread`, of its joints' distance from where the mean of both
    rates leads, and of the difference of the rates, root mean square over all joints; at the cheapest of a few speeds,
    and no more than the `limit`.
    """
    scale = 0.5 / (spread**2 * len(JOINTS))
    total = np.zeros((len(before.joints), len(after.joints)))
    for part in PARTS:
        joints, rates, later, later_rates = (
            array[:, part].reshape(len(array), -1).astype(np.float32)
            for array in (before.joints, before.rates, after.joints, after.rates)
        )
        changes = squared_distances(rates, later_rates)
        costs = np.full(changes.shape, limit)
        for speed, cost in SPEED_COSTS.items():
            half = np.float32(0.5 * speed)
            squares = squared_distances(
                joints + half * rates, later - half * later_rates
            )
            np.minimum(costs, scale * (squares + speed**2 * changes) + cost, out=costs)
        total += costs
    return total


def jump_cost(noise: float) -> float:
    """Return what a step of one part costs at most, between masks that are so many times less precise than clean ones.

    Where they are, wrong poses fit some frames better than right ones by more, which must not pay for a jump.
    """
    return MAX_PART_COST * min(noise**2, MAX_JUMP_FACTOR)


class HypothesisFilter:
    """Fits the hypotheses of one frame after the other, and reports the likeliest sequence `delay` frames later."""

    def __init__(
        self,
        task: Task,
        exemplars: Exemplars,
        step: Step,
        temperature: float,
        evaluations: float,
        delay: int,
        sampling: markov.Sampling,
    ) -> None:
        self._task = task
        self._exemplars = exemplars
        self.delay = delay
        self._temperature = temperature / SHARPNESS
        self._spread = STEP_SPREAD * step.pose
        self._sampling = markov.Sampling(sampling.paths, sampling.power / SHARPNESS)
        self._library_cost = LIBRARY_COST * 30.0 / task.fps
        # of the best hypotheses
        self._costs: deque[float] = deque(
            maxlen=max(round(MEMORY_SECONDS * task.fps), 1)
        )
        self._evaluations = evaluations

    def counts(self, frame_costs: FrameCosts) -> Counts:
        """Return how many hypotheses a frame has: fewer where several cameras show something and leave less open.

        In the only frame of a track nothing continues, and all evaluations are for fresh ones.
        """
        evaluations = self._evaluations / frame_costs.camera_count
        evaluations = max(evaluations, MIN_EVALUATIONS)
        if frame_costs.alone:
            fresh = race_count(evaluations)
            return Counts(fresh, fresh - 1 - int(ALONE_REFLECTED_SHARE * fresh), 0)
        fresh = max(int(FRESH_SHARE * evaluations / FRESH_EVALUATIONS), 2)
        continued = int(
            (evaluations - fresh * FRESH_EVALUATIONS) / CONTINUED_EVALUATIONS
        )
        return Counts(fresh, fresh - 1 - int(REFLECTED_SHARE * fresh), continued)

    def follow(
        self, estimates: Iterable[Estimate], rng: np.random.Generator
    ) -> Iterator[Estimate]:
        """Yield each estimate with the pose of the likeliest sequence, up to `delay` frames later."""
        rows = None
        self._costs.clear()  # of an earlier track
        for window in markov.windows(
            self._frames(estimates, rng.spawn(1)[0]), self.delay
        ):
            states = [frame.states for frame in window]
            estimate, hypotheses, *_ = window[0]
            row = markov.viterbi_state(states)
            weights = markov.state_weights(states)
            poses = hypotheses.poses
            squares = ((hypotheses.joints - hypotheses.joints[row]) ** 2).sum(
                axis=2
            ).mean(axis=1) / SAME_DISTANCE**2
            pose, place = markov.mean_near(
                row, weights, squares, poses, hypotheses.places
            )
            rows = markov.sample_states(states, rows, self._sampling, rng)
            paths = markov.SampledPaths.of(
                self._task.body.skeleton, poses[rows], hypotheses.places[rows], pose
            )
            yield replace(estimate, pose=pose, place=place, paths=paths)

    def _frames(
        self, estimates: Iterable[Estimate], rng: np.random.Generator
    ) -> Iterator[_FittedFrame]:
        """Yield each estimate with the evaluations of its hypotheses, and these."""
        before: _FittedFrame | None = None
        latest = Hypotheses.none()
        rows = np.empty(0, dtype=np.int64)
        for estimate in estimates:
            if before is not None:
                latest = before.hypotheses
                rows = self._continuing(before, estimate.frame_costs)
            hypotheses, noise, evaluations = self._fitted(estimate, latest, rows, rng)
            joined = self._joined(estimate.frame_costs, hypotheses, before, noise)
            estimate = replace(estimate, evaluations=estimate.evaluations + evaluations)
            before = _FittedFrame(estimate, hypotheses, *joined)
            yield before

    def _fitted(
        self,
        estimate: Estimate,
        latest: Hypotheses,
        rows: Rows,
        rng: np.random.Generator,
    ) -> tuple[Hypotheses, float, float]:
        """Return the hypotheses of a frame: fresh ones, and those that continue some `rows` of the `latest`.

        With them come how imprecise its masks are, and the evaluations of the fits.
        """
        frame_costs = estimate.frame_costs
        fresh = self._fresh(estimate, latest, rows, rng)
        continued = (latest.poses[rows], latest.places[rows])
        noise, evaluations = self._noise(frame_costs, *fresh)
        if frame_costs.usable:
            tried_limbs = frame_costs.observation.estimate is not None
            evaluations += LIMB_EVALUATIONS * tried_limbs
            contours = frame_costs.contours(estimate.place)
            weights = precisions(
                START_TURN / noise,
                ALIGNED_SHIFT if frame_costs.root is None else KNOWN_SHIFT,
            )
            if frame_costs.alone:
                poses, places, used = contour_race(
                    self._task.body,
                    contours,
                    fresh,
                    weights,
                    lambda poses, places: self._pose_costs(
                        frame_costs, poses, places, noise
                    ),
                )
                fresh = poses, places
                evaluations += used + len(poses)
            else:
                fresh = fitted(
                    self._task.body,
                    contours,
                    fresh,
                    fresh[0],
                    weights,
                    FRESH_REACHES,
                    self._task.threads,
                )
                evaluations += len(fresh[0]) * FRESH_EVALUATIONS
            evaluations += len(rows) * CONTINUED_EVALUATIONS
            if frame_costs.root is not None:  # there is no other place to start at
                evaluations -= 2.0 * len(rows)
            if len(rows):
                moved, shifted = latest.continued(rows)
                shifted = _cheaper_places(frame_costs, moved, shifted)
                means, pulls = self._pulled(moved, weights, noise)
                continued = fitted(
                    self._task.body,
                    contours,
                    (moved, shifted),
                    means,
                    pulls,
                    CONTINUED_REACHES,
                    self._task.threads,
                )
        poses, places = (
            np.concatenate(arrays) for arrays in zip(fresh, continued, strict=True)
        )
        parents = np.concatenate([np.full(len(fresh[0]), -1), rows])
        return (
            Hypotheses.of(
                self._task, poses, frame_costs.at_root(places), parents, latest
            ),
            noise,
            evaluations,
        )

    def _pose_costs(
        self,
        frame_costs: FrameCosts,
        poses: Array,
        places: Array,
        noise: float,
    ) -> Array:
        """Return what poses (n, 66) at places (n, 3) cost: their silhouettes, and the distance from those of clips."""
        squares = self._exemplars.nearest(poses, 1)[1][:, 0]
        silhouette_costs = frame_costs.full(poses, places)
        self._least_cost = float(silhouette_costs.min())
        # beside an earlier track, with limbs that no clip has together, each view counts as much as clips do
        first_pass = frame_costs.observation.estimate is None
        views = 1 if first_pass else frame_costs.camera_count
        distances = np.log1p(0.5 * squares / LIBRARY_DISTANCE**2)
        library_cost = ALONE_LIBRARY_COST if frame_costs.alone else self._library_cost
        return np.asarray(
            silhouette_costs / (noise * self._temperature)
            + library_cost / views * distances
        )

    def _joined(
        self,
        frame_costs: FrameCosts,
        hypotheses: Hypotheses,
        before: _FittedFrame | None,
        noise: float,
    ) -> tuple[markov.FrameStates, Array]:
        """Return the states of a frame, joined to the frame before, and how likely landmarks are exchanged (n, K)."""
        poses = hypotheses.poses
        places = hypotheses.places
        likelihoods = frame_costs.landmarks(poses, places)
        exchanged = usually_exchanged(likelihoods)[None]
        if before is not None:
            exchanged = exchanged_next(before.exchanged, 1.0 / self._task.fps)
        landmarks = landmark_costs(likelihoods, exchanged[:, None])
        costs = landmarks.min(axis=0)
        if frame_costs.usable:
            costs += self._pose_costs(frame_costs, poses, places, noise)
            self._costs.append(self._least_cost)
        if before is None:
            return markov.frame_states(costs), exchanged_given(likelihoods, exchanged)
        latest = before.hypotheses
        steps = (
            step_costs(self._spread, jump_cost(noise), latest, hypotheses)
            + landmarks
            - landmarks.min(axis=0)
        )
        if frame_costs.root is None:
            expected = latest.places + latest.shifts
            steps += root_deviation_costs(
                places, expected[:, None], frame_costs.camera_position
            )
        states = markov.frame_states(costs, before.states, steps)
        return states, exchanged_given(likelihoods, exchanged[states.parents])

    def _noise(
        self, frame_costs: FrameCosts, poses: Array, places: Array
    ) -> tuple[float, float]:
        """Return how many times less precise one camera's masks are than clean ones, by the best frames so far.

        With it come the evaluations that this took.
        """
        if frame_costs.camera_count > 1:
            return 1.0, 0.0
        evaluations = 0.0
        if frame_costs.usable and not self._costs:
            least = float(frame_costs.full(poses, places).min())
            self._costs.append(FITTED_COST_SHARE * least)
            evaluations = float(len(poses))
        typical = float(np.quantile(self._costs or [0.0], BEST_SHARE))
        return max(typical / CLEAN_COST, 1.0), evaluations

    def _fresh(
        self,
        estimate: Estimate,
        latest: Hypotheses,
        rows: Rows,
        rng: np.random.Generator,
    ) -> tuple[Array, Array]:
        """Return poses (n, 66) and places (n, 3): of the path, of diverse states, and reflections of the likeliest.

        Where there is an earlier track, its pose is one of them; others are that with exchanged legs, or arms, and with
        the limbs of some clips.
        """
        frame_costs, (other_poses, other_places) = (
            estimate.frame_costs,
            estimate.alternatives,
        )
        poses = np.concatenate([estimate.pose[None], other_poses])
        places = np.concatenate([estimate.place[None], other_places])
        if not frame_costs.usable:
            return poses, places
        tried = [(poses, places)]
        likeliest = latest.continued(rows) if len(rows) else (poses, places)
        # of reflections
        count = self.counts(frame_costs).fresh - len(poses)
        if count > 0:
            reflectable, place = (
                array[: -(-count // frame_costs.camera_count)] for array in likeliest
            )
            reflected = frame_costs.reflected(reflectable, estimate.place)[:count]
            tried.append((reflected, np.resize(place, (len(reflected), 3))))
        if frame_costs.observation.estimate is not None:
            pose, place = (array[None] for array in frame_costs.observation.estimate)
            exchanged = [
                exchanged_limbs(self._task.body.skeleton, pose, limbs)
                for limbs in ("legs", "arms")
            ]
            tried += [(pose, place), *((other, place) for other in exchanged)]
            tried.append(self._with_other_limbs(frame_costs, pose, place, rng))
        poses, places = (np.concatenate(arrays) for arrays in zip(*tried, strict=True))
        return poses, places

    def _with_other_limbs(
        self,
        frame_costs: FrameCosts,
        pose: Array,
        place: Array,
        rng: np.random.Generator,
    ) -> tuple[Array, Array]:
        """Return a pose (1, 66) at a place (1, 3) whose limbs are the cheapest of its own and of some poses of clips.

        What one arm does says little of the other: so a few clips give many gestures, as the crossover of Deutscher
        and Reid (2005) does.
        """
        places = np.repeat(place, LIMB_POSES + 1, axis=0)
        for limb in LIMB_ANGLES * LIMB_ROUNDS:
            poses = np.repeat(pose, LIMB_POSES + 1, axis=0)
            poses[1:, limb] = self._exemplars.poses[
                self._exemplars.draw(LIMB_POSES, rng)
            ][:, limb]
            pose = poses[frame_costs.full(poses, places).argmin()][None]
        return pose, place

    def _pulled(
        self, poses: Array, weights: Array, noise: float
    ) -> tuple[Array, Array]:
        """Return what poses (n, 66) are pulled to, between themselves and similar poses of clips, and how (69,)."""
        pulls = precisions(LIBRARY_TURN / noise, np.inf)
        pulls[3] = 0.0  # the yaws of clips are free
        means = self._exemplars.nearby_mean(poses, SIMILAR_POSES, SIMILAR_SPREAD)
        sums = weights + pulls
        return poses + (pulls / sums)[3:] * (means - poses), sums

    def _continuing(self, before: _FittedFrame, frame_costs: FrameCosts) -> Rows:
        """Return the hypotheses that continue: the likeliest so far, and of those near each other only one."""
        count = self.counts(frame_costs).continued
        joints = before.hypotheses.joints.reshape(
            len(before.hypotheses.joints), -1
        ).astype(np.float32)
        same = squared_distances(joints, joints) < SAME_DISTANCE**2 * len(JOINTS)
        rows: list[int] = []
        for row in np.argsort(before.states.totals, kind="stable"):
            if not same[row, rows].any():
                rows.append(int(row))
                if len(rows) == count:
                    break
        return np.array(rows)


def _cheaper_places(frame_costs: FrameCosts, poses: Array, places: Array) -> Array:
    """Return for each of some poses (n, 66) its place (n, 3) or, where that costs less, the one that aligns it."""
    if frame_costs.root is not None:
        return frame_costs.at_root(places)
    aligned = frame_costs.aligned(poses, places)
    cheaper = frame_costs.full(poses, aligned) < frame_costs.full(poses, places)
    return np.where(cheaper[:, None], aligned, places)
