"""The instances of a suite's functions: a person of the library, a pose, cameras, and their silhouettes.

A number is the same person, pose and view in every dimension of a function, as far as its box holds the pose; see
`posefit.motion.instances`. Training instances are of seven people, the others of three who are in no training data.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Start
from posefit.fitting.cost import SilhouetteCost
from posefit.fitting.space import SearchSpace
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import Skeleton
from posefit.motion import recorded
from posefit.motion.instances import TRAINING, generator
from posefit.silhouette.corruption import corrupted
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit.suites.boxes import (
    CONSTANT,
    FRAMES,
    HELD_OUT_PEOPLE,
    TRAINING_PEOPLE,
    AngleBox,
    ComponentBox,
    SequenceBox,
    SuiteBox,
    is_upright,
    learned_without,
)

SIZE = (120, 160)  # pixels
PLACE = np.array([0.0, 0.9, 0.0])  # metres: where the root is, and cameras aim
# metres to a camera; radians it sees across the larger side
AWAY = 3.5
FIELD = np.radians(40.0)
ROOT_RANGE = np.radians([45.0, 20.0, 20.0])  # radians to either side: yaw, pitch, roll
YAW_OFF = np.radians(20.0)  # from the box's middle to the true yaw, at most
STEP = 6  # frames, at 30 a second, from one pose of a track to the next
# of a start, beside how far the last two poses are apart: in half-sides of the box
SPREAD = 0.05
# of each silhouette of a noisy instance; how strong they are at most
DAMAGES = ("blobs", "holes")
STRENGTH = 0.6
POOL = 32  # how many of these an instance has
# they come in, again and again; a prime
ORDER = generator("suite").integers(POOL, size=10_007)
ANCHOR_OFF = 0.3  # metres along each axis that the anchor of an alignment is off
DIGITS = 4  # of a truth in the box, so that every machine has the same one


@dataclass(frozen=True, eq=False)
class SuiteInstance:
    """The person, the silhouettes and the box of a problem."""

    function: int
    number: int
    subject: str
    # one, or those of a sequence: they have a box in common
    frames: Sequence[SilhouetteCost] = field(repr=False)
    box: SuiteBox = field(repr=False)
    # (d,) the proposal of the true pose, for tests: a search that reads it cheats
    truth: Array = field(repr=False)
    truth_cost: float  # of that proposal; 0 where the function is exact
    # of function 4: each with a damaged silhouette
    noisy: Sequence[SilhouetteCost] = field(default=(), repr=False)

    @property
    def space(self) -> SearchSpace:
        """The box, as optimisers take it."""
        return self.frames[0].space

    def evaluate(self, proposals: Array) -> Array:
        """Return the costs (n,) of feasible proposals (n, d) without noise: the means over the frames."""
        costs = [frame(proposals) for frame in self.frames]
        return np.asarray(np.mean(costs, axis=0))

    def evaluate_noisy(self, proposals: Array, first: int) -> Array:
        """Return the costs (n,) of feasible proposals (n, d) with noise: the evaluations from number `first` on."""
        costs = np.empty(len(proposals))
        drawn = ORDER[(first + np.arange(len(proposals))) % len(ORDER)]
        for k in np.unique(drawn):
            costs[drawn == k] = self.noisy[k](proposals[drawn == k])
        return costs

    def repaired(self, proposals: Array) -> Array:
        """Return proposals (n, d), those that are not feasible moved: into the box, then towards its middle."""
        space = self.space
        allowed = space.feasible(proposals)
        inside = np.clip(proposals, -1.0, 1.0)
        if isinstance(self.box, ComponentBox):
            latents = space.centre[3:] + space.half[3:] * inside[:, 3:]
            inside[:, 3:] = np.clip(
                (self.box.within_reach(latents) - space.centre[3:]) / space.half[3:],
                -1.0,
                1.0,
            )
        return np.where(allowed[:, None], proposals, inside)


@lru_cache(maxsize=256)
def suite_instance(function: int, number: int, dimension: int) -> SuiteInstance:
    """Return an instance; the same for the same numbers everywhere, which `checked_address` has checked."""
    rng = generator("suite", function, number)
    people = TRAINING_PEOPLE if number in TRAINING else HELD_OUT_PEOPLE
    subject = people[int(rng.integers(len(people)))]
    # the root has three
    learned = learned_without(subject)
    count = dimension - 3
    box: SuiteBox
    if function == 5:
        box = SequenceBox(learned, count)
    elif function in (7, 9):
        rotated = (
            generator("suite", function, number, dimension) if function == 9 else None
        )
        box = AngleBox(learned, count, rotated)
    else:
        box = ComponentBox(learned, count, mixed=function == 6)
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
            first = int(
                self.rng.integers(max(int(clip.times[-1]) + 1 - STEP * (count - 1), 1))
            )
            poses = wrapped(clip.at(first + STEP * np.arange(count, dtype=np.int64))[0])
            last = poses[-1]
            if (
                is_upright(last)
                and np.abs(np.diff(poses, axis=0)).max(initial=0.0) < 1.0
            ):
                return np.asarray(poses)

    def space(self, yaw: float) -> SearchSpace:
        """Return the box around a yaw in radians."""
        return SearchSpace(self.box, np.array([yaw, 0.0, 0.0]), ROOT_RANGE, PLACE)

    def nearest(self, space: SearchSpace, poses: Array) -> Array:
        """Return the proposals (n, d) nearest to poses (n, 66), feasible, of few digits; of a sequence it is one."""
        latents = self.box.transform(poses[:, 3:])
        if isinstance(self.box, ComponentBox):
            latents = self.box.within_reach(latents)
        proposals = np.round(
            space.proposals(np.column_stack([poses[: len(latents), :3], latents])),
            DIGITS,
        )
        bad = ~space.feasible(proposals)
        # rounding moved it out of the ellipsoid
        proposals[bad] = np.round(0.999 * proposals[bad], DIGITS)
        return np.asarray(proposals)

    @cached_property
    def body(self) -> Body:
        """The person's true body."""
        return _body(recorded.clips([self.subject])[0].skeleton)

    def camera(self, azimuth: float) -> Camera:
        return Camera.around(PLACE, azimuth, AWAY, SIZE, FIELD)

    def silhouette(self, camera: Camera, pose: Array) -> Silhouette:
        return Silhouette.of(project(self.body, camera, pose, PLACE))

    def made(self, truth: Array, *frames: SilhouetteCost) -> SuiteInstance:
        truth = truth.copy()
        truth.setflags(write=False)
        made = SuiteInstance(
            self.function, self.number, self.subject, frames, self.box, truth, 0.0
        )
        return replace(made, truth_cost=float(made.evaluate(truth[None])[0]))


