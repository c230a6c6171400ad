"""Numbered instances: a person of the library, a pose, cameras, and their silhouettes.

A number is the same person, pose and view in every dimension of a function, as far as its box holds the pose; only the
ambiguous one draws until a pose's mirror image is near enough. Instances below 10,000 are of seven people, the others
of three who are in no training data.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Start
from posefit.fitting.problem import PoseProblem
from posefit.fitting.space import SearchSpace
from posefit.geometry.body import Body, varied
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import Skeleton
from posefit.geometry.symmetry import facing, reflected_poses
from posefit.motion import recorded
from posefit.silhouette.corruption import corrupted
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit.suites.boxes import (
    HELD_OUT_PEOPLE,
    TRAINING_PEOPLE,
    AngleBox,
    ComponentBox,
    RotatedBox,
    SuiteBox,
    is_upright,
    learned_without,
)
from posefit.suites.functions import TRAINING

RNG_STREAM = 2026  # part of the seed of every instance
SIZE = (120, 160)  # pixels
PLACE = np.array([0.0, 0.9, 0.0])  # metres: where the root is, and cameras aim
NEAR = (3.5, np.radians(40.0))  # metres to a camera; radians it sees across the larger side
FAR = (40.0, 0.0637)  # as large in the picture, but depth does not show
ROOT_RANGE = np.radians([45.0, 20.0, 20.0])  # radians to either side: yaw, pitch, roll
YAW_OFF = np.radians(20.0)  # from the box's middle to the true yaw, at most
STEP = 3  # frames, at 30 a second, from one pose of a track to the next
SPREAD = 0.02  # of a start, beside how far the last two poses are apart: in half-sides of the box
MISMATCH_PERCENT = 8.0
DAMAGES, STRENGTHS = ("blobs", "holes", "occluder", "shadow"), (0.3, 0.6)  # two of these; how strong each is
ANCHOR_OFF = 0.3  # metres along each axis that the anchor of an alignment is off
DECOY_COST, APART_MM, ATTEMPTS = 4.0, 60.0, 20  # of an ambiguous instance: see `_ambiguous`
DIGITS = 4  # of a truth in the box, so that every machine has the same one


@dataclass(frozen=True, eq=False)
class SuiteInstance:
    """The person, the silhouettes and the box of a problem."""

    function: int
    number: int
    subject: str
    posed: PoseProblem = field(repr=False)
    box: SuiteBox = field(repr=False)
    truth: Array = field(repr=False)  # (d,) the proposal of the true pose, for tests: a search that reads it cheats
    truth_cost: float  # of that proposal; 0 where the function is exact
    decoy: Array | None = field(default=None, repr=False)  # (d,) of function 6, the mirrored pose

    def repaired(self, proposals: Array) -> Array:
        """Return proposals (n, d), those that are not feasible moved: into the box, then towards its middle."""
        space = self.posed.space
        allowed = space.feasible(proposals)
        inside = np.clip(proposals, -1.0, 1.0)
        latents = space.centre[3:] + space.half[3:] * inside[:, 3:]
        inside[:, 3:] = np.clip((self.box.within_reach(latents) - space.centre[3:]) / space.half[3:], -1.0, 1.0)
        return np.where(allowed[:, None], proposals, inside)


@lru_cache(maxsize=256)
def suite_instance(function: int, number: int, dimension: int) -> SuiteInstance:
    """Return an instance; the same for the same numbers everywhere, which `checked_address` has checked."""
    rng = np.random.default_rng([RNG_STREAM, function, number])
    people = TRAINING_PEOPLE if number in TRAINING else HELD_OUT_PEOPLE
    subject = people[int(rng.integers(len(people)))]
    learned, count = learned_without(subject), dimension - 3  # the root has three
    box: SuiteBox
    if function == 7:
        box = AngleBox(learned, count)
    elif function == 9:
        box = RotatedBox(learned, count, np.random.default_rng([RNG_STREAM, function, number, dimension]))
    else:
        box = ComponentBox(learned, count)
    return _MAKERS[function](_Draft(function, number, subject, box, rng))


@dataclass(frozen=True, eq=False)
class _Draft:
    """An instance that is being made: its person, its box and its random numbers."""

    function: int
    number: int
    subject: str
    box: SuiteBox
    rng: np.random.Generator

    def poses(self, count: int = 1) -> Array:
        """Return poses (count, 66) of the person, `STEP` frames apart."""
        clips = recorded.clips([self.subject])
        last = np.zeros(66)
        while True:
            clip = clips[int(self.rng.integers(len(clips)))]
            first = int(self.rng.integers(max(int(clip.times[-1]) + 1 - STEP * (count - 1), 1)))
            poses = wrapped(clip.at(first + STEP * np.arange(count, dtype=np.int64))[0])
            last = poses[-1]
            if is_upright(last) and np.abs(np.diff(poses, axis=0)).max(initial=0.0) < 1.0:
                return np.asarray(poses)

    def space(self, yaw: float) -> SearchSpace:
        """Return the box around a yaw in radians."""
        return SearchSpace(self.box, np.array([yaw, 0.0, 0.0]), ROOT_RANGE, PLACE)

    def nearest(self, space: SearchSpace, poses: Array) -> Array:
        """Return the proposals (n, d) nearest to poses (n, 66), feasible, of few digits."""
        latents = self.box.within_reach(self.box.transform(poses[:, 3:]))
        proposals = np.round(space.proposals(np.column_stack([poses[:, :3], latents])), DIGITS)
        bad = ~space.feasible(proposals)
        proposals[bad] = np.round(0.999 * proposals[bad], DIGITS)  # rounding moved it out of the ellipsoid
        return np.asarray(proposals)

    @cached_property
    def body(self) -> Body:
        """The person's true body."""
        return _body(recorded.clips([self.subject])[0].skeleton)

    def camera(self, azimuth: float, away: tuple[float, float] = NEAR) -> Camera:
        return Camera.around(PLACE, azimuth, away[0], SIZE, away[1])

    def silhouette(self, camera: Camera, pose: Array) -> Silhouette:
        return Silhouette.of(project(self.body, camera, pose, PLACE))

    def made(self, problem: PoseProblem, truth: Array, decoy: Array | None = None) -> SuiteInstance:
        cost = float(problem.evaluate(truth[None])[0])
        truth = truth.copy()
        truth.setflags(write=False)
        return SuiteInstance(self.function, self.number, self.subject, problem, self.box, truth, cost, decoy)


