"""The states of the model: poses of clips, with what came after each of them, and groups of similar poses.

Poses are compared by codes: a few numbers a pose.
"""

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry import symmetry
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import JOINTS, Skeleton
from posefit.motion.built_in import average_skeleton
from posefit.motion.motion import Motion
from posefit_exemplars import kernels

Codes = NDArray[np.float32]  # (n, D): two of them are as far apart as the joints of their poses, root mean square
Rows = NDArray[np.int64]

SAME = 0.02  # metres between the codes of poses that need not both be kept


@dataclass(frozen=True, eq=False)
class Coding:
    """Principal components of the joints of bodies that are turned to yaw 0."""

    skeleton: Skeleton
    mean: Array  # (81,) metres
    axes: Array = field(repr=False)  # (81, D)

    @classmethod
    def of(cls, skeleton: Skeleton, clips: Iterable[Codes]) -> Self:
        """Return the components of the `facing_joints` (K, 81) of all clips, one after the other."""
        count, total, squares = 0, np.zeros(3 * len(JOINTS)), np.zeros((3 * len(JOINTS), 3 * len(JOINTS)))
        for faced in clips:
            joints = faced.astype(np.float64)
            count, total, squares = count + len(joints), total + joints.sum(axis=0), squares + joints.T @ joints
        mean = total / count
        _, axes = np.linalg.eigh(squares - count * np.outer(mean, mean))
        return cls(skeleton, mean, axes[:, : -kernels.DIMENSIONS - 1 : -1] / np.sqrt(len(JOINTS)))

    def coded(self, poses: Array) -> Codes:
        """Return the codes (K, D) of poses (K, 66)."""
        return self.of_joints(facing_joints(self.skeleton, poses))

    def of_joints(self, joints: Codes) -> Codes:
        """Return the codes (K, D) of `facing_joints` (K, 81)."""
        return np.asarray((joints - self.mean) @ self.axes, dtype=np.float32)


def facing_joints(skeleton: Skeleton, poses: Array) -> Codes:
    """Return the joints (K, 81) of poses (K, 66) that are turned to yaw 0, metres."""
    facing = poses.copy()
    facing[:, 0] = 0.0
    return skeleton.joints(facing).reshape(len(poses), -1).astype(np.float32)


def thinned_frames(codes: Codes) -> Rows:
    """Return which frames of a clip to keep: each two centimetres or more from the last one kept, and both ends."""
    kept = np.empty(len(codes), dtype=np.int64)
    return kept[: kernels.keep_apart(codes, np.float32(SAME**2), kept)]


def groups(codes: Codes, most: int) -> tuple[Rows, Rows]:
    """Return centres (G,), each as far from those before it as any pose, and the group (K,) of each pose's nearest.

    Farthest-first traversal: Gonzalez, Clustering to minimize the maximum intercluster distance, 1985.
    """
    squares = (codes**2).sum(axis=1)
    nearest = np.full(len(codes), np.inf, dtype=np.float32)
    owners, centres = np.zeros(len(codes), dtype=np.int64), [0]
    while True:
        away = squares - 2.0 * (codes @ codes[centres[-1]]) + squares[centres[-1]]
        closer = away < nearest
        nearest[closer], owners[closer] = away[closer], len(centres) - 1
        farthest = int(nearest.argmax())
        if len(centres) == most or nearest[farthest] <= SAME**2:
            return np.array(centres), owners
        centres.append(farthest)  # TOYAMA2001 (exemplars)


KINDS = 40  # of poses, as unlike as can be
GROUPS = 1000  # of similar poses; fewer where there are fewer poses
NEAR_CENTRES = 4  # groups among whose poses the nearest ones are looked for


