"""Poses, costs and pictures of proposals in many scenes, in one compiled call."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from posefit import SearchSpace, SilhouetteCost
from posefit.arrays import Array, Bits
from posefit.geometry.camera import stacked
from posefit.geometry.skeleton import ANGLES, BONES, JOINTS
from posefit.silhouette.cost import mean_over_views, mismatch
from posefit.silhouette.drawn import count_poses, uncounted
from posefit.silhouette.mask import pack
from posefit.silhouette.sharing import LEAST_SHARE, shares_of, work_through
from posefit_envs.kernels import Scenes, align_scenes, draw_scenes, unpack_scenes
from posefit_envs.world import (
    BODY,
    OBSERVED,
    SPLITS,
    Image,
    World,
    body_of,
    first_space,
    instance,
)

Rows = NDArray[np.int64]
_BODY = np.uint16(BODY)
# largest scene, in pixels, that is cached; it takes about 5 kB
LARGEST_REMEMBERED = 2 * 64 * 64
# worlds whose scenes are cached, such as those of training and of a test
REMEMBERED_WORLDS = 4


class SceneRow(NamedTuple):
    """What a stage stores of one observation: one row of each column."""

    centre: Array  # (d,) of the box
    half: Array  # (d,)
    anchor: Array  # (3,) metres
    offsets: Array  # (26, 3) the body's bones
    radii: Array  # (26, 2)
    rotations: Array  # (views, 3, 3)
    places: Array  # (views, 3) the cameras' translations
    focals: Array  # (views, 2)
    centres: Array  # (views, 2)
    observed: Bits  # (views, ...) bit images
    valid: Bits  # (views, ...)
    totals: NDArray[np.int64]  # (views,) pixels of the silhouettes
    joint_radii: Array  # (27,)
    borders: Array  # (views, 4) of the silhouettes
    truth: Array  # (66,) the true pose
    masks: NDArray[np.uint8]  # (height, bytes, views) the silhouettes, a bit a pixel

    @staticmethod
    def of(cost: SilhouetteCost, truth: Array) -> "SceneRow":
        """Return the scene of an observation, and the true pose (66,) in it."""
        views = stacked(cost.cameras)
        masks_of_views = []
        observed = []
        valid = []
        borders = []
        for silhouette in cost.silhouettes:
            shown, known = silhouette.bits
            masks_of_views.append(silhouette.mask)
            observed.append(shown)
            valid.append(known)
            borders.append(silhouette.extent)
        masks = np.stack(masks_of_views, axis=-1)  # (height, width, views)
        return SceneRow(
            centre=cost.space.centre,
            half=cost.space.half,
            anchor=cost.space.anchor,
            offsets=cost.body.skeleton.chain.offsets,
            radii=cost.body.radii,
            rotations=views.rotations,
            places=views.translations,
            focals=views.focals,
            centres=views.centres,
            observed=np.array(observed),
            valid=np.array(valid),
            totals=np.count_nonzero(masks, axis=(0, 1)),
            joint_radii=cost.body.joint_radii(),
            borders=np.array(borders),
            truth=truth,
            masks=np.packbits(masks, axis=1),
        )


def empty_columns(world: World, rows: int) -> SceneRow:
    """Return uninitialised columns for the scenes of a world, with that many rows."""
    width, height = world.size
    views = len(world.view_degrees)
    bits = pack(np.zeros((height, width), dtype=bool)).shape
    d = world.dimensions
    return SceneRow(
        centre=np.empty((rows, d)),
        half=np.empty((rows, d)),
        anchor=np.empty((rows, 3)),
        offsets=np.empty((rows, len(BONES), 3)),
        radii=np.empty((rows, len(BONES), 2)),
        rotations=np.empty((rows, views, 3, 3)),
        places=np.empty((rows, views, 3)),
        focals=np.empty((rows, views, 2)),
        centres=np.empty((rows, views, 2)),
        observed=np.empty((rows, views, *bits), dtype=np.uint64),
        valid=np.empty((rows, views, *bits), dtype=np.uint64),
        totals=np.empty((rows, views), dtype=np.int64),
        joint_radii=np.empty((rows, len(JOINTS))),
        borders=np.empty((rows, views, 4)),
        truth=np.empty((rows, ANGLES)),
        masks=np.empty((rows, height, (width + 7) // 8, views), dtype=np.uint8),
    )


@final
class FirstScenes:
    """The scenes of the first frames of a split's instances, made when first used."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._split = SPLITS[world.split]
        # memory is taken row by row, as scenes are written
        self._columns = empty_columns(world, len(self._split))
        self._made = np.zeros(len(self._split), dtype=bool)

    def scene(self, number: int) -> SceneRow:
        """Return the scene of an instance."""
        row = number - self._split.start
        self._make(row)
        return _read(self._columns, row)

    def scenes(self, numbers: Rows) -> SceneRow:
        """Return the scenes of instances as columns, a row for each number (m,)."""
        rows = numbers - self._split.start
        for row in rows[~self._made[rows]].tolist():
            self._make(row)
        return _read(self._columns, rows)

    def _make(self, row: int) -> None:
        if not self._made[row]:
            scene = _made_scene(self._world, row + self._split.start)
            _write(self._columns, row, scene)
            self._made[row] = True


