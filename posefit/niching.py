"""A niching task: numbered silhouettes that several known poses explain nearly as well, and its scores.

    instance = niche_instance(17)
    proposals = draw_population(instance.problem.space, np.random.default_rng(0), 20_000)      # or those of any search
    report = best_apart(instance.problem, proposals, instance.problem.evaluate(proposals))
    print(instance.kind, scored(instance, report).peak_ratio)

Instances are of three kinds in turn. `strides` are side views, where a stride has nearly the silhouette of the one half
a cycle later. `turns` are views from the front or from behind, where walking towards the camera hardly differs from
walking away. In `arms` other arms, before the trunk instead of behind it, have the same outline. The camera is far,
so that depth does not show. The true pose is drawn among the known ones. The person's build differs a little from the
fitted body and every joint is about a degree off, so that the true pose is not always the cheapest.

Every known pose lies in the searched box, costs nearly what the true one does, is apart from the others, and is
separated from each of them by a hill: on the straight line between them the cost rises.

Scores: peak ratio (X. Li, A. Engelbrecht, M. Epitropakis, Benchmark functions for CEC'2013 special session and
competition on niching methods, 2013) and Brier score (G. Brier, Verification of forecasts expressed in terms of
probability, Monthly Weather Review 78, 1950). A reported pose counts for the nearest known pose, if that is within the
level; only the ten heaviest poses of a report count.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.box import displacement, wrap
from posefit.fitting.check import positive, whole
from posefit.fitting.prior import Components
from posefit.fitting.problem import PoseProblem
from posefit.fitting.space import SearchSpace
from posefit.geometry.body import Body, varied
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import ANGLES, LIMBS, turns_of
from posefit.geometry.symmetry import facing, mirrored_poses, reflected_poses
from posefit.motion import built_in, recorded
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit.uncertainty.modes import Posterior, poses_apart
from posefit.uncertainty.searches import boltzmann_weights

# walks and runs of eight people
STRIDES = ("02_01", "05_01", "49_01", "16_16", "29_01", "09_12", "16_13", "16_22", "16_31", "09_01", "16_35", "127_06")
COMPONENTS = (3, 2)  # ours: of legs and trunk, and of the arms; with more, unlisted poses fit as well
SPARSE = 4  # every fourth library pose lends its arms: neighbours are nearly the same

_ARMS = np.isin(np.arange(ANGLES), turns_of((*LIMBS["left arm"], *LIMBS["right arm"])))
ARMS = np.flatnonzero(_ARMS)  # angles of a pose (66,) that belong to its arms


@lru_cache(maxsize=1)
def stride_poses() -> Array:
    """Return the poses (n, 66) of walks and runs, and their mirror images."""
    return _both(np.concatenate([recorded.clip(name).poses for name in STRIDES]))


@lru_cache(maxsize=1)
def lent_arms() -> Array:
    """Return the library poses (n, 66) that lend their arms, and their mirror images."""
    return _both(np.concatenate([clip.poses for clip in recorded.clips()])[::SPARSE])


@lru_cache(maxsize=1)
def legs_and_arms() -> Components:
    """Return the prior of the niching task: components of legs and trunk, and then of the arms by themselves."""
    mean, directions, ends = np.zeros(ANGLES - 3), np.zeros((sum(COMPONENTS), ANGLES - 3)), []
    prior, first = Components(mean, directions, np.empty(0), np.empty(0)), 0
    for poses, part, count in zip((stride_poses(), lent_arms()), (~_ARMS[3:], _ARMS[3:]), COMPONENTS, strict=True):
        angles, block = poses[:, 3:], slice(first, first := first + count)
        mean[part] = angles[:, part].mean(axis=0)
        axes = np.linalg.svd(angles[:, part] - mean[part], full_matrices=False)[2][:count]
        directions[block, part] = axes * np.sign(axes[np.arange(count), np.abs(axes).argmax(axis=1)])[:, None]
        latents = prior.transform(angles)[:, block]
        ends.append((latents.min(axis=0), latents.max(axis=0)))
    prior.low, prior.high = np.concatenate(ends, axis=1)
    return prior


def clipped(poses: Array) -> Array:
    """Return the poses (n, 66) of the box that are nearest to poses (n, 66)."""
    prior, poses = legs_and_arms(), np.array(poses, dtype=np.float64)
    poses[:, 3:] = prior.inverse_transform(np.clip(prior.transform(poses[:, 3:]), prior.low, prior.high))
    return poses


@lru_cache(maxsize=1)
def box_arms() -> Array:
    """Return the angles of the lent arms (n, 30), moved into the box."""
    arms = clipped(lent_arms())[:, ARMS]
    arms.setflags(write=False)
    return arms


def _both(poses: Array) -> Array:
    both = np.concatenate([poses, mirrored_poses(built_in.average_skeleton(), poses)])
    both.setflags(write=False)
    return both


Kind = Literal["strides", "turns", "arms"]
KINDS: tuple[Kind, ...] = ("strides", "turns", "arms")  # number n is of the kind n modulo 3
COUNT = 20_000  # instances

RNG_STREAM = 2017  # part of the seed of every instance
BOUND = 1.0  # units of silhouette cost: the most that a known pose differs from the true one
APART_MM = 60.0  # between two known poses at least: the mean over joints, both roots at one point
HILL = 2.0  # units of silhouette cost above the costlier of two known poses, somewhere between them
SIZE = (128, 96)  # pixels
DISTANCE, FIELD_OF_VIEW = 40.0, 0.0825  # metres; radians: the frame of a common camera 3.5 m away
BUILD_PERCENT = 2.0  # the most that bones and radii of the person differ from the fitted body
STANCE = np.radians(1.0)  # standard deviation of the person's joint angles from the true pose
ROOT_RANGE = np.array([np.pi, *np.radians([8.0, 8.0])])  # radians: all yaws are searched
PLACE = np.array([0.0, 0.9, 0.0])  # metres: where the root is, and the camera aims
VIEWS = {"strides": (70.0, 110.0), "turns": (0.0, 50.0), "arms": (0.0, 180.0)}  # degrees from the way the person faces
STEPS = np.arange(1, 10) / 10.0  # fractions of the line between two poses at which the cost is checked
LENT, MANY = 4000, 30  # arms tried on a pose; of those that fit, how many are checked for a hill
ATTEMPTS = 1000  # draws until one qualifies: a few for strides and turns, dozens for arms


@dataclass(frozen=True, eq=False)
class NicheInstance:
    """One numbered instance. Row `true` of the known poses is the person's."""

    number: int
    kind: Kind
    problem: PoseProblem = field(repr=False)
    known: Array = field(repr=False)  # (K, 66) poses
    costs: Array  # (K,) of the known poses
    true: int

    @property
    def proposals(self) -> Array:
        """The known poses as proposals (K, d)."""
        return _proposals(self.problem.space, self.known)

    def distances_mm(self, poses: Array) -> Array:
        """Return the distances (n, K) in millimetres of poses (n, 66) from the known ones; see `poses_apart`."""
        return 1e3 * poses_apart(self.problem.body.skeleton, poses, self.known)


