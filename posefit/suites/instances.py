"""The instances of a suite's functions: a person, a pose, cameras and silhouettes.

An instance's number means the same person, pose and view in every dimension of a
function, as far as its box contains the pose; see `posefit.motion.instances`. The
people come from the library: seven in training instances, and three others, who are in
no training data, in the rest.
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
PLACE = np.array([0.0, 0.9, 0.0])  # metres; the place of the root, where cameras aim
CAMERA_DISTANCE = 3.5  # metres from a camera to the place
FIELD = np.radians(40.0)  # field of view across the larger side
ROOT_RANGE = np.radians([45.0, 20.0, 20.0])  # to either side: yaw, pitch, roll
YAW_OFF = np.radians(20.0)  # the largest distance of the true yaw from the box's middle
STEP = 6  # frames, at 30 per second, from one pose of a track to the next
# Half-sides of the box that are added to a start's spread, which is otherwise the
# distance of the last two poses.
SPREAD = 0.05
# Kinds of damage to each silhouette of a noisy instance, and their greatest strength.
DAMAGES = ("blobs", "holes")
STRENGTH = 0.6
POOL = 32  # damaged silhouettes of a noisy instance
# The order of the damaged silhouettes, which repeats. Its length is a prime.
ORDER = generator("suite").integers(POOL, size=10_007)
ANCHOR_OFF = 0.3  # metres; the largest error of an alignment's anchor along each axis
DIGITS = 4  # digits of a true proposal, which is then the same on every machine


@dataclass(frozen=True, eq=False)
class SuiteInstance:
    """The person, the silhouettes and the box of a problem.

    Attributes:
        function: The function's number.
        number: The instance's number.
        subject: The person in the library.
        frames: The cost of each frame. There is one frame, or several in a sequence,
            all with the same box.
        box: The box of joint angles.
        truth: The proposal of the true pose (d,), for tests. A search that reads it
            cheats.
        truth_cost: The cost of that proposal, 0 if the function is exact.
        noisy: Of function 4, a cost with each damaged silhouette.
    """

    function: int
    number: int
    subject: str
    frames: Sequence[SilhouetteCost] = field(repr=False)
    box: SuiteBox = field(repr=False)
    truth: Array = field(repr=False)
    truth_cost: float
    noisy: Sequence[SilhouetteCost] = field(default=(), repr=False)

    @property
    def space(self) -> SearchSpace:
        """The search space of optimisers."""
        return self.frames[0].space

    def evaluate(self, proposals: Array) -> Array:
        """Return the costs (n,) of feasible proposals (n, d) without noise.

        A cost is the mean over the frames.
        """
        costs = [frame(proposals) for frame in self.frames]
        return np.asarray(np.mean(costs, axis=0))

    def evaluate_noisy(self, proposals: Array, first: int) -> Array:
        """Return the costs (n,) of feasible proposals (n, d) with noise.

        `first` is the number of earlier evaluations, on which the noise depends.
        """
        costs = np.empty(len(proposals))
        drawn = ORDER[(first + np.arange(len(proposals))) % len(ORDER)]
        for k in np.unique(drawn):
            costs[drawn == k] = self.noisy[k](proposals[drawn == k])
        return costs

    def repaired(self, proposals: Array) -> Array:
        """Return feasible proposals (n, d).

        Infeasible ones are moved into the box, and then towards its middle.
        """
        space = self.space
        allowed = space.feasible(proposals)
        inside = np.clip(proposals, -1.0, 1.0)
        if isinstance(self.box, ComponentBox):
            # the first three coordinates are the root's
            centre = space.centre[3:]
            half = space.half[3:]
            latents = self.box.within_reach(centre + half * inside[:, 3:])
            inside[:, 3:] = np.clip((latents - centre) / half, -1.0, 1.0)
        return np.where(allowed[:, None], proposals, inside)


@lru_cache(maxsize=256)
def suite_instance(function: int, number: int, dimension: int) -> SuiteInstance:
    """Return an instance, which is the same for the same numbers everywhere.

    The numbers must have been checked by `checked_address`.
    """
    rng = generator("suite", function, number)
    people = TRAINING_PEOPLE if number in TRAINING else HELD_OUT_PEOPLE
    subject = people[int(rng.integers(len(people)))]
    learned = learned_without(subject)
    count = dimension - 3  # the root has three coordinates
    box: SuiteBox
    if function == 5:
        box = SequenceBox(learned, count)
    elif function == 7:
        box = AngleBox(learned, count)
    elif function == 9:
        rotation_rng = generator("suite", function, number, dimension)
        box = AngleBox(learned, count, rotation_rng)
    else:
        box = ComponentBox(learned, count, mixed=function == 6)
    return _MAKERS[function](_Draft(function, number, subject, box, rng))


@dataclass(frozen=True, eq=False)
class _Draft:
    """The person, the box and the random numbers from which an instance is made."""

    function: int
    number: int
    subject: str
    box: SuiteBox
    rng: np.random.Generator

    def poses(self, count: int = 1) -> Array:
        """Return poses (count, 66) of the person, `STEP` frames apart."""
        clips = recorded.clips([self.subject])
        while True:
            clip = clips[int(self.rng.integers(len(clips)))]
            starts = max(int(clip.times[-1]) + 1 - STEP * (count - 1), 1)
            first = int(self.rng.integers(starts))
            frames = first + STEP * np.arange(count, dtype=np.int64)
            poses = wrapped(clip.at(frames)[0])
            # reject poses that jump, as when an angle passes half a turn
            largest_change = np.abs(np.diff(poses, axis=0)).max(initial=0.0)
            if is_upright(poses[-1]) and largest_change < 1.0:
                return np.asarray(poses)

    def space(self, yaw: float) -> SearchSpace:
        """Return the search space around a yaw in radians."""
        return SearchSpace(self.box, np.array([yaw, 0.0, 0.0]), ROOT_RANGE, PLACE)

    def nearest(self, space: SearchSpace, poses: Array) -> Array:
        """Return the feasible proposals (n, d) nearest to poses (n, 66), rounded.

        For a sequence there is one proposal of all its poses.
        """
        latents = self.box.transform(poses[:, 3:])
        if isinstance(self.box, ComponentBox):
            latents = self.box.within_reach(latents)
        coordinates = np.column_stack([poses[: len(latents), :3], latents])
        proposals = np.round(space.proposals(coordinates), DIGITS)
        # rounding may move a proposal out of the ellipsoid
        bad = ~space.feasible(proposals)
        proposals[bad] = np.round(0.999 * proposals[bad], DIGITS)
        return np.asarray(proposals)

    @cached_property
    def body(self) -> Body:
        """The person's true body."""
        return _body(recorded.clips([self.subject])[0].skeleton)

    def camera(self, azimuth: float) -> Camera:
        """Return a camera at an azimuth in radians."""
        return Camera.around(PLACE, azimuth, CAMERA_DISTANCE, SIZE, FIELD)

    def silhouette(self, camera: Camera, pose: Array) -> Silhouette:
        """Return the silhouette of the true body in a pose (66,)."""
        return Silhouette.of(project(self.body, camera, pose, PLACE))

    def made(self, truth: Array, *frames: SilhouetteCost) -> SuiteInstance:
        """Return the instance with a true proposal (d,) and the cost of each frame."""
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
    """Return an instance of one pose, seen from a random direction.

    More cameras are at right angles to each other.
    """
    pose = draft.poses()[0]
    rng = draft.rng
    space = draft.space(pose[0] + YAW_OFF * rng.uniform(-1.0, 1.0))
    azimuth = rng.uniform(-np.pi, np.pi)
    pose = _still(draft, pose)
    truth = draft.nearest(space, pose[None])[0]
    pose = space.decode(truth[None])[0][0]
    cameras = []
    silhouettes = []
    for k in range(views):
        camera = draft.camera(azimuth + 0.5 * np.pi * k)
        cameras.append(camera)
        silhouettes.append(draft.silhouette(camera, pose))
    return draft.made(truth, SilhouetteCost(draft.body, cameras, silhouettes, space))