@lru_cache(maxsize=16)
def _body(skeleton: Skeleton) -> Body:
    return Body.of(skeleton)


def _single(draft: _Draft, views: int = 1) -> SuiteInstance:
    """Return a pose of the box, seen from anywhere by one camera or more at right angles."""
    pose, rng = draft.poses()[0], draft.rng
    space = draft.space(pose[0] + YAW_OFF * rng.uniform(-1.0, 1.0))
    azimuth = rng.uniform(-np.pi, np.pi)
    pose = _still(draft, pose)
    truth = draft.nearest(space, pose[None])[0]
    cameras = [draft.camera(azimuth + 0.5 * np.pi * k) for k in range(views)]
    pose = space.decode(truth[None])[0][0]
    silhouettes = [draft.silhouette(camera, pose) for camera in cameras]
    return draft.made(PoseProblem(draft.body, cameras, silhouettes, space), truth)


def _still(draft: _Draft, pose: Array) -> Array:
    """Return a pose (66,) with random values of the angles that are constant in the data, off the box's middle."""
    offs = draft.rng.uniform(-0.5, 0.5, 66)
    if isinstance(draft.box, ComponentBox):
        return pose
    moved = pose.copy()
    still = 3 + draft.box.angles[np.abs(draft.box.reach - np.radians(10.0)) < 1e-3]
    moved[still] += np.radians(10.0) * offs[still]
    return moved