@lru_cache(maxsize=256)
def niche_instance(number: int) -> NicheInstance:
    """Return instance `number`: the same silhouette and known poses on every machine.

    Raises ValueError where the number is out of range.
    """
    if whole("instance", number, 0) >= COUNT:
        raise InputError(f"instance must be at most {COUNT - 1}, got {number}")
    kind, rng = KINDS[number % len(KINDS)], np.random.default_rng([RNG_STREAM, number])
    for _ in range(ATTEMPTS):
        instance = _attempt(int(number), kind, rng)
        if instance is not None:
            return instance
    raise InputError(f"instance {number} must succeed within {ATTEMPTS} draws, and did not")


def niche_space() -> SearchSpace:
    """Return the box that is searched, the same in all instances."""
    return SearchSpace(legs_and_arms(), np.zeros(3), ROOT_RANGE, PLACE)


def _attempt(number: int, kind: Kind, rng: np.random.Generator) -> NicheInstance | None:
    """Return the instance of one draw, or None where fewer than two of its poses qualify."""
    space, body = niche_space(), Body.of(built_in.average_skeleton())
    yaw, side = rng.uniform(-np.pi, np.pi), rng.choice([-1.0, 1.0])
    view = np.radians(side * rng.uniform(*VIEWS[kind]) + (180.0 * rng.integers(2) if kind == "turns" else 0.0))
    camera = Camera.around(PLACE, yaw + view, DISTANCE, SIZE, FIELD_OF_VIEW)
    pose = stride_poses()[rng.integers(len(stride_poses()))].copy()
    pose[0], pose[1:3] = yaw, np.clip(wrapped(pose[1:3]), -ROOT_RANGE[1:], ROOT_RANGE[1:])
    if kind == "arms":
        pose[ARMS] = box_arms()[rng.integers(len(box_arms()))]
    poses = clipped(pose[None])
    person = varied(body, BUILD_PERCENT, rng)
    if kind == "arms":
        poses = np.concatenate([poses, _other_arms(_problem(person, body, camera, poses[0], space), poses[0], rng)])
    poses = np.concatenate([poses, clipped(reflected_poses(body.skeleton, poses, facing(camera, PLACE)))])
    true = int(rng.integers(len(poses)))
    stance = poses[true].copy()
    stance[3:] += rng.normal(0.0, STANCE, len(stance) - 3)
    problem = _problem(person, body, camera, stance, space)
    costs = problem.cost(poses, np.tile(PLACE, (len(poses), 1)))
    rows: list[int] = []
    for k in sorted(range(len(poses)), key=lambda k: k != true):
        if abs(costs[k] - costs[true]) <= BOUND and _is_separate_niche(problem, poses, costs, k, rows):
            rows.append(k)
    if len(rows) < 2 or (kind == "arms" and not _arms_differ(poses[rows])):
        return None
    rows.sort()
    return NicheInstance(number, kind, problem, poses[rows], costs[rows], rows.index(true))


