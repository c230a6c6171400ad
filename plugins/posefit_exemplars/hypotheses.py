"""Several hypotheses of each frame, fitted to the contours of its masks, and the likeliest sequence of them.

The poses of clips are only near those of a person whom no clip shows, and one silhouette leaves open which way the
person leans or faces. So each frame has several hypotheses. Some are fresh: the pose of the path, unlike states of the
beam, and reflections of these. The others are those of the frame before, which go on at their speed. Each is fitted to
the contours by a few steps of Gauss and Newton, which may turn every joint. A hypothesis costs what its silhouette
does, and its distance from the poses of clips; a step costs the distance of the trunk and of each limb from where they
were going. The likeliest sequence is Viterbi's: what is wrong may fit one frame, but hardly ever twenty.

Masks of a camera and a fitted body are less precise than clean ones. Where even the best frames cost more, the contours
of a single view count for less against the poses that a fit begins with and those of clips: nothing else keeps a body
from leaning to where the mask is wrong.

After Sminchisescu and Triggs, Kinematic jump processes for monocular 3D human tracking, 2003.
"""

import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from posefit.arrays import Array
from posefit.fitting.landmarks import exchanged_given, exchanged_next, landmark_costs, usually_exchanged
from posefit.fitting.tracker import Task
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import JOINTS, LIMBS, root_centred
from posefit_exemplars.beam import Steps, root_deviation_costs, squared_distances
from posefit_exemplars.contours import SHARE, precisions
from posefit_exemplars.exemplars import Exemplars, Rows
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.smoothing import Estimate
from posefit_exemplars.window import (
    FrameStates,
    SampledPaths,
    Sampler,
    frame_states,
    mean_near,
    state_weights,
    viterbi_state,
)

FRESH_REACHES = (0.09, 0.09, 0.065, 0.065, 0.045, 0.045, 0.033, 0.033)  # metres, of the steps of a fit: contours that
REACHES = (0.15, 0.09, 0.065, 0.045, 0.033)  # are farther off count less; and of a hypothesis that goes on
FRESH_EVALUATIONS = len(FRESH_REACHES) * SHARE + 1.0
GOING_EVALUATIONS = len(REACHES) * SHARE + 3.0  # two of them are of places to begin at
MIN_EVALUATIONS = 2 * FRESH_EVALUATIONS + GOING_EVALUATIONS  # of a frame
FRESH = 0.45  # share of the evaluations that is for fresh hypotheses
REFLECTED = 0.25  # share of the fresh hypotheses that are reflections of the others
TURN = np.radians(8.0)  # that an angle may be off where a fit begins: standard deviation, as all that follow
LIBRARY_TURN = np.radians(15.0)  # that it may be off similar poses of clips
KNOWN_SHIFT, ALIGNED_SHIFT = 0.003, 0.05  # metres that a known root, and an aligned one, may be off
SIMILAR_POSES = 8  # of clips, whose mean pulls a hypothesis that goes on
SIMILAR = 0.03  # metres: that they are off the nearest of them
LIBRARY_DISTANCE = 0.05  # metres: d times that off the clips costs LIBRARY_COST log(1 + d^2 / 2)
LIBRARY_COST = 4.0  # for a thirtieth of a second
SHARPNESS = 2.0  # times what a silhouette costs on the path, as fitted poses are nearer
SPREAD = 4.0 / 3.0  # times the spread of the path's steps
CLEAN_COST = 3.0  # of a fitted pose; where even the best frames cost more, masks and the body are less precise
BEST = 0.2  # share of the frames that are the best
MEMORY = 10.0  # seconds of frames
FITTED_COST = 0.4  # what a fit leaves of a cost, before any is made
SAME = 0.03  # metres: hypotheses that are nearer to each other go on as one; standard deviation of those averaged
_LIMBS = [np.array([JOINTS.index(bone) for bone in bones]) for bones in LIMBS.values()]
_TRUNK = np.setdiff1d(np.arange(len(JOINTS)), np.concatenate(_LIMBS))
PARTS: Sequence[Rows] = [_TRUNK, *_LIMBS]  # joints
SPEEDS: Mapping[float, float] = {0.0: 0.3, 0.5: 0.1, 1.0: 0.0, 1.4: 0.15}  # at which a part goes on: what each costs
HIGHEST = 4.0  # cost of a step of one part


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """The hypotheses of one frame."""

    poses: Array = field(repr=False)  # (n, 66)
    places: Array = field(repr=False)  # (n, 3)
    joints: Array = field(repr=False)  # (n, 27, 3) metres, the root at the origin
    turns: Array = field(repr=False)  # (n, 66) radians since the frame before; 0 for fresh ones, as both that follow
    shifts: Array = field(repr=False)  # (n, 3) metres
    rates: Array = field(repr=False)  # (n, 27, 3) metres
    exchanged: Array = field(repr=False)  # (n, K) how likely left and right of groups of landmarks are exchanged
    parents: Rows = field(repr=False)
    totals: Array = field(repr=False)

    def __len__(self) -> int:
        return len(self.poses)