_first_scenes = lru_cache(maxsize=REMEMBERED_WORLDS)(FirstScenes)


def first_scene(world: World, number: int) -> SceneRow:
    """Return the scene of an instance's first frame.

    Small scenes of the world's own split are cached.
    """
    if _is_small(world) and number in SPLITS[world.split]:
        return _first_scenes(world.default_infos).scene(number)
    return _made_scene(world, number)


def first_scenes(world: World, numbers: Rows) -> SceneRow:
    """Return the scenes of instances (m,) as columns of m rows. See `first_scene`."""
    if _is_small(world):
        return _first_scenes(world.default_infos).scenes(numbers)
    columns = empty_columns(world, len(numbers))
    for row, number in enumerate(numbers.tolist()):
        _write(columns, row, _made_scene(world, number))
    return columns


def _is_small(world: World) -> bool:
    width, height = world.size
    return width * height * len(world.view_degrees) <= LARGEST_REMEMBERED


def _made_scene(world: World, number: int) -> SceneRow:
    made = instance(world, number)
    return SceneRow.of(made.cost(0, first_space(world, made)), made.truth.poses[0])


def _read(columns: SceneRow, rows: int | Rows) -> SceneRow:
    """Return a scene of columns, or columns of m scenes."""
    arrays: Sequence[Any] = columns
    return SceneRow(*[column[rows] for column in arrays])


def _write(columns: SceneRow, rows: int | Rows, scenes: SceneRow) -> None:
    """Write a scene to a row of columns, or columns of m scenes to m rows."""
    arrays: Sequence[NDArray[Any]] = columns
    for column, values in zip(arrays, scenes, strict=True):
        column[rows] = values


class Drawn(NamedTuple):
    """Poses, costs and pictures of proposals, one row per scene.

    Rows of scenes that were not rasterised are meaningless, except where noted.
    """

    poses: Array  # (n, 66)
    translations: Array  # (n, 3)
    costs: Array  # (n,)
    areas: NDArray[np.int64]  # (n, views, 3), zero where a scene was left out
    pictures: Image  # (n, height, width, 2 views)