def _problem(person: Body, body: Body, camera: Camera, pose: Array, space: SearchSpace) -> PoseProblem:
    """Return the problem of estimating a body's pose from the silhouette of a person in this one."""
    return PoseProblem(body, [camera], [Silhouette.of(project(person, camera, pose, PLACE))], space)


def _other_arms(problem: PoseProblem, pose: Array, rng: np.random.Generator) -> Array:
    """Return a pose with other arms (1, 66) and nearly the same silhouette; (0, 66) where there is none."""
    lent, poses = box_arms(), np.tile(pose, (LENT, 1))
    poses[:, ARMS] = lent[rng.choice(len(lent), LENT, replace=False)]
    costs = problem.cost(np.concatenate([pose[None], poses]), np.tile(PLACE, (len(poses) + 1, 1)))
    near = np.flatnonzero(np.abs(costs[1:] - costs[0]) <= BOUND)
    far = near[1e3 * poses_apart(problem.body.skeleton, poses[near], pose[None])[:, 0] >= APART_MM]
    for k in rng.permutation(far)[:MANY]:
        pair, pair_costs = np.array([pose, poses[k]]), costs[[0, k + 1]]
        if _is_separate_niche(problem, pair, pair_costs, 1, [0]):
            return pair[1:]
    return poses[:0]


def _arms_differ(poses: Array) -> bool:
    """Return whether two of some poses (K, 66) have the same legs and other arms."""
    legs = np.setdiff1d(np.arange(poses.shape[1]), ARMS)
    same_legs = np.abs(wrapped(poses[:, None, legs] - poses[None, :, legs])).max(axis=-1) < 1e-6
    return bool(np.count_nonzero(same_legs) > len(poses))


def _is_separate_niche(problem: PoseProblem, poses: Array, costs: Array, k: int, others: list[int]) -> bool:
    """Return whether pose k is apart from the others, with a hill in between."""
    if not others:
        return True
    if 1e3 * poses_apart(problem.body.skeleton, poses[[k]], poses[others]).min() < APART_MM:
        return False
    proposals = _proposals(problem.space, poses)
    for other in others:
        way = displacement(problem.space, proposals[k], proposals[other])
        between = problem.evaluate(wrap(problem.space, proposals[k] + STEPS[:, None] * way))
        if between.max() < max(costs[k], costs[other]) + HILL:
            return False
    return True


def _proposals(space: SearchSpace, poses: Array) -> Array:
    return space.proposals(np.column_stack([poses[:, :3], legs_and_arms().transform(poses[:, 3:])]))


REPORTED = 10  # poses of a report that count; a report of everything would be worth nothing
TEMPERATURE = 1.0  # ours: units of silhouette cost
CANDIDATES = 2000  # proposals of the least cost, from which the poses of a report are chosen


