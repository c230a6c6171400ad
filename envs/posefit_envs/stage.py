"""Poses, costs and pictures of proposals: each in a scene of its own, all scenes in one compiled call."""

from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from posefit import Problem
from posefit.arrays import Array
from posefit.geometry.skeleton import ANGLES, BONES, JOINTS
from posefit.silhouette.cost import mean_over_views, mismatch
from posefit.silhouette.drawn import count_poses
from posefit.silhouette.mask import pack
from posefit.silhouette.sharing import LEAST_SHARE, work_through
from posefit_envs.instance import (
    BODY,
    OBSERVED,
    SPLITS,
    Image,
    World,
    body_of,
    first_episode,
)
from posefit_envs.kernels import Scenes, align_scenes, draw_scenes, unpack_scenes

Rows = NDArray[np.int64]
_BODY = np.uint16(BODY)
CAMERA_VALUES = ("rotation", "translation", "focal", "centre")
# pixels of an instance whose values are remembered, in about 5 kB
LARGEST_REMEMBERED = 2 * 64 * 64


class Evaluation(NamedTuple):
    """Poses, costs and pictures of proposals, a row a scene; rows of scenes that were left out mean nothing."""

    poses: Array  # (n, 66)
    translations: Array  # (n, 3)
    costs: Array  # (n,)
    areas: NDArray[np.int64]  # (n, views, 3), zero where a scene was left out
    pictures: Image  # (n, height, width, 2 views)


def values_of(problem: Problem) -> tuple[NDArray[Any], ...]:
    """Return everything of a problem that a stage stores: its masks as bits, its box, and the rest in order."""
    cameras = problem.cameras
    silhouettes = problem.silhouettes
    body = problem.body
    space = problem.space
    masks = np.stack([silhouette.mask for silhouette in silhouettes], axis=-1)
    return (
        np.packbits(masks, axis=1),
        space.centre,
        space.half,
        space.anchor,
        body.skeleton.chain.offsets,
        body.radii,
        *(
            np.array([getattr(camera, name) for camera in cameras])
            for name in CAMERA_VALUES
        ),
        *(
            np.array(bits)
            for bits in zip(
                *(silhouette.bits for silhouette in silhouettes), strict=True
            )
        ),
        np.count_nonzero(masks, axis=(0, 1)),
        body.joint_radii(),
        np.array([silhouette.extent for silhouette in silhouettes]),
    )


def prepared(
    world: World, number: int, evaluations: int
) -> tuple[tuple[NDArray[Any], ...], Array]:
    """Return the values of an instance's first frame, and the true pose; small ones are remembered."""
    width, height = world.size
    remembers = width * height * len(world.view_degrees) <= LARGEST_REMEMBERED
    return (_prepared if remembers else _prepared.__wrapped__)(
        world, number, evaluations
    )


@lru_cache(maxsize=SPLITS["train"][1])
def _prepared(
    world: World, number: int, evaluations: int
) -> tuple[tuple[NDArray[Any], ...], Array]:
    episode = first_episode(world, number, evaluations)
    return values_of(episode.problem), episode.instance.truth.poses[0]


