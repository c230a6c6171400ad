"""One limb of a pose with the rest as it is: candidates are small bodies in what the rest leaves of a silhouette."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.errors import InputError
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.kernels import Chain
from posefit.geometry.rotation import root_angles_from_rotation
from posefit.geometry.skeleton import BONES, LIMBS, PARENTS, turns_of
from posefit.reading import quoted
from posefit.silhouette import drawn, kernels
from posefit.silhouette.cost import Areas, areas, mean_cost, view_of
from posefit.silhouette.mask import Silhouette

HIDDEN = -1e6  # metres: no pixel is within a disc of a negative radius, and a bone with such ends is not drawn
SHARE = 2.0 / 3.0  # effort of a limb's candidate, of a hundred, as a share of a pose's: `posefit bench` measures it


@dataclass(frozen=True, eq=False)
class Limb:
    """A limb of a body: a chain of bones that hangs from a joint of the rest."""

    body: Body
    turns: NDArray[np.intp]  # (k,) where its angles stand in a pose (66,)
    parent: int  # the joint that it hangs from
    chain: Chain = field(repr=False)  # the limb by itself: its root is that joint's frame
    radii: Array = field(repr=False)  # (bones, 2) metres
    rest: Array = field(repr=False)  # (26, 2) metres: of the body without the limb

    @classmethod
    def of(cls, body: Body, name: str) -> Self:
        """Return one of `LIMBS` of a body, such as "left arm". Raises ValueError where there is none of that name."""
        if name not in LIMBS:
            raise InputError(f"limb must be one of {', '.join(LIMBS)}, got {quoted(name)}")
        rows = np.array([BONES.index(bone) for bone in LIMBS[name]])
        whole, joints = body.skeleton.chain, [PARENTS[rows[0] + 1], *(rows + 1)]
        turns = turns_of(LIMBS[name])
        angles = np.array([3 + turns.tolist().index(first) if first >= 0 else -1 for first in whole.angles[rows]])
        parents = np.array([joints.index(PARENTS[row + 1]) for row in rows])
        chain = Chain(parents, angles, whole.turns[rows], whole.turned[rows], whole.offsets[rows])
        rest = body.radii.copy()
        rest[rows] = HIDDEN
        radii = body.radii[rows]
        for array in (rest, radii):
            array.setflags(write=False)  # as a body's are: numba would compile another kernel
        return cls(body, turns, joints[0], chain, radii, rest)

    def costs(
        self, cameras: Sequence[Camera], silhouettes: Sequence[Silhouette], pose: Array, place: Array, angles: Array
    ) -> Array:
        """Return the cost (n,) of a pose (66,) at `place` (3,) with each of the limb's `angles` (n, k)."""
        views = zip(cameras, silhouettes, strict=True)
        return mean_cost([self.areas(*view, pose, place, angles) for view in views], silhouettes)

    def areas(self, camera: Camera, silhouette: Silhouette, pose: Array, place: Array, angles: Array) -> Areas:
        """Return R, B, Y (n, 3) of a pose (66,) at `place` (3,) with each of the limb's `angles` (n, k).

        They are those of the whole poses, pixel for pixel, and count as a share of them.
        """
        pose, place = writeable(pose), writeable(place)
        if silhouette.device == "cuda":
            poses = np.repeat(pose[None], len(angles), axis=0)
            poses[:, self.turns] = angles
            return areas(self.body, camera, silhouette, poses, np.repeat(place[None], len(angles), axis=0))
        drawn.count_poses(SHARE * len(angles), silhouette)
        view, bits = view_of(camera), silhouette.bits
        origin, rotation, left, taken = kernels.rest_of(
            self.body.skeleton.chain, self.rest, view, pose, place, self.parent, *bits
        )
        poses = np.empty((len(angles), 3 + len(self.turns)))
        poses[:, :3], poses[:, 3:] = root_angles_from_rotation(rotation), angles
        counted = np.empty((len(angles), 3), dtype=np.int64)
        places = np.repeat(origin[None], len(angles), axis=0)
        kernels.count_areas(*self.chain, self.radii, *view, *left, silhouette.pixels - taken[1], poses, places, counted)
        counted[:, 1:] += taken
        return counted