def best_apart(
    problem: PoseProblem,
    proposals: Array,
    costs: Array,
    *,
    temperature: float = TEMPERATURE,
    apart: float = APART_MM,
    most: int = REPORTED,
) -> Posterior:
    """Return the best of proposals (n, d) with costs (n,), the best that is `apart` millimetres from it, and so on.

    Weights go with exp(-cost / temperature). Raises ValueError where no cost is a number.
    """
    positive("temperature", temperature)
    proposals, costs = np.asarray(proposals, dtype=np.float64), np.asarray(costs, dtype=np.float64)
    if proposals.ndim != 2 or costs.shape != (len(proposals),):
        raise InputError(f"costs must be one a proposal ({len(proposals)}), got shape {costs.shape}")
    order = np.argsort(costs, kind="stable")
    order = order[np.isfinite(costs[order])][:CANDIDATES]
    if not len(order):
        raise InputError(f"costs must be numbers, got none among {len(costs)}")
    poses, translations = problem.decode(proposals[order])
    left, chosen = np.ones(len(order), dtype=bool), list[int]()
    while left.any() and len(chosen) < most:
        chosen.append(int(left.argmax()))
        left &= 1e3 * poses_apart(problem.body.skeleton, poses[chosen[-1:]], poses)[0] > apart
    return Posterior(poses[chosen], translations[chosen], boltzmann_weights(costs[order][chosen], temperature))


LEVELS_MM = (15.0, 30.0, 60.0)  # the mean over joints, both roots at one point
MIN_PROBABILITY = 1e-3  # ours: in the log score, so that one missed pose does not cost everything


@dataclass(frozen=True)
class Scores:
    """The scores of a report."""

    peak_ratio: dict[float, float]  # by level in millimetres, the share of the known poses that were reported
    brier: float  # 0 to 2; 0 where all the weight is near the true pose
    log_score: float  # minus the logarithm of the weight near the true pose, 0 to 6.9
    weights: tuple[float, ...]  # near each known pose; the rest is near none
    reported: int


def scored(instance: NicheInstance, report: Posterior) -> Scores:
    """Return the scores of a report. Its weights are judged at the widest level."""
    heaviest = np.argsort(-report.weights, kind="stable")[:REPORTED]
    distances = instance.distances_mm(report.poses[heaviest])
    weights = report.weights[heaviest]
    near = shares(distances, weights / weights.sum(), LEVELS_MM[-1])
    return Scores(
        {level: peak_ratio(distances, level) for level in LEVELS_MM},
        brier_score(near, instance.true),
        log_score(near, instance.true),
        tuple(near.tolist()),
        len(heaviest),
    )


def peak_ratio(distances: Array, level: float) -> float:
    """Return the share of known poses within a level of a reported one; distances (n, K) in millimetres."""
    nearest = _nearest_known(distances, level)
    return len(set(nearest[nearest >= 0].tolist())) / int(np.shape(distances)[1])  # CEC2013 (peak ratio)


def shares(distances: Array, weights: Array, level: float) -> Array:
    """Return the weight near each known pose (K,), of poses with weights (n,) at distances (n, K) in millimetres."""
    nearest = _nearest_known(distances, level)
    count = np.shape(distances)[1]
    return np.bincount(nearest[nearest >= 0], np.asarray(weights)[nearest >= 0], count).astype(np.float64)


def brier_score(weights: Array, true: int) -> float:
    """Return the squared error of the weights (K,) near the known poses and of the weight near none."""
    errors = np.append(weights, max(1.0 - float(np.sum(weights)), 0.0))
    errors[true] -= 1.0
    return float(np.sum(errors**2))  # BRIER1950 (score)


def log_score(weights: Array, true: int) -> float:
    """Return minus the natural logarithm of the weight near the true pose, a weight of at least 0.001."""
    return float(-np.log(np.clip(weights[true], MIN_PROBABILITY, 1.0)))


def _nearest_known(distances: Array, level: float) -> NDArray[np.int64]:
    """Return the nearest known pose of each reported one (n,), -1 where none is within the level."""
    if not len(distances):
        return np.empty(0, dtype=np.int64)
    return np.where(distances.min(axis=1) <= level, distances.argmin(axis=1), -1)
