"""The poses of recorded clips, how each continues, and codes that compare poses."""

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import is_
from typing import NamedTuple, Self

import numpy as np

from posefit.arrays import Array
from posefit.arrays.compiling import state_of
from posefit.arrays.stored import Arrays, stored
from posefit.errors import InputError
from posefit.fitting.tracker import Task
from posefit.geometry import symmetry
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import ANGLES, JOINTS, Skeleton
from posefit.motion.built_in import average_skeleton
from posefit.motion.motion import Motion
from posefit_exemplars import kernels
from posefit_exemplars.kernels import Codes, Rows

# Metres: the least distance between successive states of a clip, except to its last
# frame, and between the centres of two groups.
MIN_FRAME_DISTANCE = 0.02
# Radians: directions that differ by less count as similar.
SAME_TURN = np.radians(15.0)
YAWS = round(math.tau / SAME_TURN)  # different yaws in a full turn
GROUPS = 1000  # groups of similar poses, at most
NEAR_GROUPS = 4  # groups that a search for the nearest poses looks into


class Coding(NamedTuple):
    """The principal components of the joints of bodies turned to yaw 0."""

    skeleton: Skeleton
    mean: Array  # (81,) metres
    axes: Array  # (81, D)

    @classmethod
    def of(cls, skeleton: Skeleton, clips: Iterable[Codes]) -> Self:
        """Return the components of the `facing_joints` (K, 81) of each of the clips."""
        count = 0
        total = np.zeros(3 * len(JOINTS))
        squares = np.zeros((3 * len(JOINTS), 3 * len(JOINTS)))
        for clip in clips:
            joints = clip.astype(np.float64)
            count = count + len(joints)
            total = total + joints.sum(axis=0)
            squares = squares + joints.T @ joints
        mean = total / count
        _, axes = np.linalg.eigh(squares - count * np.outer(mean, mean))
        # eigh sorts eigenvalues in ascending order: the last axes come first here
        principal = axes[:, : -kernels.DIMENSIONS - 1 : -1]  # (81, D)
        return cls(skeleton, mean, principal / np.sqrt(len(JOINTS)))

    def of_joints(self, joints: Codes) -> Codes:
        """Return the codes (K, D) of `facing_joints` (K, 81)."""
        return np.asarray((joints - self.mean) @ self.axes, dtype=np.float32)

    def of_poses(self, poses: Array) -> Codes:
        """Return the codes (K, D) of poses (K, 66)."""
        return self.of_joints(facing_joints(self.skeleton, poses))


def facing_joints(skeleton: Skeleton, poses: Array) -> Codes:
    """Return the joints (K, 81), in metres, of poses (K, 66) turned to yaw 0."""
    facing = poses.copy()
    facing[:, 0] = 0.0
    return skeleton.joints(facing).reshape(len(poses), -1).astype(np.float32)


def farthest_first(codes: Codes, max_groups: int) -> tuple[Rows, Rows]:
    """Return the centres (G,) of groups of similar poses, and each pose's group (K,).

    Each new centre is the pose farthest from all centres so far: farthest-first
    traversal (Gonzalez, Clustering to minimize the maximum intercluster distance,
    1985). A pose belongs to the group of the nearest centre.
    """
    lengths = (codes**2).sum(axis=1)
    nearest = np.full(len(codes), np.inf, dtype=np.float32)
    groups = np.zeros(len(codes), dtype=np.int64)
    centres = [0]
    while True:
        squares = lengths - 2.0 * (codes @ codes[centres[-1]]) + lengths[centres[-1]]
        nearer = squares < nearest
        nearest[nearer] = squares[nearer]
        groups[nearer] = len(centres) - 1
        farthest = int(nearest.argmax())
        if len(centres) == max_groups or nearest[farthest] <= MIN_FRAME_DISTANCE**2:
            return np.array(centres), groups
        centres.append(farthest)  # TOYAMA2001 (exemplars)


