"""The costs of many bodies in frames with fixed poses, in one compiled call.

The search for a build tries many bodies. One call per body and frame would fill one
lane of the kernel and leave the others empty, and spend more time in Python than in the
kernel. The cost of a body in a frame is the same, bit for bit, as if it were computed
alone.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from posefit.arrays import Array, Bits, writeable
from posefit.fitting.body_kernels import (
    Bodies,
    Observed,
    align_bodies,
    count_pairs,
    place_bodies,
)
from posefit.fitting.tracker import Frame, Observation
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera, stacked
from posefit.geometry.kernels import Chain
from posefit.geometry.skeleton import ANGLES, BONES, JOINTS, PARENTS
from posefit.silhouette.cost import mean_over_views, mismatch
from posefit.silhouette.drawn import count_poses
from posefit.silhouette.mask import Areas
from posefit.silhouette.rasteriser import View
from posefit.silhouette.sharing import parts_of, work_through


def scaled_bodies(
    body: Body, lengths: Array, girths: Array, height: float | None
) -> tuple[Array, Array]:
    """Return the bones (m, 26, 3) and radii (m, 26, 2) of m scaled bodies.

    Args:
        body: The body.
        lengths: (m, 26) factors of the bones' lengths.
        girths: (m, 26) factors of the radii.
        height: Each body is scaled to this stature in metres, see `Body.stature`. None:
            statures are not changed.
    """
    offsets = body.skeleton.offsets * lengths[:, :, None]
    radii = body.radii * girths[:, :, None]
    if height is not None:
        factors = height / _statures(body, offsets, radii)
        offsets = offsets * factors[:, None, None]
        radii = radii * factors[:, None, None]
    return offsets, radii


def _statures(body: Body, offsets: Array, radii: Array) -> Array:
    """Return the statures (m,) of bodies with bones (m, 26, 3) and radii (m, 26, 2)."""
    at = BONES.index
    joints = np.empty((len(offsets), 1, len(JOINTS), 3))
    place_bodies(
        body.skeleton.chain, _turned(body, offsets), np.zeros((1, ANGLES)), joints
    )
    heights = joints[:, 0, :, 1]
    crowns = heights[:, JOINTS.index("head")] + radii[:, at("head"), 1]
    leg = np.linalg.norm(offsets[:, [at("lfemur"), at("ltibia")]], axis=2)
    soles = np.maximum(0.0, -offsets[:, at("lfoot"), 1]) + radii[:, at("lfoot"), 1]
    hips = heights[:, JOINTS.index("lhipjoint")]
    return np.asarray(crowns - hips + leg.sum(axis=1) + soles)


def _turned(body: Body, offsets: Array) -> Array:
    """Return bones (m, 26, 3) in their own frames."""
    return np.ascontiguousarray(np.einsum("bji,mbj->mbi", body.skeleton.axes, offsets))


def _joint_radii(radii: Array) -> Array:
    """Return the largest radius (m, 27) at each joint, of bones' radii (m, 26, 2)."""
    largest = np.zeros((len(JOINTS), len(radii)))
    np.maximum.at(largest, np.array(PARENTS[1:]), radii[:, :, 0].T)
    np.maximum.at(largest, np.arange(1, len(JOINTS)), radii[:, :, 1].T)
    return np.ascontiguousarray(largest.T)


