"""Numbered instances of the niching task: a silhouette, and the known poses that have nearly that silhouette.

A number is one of three kinds in turn. `strides` are seen from the side, where a stride has nearly the silhouette of
the one half a cycle later. `turns` are seen from in front or from behind, where somebody who comes is hardly told from
somebody who goes. `arms` are hidden: with other arms, before the trunk instead of behind it, the pose looks the same.
The camera stands far away, so that depth does not show. Which of the known poses is the true one is drawn at random;
the person's build is a little other than the body that is fitted, and every joint is about a degree off the true pose,
so that the true one does not give itself away by being the cheapest.

Every known pose is in the box that is searched, costs nearly what the true one does, is apart from the others, and
has a hill between itself and each of them: on the straight way from one to the other the cost rises.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.problem import PoseProblem
from posefit.fitting.space import SearchSpace
from posefit.geometry.alike import facing, reflected_poses
from posefit.geometry.body import Body, varied
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.motion import built_in
from posefit.niching.space import ARMS, LegsAndArms, held_arms, legs_and_arms, stride_poses
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette

Kind = Literal["strides", "turns", "arms"]
KINDS: tuple[Kind, ...] = ("strides", "turns", "arms")  # number n is of the kind n modulo 3
COUNT = 20_000  # how many numbers there are

SALT = 2017  # part of the seed of every instance
BOUND = 1.0  # units of silhouette cost by which a known pose differs from the true one at most
APART_MM = 60.0  # between two known poses at least: the mean over joints, both roots at one point
HILL = 2.0  # units of silhouette cost above the dearer of two known poses, somewhere between them
SIZE = (128, 96)  # pixels
DISTANCE, FIELD_OF_VIEW = 40.0, 0.0825  # metres; radians, which show as much as a common camera does from 3.5 m
BUILD_PERCENT = 2.0  # by which bones and radii of the person are off those of the body that is fitted, at most
STANCE = np.radians(1.0)  # standard deviation by which the person's joint angles are off those of the true pose
ROOT_RANGE = np.array([np.pi, *np.radians([8.0, 8.0])])  # radians: yaw is sought all round
PLACE = np.array([0.0, 0.9, 0.0])  # metres: where the root is, and the camera aims
VIEWS = {"strides": (70.0, 110.0), "turns": (0.0, 50.0), "arms": (0.0, 180.0)}  # degrees from where somebody faces
STEPS = np.arange(1, 10) / 10.0  # where the cost is looked at between two poses
LENT, MANY = 4000, 30  # arms that are tried on a pose; of those that fit, as many as are looked at for a hill
ATTEMPTS = 1000  # draws until one is as it should be: a few for strides and turns, some dozens for arms


@dataclass(frozen=True, eq=False)
class NicheInstance:
    """One numbered instance. Of the known poses, row `true` is the one that the person is in."""

    number: int
    kind: Kind
    problem: PoseProblem = field(repr=False)
    known: Array = field(repr=False)  # (K, 66) poses
    costs: Array  # (K,) of the known poses
    true: int

    @property
    def proposals(self) -> Array:
        """The known poses as proposals (K, d)."""
        return _proposals(self.problem.space, legs_and_arms(), self.known)

    def distances_mm(self, poses: Array) -> Array:
        """Return how far poses (n, 66) are from the known ones (n, K), as `apart_mm` says."""
        return apart_mm(self.problem.body, poses, self.known)


@lru_cache(maxsize=256)
def niche_instance(number: int) -> NicheInstance:
    """Return an instance: the same silhouette and known poses for the same number, everywhere.

    Raises ValueError where there is none of that number.
    """
    if isinstance(number, bool) or not isinstance(number, int | np.integer) or not 0 <= number < COUNT:
        raise ValueError(f"instance must be a whole number from 0 to {COUNT - 1}, got {number!r}")
    kind, rng = KINDS[number % len(KINDS)], np.random.default_rng([SALT, number])
    for _ in range(ATTEMPTS):
        made = _tried(int(number), kind, rng)
        if made is not None:
            return made
    raise ValueError(f"instance {number} must be found in {ATTEMPTS} draws, got none")


def niche_space() -> SearchSpace:
    """Return the box that is searched, the same in all instances."""
    return SearchSpace(legs_and_arms(), np.zeros(3), ROOT_RANGE, PLACE)


def apart_mm(body: Body, poses: Array, others: Array) -> Array:
    """Return how far poses (n, 66) are from others (K, 66), in millimetres (n, K).

    That is the mean over joints, both roots at one point.
    """
    joints = body.skeleton.joints(poses, np.zeros((len(poses), 3)))
    theirs = body.skeleton.joints(others, np.zeros((len(others), 3)))
    return np.array([1e3 * np.linalg.norm(one - theirs, axis=-1).mean(axis=-1) for one in joints]).reshape(
        len(poses), len(others)
    )


def _tried(number: int, kind: Kind, rng: np.random.Generator) -> NicheInstance | None:
    """Return the instance of one draw, or none where fewer than two of its poses are as they should be."""
    prior, space, body = legs_and_arms(), niche_space(), Body.of(built_in.average_skeleton())
    yaw, side = rng.uniform(-np.pi, np.pi), rng.choice([-1.0, 1.0])
    view = np.radians(side * rng.uniform(*VIEWS[kind]) + (180.0 * rng.integers(2) if kind == "turns" else 0.0))
    camera = Camera.around(PLACE, yaw + view, DISTANCE, SIZE, FIELD_OF_VIEW)
    pose = stride_poses()[rng.integers(len(stride_poses()))].copy()
    pose[0], pose[1:3] = yaw, np.clip(wrapped(pose[1:3]), -ROOT_RANGE[1:], ROOT_RANGE[1:])
    if kind == "arms":
        pose[ARMS] = held_arms()[rng.integers(len(held_arms()))]
    poses = prior.held(pose[None])
    person = varied(body, BUILD_PERCENT, rng)
    if kind == "arms":
        poses = np.concatenate([poses, _other_arms(_seen(person, body, camera, poses[0], space), poses[0], rng)])
    poses = np.concatenate([poses, prior.held(reflected_poses(body.skeleton, poses, facing(camera, PLACE)))])
    true = int(rng.integers(len(poses)))
    stance = poses[true].copy()
    stance[3:] += rng.normal(0.0, STANCE, len(stance) - 3)
    problem = _seen(person, body, camera, stance, space)
    costs = problem.cost(poses, np.tile(PLACE, (len(poses), 1)))
    order = [true, *np.flatnonzero(np.arange(len(poses)) != true)]
    kept: list[int] = []
    for k in order:
        if abs(costs[k] - costs[true]) <= BOUND and _niche_of_its_own(problem, poses, costs, k, kept):
            kept.append(int(k))
    if len(kept) < 2 or (kind == "arms" and not _arms_differ(poses[kept])):
        return None
    rows = sorted(kept)
    return NicheInstance(number, kind, problem, poses[rows], costs[rows], rows.index(true))


def _seen(person: Body, body: Body, camera: Camera, pose: Array, space: SearchSpace) -> PoseProblem:
    """Return the problem of finding a body's pose where a person is seen in this one."""
    return PoseProblem(body, [camera], [Silhouette.of(project(person, camera, pose, PLACE))], space)