class Tiles(NamedTuple):
    """The codes of states in groups, `LANES` side by side.

    The last tile of a group is filled up with codes that are infinitely far away.
    """

    codes: Codes  # (T, D, LANES)
    states: Rows  # (T LANES,) the state of each slot: a lane of a tile
    starts: Rows  # (G + 1,) the first tile of each group

    @classmethod
    def of(cls, codes: Codes, members: Rows, starts: Rows) -> Self:
        """Return tiles of `members` (K,), in groups that begin at `starts` (G + 1,)."""
        sizes = np.diff(starts)
        lanes = kernels.LANES
        tiles = np.append(0, np.cumsum(-(-sizes // lanes)))
        # a group begins with a new tile, so that its members move up by the lanes that
        # the groups before it leave empty
        moved = np.repeat(lanes * tiles[:-1] - starts[:-1], sizes)
        slots = np.arange(len(members)) + moved
        states = np.zeros(lanes * tiles[-1], np.int64)
        filled = np.full((len(states), codes.shape[1]), np.inf, codes.dtype)
        states[slots] = members
        filled[slots] = codes[members]
        by_tile = filled.reshape(-1, lanes, codes.shape[1])  # (T, LANES, D)
        lanes_last = np.ascontiguousarray(by_tile.transpose(0, 2, 1))
        return cls(lanes_last, states, tiles)


@dataclass(frozen=True, eq=False, repr=False)
class Exemplars:
    """The poses of clips, clip by clip, and all that is learned from them.

    The yaw of a state is free; its pitch and roll come from the clip.
    """

    angles: Codes  # (K, 66) radians: 32 bits, in half the memory, are exact to 1e-6
    codes: Codes  # (K, D) metres
    places: Array  # (K, 3) metres: the root in the clip
    times: Array  # (K,) seconds since the clip's first frame
    clips: Rows  # (K,) number of the clip
    last_states: Rows  # (clips,) the last pose of each clip
    centres: Rows  # (G,) the central pose of each group
    groups: Rows  # (K,) the group of each pose
    coarse_groups: Rows  # (K,) the group of each pose among a few large groups
    members: Rows  # (K,) all poses, group by group
    starts: Rows  # (G + 1,) where each group begins in `members`
    tiles: Tiles  # of the codes, group by group
    centre_tiles: Tiles  # of the centres' codes, as one group
    coding: Coding
    # of the motions learned from; empty if nothing is cached on disk
    digest: bytes = b""

    @classmethod
    def of(
        cls, motions: Sequence[Motion], skeleton: Skeleton, *, mirrored: bool = False
    ) -> Self:
        """Return the states of motions performed by a person with this skeleton.

        Args:
            motions: The motions to learn from.
            skeleton: The person's skeleton.
            mirrored: Whether the mirror images of the motions are learned too.
        """
        learned = learned_from(motions, skeleton, mirrored)
        return cls.assembled(motions, skeleton, learned)

    @classmethod
    def assembled(
        cls,
        motions: Sequence[Motion],
        skeleton: Skeleton,
        learned: Arrays,
        digest: bytes = b"",
    ) -> Self:
        """Return the states of motions, from the arrays of `learned_from`."""
        counts = learned["counts"]  # per clip; mirror images follow all motions
        ends = np.cumsum(counts)
        # filled clip by clip: a list of all clips would double the memory
        angles = np.empty((ends[-1], ANGLES), np.float32)
        places = np.empty((ends[-1], 3))
        times = np.empty(ends[-1])
        for number, rows in enumerate(np.split(learned["rows"], ends[:-1])):
            motion = motions[number % len(motions)]
            states = slice(ends[number] - len(rows), ends[number])
            poses = motion.poses[rows]
            roots = motion.translations[rows]
            if number >= len(motions):
                poses, roots = _mirrored(motion.skeleton, poses, roots)
            angles[states] = poses
            places[states] = roots
            times[states] = rows / motion.fps
        codes = learned["codes"]
        centres = learned["centres"]
        groups = learned["groups"].astype(np.int64)
        members = np.argsort(groups, kind="stable")
        starts = np.searchsorted(groups[members], np.arange(len(centres) + 1))
        return cls(
            angles=angles,
            codes=codes,
            places=places,
            times=times,
            clips=np.repeat(np.arange(len(ends)), counts),
            last_states=ends - 1,
            centres=centres,
            groups=groups,
            coarse_groups=learned["coarse_groups"].astype(np.int64),
            members=members,
            starts=starts,
            tiles=Tiles.of(codes, members, starts),
            centre_tiles=Tiles.of(codes, centres, np.array([0, len(centres)])),
            coding=Coding(skeleton, learned["mean"], learned["axes"]),
            digest=digest,
        )

    def __len__(self) -> int:
        return len(self.angles)

    @cached_property
    def coarse_count(self) -> int:
        """The number of large groups."""
        return int(self.coarse_groups.max()) + 1

    @cached_property
    def _line(self) -> tuple[float, Array]:
        """All clips one after the other on one line of time.

        Returns:
            The length of each clip's part of the line, and the positions (K,) of the
            poses on it. One search in these finds times within any clip.
        """
        length = 1.0 + float(self.times.max())
        return length, self.clips * length + self.times

    def continuation(self, states: Rows, seconds: float) -> tuple[Codes, Array, Array]:
        """Return the continuation of some states' clips, `seconds` later.

        Values between two poses are interpolated. After its end a clip has its last
        pose, and before its beginning, with negative seconds, its first pose.

        Args:
            states: (n,) the states that continue.
            seconds: The time that passes; negative for the time before a state.

        Returns:
            The codes (n, D), the turns (n,) in radians, and the displacements (n, 3) in
            metres of a body whose yaw was 0.
        """
        last = self.last_states[self.clips[states]]
        length, line = self._line
        times = np.clip(self.times[states] + seconds, 0.0, self.times[last])
        before = np.searchsorted(line, self.clips[states] * length + times, "right") - 1
        after = np.minimum(before + 1, last)
        # 1e-9 s avoids a division by 0 at the end of a clip, where both are one pose
        gap = np.maximum(self.times[after] - self.times[before], 1e-9)
        share = np.clip((times - self.times[before]) / gap, 0.0, 1.0)[:, None]

        def interpolated(values: Array | Codes) -> Array:
            return np.asarray((1.0 - share) * values[before] + share * values[after])

        yaws = interpolated(self.angles[:, :1])[:, 0]
        first_yaws = self.angles[states, 0].astype(np.float64)
        displacements = about_vertical(
            interpolated(self.places) - self.places[states], -first_yaws
        )
        return (
            interpolated(self.codes).astype(np.float32),
            yaws - first_yaws,
            displacements,
        )

    def draw(self, count: int, rng: np.random.Generator) -> Rows:
        """Return `count` states drawn at random.

        A group is drawn in proportion to the square root of its size, and a pose of it
        uniformly. With equal weights of poses nearly all would be standing poses; with
        equal weights of groups nearly all would be acrobatic.
        """
        sizes = np.diff(self.starts)
        ends = np.cumsum(np.sqrt(sizes))
        drawn = rng.uniform(0.0, ends[-1], count)
        group = np.minimum(np.searchsorted(ends, drawn, "right"), len(sizes) - 1)
        ranks = (rng.random(count) * sizes[group]).astype(np.int64)  # in their groups
        states: Rows = self.members[self.starts[group] + ranks]
        return states

    def nearest(self, poses: Array, count: int) -> tuple[Rows, Codes]:
        """Return the states nearest to poses, and their squared distances.

        Only the few groups near each pose are searched.

        Args:
            poses: (n, 66).
            count: How many states for each pose.

        Returns:
            The states (n, count), nearest first, and the squared distances (n, count),
            infinite if the groups have fewer states.
        """
        codes = self.coding.of_poses(poses)
        states, squares = kernels.nearest_codes(
            codes, self.near_groups(codes), self.tiles, count
        )
        return states, squares

    def near_groups(self, codes: Codes) -> Rows:
        """Return the few groups (n, g) with the centres nearest to codes (n, D)."""
        count = min(NEAR_GROUPS, len(self.centres))
        states: Rows = kernels.nearest_codes(
            codes, np.zeros((len(codes), 1), np.int64), self.centre_tiles, count
        )[0]
        return self.groups[states]

    def nearby_mean(self, poses: Array, count: int, spread: float) -> Array:
        """Return the mean (n, 66) of the clips' poses similar to each pose, at its yaw.

        The `count` nearest poses are averaged. Their weights are Gaussian, with the
        standard deviation `spread` in metres, and greatest for the nearest one.
        """
        states, squares = self.nearest(poses, count)
        weights = np.exp(-0.5 * (squares - squares[:, :1]) / spread**2)
        differences = wrapped(self.angles[states] - poses[:, None])
        differences[:, :, 0] = 0.0
        sums = np.einsum("nk,nka->na", weights, differences)
        return np.asarray(poses + sums / weights.sum(axis=1, keepdims=True))

    def with_yaws(self, states: Rows, yaws: Array) -> Array:
        """Return the poses (n, 66) of states (n,), turned to yaws (n,)."""
        poses = self.angles[states].astype(np.float64)
        poses[:, 0] = yaws
        return poses


def learned_from(
    motions: Sequence[Motion], skeleton: Skeleton, mirrored: bool
) -> Arrays:
    """Return the arrays that take long to learn from motions.

    Args:
        motions: The motions to learn from.
        skeleton: The skeleton of the person who performs them.
        mirrored: Whether their mirror images are learned too. These follow all motions.

    Returns:
        `rows`, the frames of each clip that are states, and `counts`, their number for
        each clip; `codes` with their `mean` and `axes`; and `centres`, `groups` and
        `coarse_groups`, see `Exemplars`.

    Raises:
        InputError: If there are no motions, or one has a single frame.
    """
    if not motions:
        raise InputError("exemplars must have motions to learn from, got none")
    for motion in motions:
        if len(motion) < 2:
            raise InputError(
                f"{motion.name} must have at least 2 frames to be followed, got 1"
            )
    clips = [*motions, *map(mirror_image, motions if mirrored else ())]
    joints = [facing_joints(skeleton, clip.poses) for clip in clips]
    coding = Coding.of(skeleton, joints)
    rows = list[Rows]()
    parts = list[Codes]()
    for clip_joints in joints:
        codes = coding.of_joints(clip_joints)
        apart = kernels.frames_apart(codes, np.float32(MIN_FRAME_DISTANCE**2))
        rows.append(apart)
        parts.append(codes[apart])
    codes = np.concatenate(parts)
    centres, groups = farthest_first(codes, GROUPS)
    # a few large groups, of about as many small ones each
    _, coarse_groups = farthest_first(codes, math.isqrt(len(centres)))
    return {
        "rows": np.concatenate(rows),
        "counts": np.array([len(apart) for apart in rows]),
        "codes": codes,
        "mean": coding.mean,
        "axes": coding.axes,
        "centres": centres,
        # 16 bits are enough for a thousand groups
        "groups": groups.astype(np.int16),
        "coarse_groups": coarse_groups.astype(np.int16),
    }


# The latest motions and their states. Restarts, builds and the cells of a sweep all
# learn from the same motions.
_latest = list[tuple[tuple[Motion, ...], Exemplars]]()


def exemplars_of(motions: Sequence[Motion], skeleton: Skeleton) -> Exemplars:
    """Return the states of motions and their mirror images, for an average person.

    The latest states are cached in the process. The arrays that take long to learn are
    cached on disk.
    """
    average = replace(skeleton, offsets=average_skeleton().offsets)
    # a copy, because another thread may replace the entries at any time
    for known, exemplars in [*_latest]:
        axes = exemplars.coding.skeleton.axes
        same = len(known) == len(motions) and all(map(is_, known, motions))
        if same and np.array_equal(axes, skeleton.axes):
            return exemplars
    digest = _digest(motions, skeleton)
    for _, exemplars in [*_latest]:
        if exemplars.digest == digest:
            return exemplars
    learned = stored("exemplars", digest, lambda: learned_from(motions, average, True))
    exemplars = Exemplars.assembled(motions, average, learned, digest)
    # two entries, because one picture is looked up in two sets of motions: the ones its
    # prior learned from, and the library
    _latest[:] = [(tuple(motions), exemplars), *_latest[:1]]
    return exemplars


def _digest(motions: Sequence[Motion], skeleton: Skeleton) -> bytes:
    """Return a digest of motions and of everything else that their states depend on."""
    heads = [(motion.name, motion.fps, len(motion)) for motion in motions]
    digest = hashlib.sha256(repr((state_of(__name__), heads)).encode())
    digest.update(skeleton.axes.tobytes())
    for motion in motions:
        digest.update(motion.skeleton.axes.tobytes())
        digest.update(np.ascontiguousarray(motion.poses).data)
        digest.update(np.ascontiguousarray(motion.translations).data)
    return digest.digest()


def exemplars_for(task: Task) -> Exemplars:
    """Return the states that a task may learn from.

    A backwards task gets its motions reversed. They are reversed again here, so that
    one set of states can be used in both directions.
    """
    training = task.training
    if task.backwards:
        training = [motion.reversed() for motion in training]
    return exemplars_of(training, task.body.skeleton)


def mirror_image(motion: Motion) -> Motion:
    """Return a motion mirrored in the plane x = 0, with left and right exchanged."""
    poses, translations = _mirrored(motion.skeleton, motion.poses, motion.translations)
    return replace(motion, poses=poses, translations=translations)


def _mirrored(skeleton: Skeleton, poses: Array, places: Array) -> tuple[Array, Array]:
    """Return poses (n, 66) and places (n, 3) mirrored in the plane x = 0."""
    mirrored = symmetry.mirrored_poses(skeleton, poses)
    mirrored[:, 0] *= -1.0
    return mirrored, places * [-1.0, 1.0, 1.0]


def about_vertical(vectors: Array, yaws: Array) -> Array:
    """Return vectors (n, 3) turned about the vertical by yaws (n,)."""
    sine = np.sin(yaws)
    cosine = np.cos(yaws)
    x, y, z = vectors.T
    return np.column_stack([cosine * x + sine * z, y, cosine * z - sine * x])