def step_costs(spread: float, before: Hypotheses, after: Hypotheses) -> Array:
    """Return what steps between hypotheses of successive frames cost (n, m).

    For the trunk and each limb, half the square, over the `spread`, of what its joints are off where the mean of both
    rates leads, and of the difference of the rates; at the cheapest of a few speeds. A distance is over all joints,
    root mean square.
    """
    scale = 0.5 / (spread**2 * len(JOINTS))
    total = np.zeros((len(before), len(after)))
    for part in PARTS:
        codes, rates, later, later_rates = (
            array[:, part].reshape(len(array), -1).astype(np.float32)
            for array in (before.joints, before.rates, after.joints, after.rates)
        )
        changes = squared_distances(rates, later_rates)
        costs = np.full(changes.shape, HIGHEST)
        for speed, cost in SPEEDS.items():
            half = np.float32(0.5 * speed)
            off = squared_distances(codes + half * rates, later - half * later_rates)
            np.minimum(costs, scale * (off + speed**2 * changes) + cost, out=costs)
        total += costs
    return total


class HypothesisFilter:
    """Fits the hypotheses of one frame after the other, and reports the likeliest sequence `delay` frames later.

    `evaluations` are for each frame, and decide how many hypotheses there are; `temperature` is that of the path.
    """

    def __init__(
        self,
        task: Task,
        exemplars: Exemplars,
        steps: Steps,
        temperature: float,
        evaluations: float,
        delay: int,
        samples: int,
        power: float,
    ) -> None:
        self._task, self._exemplars, self._steps, self.delay = task, exemplars, steps, delay
        self._temperature, self._spread = temperature / SHARPNESS, SPREAD * steps.spread
        self._samples, self._power = samples, power / SHARPNESS
        self._library_cost = LIBRARY_COST * 30.0 / task.fps
        self._costs: deque[float] = deque(maxlen=max(round(MEMORY * task.fps), 1))  # of the best hypotheses
        self._evaluations = evaluations

    def unlike(self, cameras: int) -> int:
        """Return how many of the beam's states, unlike each other, begin hypotheses where so many cameras see."""
        fresh, _ = self._counts(cameras)
        return fresh - 1 - int(REFLECTED * fresh)

    def _counts(self, cameras: int) -> tuple[int, int]:
        """Return how many hypotheses are fresh, and how many go on; several cameras leave less open."""
        evaluations = max(self._evaluations / cameras, MIN_EVALUATIONS)
        fresh = max(int(FRESH * evaluations / FRESH_EVALUATIONS), 2)
        return fresh, int((evaluations - fresh * FRESH_EVALUATIONS) / GOING_EVALUATIONS)

    def follow(self, frames: Iterable[Estimate], rng: np.random.Generator) -> Iterator[Estimate]:
        """Yield each frame with the pose of the likeliest sequence, up to `delay` frames later."""
        waiting: deque[tuple[Estimate, FrameStates[Hypotheses]]] = deque()
        latest: FrameStates[Hypotheses] | None = None
        sampler = Sampler(self._samples, self._power, rng)
        for frame in frames:
            start, cpu_start = time.perf_counter(), time.process_time()
            latest, used = self._fitted(frame, latest)
            frame = frame.longer(used, time.perf_counter() - start, time.process_time() - cpu_start)
            waiting.append((frame, latest))
            if len(waiting) > self.delay:
                yield self._estimated(waiting, sampler)
        while waiting:
            yield self._estimated(waiting, sampler)

    def _estimated(self, waiting: deque[tuple[Estimate, FrameStates[Hypotheses]]], sampler: Sampler) -> Estimate:
        """Return the oldest waiting frame, with the mean pose of the hypotheses near that of the likeliest sequence."""
        start, cpu_start = time.perf_counter(), time.process_time()
        window = [states for _, states in waiting]
        row, weights, rows = viterbi_state(window), state_weights(window), sampler.draw(window)
        frame, states = waiting.popleft()
        own, paths = states.beam, None
        squares = ((own.joints - own.joints[row]) ** 2).sum(axis=2).mean(axis=1) / SAME**2
        pose, place = mean_near(row, weights, squares, own.poses, own.places)
        if rows is not None:
            paths = SampledPaths.of(self._task.body.skeleton, own.poses[rows], own.places[rows], pose)
        frame = frame.longer(0.0, time.perf_counter() - start, time.process_time() - cpu_start)
        return replace(frame, pose=pose, place=place, paths=paths)

    def _fitted(self, frame: Estimate, before: FrameStates[Hypotheses] | None) -> tuple[FrameStates[Hypotheses], float]:
        """Return the hypotheses of a frame, and the evaluations that they took."""
        look, task, latest, used = frame.look, self._task, None if before is None else before.beam, 0.0
        contours = look.contours(frame.place) if look.usable else None
        poses, places = self._fresh(frame, latest)
        noise = self._noise(look, poses, places)
        weights = precisions(TURN / noise, ALIGNED_SHIFT if look.root is None else KNOWN_SHIFT)
        if contours is not None:
            poses, places = contours.fitted(task, poses, places, poses, weights, FRESH_REACHES)
            used += len(poses) * FRESH_EVALUATIONS
        origins = np.full(len(poses), -1)
        if latest is not None:
            going = self._unlike(latest, look)
            moved, shifted = latest.poses[going], latest.places[going]
            if contours is not None:
                moved = moved + latest.turns[going]
                shifted = _cheaper(look, moved, shifted + latest.shifts[going])
                means, pulls = self._pulled(moved, weights, noise)
                moved, shifted = contours.fitted(task, moved, shifted, means, pulls, REACHES)
                used += len(going) * GOING_EVALUATIONS
            poses, places = np.concatenate([poses, moved]), np.concatenate([places, shifted])
            origins = np.concatenate([origins, going])
        places = look.at_root(places)
        joints = root_centred(task.body.skeleton.joints(poses))
        turns, shifts, rates = np.zeros_like(poses), np.zeros_like(places), np.zeros_like(joints)
        if latest is not None:
            on, since = origins >= 0, origins[origins >= 0]
            turns[on], shifts[on] = wrapped(poses[on] - latest.poses[since]), places[on] - latest.places[since]
            rates[on] = joints[on] - latest.joints[since]
        likelihoods = look.landmarks(poses, places)
        exchanged = usually_exchanged(likelihoods)[None]
        if latest is not None:
            exchanged = exchanged_next(latest.exchanged, 1.0 / task.fps)
        landmarks = landmark_costs(likelihoods, exchanged[:, None])
        hypotheses = Hypotheses(poses, places, joints, turns, shifts, rates, exchanged, origins, np.zeros(len(poses)))
        fits, steps = landmarks.min(axis=0), None
        if look.usable:
            squares = self._exemplars.nearest(poses, 1)[1][:, 0]
            costs = look.full(poses, places)
            self._costs.append(float(costs.min()))
            fits += costs / (noise * self._temperature)
            fits += self._library_cost * np.log1p(0.5 * squares / LIBRARY_DISTANCE**2)
        if latest is not None:
            steps = step_costs(self._spread, latest, hypotheses) + landmarks - landmarks.min(axis=0)
            if look.root is None:
                expected = latest.places + latest.shifts
                steps += root_deviation_costs(places, expected[:, None], look.eye, self._steps)
        states = frame_states(hypotheses, fits, before, steps)
        exchanged = exchanged_given(likelihoods, exchanged[states.beam.parents if latest is not None else 0])
        return replace(states, beam=replace(states.beam, exchanged=exchanged)), used

    def _noise(self, look: FrameCosts, poses: Array, places: Array) -> float:
        """Return how many times less precise masks are than clean ones, 1 or more, by the best frames so far.

        Before the first, what its hypotheses' poses (n, 66) at places (n, 3) cost tells. With several cameras it is 1.
        """
        if look.cameras > 1:
            return 1.0
        if look.usable and not self._costs:
            self._costs.append(FITTED_COST * float(look.full(poses, places).min()))
        return max(float(np.quantile(self._costs or [0.0], BEST)) / CLEAN_COST, 1.0)

    def _fresh(self, frame: Estimate, latest: Hypotheses | None) -> tuple[Array, Array]:
        """Return the poses (n, 66) and places (n, 3) of the path, of unlike states, and reflections of the likeliest.

        Before any is known, the path and the states are reflected.
        """
        poses, places = frame.pose[None], frame.place[None]
        if frame.others is not None:
            poses, places = np.concatenate([poses, frame.others[0]]), np.concatenate([places, frame.others[1]])
        left = self._counts(frame.look.cameras)[0] - len(poses)
        if not frame.look.usable or left <= 0:
            return poses, places
        first, beside = poses, places
        if latest is not None:
            going = self._unlike(latest, frame.look)
            first, beside = latest.poses[going] + latest.turns[going], latest.places[going] + latest.shifts[going]
        first = first[: -(-left // frame.look.cameras)]
        reflected = frame.look.reflected(first, frame.place)[:left]
        beside = np.resize(beside[: len(first)], (len(reflected), 3))
        return np.concatenate([poses, reflected]), np.concatenate([places, beside])

    def _pulled(self, poses: Array, weights: Array, noise: float) -> tuple[Array, Array]:
        """Return what poses (n, 66) are pulled to, between themselves and similar poses of clips, and how (69,)."""
        pulls = precisions(LIBRARY_TURN / noise, np.inf)
        pulls[3] = 0.0  # the yaws of clips are free
        similar = self._exemplars.similar(poses, SIMILAR_POSES, SIMILAR)
        both = weights + pulls
        return poses + (pulls / both)[3:] * (similar - poses), both

    def _unlike(self, latest: Hypotheses, look: FrameCosts) -> Rows:
        """Return the hypotheses that go on: the likeliest so far, of those that are near each other one."""
        _, most = self._counts(look.cameras)
        flat = latest.joints.reshape(len(latest), -1).astype(np.float32)
        near = squared_distances(flat, flat) < SAME**2 * len(JOINTS)
        chosen: list[int] = []
        for row in np.argsort(latest.totals, kind="stable"):
            if not near[row, chosen].any():
                chosen.append(int(row))
                if len(chosen) == most:
                    break
        return np.array(chosen)


def _cheaper(look: FrameCosts, poses: Array, places: Array) -> Array:
    """Return for each of some poses (n, 66) its place (n, 3) or, where that costs less, the one that aligns it."""
    if look.root is not None:
        return look.at_root(places)
    aligned = look.placed(poses, places)
    return np.where((look.full(poses, aligned) < look.full(poses, places))[:, None], aligned, places)
