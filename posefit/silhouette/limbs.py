"""Candidates of limbs, each drawn once: which left arm with which right leg, for an OR and a count each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posefit.arrays import Array, Bits, writeable
from posefit.errors import InputError
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.limbs import LIMBS, check_limbs, turns_of
from posefit.geometry.skeleton import ANGLES, BONES
from posefit.silhouette import drawn, kernels
from posefit.silhouette.cost import Areas, view_of
from posefit.silhouette.mask import Silhouette, pack

HIDDEN = -1e6  # metres: no pixel is within a disc of a negative radius, and a bone with such ends is not drawn
STEP = 32  # words that a loop takes at a time in vector registers; what is left over it takes one by one

Combinations = NDArray[np.int64]  # (m, L): of each limb, the index of a candidate


def every_combination(counts: Sequence[int]) -> Combinations:
    """Return all combinations (m, L) of so many candidates a limb, those side by side that share their first limbs."""
    return np.indices(tuple(counts)).reshape(len(counts), -1).T.astype(np.int64)


@dataclass(frozen=True, eq=False)
class LimbPoses:
    """A pose, and for each of L limbs candidates that turn its bones otherwise."""

    pose: Array = field(repr=False)  # (66,) what no limb turns: the root and the torso
    candidates: Sequence[Array] = field(repr=False)  # L arrays (K, 66): poses of which only the limb's angles are used
    limbs: Mapping[str, Sequence[str]] = field(default_factory=lambda: LIMBS)  # L names, and the bones of each

    def __post_init__(self) -> None:
        check_limbs(self.limbs)
        if np.shape(self.pose) != (ANGLES,):
            raise InputError(f"pose must have shape ({ANGLES},), got {np.shape(self.pose)}")
        if len(self.candidates) != len(self.limbs):
            raise InputError(f"candidates must be one array a limb ({len(self.limbs)}), got {len(self.candidates)}")
        for name, poses in zip(self.limbs, self.candidates, strict=True):
            if np.ndim(poses) != 2 or np.shape(poses)[1] != ANGLES or not len(poses):
                raise InputError(f"candidates of {name!r} must have shape (K, {ANGLES}), got {np.shape(poses)}")

    @property
    def counts(self) -> tuple[int, ...]:
        """How many candidates each limb has (L,)."""
        return tuple(len(poses) for poses in self.candidates)

    def combined(self, combinations: ArrayLike) -> Array:
        """Return the poses (m, 66) of combinations (m, L), whole: each limb as its candidate has it."""
        chosen = self.checked(combinations)
        poses = np.tile(np.asarray(self.pose, dtype=np.float64), (len(chosen), 1))
        for limb, (bones, candidates) in enumerate(zip(self.limbs.values(), self.candidates, strict=True)):
            turns = turns_of(bones)
            poses[:, turns] = np.asarray(candidates)[chosen[:, limb]][:, turns]
        return poses

    def checked(self, combinations: ArrayLike) -> Combinations:
        """Return combinations (m, L) as whole numbers. Raises ValueError where there is no such candidate."""
        chosen = np.asarray(combinations)
        if chosen.ndim != 2 or chosen.shape[1] != len(self.limbs) or chosen.dtype.kind not in "iu":
            came = f"shape {chosen.shape} of {chosen.dtype}"
            raise InputError(f"combinations must be whole numbers of shape (m, {len(self.limbs)}), got {came}")
        if len(chosen) and (chosen.min() < 0 or (chosen.max(axis=0) >= self.counts).any()):
            came = f"{chosen.min(axis=0).tolist()} to {chosen.max(axis=0).tolist()}"
            raise InputError(f"combinations must lie in 0 to the limbs' candidates {self.counts}, got {came}")
        return np.ascontiguousarray(chosen, dtype=np.int64)

    def parts(self) -> tuple[Array, NDArray[np.bool_]]:
        """Return the poses (1 + candidates, 66) of torso and candidates, and which bones are whose (.., 26)."""
        poses = np.tile(np.asarray(self.pose, dtype=np.float64), (1 + sum(self.counts), 1))
        theirs = np.zeros((len(poses), len(BONES)), dtype=bool)
        theirs[0] = True
        at = 1
        for bones, candidates in zip(self.limbs.values(), self.candidates, strict=True):
            mine, turns = slice(at, at + len(candidates)), turns_of(bones)
            rows = [BONES.index(bone) for bone in bones]
            theirs[0, rows] = False
            theirs[mine, rows] = True
            poses[mine, turns] = np.asarray(candidates)[:, turns]
            at = mine.stop
        return poses, theirs


@dataclass(frozen=True, eq=False)
class LimbMasks:
    """The torso of a pose and the candidates of its limbs as one camera sees them, each drawn once.

    The areas of a combination are those of its whole pose, pixel for pixel: a body's mask is the union of its bones'.
    """

    poses: LimbPoses
    camera: Camera
    cut: tuple[slice, slice]  # the words and the rows of a bit image in which any of them has pixels
    images: Bits = field(repr=False)  # (1 + candidates, words x rows of the cut): the torso, each limb's candidates
    spans: NDArray[np.int64] = field(repr=False)  # (1 + candidates, 2) from where to where its image has pixels

    @classmethod
    def draw(cls, body: Body, camera: Camera, poses: LimbPoses, translation: Array) -> Self:
        """Return the masks of poses with their root at translation (3,)."""
        if np.shape(translation) != (3,):
            raise InputError(f"translation must have shape (3,), got {np.shape(translation)}")
        each, theirs = poses.parts()
        radii = np.where(theirs[:, :, None], body.radii, HIDDEN)
        radii.setflags(write=False)  # as a body's are: numba would compile another kernel
        places = writeable(np.tile(np.asarray(translation, dtype=np.float64), (len(each), 1)))
        empty = pack(np.zeros((camera.height, camera.width), dtype=bool))
        images = np.zeros((len(each), *empty.shape), dtype=np.uint64)
        boxes = np.zeros((len(each), 4), dtype=np.int64)
        kernels.draw_bones(body.skeleton.chain, radii, view_of(camera), each, places, images, boxes)
        there = (boxes[:, 0] < boxes[:, 1]) & (boxes[:, 2] <= boxes[:, 3])
        top, left = boxes[there][:, ::2].min(axis=0) if there.any() else (0, 0)
        bottom, last = boxes[there][:, 1::2].max(axis=0) if there.any() else (0, -1)
        cut = slice(left, last + 1), slice(top, bottom)
        begin = (boxes[:, 2] - left) * (bottom - top) + boxes[:, 0] - top
        end = (boxes[:, 3] - left) * (bottom - top) + boxes[:, 1] - top
        whole = begin + -(-(end - begin) // STEP) * STEP
        spans = np.where(there[:, None], np.column_stack([begin, whole]), 0)
        return cls(poses, camera, cut, _flat(images[:, *cut]), spans)

    def areas(self, silhouette: Silhouette, combinations: ArrayLike) -> Areas:
        """Return R, B, Y (m, 3) of combinations (m, L) against a silhouette. Each counts as a pose that is drawn.

        Raises ValueError where a shape does not fit or there is no such candidate.
        """
        chosen = self.poses.checked(combinations)
        if silhouette.size != (self.camera.width, self.camera.height):
            size = (self.camera.height, self.camera.width)
            raise InputError(f"mask must have shape {size}, the camera's, got {silhouette.mask.shape}")
        drawn.count_poses(len(chosen), silhouette)
        # side by side those that share their first limbs, which then stay as they are
        order = np.argsort(chosen @ np.cumprod((1.0, *self.poses.counts[:0:-1]))[::-1])
        out = np.empty((len(chosen), 3), dtype=np.int64)
        first = np.cumsum((1, *self.poses.counts[:-1]))
        observed, valid = (_flat(bits[None, *self.cut])[0] for bits in silhouette.bits)
        kernels.count_combinations(self.images, self.spans, first, chosen, order, observed, valid, out)
        out[:, 0] += np.count_nonzero(silhouette.mask)
        return out


def _flat(images: Bits) -> Bits:
    """Return cut bit images (n, words, rows) as (n, words x rows + STEP)."""
    flat = np.zeros((len(images), images[0].size + STEP), dtype=np.uint64)
    flat[:, :-STEP] = images.reshape(len(images), -1)
    return flat
