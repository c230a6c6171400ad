"""Several hypotheses per frame, fitted to contours, and the likeliest sequence of them.

The poses of clips are only near the poses of a person whom no clip shows, and one
silhouette leaves open which way the person leans or faces. So each frame has several
hypotheses. Fresh hypotheses start from the pose of the path, diverse states of the
beam, and reflections of these. The others continue hypotheses of the frame before at
their speed. A few Gauss-Newton steps, which may turn every joint, fit each hypothesis
to the contours of the masks.

The cost of a hypothesis is that of its silhouette, plus a cost of its distance from the
poses of clips. The cost of a step is the distance of the trunk and of each limb from
where their motion leads. The Viterbi algorithm finds the likeliest sequence: a wrong
pose may fit one frame, but hardly twenty.

Real masks and fitted bodies are less precise than clean ones. If even the best frames
cost more, the contours of a single view get less weight than the start of the fit and
the poses of clips. Nothing else keeps a body from leaning to where the mask is wrong.

After Sminchisescu and Triggs, Kinematic jump processes for monocular 3D human tracking,
2003.
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

# Metres, for each step of a fit. Contours that are farther away count less.
FRESH_REACHES = (0.09, 0.09, 0.065, 0.065, 0.045, 0.045, 0.033, 0.033)
CONTINUED_REACHES = (0.15, 0.09, 0.065, 0.045, 0.033)
FRESH_EVALUATIONS = len(FRESH_REACHES) * STEP_EVALUATIONS + 1.0
# Two of the evaluations compare the places to start at.
CONTINUED_EVALUATIONS = len(CONTINUED_REACHES) * STEP_EVALUATIONS + 3.0
# Evaluations per frame, at least: two fresh hypotheses and one that continues.
MIN_EVALUATIONS = 2 * FRESH_EVALUATIONS + CONTINUED_EVALUATIONS
FRESH_SHARE = 0.45  # share of the evaluations for fresh hypotheses
REFLECTED_SHARE = 0.25  # share of reflections among the fresh hypotheses
ALONE_REFLECTED_SHARE = 0.5  # the same in the only frame of a track
LIMB_POSES = 16  # poses of clips that lend their limbs, for each limb
LIMB_ROUNDS = 2  # how often each limb is tried
LIMB_ANGLES = [angles_of(bones) for bones in LIMBS.values()]
LIMB_EVALUATIONS = LIMB_ROUNDS * len(LIMBS) * (LIMB_POSES + 1.0)
# Standard deviations of an angle from the start of a fit, and from similar clips.
START_TURN = np.radians(8.0)
LIBRARY_TURN = np.radians(15.0)
# Standard deviations of the root from its start, metres.
KNOWN_SHIFT = 0.003
ALIGNED_SHIFT = 0.05
# The mean of the nearest poses of clips pulls a hypothesis that continues. A pose gets
# less weight the farther it is away, compared to the nearest one.
SIMILAR_POSES = 8
SIMILAR_SPREAD = 0.03  # metres, standard deviation of these weights
# A distance from the clips of d LIBRARY_DISTANCE costs LIBRARY_COST log(1 + d^2 / 2).
LIBRARY_DISTANCE = 0.05  # metres
LIBRARY_COST = 4.0  # for a thirtieth of a second
# The same in the only frame of a track, where hypotheses are fitted longer.
ALONE_LIBRARY_COST = 1.0
# Silhouettes cost this times as much as on the path, because fitted poses are nearer.
SHARPNESS = 2.0
STEP_SPREAD = 4.0 / 3.0  # times the spread of the path's steps
# The cost of a pose fitted to clean masks. If even the best frames cost more, masks or
# the body are less precise.
CLEAN_COST = 3.0
BEST_SHARE = 0.2  # the quantile of costs that stands for the best frames
MEMORY_SECONDS = 10.0  # frames longer ago are forgotten
FITTED_COST_SHARE = 0.4  # estimate of the cost after a fit, before the first one
# Metres. Hypotheses nearer than this continue as one. It is also the standard deviation
# of the mean that is reported.
SAME_DISTANCE = 0.03
_LIMBS = [np.array([JOINTS.index(bone) for bone in bones]) for bones in LIMBS.values()]
_TRUNK = np.setdiff1d(np.arange(len(JOINTS)), np.concatenate(_LIMBS))
PARTS: Sequence[Rows] = [_TRUNK, *_LIMBS]  # the joints of each part
# Costs of the speeds at which a part may continue, as multiples of its speed before.
SPEED_COSTS: Mapping[float, float] = {0.0: 0.3, 0.5: 0.1, 1.0: 0.0, 1.4: 0.15}
MAX_PART_COST = 4.0  # cost of a step of one part, at most, between clean masks
# Noisy masks multiply it by the square of their noise, at most by this.
MAX_JUMP_FACTOR = 3.0


class Hypotheses(NamedTuple):
    """The hypotheses of one frame."""

    poses: Array  # (n, 66)
    places: Array  # (n, 3)
    joints: Array  # (n, 27, 3) metres, the root at the origin
    # the changes since the frame before, 0 for fresh hypotheses
    turns: Array  # (n, 66) radians
    shifts: Array  # (n, 3) metres
    rates: Array  # (n, 27, 3) metres

    @classmethod
    def none(cls) -> Self:
        """Return no hypotheses, for the time before the first frame."""
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
        """Return hypotheses with their motion since the frame before.

        Args:
            task: The task, for the skeleton of its body.
            poses: (n, 66).
            places: (n, 3) metres.
            parents: (n,) the rows of `before` that they continue, or -1 for fresh ones.
            before: The hypotheses of the frame before.

        """
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
        """Return poses (n, 66) and places (n, 3) one frame later, at the same speed."""
        poses = self.poses[rows] + self.turns[rows]
        places = self.places[rows] + self.shifts[rows]
        return poses, places


class Counts(NamedTuple):
    """The numbers of hypotheses of a frame."""

    fresh: int
    diverse: int  # fresh ones from diverse states; others: the path and reflections
    continued: int


class _FittedFrame(NamedTuple):
    """A frame with its fitted hypotheses."""

    estimate: Estimate  # on the path of the beam
    hypotheses: Hypotheses
    states: markov.FrameStates
    # (n, K) probabilities that groups of landmarks have left and right exchanged
    exchanged: Array


def step_costs(
    spread: float, limit: float, before: Hypotheses, after: Hypotheses
) -> Array:
    """Return the costs (n, m) of steps between hypotheses of successive frames.

    A step costs the sum over the trunk and the limbs. The cost of a part is half the
    sum of two squares: the distance of its joints from where the mean of both rates
    leads, and the difference of the rates. Both are in spreads, root mean square over
    all joints. A part takes the cheapest of a few speeds.

    Args:
        spread: Standard deviation of a step, metres.
        limit: The cost of one part, at most.
        before: The n hypotheses of one frame.
        after: The m hypotheses of the next frame.

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
            # half a frame after the one and half a frame before the other
            squares = squared_distances(
                joints + half * rates, later - half * later_rates
            )
            speed_costs = scale * (squares + speed**2 * changes) + cost  # (n, m)
            np.minimum(costs, speed_costs, out=costs)
        total += costs
    return total