def _still(draft: _Draft, pose: Array) -> Array:
    """Return a pose (66,) with random values of angles that are constant in the data.

    The truth would otherwise be in the middle of the box along these angles.
    """
    moved = pose.copy()
    offsets = draft.rng.uniform(-0.5, 0.5, 66)
    if isinstance(draft.box, AngleBox):
        constant = 3 + draft.box.constant
        moved[constant] += CONSTANT * offsets[constant]
    return moved


def _next_frame(draft: _Draft) -> SuiteInstance:
    """Return an instance of the third of three poses of a track.

    Its start is the prediction from the first two.
    """
    poses = draft.poses(3)
    rng = draft.rng
    space = draft.space(float(poses[1, 0]) + 0.25 * YAW_OFF * rng.uniform(-1.0, 1.0))
    camera = draft.camera(rng.uniform(-np.pi, np.pi))
    before, last, truth = draft.nearest(space, poses)
    step = last - before
    pose = space.decode(truth[None])[0][0]
    predicted = np.clip(last + step, -1.0, 1.0)
    mean = draft.nearest(space, space.decode(predicted[None])[0])[0]
    space = replace(space, start=Start(mean, np.abs(step) + SPREAD, step))
    silhouette = draft.silhouette(camera, pose)
    cost = SilhouetteCost(draft.body, [camera], [silhouette], space)
    return draft.made(truth, cost)


def _noisy(draft: _Draft) -> SuiteInstance:
    """Return an instance with a differently damaged silhouette at each evaluation."""
    made = _single(draft)
    rng = draft.rng
    mask = made.frames[0].silhouettes[0].mask
    noisy = []
    for _ in range(POOL):
        strengths = rng.uniform(0.0, STRENGTH, len(DAMAGES))
        damaged = corrupted(
            mask,
            dict(zip(DAMAGES, strengths, strict=True)),
            rng,
            # the instances of a published suite must not change
            visibly=False,
        )
        noisy.append(replace(made.frames[0], silhouettes=[Silhouette.of(damaged)]))
    return replace(made, noisy=noisy)


def _sequence(draft: _Draft) -> SuiteInstance:
    """Return an instance of `FRAMES` poses of a motion, seen by one camera.

    The root has the same direction in all of them.
    """
    poses = draft.poses(FRAMES)
    rng = draft.rng
    box = draft.box
    assert isinstance(box, SequenceBox)
    space = draft.space(float(poses[0, 0]) + YAW_OFF * rng.uniform(-1.0, 1.0))
    camera = draft.camera(rng.uniform(-np.pi, np.pi))
    truth = draft.nearest(space, poses)
    costs = []
    for prior in box.frames:
        frame_space = replace(space, prior=prior)
        silhouette = draft.silhouette(camera, frame_space.decode(truth)[0][0])
        cost = SilhouetteCost(draft.body, [camera], [silhouette], frame_space)
        costs.append(cost)
    return draft.made(truth[0], *costs)


def _aligned(draft: _Draft) -> SuiteInstance:
    """Return an instance whose place is estimated from the silhouette's borders."""
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