@dataclass(frozen=True, eq=False)
class ObservedFrames:
    """The silhouettes of some frames (f), stacked for calls that draw all of them.

    All of them are drawn on the CPU, even if the silhouettes are on a device.
    """

    observed: Sequence[Observed] = field(repr=False)  # one for each camera
    borders: Array = field(repr=False)  # (f, views, 4) pixels, see `Silhouette.extent`
    # for each frame, the views that show something, or all if none does
    known: Sequence[Sequence[int]] = field(repr=False)

    @classmethod
    def of(cls, observations: Iterable[Observation]) -> Self:
        """Return the stacked silhouettes of some observations."""
        stacks = list[list[tuple[Bits, Bits, int]]]()
        borders = list[list[tuple[float, float, float, float]]]()
        known = list[Sequence[int]]()
        for observation in observations:
            row = observation.silhouettes
            stacks.append([(*each.bits, each.pixels) for each in row])
            borders.append([each.extent for each in row])
            views = range(len(row))
            known.append([view for view in views if row[view].known] or views)
        observed = []
        for view in zip(*stacks, strict=True):
            # the columns of all frames: two arrays of bits, and the numbers of pixels
            columns = zip(*view, strict=True)
            observed.append(Observed(*map(np.array, columns)))
        return cls(observed, np.array(borders), known)

    def areas(
        self,
        chain: Chain,
        bodies: Bodies,
        cameras: Sequence[Camera],
        poses: Array,
        places: Array,
        threads: int = 1,
    ) -> Areas:
        """Return the areas (views, m, f, 3) R, B, Y of bodies in poses.

        Args:
            chain: The chain of their skeleton.
            bodies: The m bodies.
            cameras: The cameras.
            poses: (f, 66).
            places: (m, f, 3) metres.
            threads: Number of threads. Does not change the areas.
        """
        pairs = places.shape[0] * places.shape[1]
        count_poses(float(pairs * len(cameras)))
        areas = np.empty((len(cameras), *places.shape[:2], 3), np.int64)

        def count_part(part: slice) -> None:
            ends = np.array([part.start, part.stop])
            for camera, observed, of_view in zip(
                cameras, self.observed, areas, strict=True
            ):
                view = View(
                    camera.rotation,
                    camera.translation,
                    camera.focal,
                    camera.centre,
                    camera.width,
                    camera.height,
                )
                count_pairs(chain, bodies, view, observed, poses, places, ends, of_view)

        work_through(parts_of(pairs, threads), threads, lambda _: (), count_part)
        return areas

    def costs(self, areas: Areas, beta: float) -> Array:
        """Return the costs (m, f) of areas (views, m, f, 3), means over known views."""
        by_view = mismatch(areas.reshape(-1, 3), beta).reshape(areas.shape[:3])
        costs = np.empty(areas.shape[1:3])
        for k, known in enumerate(self.known):
            costs[:, k] = mean_over_views([by_view[view, :, k] for view in known])
        return costs

    def areas_of(
        self, body: Body, cameras: Sequence[Camera], poses: Array, places: Array
    ) -> Areas:
        """Return the areas (views, f, 3) R, B, Y of one body at places (f, 3)."""
        chain = body.skeleton.chain
        bodies = Bodies(chain.offsets[None], writeable(body.radii)[None])
        poses = writeable(poses)
        return self.areas(chain, bodies, cameras, poses, writeable(places)[None])[:, 0]

    def costs_of(
        self,
        body: Body,
        cameras: Sequence[Camera],
        poses: Array,
        places: Array,
        beta: float,
    ) -> Array:
        """Return the costs (f,) of one body in poses at places (f, 3). SAPSO (4)."""
        areas = self.areas_of(body, cameras, poses, places)
        return np.asarray(self.costs(areas[:, None], beta)[0])


@dataclass(frozen=True, eq=False)
class HeldFrames:
    """Frames with fixed poses, in which bodies are tried."""

    body: Body  # all bodies have its skeleton, with other lengths
    cameras: Sequence[Camera]
    poses: Array = field(repr=False)  # (f, 66)
    places: Array = field(repr=False)  # (f, 3) metres
    frames: ObservedFrames

    @classmethod
    def of(
        cls,
        body: Body,
        cameras: Sequence[Camera],
        observations: Sequence[Observation],
        frames: Sequence[Frame],
    ) -> Self:
        """Return the frames of some observations, with the poses of tracked frames."""
        return cls(
            body,
            cameras,
            np.array([frame.pose for frame in frames]),
            np.array([frame.translation for frame in frames]),
            ObservedFrames.of(observations),
        )

    def costs(
        self, offsets: Array, radii: Array, aligned: bool, beta: float, threads: int = 1
    ) -> Array:
        """Return the mean costs (m,) of bodies over the frames, 0 to 100. SAPSO (4).

        Args:
            offsets: (m, 26, 3) metres, their bones at rest.
            radii: (m, 26, 2) metres.
            aligned: Whether each body is placed to fill the silhouettes' boxes.
            beta: Weight of the missed share, 0 to 1; the spilled share has 1 - beta.
            threads: Number of threads. Does not change the costs.
        """
        chain = self.body.skeleton.chain
        bodies = Bodies(_turned(self.body, offsets), np.ascontiguousarray(radii))
        places = np.repeat(self.places[None], len(offsets), axis=0)
        if aligned:
            self._align(bodies, places)
        drawn = chain, bodies, self.cameras, self.poses, places, threads
        costs = self.frames.costs(self.frames.areas(*drawn), beta)
        total = np.zeros(len(offsets))
        # one by one: the order of a sum decides its last digit
        for of_frame in costs.T:
            total += of_frame
        return total / len(self.poses)

    def _align(self, bodies: Bodies, places: Array) -> None:
        """Move places (m, f, 3) to where bodies fill the silhouettes' boxes."""
        joints = np.empty((*places.shape[:2], len(JOINTS), 3))
        place_bodies(self.body.skeleton.chain, bodies.offsets, self.poses, joints)
        cameras = tuple(stacked(self.cameras))
        borders = self.frames.borders
        align_bodies(joints, _joint_radii(bodies.radii), cameras, borders, places)