def jump_cost(noise: float) -> float:
    """Return the greatest cost of a step of one part, for masks with this noise.

    A noise of 2 means masks half as precise as clean ones. With noisy masks a wrong
    pose may fit some frames much better than the right one, and a jump to it must still
    not pay.
    """
    return MAX_PART_COST * min(noise**2, MAX_JUMP_FACTOR)


class HypothesisFilter:
    """Fits the hypotheses of each frame, and reports the likeliest sequence of them.

    Args:
        task: The task.
        exemplars: The poses of clips.
        step: The time between frames, and the usual differences on the path.
        temperature: Divides silhouette costs on the path.
        evaluations: The budget of the fits in each frame.
        delay: How many frames later a frame is reported.
        sampling: How paths are sampled on the path of the beam.

    """

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
        # the costs of the best hypotheses of the latest frames
        remembered = max(round(MEMORY_SECONDS * task.fps), 1)
        self._costs: deque[float] = deque(maxlen=remembered)
        self._evaluations = evaluations

    def counts(self, frame_costs: FrameCosts) -> Counts:
        """Return the numbers of hypotheses of a frame.

        There are fewer if several cameras show the person, because they leave less
        open. In the only frame of a track nothing continues, so all evaluations are for
        fresh hypotheses.
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
        """Yield each estimate with the pose of the likeliest sequence.

        Args:
            estimates: The estimates of the frames on the path of the beam.
            rng: The random numbers.

        Yields:
            The estimates, each with up to `delay` later frames known.

        """
        rows = None
        self._costs.clear()  # from an earlier track
        frames = self._frames(estimates, rng.spawn(1)[0])
        for window in markov.windows(frames, self.delay):
            states = [frame.states for frame in window]
            estimate, hypotheses, *_ = window[0]
            row = markov.viterbi_state(states)
            weights = markov.state_weights(states)
            poses = hypotheses.poses
            offsets = hypotheses.joints - hypotheses.joints[row]  # (n, 27, 3)
            squares = (offsets**2).sum(axis=2).mean(axis=1) / SAME_DISTANCE**2
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
        """Yield each estimate with its fitted hypotheses and their evaluations."""
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
        """Return the fitted hypotheses of a frame.

        Args:
            estimate: The estimate of the frame on the path of the beam.
            latest: The hypotheses of the frame before.
            rows: The rows of `latest` that continue.
            rng: The random numbers.

        Returns:
            The hypotheses, first the fresh ones; the noise of the masks; and the
            evaluations of the fits.

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
            # a known root leaves no choice of places to start at
            if frame_costs.root is not None:
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
        places = frame_costs.at_root(places)
        parents = np.concatenate([np.full(len(fresh[0]), -1), rows])
        hypotheses = Hypotheses.of(self._task, poses, places, parents, latest)
        return hypotheses, noise, evaluations

    def _pose_costs(
        self,
        frame_costs: FrameCosts,
        poses: Array,
        places: Array,
        noise: float,
    ) -> Array:
        """Return the costs (n,) of poses: of silhouettes, and of leaving the clips."""
        squares = self._exemplars.nearest(poses, 1)[1][:, 0]
        silhouette_costs = frame_costs.full(poses, places)
        self._least_cost = float(silhouette_costs.min())
        # hypotheses of a second pass have limbs that no clip combines, so that each
        # view counts as much as the clips do
        first_pass = frame_costs.observation.estimate is None
        views = 1 if first_pass else frame_costs.camera_count
        distances = np.log1p(0.5 * squares / LIBRARY_DISTANCE**2)
        library_cost = ALONE_LIBRARY_COST if frame_costs.alone else self._library_cost
        scaled_costs = silhouette_costs / (noise * self._temperature)
        return np.asarray(scaled_costs + library_cost / views * distances)

    def _joined(
        self,
        frame_costs: FrameCosts,
        hypotheses: Hypotheses,
        before: _FittedFrame | None,
        noise: float,
    ) -> tuple[markov.FrameStates, Array]:
        """Return the states of a frame, joined to the frame before.

        With them come the probabilities (n, K) that groups of landmarks are exchanged.
        """
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
        """Return the noise of the masks, and the evaluations that this took.

        The noise tells how many times less precise the masks of one camera are than
        clean masks, judged by the best frames so far. It is 1 with several cameras.
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
        """Return the poses (n, 66) and places (n, 3) that fresh hypotheses start from.

        They are the path, diverse states, and reflections of the likeliest hypotheses.
        If there is an earlier track, its pose is added: as it is, with exchanged legs,
        with exchanged arms, and with limbs of clips.
        """
        frame_costs = estimate.frame_costs
        other_poses, other_places = estimate.alternatives
        poses = np.concatenate([estimate.pose[None], other_poses])
        places = np.concatenate([estimate.place[None], other_places])
        if not frame_costs.usable:
            return poses, places
        tried = [(poses, places)]
        likeliest = latest.continued(rows) if len(rows) else (poses, places)
        count = self.counts(frame_costs).fresh - len(poses)  # of reflections
        if count > 0:
            # each pose has one reflection per camera
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
        """Return a pose (1, 66) with the cheapest limbs, at its place (1, 3).

        Each limb is the cheapest of its own and those of a few random poses of clips.
        The motion of one arm says little about the other, so a few clips combine to
        many gestures, as in the crossover of Deutscher and Reid (2005).
        """
        places = np.repeat(place, LIMB_POSES + 1, axis=0)
        for limb in LIMB_ANGLES * LIMB_ROUNDS:
            poses = np.repeat(pose, LIMB_POSES + 1, axis=0)
            drawn = self._exemplars.draw(LIMB_POSES, rng)
            poses[1:, limb] = self._exemplars.poses[drawn][:, limb]
            pose = poses[frame_costs.full(poses, places).argmin()][None]
        return pose, place

    def _pulled(
        self, poses: Array, weights: Array, noise: float
    ) -> tuple[Array, Array]:
        """Return what a fit pulls poses (n, 66) to, and the weights of its pulls (69,).

        They lie between the poses themselves and the mean of similar poses of clips.
        """
        pulls = precisions(LIBRARY_TURN / noise, np.inf)
        pulls[3] = 0.0  # the yaws of clips are free
        means = self._exemplars.nearby_mean(poses, SIMILAR_POSES, SIMILAR_SPREAD)
        sums = weights + pulls
        return poses + (pulls / sums)[3:] * (means - poses), sums

    def _continuing(self, before: _FittedFrame, frame_costs: FrameCosts) -> Rows:
        """Return the hypotheses that continue: the likeliest, without duplicates."""
        count = self.counts(frame_costs).continued
        count_before = len(before.hypotheses.joints)
        flat = before.hypotheses.joints.reshape(count_before, -1)  # (n, 81)
        joints = flat.astype(np.float32)
        same = squared_distances(joints, joints) < SAME_DISTANCE**2 * len(JOINTS)
        rows: list[int] = []
        for row in np.argsort(before.states.totals, kind="stable"):
            if not same[row, rows].any():
                rows.append(int(row))
                if len(rows) == count:
                    break
        return np.array(rows)


def _cheaper_places(frame_costs: FrameCosts, poses: Array, places: Array) -> Array:
    """Return the cheaper place (n, 3) of each pose (n, 66): its own or the aligned one.

    A known root is returned as it is.
    """
    if frame_costs.root is not None:
        return frame_costs.at_root(places)
    aligned = frame_costs.aligned(poses, places)
    cheaper = frame_costs.full(poses, aligned) < frame_costs.full(poses, places)
    return np.where(cheaper[:, None], aligned, places)