@final
class Stage:
    """Scenes of one world side by side, a row each. What differs between them is stacked, so that one call does all.

    A row has the same bits whatever the others hold, whatever number of rows there is, and however many `threads` draw.
    """

    def __init__(self, world: World, rows: int, threads: int = 1) -> None:
        views, (width, height) = len(world.view_degrees), world.size
        bones = len(BONES)
        bits = pack(np.zeros((height, width), dtype=bool)).shape
        self._width = width
        self._height = height
        self.threads = threads
        self._prior = world.learned
        self._aligned = world.translation == "aligned"
        self._chain = body_of(world.motion[0]).skeleton.chain
        self._scenes = Scenes(
            np.empty((rows, bones, 3)),
            np.empty((rows, bones, 2)),
            np.empty((rows, views, 3, 3)),
            np.empty((rows, views, 3)),
            np.empty((rows, views, 2)),
            np.empty((rows, views, 2)),
            np.empty((rows, views, *bits), dtype=np.uint64),
            np.empty((rows, views, *bits), dtype=np.uint64),
            np.empty((rows, views), dtype=np.int64),
            np.empty((rows, height, width, views), dtype=np.uint16),
        )
        self._joint_radii, self._borders = (
            np.empty((rows, len(JOINTS))),
            np.empty((rows, views, 4)),
        )
        self._first = 6 if world.translation == "searched" else 3
        d = self._first + len(self._prior.low)
        self._centres, self._halves, self._anchors = (
            np.empty((rows, d)),
            np.empty((rows, d)),
            np.empty((rows, 3)),
        )
        boxes = self._centres, self._halves, self._anchors
        self._columns = *boxes, *self._scenes[:-1], self._joint_radii, self._borders
        self.all_rows: Rows = np.arange(rows)

    def set_values(self, row: int, values: tuple[NDArray[Any], ...]) -> None:
        """Make a row the problem, one of the world's, that these are the values of."""
        masks, *others = values
        backdrop = self._scenes.backdrops[row]
        backdrop[:] = np.unpackbits(masks, axis=1, count=self._width)
        backdrop *= OBSERVED
        for array, value in zip(self._columns, others, strict=True):
            array[row] = value

    def pictures(self) -> Image:
        """Return the pictures (n, height, width, 2 views) before the first proposals."""
        return np.array(self._scenes.backdrops).view(np.uint8)

    def evaluate(self, proposals: Array, rows: Rows) -> Evaluation:
        """Return the evaluation of proposals (n, d) in some rows; the others' pictures show no body."""
        several = proposals[:, None]
        whole = len(rows) == len(self.all_rows)
        poses, translations = self.decode(several, rows)
        pictures = (
            np.empty_like(self._scenes.backdrops)
            if whole
            else np.array(self._scenes.backdrops)
        )
        costs, areas = self._drawn(poses, translations, rows, pictures)
        counts = np.ascontiguousarray(areas[:, :, 0].swapaxes(0, 1))
        return Evaluation(
            poses[:, 0],
            translations[:, 0],
            costs[:, 0],
            counts,
            pictures.view(np.uint8),
        )

    def costs(self, proposals: Array, rows: Rows) -> Array:
        """Return the costs (n, k) of proposals (n, k, d), k in each scene, those of some rows."""
        no_pictures = np.empty(
            (0, self._height, self._width, self._scenes.places.shape[1]),
            dtype=np.uint16,
        )
        return self._drawn(*self.decode(proposals, rows), rows, no_pictures)[0]

    def redraw(
        self, poses: Array, translations: Array, rows: Rows, pictures: Image
    ) -> None:
        """Write the pictures of some rows with poses (n, 66) as they are, unaligned."""
        self._drawn(
            poses[:, None], translations[:, None], rows, pictures.view(np.uint16)
        )

    def decode(self, proposals: Array, rows: Rows) -> tuple[Array, Array]:
        """Return the poses (n, k, 66) and translations (n, k, 3) of proposals (n, k, d), those of some rows aligned."""
        poses, translations = self._unpacked(proposals)
        if self._aligned:
            align_scenes(
                self._chain,
                self._scenes,
                self._joint_radii,
                self._borders,
                rows,
                poses,
                translations,
            )
        return poses, translations

    def poses(self, proposals: Array) -> Array:
        """Return the poses (n, 66) of proposals (n, d), wherever they stand."""
        return self._unpacked(proposals[:, None])[0][:, 0]

    def _unpacked(self, proposals: Array) -> tuple[Array, Array]:
        (n, k, d), first = proposals.shape, self._first
        poses = np.empty((n, k, ANGLES))
        translations = np.empty((n, k, 3))
        latents = np.empty((n, k, d - first))
        finite = unpack_scenes(
            proposals,
            self._centres,
            self._halves,
            self._anchors,
            poses,
            translations,
            latents,
        )
        assert finite, "actions are checked, and spaces are finite"
        angles = self._prior.inverse_transform(latents.reshape(n * k, -1))
        poses[..., 3:] = angles.reshape(n, k, -1)
        return poses, translations

    def _drawn(
        self,
        poses: Array,
        translations: Array,
        rows: Rows,
        pictures: NDArray[np.uint16],
    ) -> tuple[Array, NDArray[np.int64]]:
        """Return the costs (n, k) and areas (views, n, k, 3) of poses (n, k, 66) in some rows; write their pictures."""
        n, k = poses.shape[:2]
        views = self._scenes.places.shape[1]
        count_poses(len(rows) * k * views)
        areas = np.zeros((views, n, k, 3), dtype=np.int64)
        at = self._chain, self._scenes
        values = poses, translations, areas, _BODY, pictures
        shares = max(min(self.threads, len(rows), len(rows) * k // LEAST_SHARE), 1)
        if shares == 1:
            draw_scenes(*at, rows, *values)
        else:
            cuts = [len(rows) * share // shares for share in range(shares + 1)]
            parts = [slice(a, b) for a, b in pairwise(cuts)]
            work_through(
                parts,
                self.threads,
                lambda _: (),
                lambda part: draw_scenes(*at, rows[part], *values),
            )
        # every pixel is known
        costs = mean_over_views(
            [mismatch(view) for view in areas.reshape(views, n * k, 3)]
        )
        return costs.reshape(n, k), areas