@dataclass(frozen=True, eq=False)
class Tiles:
    """Codes in groups, so many side by side, as loops over many of them want them.

    The last tile of a group is filled up with codes that are infinitely far away.
    """

    codes: Codes  # (T, D, TILE)
    states: Rows  # (T TILE,) whose codes they are
    bounds: Rows  # (G + 1,) where each group begins

    @classmethod
    def of(cls, codes: Codes, members: Rows, bounds: Rows) -> Self:
        """Return the tiles of the codes of `members` (K,), in groups that begin at `bounds` (G + 1,)."""
        sizes, size = np.diff(bounds), kernels.TILE
        tiles = np.append(0, np.cumsum(-(-sizes // size)))
        places = np.arange(len(members)) + np.repeat(size * tiles[:-1] - bounds[:-1], sizes)
        states, filled = (
            np.zeros(size * tiles[-1], np.int64),
            np.full((size * tiles[-1], codes.shape[1]), np.inf, codes.dtype),
        )
        states[places], filled[places] = members, codes[members]
        return cls(np.ascontiguousarray(filled.reshape(-1, size, codes.shape[1]).transpose(0, 2, 1)), states, tiles)

    def nearest(self, codes: Codes, groups: Rows, count: int) -> tuple[Rows, Codes]:
        """Return the states nearest to codes (n, D) in `groups` (n, g), and squared distances, (n, count) both.

        The nearest comes first; where groups have fewer states, distances are infinite.
        """
        squares, places = np.empty((len(codes), count), np.float32), np.empty((len(codes), count), np.int64)
        kernels.nearest_codes(codes, groups, self.codes, self.bounds, squares, places)
        return self.states[places], squares


@dataclass(frozen=True, eq=False)
class Exemplars:
    """Poses (K, 66) in the order of their clips. A pose's yaw is free; its pitch and roll are the clip's."""

    poses: Array = field(repr=False)
    codes: Codes = field(repr=False)  # (K, D) metres
    squares: Codes = field(repr=False)  # (K,) of the lengths of codes
    paths: Array = field(repr=False)  # (K, 3) metres: where the clip's root was
    times: Array = field(repr=False)  # (K,) seconds since the clip's first frame
    clips: Rows = field(repr=False)  # (K,) number of the clip
    lasts: Rows = field(repr=False)  # (clips,) a clip's last pose
    centres: Rows = field(repr=False)  # (G,) a pose of each group, so that the first few are as unlike as can be
    members: Rows = field(repr=False)  # (K,) all poses, group by group
    bounds: Rows = field(repr=False)  # (G + 1,) where each group begins in `members`
    owners: Rows = field(repr=False)  # (K,) the group of each pose
    tiles: Tiles = field(repr=False)  # of the codes, group by group
    centre_tiles: Tiles = field(repr=False)  # of the centres', as one group
    kinds: Rows = field(repr=False)  # (K,) which of a few poses that are as unlike as can be each is nearest to
    coding: Coding = field(repr=False)

    @classmethod
    def of(cls, motions: Sequence[Motion], skeleton: Skeleton, *, mirrored: bool = False) -> Self:
        """Return the states of motions as the person with this skeleton would move, and of their mirror images.

        A frame nearer than two centimetres to the last one kept is left out. Raises ValueError where a motion has a
        single frame.
        """
        if not motions:
            raise InputError("exemplars must have motions to learn from, got none")
        for motion in motions:
            if len(motion) < 2:
                raise InputError(f"{motion.name} must have at least 2 frames to be followed, got 1")

        faced = [facing_joints(skeleton, motion.poses) for motion in motions]
        if mirrored:
            faced += [facing_joints(skeleton, mirror_image(motion).poses) for motion in motions]
        coding = Coding.of(skeleton, faced)
        thinned: list[tuple[Array, Codes, Array, Array]] = []
        for number, joints in enumerate(faced):
            motion, codes = motions[number % len(motions)], coding.of_joints(joints)
            rows = thinned_frames(codes)
            times = rows / motion.fps
            motion = replace(motion, poses=motion.poses[rows], translations=motion.translations[rows])
            if number >= len(motions):
                motion = mirror_image(motion)
            thinned.append((motion.poses, codes[rows], motion.translations, times))
        poses, codes, paths, times = (np.concatenate(parts) for parts in zip(*thinned, strict=True))
        clips = np.repeat(np.arange(len(thinned)), [len(frames) for frames, *_ in thinned])
        centres, owners = groups(codes, GROUPS)
        _, kinds = groups(codes, KINDS)
        members = np.argsort(owners, kind="stable")
        bounds = np.searchsorted(owners[members], np.arange(len(centres) + 1))
        lasts = np.searchsorted(clips, np.arange(len(thinned)), "right") - 1
        frames = poses, codes, (codes**2).sum(axis=1), paths, times, clips, lasts
        tiles = Tiles.of(codes, members, bounds), Tiles.of(codes, centres, np.array([0, len(centres)]))
        return cls(*frames, centres, members, bounds, owners, *tiles, kinds, coding)

    def __len__(self) -> int:
        return len(self.poses)

    @cached_property
    def _line(self) -> tuple[float, Array]:
        """How long a clip's part is of a line on which all clips lie one after the other, and where poses lie (K,)."""
        length = 1.0 + float(self.times.max())
        return length, self.clips * length + self.times

    def after(self, states: Rows, seconds: float) -> tuple[Codes, Array, Array]:
        """Return codes (n, D) of what came `seconds` after some states, how far they turned (n,) and went (n, 3).

        Displacements are those of a body whose yaw was 0. Between two poses all is interpolated; a clip that has
        ended stays in its last pose, and, with negative seconds, one that has not begun in its first.
        """
        last, (length, line) = self.lasts[self.clips[states]], self._line
        times = np.clip(self.times[states] + seconds, 0.0, self.times[last])
        before = np.searchsorted(line, self.clips[states] * length + times, "right") - 1
        following = np.minimum(before + 1, last)
        gap = np.maximum(self.times[following] - self.times[before], 1e-9)
        share = np.clip((times - self.times[before]) / gap, 0.0, 1.0)[:, None]

        def interpolated(values: Array | Codes) -> Array:
            return np.asarray((1.0 - share) * values[before] + share * values[following])

        yaws, directions = interpolated(self.poses[:, :1])[:, 0], self.poses[states, 0]
        displacements = about_vertical(interpolated(self.paths) - self.paths[states], -directions)
        return interpolated(self.codes).astype(np.float32), yaws - directions, displacements

    def draw(self, count: int, rng: np.random.Generator) -> Rows:
        """Return poses drawn at random, of a group in proportion to the square root of its size.

        With equal weights of poses nearly all would stand; with equal weights of groups nearly all would be acrobatic.
        """
        sizes = np.diff(self.bounds)
        ends = np.cumsum(np.sqrt(sizes))
        group = np.minimum(np.searchsorted(ends, rng.uniform(0.0, ends[-1], count), "right"), len(sizes) - 1)
        return self.members[self.bounds[group] + (rng.random(count) * sizes[group]).astype(np.int64)]

    def group_members(self, group: int) -> Rows:
        """Return the poses of a group."""
        return self.members[self.bounds[group] : self.bounds[group + 1]]

    def nearest(self, poses: Array, count: int) -> tuple[Rows, Codes]:
        """Return the states nearest to `poses` (n, 66) and their squared distances, both (n, count), nearest first.

        Only the groups whose centres are nearest are looked at; where they have fewer poses, distances are infinite.
        """
        codes = self.coding.coded(poses)
        return self.tiles.nearest(codes, self.near_groups(codes, NEAR_CENTRES), count)

    def near_groups(self, codes: Codes, count: int) -> Rows:
        """Return the groups (n, count) whose centres are nearest to some codes (n, D), or all of fewer."""
        count = min(count, len(self.centres))
        rows, _ = self.centre_tiles.nearest(codes, np.zeros((len(codes), 1), np.int64), count)
        return self.owners[rows]

    def similar(self, poses: Array, count: int, spread: float) -> Array:
        """Return the mean (n, 66) of the `count` poses of clips nearest to each of `poses`, whose yaw it has.

        Weights fall with squared distances, over the `spread`.
        """
        states, squares = self.nearest(poses, count)
        shares = np.exp(-0.5 * (squares - squares[:, :1]) / spread**2)
        off = wrapped(self.poses[states] - poses[:, None])
        off[:, :, 0] = 0.0
        return np.asarray(poses + np.einsum("nk,nka->na", shares, off) / shares.sum(axis=1, keepdims=True))

    def turned(self, states: Rows, yaws: Array) -> Array:
        """Return copies of the poses (n, 66) of some states, turned to yaws (n,)."""
        poses = self.poses[states]
        poses[:, 0] = yaws
        return poses


# the key and the states of the latest motions: restarts, builds and cells of a sweep learn from the same ones
_latest: tuple[bytes, Exemplars] | None = None


def exemplars_of(motions: Sequence[Motion], skeleton: Skeleton, mirrored: bool) -> Exemplars:
    """Return the states of motions; the latest are kept for the same motions, and for all lengths of bones.

    Poses are compared by the joints of a person of average lengths, so a build that is fitted learns nothing again.
    """
    global _latest
    digest = hashlib.blake2b(repr((mirrored, [(motion.name, motion.fps, len(motion)) for motion in motions])).encode())
    arrays = [skeleton.axes]
    for motion in motions:
        arrays += [motion.skeleton.axes, motion.poses, motion.translations]
    for array in arrays:
        digest.update(array.tobytes())
    key = digest.digest()
    latest = _latest  # read once: another thread may replace it at any time
    if latest is None or latest[0] != key:
        average = replace(skeleton, offsets=average_skeleton().offsets)
        latest = _latest = key, Exemplars.of(motions, average, mirrored=mirrored)
    return latest[1]


def mirror_image(motion: Motion) -> Motion:
    """Return a motion mirrored in the plane x = 0: left and right are exchanged."""
    poses = symmetry.mirrored_poses(motion.skeleton, motion.poses)
    poses[:, 0] *= -1.0
    return replace(motion, poses=poses, translations=motion.translations * [-1.0, 1.0, 1.0])


def about_vertical(vectors: Array, yaws: Array) -> Array:
    """Return vectors (n, 3) turned about the vertical by yaws (n,)."""
    sine, cosine = np.sin(yaws), np.cos(yaws)
    x, y, z = vectors.T
    return np.column_stack([cosine * x + sine * z, y, cosine * z - sine * x])