@final
class Stage:
    """Scenes of one world side by side, one row each, evaluated in one call.

    A row's bits do not depend on the other rows, on their number, or on `threads`.
    """

    def __init__(self, world: World, rows: int, threads: int = 1) -> None:
        width, height = world.size
        views = len(world.view_degrees)
        self.threads = threads
        self.all_rows: Rows = np.arange(rows)
        self._width = width
        self._prior = world.learned
        self._translation = world.translation
        self._chain = body_of(world.motion[0]).skeleton.chain
        self._columns = empty_columns(world, rows)
        # the bodies that were rasterised last, and which rows have one
        self._poses = np.zeros((rows, ANGLES))
        self._translations = np.zeros((rows, 3))
        self._has_body = np.zeros(rows, dtype=bool)
        # a pixel's two bytes: the observed silhouette, and the body drawn over it
        self._backdrops = np.empty((rows, height, width, views), dtype=np.uint16)
        self._no_pictures = np.empty((0, height, width, views), dtype=np.uint16)
        drawn_columns = self._columns._asdict()
        self._scenes = Scenes(*[drawn_columns[name] for name in Scenes._fields])

    @property
    def truths(self) -> Array:
        """The true poses (n, 66)."""
        return self._columns.truth

    @property
    def totals(self) -> NDArray[np.int64]:
        """The pixels (n, views) of the observed silhouettes."""
        return self._columns.totals

    def set_scene(self, row: int, scene: SceneRow) -> None:
        """Set a row's scene, without a body."""
        self._set(row, scene, axis=1)

    def set_scenes(self, rows: Rows, scenes: SceneRow) -> None:
        """Set the scenes of rows (m,), without bodies; `scenes` are columns of them."""
        self._set(rows, scenes, axis=2)

    def _set(self, rows: int | Rows, scenes: SceneRow, axis: int) -> None:
        self._has_body[rows] = False
        _write(self._columns, rows, scenes)
        # bits are unpacked once for each scene, not for each of its pictures
        pixels = np.unpackbits(scenes.masks, axis=axis, count=self._width)
        self._backdrops[rows] = np.multiply(pixels, OBSERVED, dtype=np.uint16)

    def space(self, row: int) -> SearchSpace:
        """Return the box of a row's proposals."""
        columns = self._columns
        return SearchSpace(
            self._prior,
            columns.centre[row, :3].copy(),
            columns.half[row, :3].copy(),
            columns.anchor[row].copy(),
            self._translation,
        )

    def set_body(self, row: int, pose: Array, translation: Array) -> None:
        """Set the body that a row's pictures show."""
        self._poses[row] = pose
        self._translations[row] = translation
        self._has_body[row] = True

    def body(self, row: int) -> tuple[Array, Array] | None:
        """Return a row's body as a pose (66,) and translation (3,), or None."""
        if not self._has_body[row]:
            return None
        return self._poses[row], self._translations[row]

    def pictures(self, rows: Rows) -> Image:
        """Return the pictures (m, height, width, 2 views) of some rows.

        Each shows the body that was rasterised last in its row.
        """
        shown = rows[self._has_body[rows]]
        # after a reset, the usual case, there is no body to draw
        if len(shown) == 0:
            observed = self._backdrops[rows]
            return observed.view(np.uint8)
        pictures = self._backdrops.copy()
        # redrawing a body is not an evaluation
        with uncounted():
            self._drawn(
                self._poses[:, None], self._translations[:, None], shown, pictures
            )
        return pictures[rows].view(np.uint8)

    def draw(self, proposals: Array, rows: Rows) -> Drawn:
        """Return poses, costs and pictures of proposals (n, d), evaluated in some rows.

        The pictures of the other rows show no body.
        """
        poses, translations = self.decode(proposals[:, None], rows)
        # bodies are painted over the copy, and the next proposals need a clean one
        pictures = self._backdrops.copy()
        costs, areas = self._drawn(poses, translations, rows, pictures)
        drawn_poses = poses[:, 0]
        drawn_translations = translations[:, 0]
        # most steps cover all rows: then keep the arrays and copy nothing
        if len(rows) == len(self.all_rows):
            self._poses = drawn_poses
            self._translations = drawn_translations
        else:
            self._poses[rows] = drawn_poses[rows]
            self._translations[rows] = drawn_translations[rows]
        self._has_body[rows] = True
        return Drawn(
            drawn_poses,
            drawn_translations,
            costs[:, 0],
            np.ascontiguousarray(areas[:, :, 0].swapaxes(0, 1)),
            pictures.view(np.uint8),
        )

    def costs(self, proposals: Array, rows: Rows) -> Array:
        """Return the costs (n, k) of proposals (n, k, d), k per scene, in some rows."""
        return self._drawn(*self.decode(proposals, rows), rows, self._no_pictures)[0]

    def decode(self, proposals: Array, rows: Rows) -> tuple[Array, Array]:
        """Return poses (n, k, 66) and translations (n, k, 3) of proposals (n, k, d).

        Aligned translations are set only for `rows`.
        """
        n, k = proposals.shape[:2]
        columns = self._columns
        poses = np.empty((n, k, ANGLES))
        translations = np.empty((n, k, 3))
        latents = np.empty((n, k, len(self._prior.low)))
        finite = unpack_scenes(
            proposals,
            columns.centre,
            columns.half,
            columns.anchor,
            poses,
            translations,
            latents,
        )
        assert finite, "actions are checked, and spaces are finite"
        # one call for the latents of all scenes, which is faster than one for each
        angles = self._prior.inverse_transform(latents.reshape(n * k, -1))
        poses[..., 3:] = angles.reshape(n, k, -1)
        if self._translation == "aligned":
            align_scenes(
                self._chain,
                self._scenes,
                columns.joint_radii,
                columns.borders,
                rows,
                poses,
                translations,
            )
        return poses, translations

    def _drawn(
        self,
        poses: Array,
        translations: Array,
        rows: Rows,
        pictures: NDArray[np.uint16],
    ) -> tuple[Array, NDArray[np.int64]]:
        """Return costs (n, k) and areas (views, n, k, 3) of poses (n, k, 66).

        Only the scenes in `rows` are rasterised; the bodies are painted into
        `pictures`.
        """
        n, k = poses.shape[:2]
        views = self._scenes.places.shape[1]
        count_poses(len(rows) * k * views)
        areas = np.zeros((views, n, k, 3), dtype=np.int64)

        def draw(part: slice) -> None:
            draw_scenes(
                self._chain,
                self._scenes,
                rows[part],
                poses,
                translations,
                areas,
                _BODY,
                pictures,
            )

        shares = min(self.threads, len(rows) * k // LEAST_SHARE)
        parts = shares_of(len(rows), shares)
        work_through(parts, self.threads, lambda _: (), draw)
        # no pixel is unknown here, so the areas alone give the cost
        costs = [mismatch(view) for view in areas.reshape(views, n * k, 3)]
        return mean_over_views(costs).reshape(n, k), areas