def _other_arms(problem: PoseProblem, pose: Array, rng: np.random.Generator) -> Array:
    """Return the pose with other arms (1, 66) that has nearly its silhouette; none of them (0, 66) where none has."""
    lent = held_arms()
    poses = np.tile(pose, (LENT, 1))
    poses[:, ARMS] = lent[rng.choice(len(lent), LENT, replace=False)]
    costs = problem.cost(np.concatenate([pose[None], poses]), np.tile(PLACE, (len(poses) + 1, 1)))
    near = np.flatnonzero(np.abs(costs[1:] - costs[0]) <= BOUND)
    far = near[apart_mm(problem.body, poses[near], pose[None])[:, 0] >= APART_MM]
    for k in rng.permutation(far)[:MANY]:
        pair, theirs = np.array([pose, poses[k]]), costs[[0, k + 1]]
        if _niche_of_its_own(problem, pair, theirs, 1, [0]):
            return pair[1:]
    return poses[:0]


def _arms_differ(poses: Array) -> bool:
    """Return whether two of some poses (K, 66) have the same legs and other arms."""
    legs = np.setdiff1d(np.arange(poses.shape[1]), ARMS)
    alike = np.abs(wrapped(poses[:, None, legs] - poses[None, :, legs])).max(axis=-1) < 1e-6
    return bool(np.count_nonzero(alike) > len(poses))


def _niche_of_its_own(problem: PoseProblem, poses: Array, costs: Array, k: int, others: list[int]) -> bool:
    """Return whether pose k is apart from the others, with a hill in between."""
    if not others:
        return True
    if apart_mm(problem.body, poses[[k]], poses[others]).min() < APART_MM:
        return False
    proposals = _proposals(problem.space, legs_and_arms(), poses)
    for other in others:
        way = problem.space.towards(proposals[k], proposals[other])
        between = problem.evaluate(problem.space.wrap(proposals[k] + STEPS[:, None] * way))
        if between.max() < max(costs[k], costs[other]) + HILL:
            return False
    return True


def _proposals(space: SearchSpace, prior: LegsAndArms, poses: Array) -> NDArray[np.float64]:
    return space.proposals(np.column_stack([poses[:, :3], prior.transform(poses[:, 3:])]))