def _next_frame(draft: _Draft) -> SuiteInstance:
    """Return the third of three poses of a track, as the box holds them, with a start where the first two lead."""
    poses, rng = draft.poses(3), draft.rng
    space = draft.space(float(poses[1, 0]) + 0.25 * YAW_OFF * rng.uniform(-1.0, 1.0))
    camera = draft.camera(rng.uniform(-np.pi, np.pi))
    before, last, truth = draft.nearest(space, poses)
    step, pose = last - before, space.decode(truth[None])[0][0]
    mean = draft.nearest(space, space.decode(np.clip(last + step, -1.0, 1.0)[None])[0])[0]
    space = replace(space, start=Start(mean, np.abs(step) + SPREAD, step))
    return draft.made(PoseProblem(draft.body, [camera], [draft.silhouette(camera, pose)], space), truth)


def _corrupted(draft: _Draft) -> SuiteInstance:
    made, rng = _single(draft), draft.rng
    kinds = rng.choice(len(DAMAGES), 2, replace=False)
    noise = {DAMAGES[k]: float(rng.uniform(*STRENGTHS)) for k in kinds}
    spoilt = corrupted(made.posed.silhouettes[0].mask, noise, rng)
    return draft.made(replace(made.posed, silhouettes=[Silhouette.of(spoilt)]), made.truth)


def _mismatched(draft: _Draft) -> SuiteInstance:
    made = _single(draft)
    return draft.made(replace(made.posed, body=varied(made.posed.body, MISMATCH_PERCENT, draft.rng)), made.truth)


def _ambiguous(draft: _Draft) -> SuiteInstance:
    """Return a pose of the box whose mirror image, `APART_MM` away, costs `DECOY_COST` or less.

    Where no draw has one, it is the draw whose mirror image costs the least.
    """
    best, least = None, np.inf
    for _ in range(ATTEMPTS):
        pose, body, rng = draft.poses()[0], draft.body, draft.rng
        space = draft.space(pose[0] + 0.5 * YAW_OFF * rng.uniform(-1.0, 1.0))
        side = rng.choice([-1.0, 1.0]) * 0.5 * np.pi + np.radians(10.0) * rng.uniform(-1.0, 1.0)
        camera = draft.camera(pose[0] + side, FAR)
        truth = draft.nearest(space, pose[None])
        true_pose = space.decode(truth)[0]
        problem = PoseProblem(body, [camera], [draft.silhouette(camera, true_pose[0])], space)
        decoy = draft.nearest(space, wrapped(reflected_poses(body.skeleton, true_pose, facing(camera, PLACE))))
        joints = body.skeleton.joints(np.concatenate([true_pose, space.decode(decoy)[0]]), np.zeros((2, 3)))
        cost = float(problem.evaluate(decoy)[0])
        apart = 1e3 * float(np.linalg.norm(joints[0] - joints[1], axis=-1).mean()) >= APART_MM
        if best is None or cost + 100.0 * (not apart) < least:
            best, least = (problem, truth[0], decoy[0]), cost + 100.0 * (not apart)
        if least <= DECOY_COST:
            break
    assert best is not None
    return draft.made(*best)


def _aligned(draft: _Draft) -> SuiteInstance:
    """Return a pose of the box whose place is taken from the silhouette's borders."""
    made = _single(draft)
    anchor = PLACE + ANCHOR_OFF * draft.rng.uniform(-1.0, 1.0, 3)
    return draft.made(
        replace(made.posed, space=replace(made.posed.space, anchor=anchor, translation="aligned")), made.truth
    )


_MAKERS: dict[int, Callable[[_Draft], SuiteInstance]] = {
    1: _single,
    2: _next_frame,
    3: partial(_single, views=2),
    4: _corrupted,
    5: _mismatched,
    6: _ambiguous,
    7: _single,
    8: _aligned,
    9: _single,
}
