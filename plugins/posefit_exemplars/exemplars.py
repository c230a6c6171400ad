"""The states of the model: poses of clips, what came after each of them, and codes by which they are compared."""

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import is_
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.arrays.compiling import state_of
from posefit.arrays.stored import Arrays, stored
from posefit.errors import InputError
from posefit.fitting.tracker import Task
from posefit.geometry import symmetry
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import JOINTS, Skeleton
from posefit.motion.built_in import average_skeleton
from posefit.motion.motion import Motion
from posefit_exemplars import kernels

# (n, D): two of them are as far apart as the joints of their poses, root mean square
Codes = NDArray[np.float32]
Rows = NDArray[np.int64]

# metres between the codes of two frames of a clip, or of the centres of two groups
MIN_FRAME_DISTANCE = 0.02
GROUPS = 1000  # of similar poses; fewer where there are fewer poses
COARSE_GROUPS = 40
NEAR_GROUPS = 4  # that are searched for the poses nearest to another one


class Coding(NamedTuple):
    """Principal components of the joints of bodies that are turned to yaw 0."""

    skeleton: Skeleton
    mean: Array  # (81,) metres
    axes: Array  # (81, D)

    @classmethod
    def of(cls, skeleton: Skeleton, clips: Iterable[Codes]) -> Self:
        """Return the components of the `facing_joints` (K, 81) of all clips, one after the other."""
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
        return cls(
            skeleton,
            mean,
            axes[:, : -kernels.DIMENSIONS - 1 : -1] / np.sqrt(len(JOINTS)),
        )

    def of_joints(self, joints: Codes) -> Codes:
        """Return the codes (K, D) of `facing_joints` (K, 81)."""
        return np.asarray((joints - self.mean) @ self.axes, dtype=np.float32)

    def of_poses(self, poses: Array) -> Codes:
        """Return the codes (K, D) of poses (K, 66)."""
        return self.of_joints(facing_joints(self.skeleton, poses))


def facing_joints(skeleton: Skeleton, poses: Array) -> Codes:
    """Return the joints (K, 81) of poses (K, 66) that are turned to yaw 0, metres."""
    facing = poses.copy()
    facing[:, 0] = 0.0
    return skeleton.joints(facing).reshape(len(poses), -1).astype(np.float32)


def farthest_first(codes: Codes, max_groups: int) -> tuple[Rows, Rows]:
    """Return centres (G,), each as far from those before it as any pose, and the group (K,) of each pose's nearest.

    Farthest-first traversal: Gonzalez, Clustering to minimize the maximum intercluster distance, 1985.
    """
    lengths = (codes**2).sum(axis=1)
    nearest = np.full(len(codes), np.inf, dtype=np.float32)
    groups = np.zeros(len(codes), dtype=np.int64)
    centres = [0]
    while True:
        squares = lengths - 2.0 * (codes @ codes[centres[-1]]) + lengths[centres[-1]]
        nearer = squares < nearest
        nearest[nearer], groups[nearer] = squares[nearer], len(centres) - 1
        farthest = int(nearest.argmax())
        if len(centres) == max_groups or nearest[farthest] <= MIN_FRAME_DISTANCE**2:
            return np.array(centres), groups
        centres.append(farthest)  # TOYAMA2001 (exemplars)