@lru_cache(maxsize=16)
def _body(skeleton: Skeleton) -> Body:
    return Body.of(skeleton)


def _single(draft: _Draft, views: int = 1) -> SuiteInstance:
    """Return a pose of the box, seen from anywhere by one camera or more at right angles."""
    pose = draft.poses()[0]
    rng = draft.rng
    space = draft.space(pose[0] + YAW_OFF * rng.uniform(-1.0, 1.0))
    azimuth = rng.uniform(-np.pi, np.pi)
    pose = _still(draft, pose)
    truth = draft.nearest(space, pose[None])[0]
    cameras = [draft.camera(azimuth + 0.5 * np.pi * k) for k in range(views)]
    pose = space.decode(truth[None])[0][0]
    silhouettes = [draft.silhouette(camera, pose) for camera in cameras]
    return draft.made(truth, SilhouetteCost(draft.body, cameras, silhouettes, space))


def _still(draft: _Draft, pose: Array) -> Array:
    """Return a pose (66,) with random values of the angles that are constant in the data, off the box's middle."""
    moved = pose.copy()
    offs = draft.rng.uniform(-0.5, 0.5, 66)
    if isinstance(draft.box, AngleBox):
        moved[3 + draft.box.constant] += CONSTANT * offs[3 + draft.box.constant]
    return moved


def _next_frame(draft: _Draft) -> SuiteInstance:
    """Return the third of three poses of a track, as the box holds them, with a start where the first two lead."""
    poses = draft.poses(3)
    rng = draft.rng
    space = draft.space(float(poses[1, 0]) + 0.25 * YAW_OFF * rng.uniform(-1.0, 1.0))
    camera = draft.camera(rng.uniform(-np.pi, np.pi))
    before, last, truth = draft.nearest(space, poses)
    step = last - before
    pose = space.decode(truth[None])[0][0]
    mean = draft.nearest(space, space.decode(np.clip(last + step, -1.0, 1.0)[None])[0])[
        0
    ]
    space = replace(space, start=Start(mean, np.abs(step) + SPREAD, step))
    return draft.made(
        truth,
        SilhouetteCost(draft.body, [camera], [draft.silhouette(camera, pose)], space),
    )


def _noisy(draft: _Draft) -> SuiteInstance:
    """Return a pose of the box whose silhouette is damaged again at each evaluation."""
    made = _single(draft)
    rng = draft.rng
    mask = made.frames[0].silhouettes[0].mask
    noisy = []
    for _ in range(POOL):
        damaged = corrupted(
            mask,
            dict(zip(DAMAGES, rng.uniform(0.0, STRENGTH, len(DAMAGES)), strict=True)),
            rng,
            # the instances of a published suite stay as they are
            shows=False,
        )
        noisy.append(replace(made.frames[0], silhouettes=[Silhouette.of(damaged)]))
    return replace(made, noisy=noisy)


def _sequence(draft: _Draft) -> SuiteInstance:
    """Return `FRAMES` poses of a motion as the box holds them, before one camera; the root turns in none of them."""
    poses = draft.poses(FRAMES)
    rng = draft.rng
    box = draft.box
    assert isinstance(box, SequenceBox)
    space = draft.space(float(poses[0, 0]) + YAW_OFF * rng.uniform(-1.0, 1.0))
    camera = draft.camera(rng.uniform(-np.pi, np.pi))
    truth = draft.nearest(space, poses)
    spaces = [replace(space, prior=frame) for frame in box.frames]
    silhouettes = [
        draft.silhouette(camera, frame.decode(truth)[0][0]) for frame in spaces
    ]
    costs = [
        SilhouetteCost(draft.body, [camera], [silhouette], frame)
        for silhouette, frame in zip(silhouettes, spaces, strict=True)
    ]
    return draft.made(truth[0], *costs)


def _aligned(draft: _Draft) -> SuiteInstance:
    """Return a pose of the box whose place is taken from the silhouette's borders."""
    made = _single(draft)
    anchor = PLACE + ANCHOR_OFF * draft.rng.uniform(-1.0, 1.0, 3)
    space = replace(made.space, anchor=anchor, translation="aligned")
    return draft.made(made.truth, replace(made.frames[0], space=space))


_MAKERS: dict[int, Callable[[_Draft], SuiteInstance]] = {
    1: _single,
    2: _next_frame,
    3: partial(_single, views=2),
    4: _noisy,
    5: _sequence,
    6: _single,
    7: _single,
    8: _aligned,
    9: _single,
}