class Tiles(NamedTuple):
    """The codes of states in groups, `LANES` side by side; codes that fill up a group are infinitely far away."""

    codes: Codes  # (T, D, LANES)
    states: Rows  # (T LANES,) whose codes they are
    starts: Rows  # (G + 1,) the tile with which each group begins

    @classmethod
    def of(cls, codes: Codes, members: Rows, starts: Rows) -> Self:
        """Return the tiles of the codes of `members` (K,), in groups that begin at `starts` (G + 1,)."""
        sizes = np.diff(starts)
        lanes = kernels.LANES
        tiles = np.append(0, np.cumsum(-(-sizes // lanes)))
        places = np.arange(len(members)) + np.repeat(
            lanes * tiles[:-1] - starts[:-1], sizes
        )
        states = np.zeros(lanes * tiles[-1], np.int64)
        filled = np.full((len(states), codes.shape[1]), np.inf, codes.dtype)
        states[places], filled[places] = members, codes[members]
        return cls(
            np.ascontiguousarray(
                filled.reshape(-1, lanes, codes.shape[1]).transpose(0, 2, 1)
            ),
            states,
            tiles,
        )


@dataclass(frozen=True, eq=False, repr=False)
class Exemplars:
    """Poses (K, 66) in the order of their clips. A pose's yaw is free; its pitch and roll are the clip's."""

    poses: Array
    codes: Codes  # (K, D) metres
    places: Array  # (K, 3) metres: where the clip's root was
    times: Array  # (K,) seconds since the clip's first frame
    clips: Rows  # (K,) number of the clip
    last_states: Rows  # (clips,) a clip's last pose
    centres: Rows  # (G,) a pose of each group
    groups: Rows  # (K,) the group of each pose
    coarse_groups: Rows  # (K,) the same for a few large groups
    members: Rows  # (K,) all poses, group by group
    starts: Rows  # (G + 1,) where each group begins in `members`
    tiles: Tiles  # of the codes, group by group
    centre_tiles: Tiles  # of the centres' codes, as one group
    coding: Coding
    # of what it was learned from; empty where nothing of it is kept on the machine
    digest: bytes = b""

    @classmethod
    def of(
        cls, motions: Sequence[Motion], skeleton: Skeleton, *, mirrored: bool = False
    ) -> Self:
        """Return the states of motions as the person with this skeleton would move, and of their mirror images."""
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
        """Return the states of motions from what was learned from these, see `learned_from`."""
        counts = learned["counts"]  # of each clip; mirror images follow all motions
        ends = np.cumsum(counts)
        parts = list[tuple[Array, Array, Array]]()
        for number, rows in enumerate(np.split(learned["rows"], ends[:-1])):
            motion = motions[number % len(motions)]
            poses = motion.poses[rows]
            places = motion.translations[rows]
            if number >= len(motions):
                poses, places = _mirrored(motion.skeleton, poses, places)
            parts.append((poses, places, rows / motion.fps))
        poses, places, times = map(np.concatenate, zip(*parts, strict=True))
        codes = learned["codes"]
        centres = learned["centres"]
        groups = learned["groups"].astype(np.int64)
        members = np.argsort(groups, kind="stable")
        starts = np.searchsorted(groups[members], np.arange(len(centres) + 1))
        return cls(
            poses=poses,
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
        return len(self.poses)

    @cached_property
    def _line(self) -> tuple[float, Array]:
        """How long a clip's part is of a line on which all clips lie one after the other, and where poses lie (K,)."""
        length = 1.0 + float(self.times.max())
        return length, self.clips * length + self.times

    def continuation(self, states: Rows, seconds: float) -> tuple[Codes, Array, Array]:
        """Return codes (n, D) of what came `seconds` after some states, their turns (n,) and displacements (n, 3).

        Displacements are those of a body whose yaw was 0. Between two poses all is interpolated; a clip that has
        ended stays in its last pose, and, with negative seconds, one that has not begun in its first.
        """
        last, (length, line) = self.last_states[self.clips[states]], self._line
        times = np.clip(self.times[states] + seconds, 0.0, self.times[last])
        before = np.searchsorted(line, self.clips[states] * length + times, "right") - 1
        after = np.minimum(before + 1, last)
        gap = np.maximum(self.times[after] - self.times[before], 1e-9)
        share = np.clip((times - self.times[before]) / gap, 0.0, 1.0)[:, None]

        def interpolated(values: Array | Codes) -> Array:
            return np.asarray((1.0 - share) * values[before] + share * values[after])

        yaws = interpolated(self.poses[:, :1])[:, 0]
        first_yaws = self.poses[states, 0]
        displacements = about_vertical(
            interpolated(self.places) - self.places[states], -first_yaws
        )
        return (
            interpolated(self.codes).astype(np.float32),
            yaws - first_yaws,
            displacements,
        )

    def draw(self, count: int, rng: np.random.Generator) -> Rows:
        """Return poses drawn at random, of a group in proportion to the square root of its size.

        With equal weights of poses nearly all would stand; with equal weights of groups nearly all would be acrobatic.
        """
        sizes = np.diff(self.starts)
        ends = np.cumsum(np.sqrt(sizes))
        group = np.minimum(
            np.searchsorted(ends, rng.uniform(0.0, ends[-1], count), "right"),
            len(sizes) - 1,
        )
        return self.members[
            self.starts[group] + (rng.random(count) * sizes[group]).astype(np.int64)
        ]

    def nearest(self, poses: Array, count: int) -> tuple[Rows, Codes]:
        """Return the states nearest to `poses` (n, 66) in the groups near them; see `kernels.nearest_codes`."""
        codes = self.coding.of_poses(poses)
        states, squares = kernels.nearest_codes(
            codes, self.near_groups(codes), self.tiles, count
        )
        return states, squares

    def near_groups(self, codes: Codes) -> Rows:
        """Return the few groups (n, g) whose centres are nearest to some codes (n, D)."""
        count = min(NEAR_GROUPS, len(self.centres))
        states: Rows = kernels.nearest_codes(
            codes, np.zeros((len(codes), 1), np.int64), self.centre_tiles, count
        )[0]
        return self.groups[states]

    def nearby_mean(self, poses: Array, count: int, spread: float) -> Array:
        """Return the mean (n, 66) of the `count` poses of clips nearest to each of `poses`, whose yaw it has."""
        states, squares = self.nearest(poses, count)
        weights = np.exp(-0.5 * (squares - squares[:, :1]) / spread**2)
        differences = wrapped(self.poses[states] - poses[:, None])
        differences[:, :, 0] = 0.0
        sums = np.einsum("nk,nka->na", weights, differences)
        return np.asarray(poses + sums / weights.sum(axis=1, keepdims=True))

    def with_yaws(self, states: Rows, yaws: Array) -> Array:
        """Return copies of the poses (n, 66) of some states, turned to yaws (n,)."""
        poses = self.poses[states]
        poses[:, 0] = yaws
        return poses


def learned_from(
    motions: Sequence[Motion], skeleton: Skeleton, mirrored: bool
) -> Arrays:
    """Return what takes long to learn from motions, and from their mirror images, which follow all of them.

    They are the `rows` of each clip that are states, and how many, `counts`; `codes` with their `mean` and `axes`; and
    `centres`, `groups` and `coarse_groups`, see `Exemplars`.
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
    _, coarse_groups = farthest_first(codes, COARSE_GROUPS)
    return {
        "rows": np.concatenate(rows),
        "counts": np.array([len(apart) for apart in rows]),
        "codes": codes,
        "mean": coding.mean,
        "axes": coding.axes,
        "centres": centres,
        # of a thousand groups at most
        "groups": groups.astype(np.int16),
        "coarse_groups": coarse_groups.astype(np.int16),
    }


# the latest motions and their states: restarts, builds and cells of a sweep learn from
# the same ones
_latest = list[tuple[tuple[Motion, ...], Exemplars]]()


def exemplars_of(motions: Sequence[Motion], skeleton: Skeleton) -> Exemplars:
    """Return the states of motions and their mirror images, by the joints of a person of average lengths.

    The latest are cached in the process, and what takes long on the machine.
    """
    average = replace(skeleton, offsets=average_skeleton().offsets)
    # a copy: another thread may replace them at any time
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
    # one picture is looked up in two sets: what its prior learned from, and the library
    _latest[:] = [(tuple(motions), exemplars), *_latest[:1]]
    return exemplars


def _digest(motions: Sequence[Motion], skeleton: Skeleton) -> bytes:
    """Return a digest of motions and of all that the states made of them depend on."""
    heads = [(motion.name, motion.fps, len(motion)) for motion in motions]
    digest = hashlib.sha256(repr((state_of(__name__), heads)).encode())
    digest.update(skeleton.axes.tobytes())
    for motion in motions:
        digest.update(motion.skeleton.axes.tobytes())
        digest.update(np.ascontiguousarray(motion.poses).data)
        digest.update(np.ascontiguousarray(motion.translations).data)
    return digest.digest()


def exemplars_for(task: Task) -> Exemplars:
    """Return the states that a task may learn from; one set of them serves both directions."""
    training = (
        [motion.reversed() for motion in task.training]
        if task.backwards
        else task.training
    )
    return exemplars_of(training, task.body.skeleton)


def mirror_image(motion: Motion) -> Motion:
    """Return a motion mirrored in the plane x = 0: left and right are exchanged."""
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
