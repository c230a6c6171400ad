"""The cost of a pose: how much the silhouettes of its body differ from the observed ones."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from posefit.arrays import Array, writeable
from posefit.errors import InputError
from posefit.fitting.check import at_least, between
from posefit.fitting.kernels import move_to_borders
from posefit.fitting.space import SearchSpace
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.silhouette.cost import (
    BETA,
    check_square,
    costs_in,
    drawing_of,
    known_views,
    mean_over_views,
    pose_costs,
)
from posefit.silhouette.mask import (
    Areas,
    Silhouette,
    coarser_camera,
    coarser_silhouette,
)
from posefit.silhouette.sharing import parts_of, work_through


def align(
    body: Body,
    cameras: Sequence[Camera],
    silhouettes: Sequence[Silhouette],
    poses: Array,
    anchors: Array,
) -> Array:
    """Return the translations (n, 3) that bring poses (n, 66) to the silhouettes' boxes. Interpretation S4, `aligned`.

    Each border of a box says where the outermost disc of the body must touch, and that is linear in the translation:
    `focal (x + t_x) +- focal radius = (border - centre) (z + t_z)`. All borders of all views are solved for together,
    by least squares, starting from anchors (n, 3). A border at the image's edge is unknown and does not count.
    """
    translations = writeable(anchors.copy())
    move_to_borders(
        writeable(body.skeleton.joints(poses)),
        body.joint_radii(),
        np.array([camera.rotation for camera in cameras]),
        np.array([camera.translation for camera in cameras]),
        np.array([camera.focal for camera in cameras]),
        np.array([camera.centre for camera in cameras]),
        np.array([silhouette.extent for silhouette in silhouettes]),
        translations,
    )
    return translations


@dataclass(frozen=True, eq=False)
class SilhouetteCost:
    """The cost of proposals for one observation, from one camera or several: a pure function. SAPSO (4).

    Call it with proposals (n, d) of its space for their costs (n,), 0 to 100: the mean over the views. A proposal's
    cost has the same bits whatever the others are and however many threads work. A `Problem` counts the calls.

    Args:
        body: the person's.
        cameras: one or several.
        silhouettes: one a camera, of its size.
        space: the box of proposals, and the poses they stand for.
        beta: what the missed share counts, 0 to 1; 1 - beta the spilled share.
        threads: the number that draw; the costs are the same with any.
        blank: whether all silhouettes may be empty, as in the middle of a track.

    """

    body: Body = field(repr=False)
    cameras: Sequence[Camera]
    silhouettes: Sequence[Silhouette] = field(repr=False)
    space: SearchSpace
    beta: float = BETA
    threads: int = 1
    blank: bool = False
    _coarser: dict[int, "SilhouetteCost"] = field(
        init=False, repr=False, default_factory=dict
    )

    def __post_init__(self) -> None:
        if len(self.cameras) != len(self.silhouettes) or not self.cameras:
            raise InputError(
                f"silhouettes must be one a camera ({len(self.cameras)}), got {len(self.silhouettes)}"
            )
        for camera, silhouette in zip(self.cameras, self.silhouettes, strict=True):
            if silhouette.size != (camera.width, camera.height):
                size = (camera.height, camera.width)
                raise InputError(
                    f"mask must have shape {size}, the camera's, got {silhouette.mask.shape}"
                )
        if not self.blank and not any(
            silhouette.mask.any() for silhouette in self.silhouettes
        ):
            raise InputError("silhouettes must show a person, got an empty mask")
        check_square(self.cameras)
        between("beta", self.beta, 0.0, 1.0)
        at_least("threads", self.threads, 1)

    def __call__(self, proposals: Array) -> Array:
        """Return the cost (n,), 0 to 100, of proposals (n, d)."""
        if proposals.shape[1:] != (self.space.dimensions,):
            # raises InputError with this shape, not that of one thread's part
            self.space.decode(proposals)
        if self.on_device:
            return self.cost_and_areas(*self.decode(proposals))[0]
        parts = parts_of(len(proposals), self.threads)
        if len(parts) == 1:
            return self._cost(*self.decode(proposals))
        costs = np.empty(len(proposals))

        def count(part: slice, poses: Array, translations: Array) -> None:
            costs[part] = self._cost(poses, self._aligned(poses, translations))

        work_through(
            parts, self.threads, lambda part: self.space.decode(proposals[part]), count
        )
        return costs

    def coarser(self, factor: int) -> "SilhouetteCost":
        """Return the same cost on every `factor`th pixel of every `factor`th row; made once.

        It has the same space, and a proposal means the same pose. See `posefit.silhouette.mask`.
        """
        if factor not in self._coarser:
            self._coarser[factor] = replace(
                self,
                cameras=[coarser_camera(camera, factor) for camera in self.cameras],
                silhouettes=[
                    coarser_silhouette(silhouette, factor)
                    for silhouette in self.silhouettes
                ],
                blank=True,  # a small silhouette may be empty
            )
        return self._coarser[factor]

    def decode(self, proposals: Array) -> tuple[Array, Array]:
        """Return the poses (n, 66) and translations (n, 3) of proposals (n, d), aligned where the space says so."""
        poses, translations = self.space.decode(proposals)
        return poses, self._aligned(poses, translations)

    def cost_and_areas(self, poses: Array, translations: Array) -> tuple[Array, Areas]:
        """Return the cost (n,) and R, B, Y (views, n, 3) of poses (n, 66) with their root at translations (n, 3)."""
        return pose_costs(
            self.body,
            self.cameras,
            self.silhouettes,
            poses,
            translations,
            self.beta,
            self.threads,
        )

    @cached_property
    def on_device(self) -> bool:
        """Whether a device draws the poses: then all of them at once, and threads have nothing to share."""
        return any(silhouette.device is not None for silhouette in self.silhouettes)

    @cached_property
    def _drawings(self) -> Sequence[tuple[tuple[Any, ...], Silhouette]]:
        views = [
            (drawing_of(self.body, camera, silhouette), silhouette)
            for camera, silhouette in zip(self.cameras, self.silhouettes, strict=True)
        ]
        return known_views(views, self.silhouettes)

    def _cost(self, poses: Array, translations: Array) -> Array:
        """Return the cost (n,) of decoded poses (n, 66) at translations (n, 3), on one thread."""
        return mean_over_views(
            [costs_in(*view, poses, translations, self.beta) for view in self._drawings]
        )

    def _aligned(self, poses: Array, translations: Array) -> Array:
        """Return the translations (n, 3) of decoded poses (n, 66): other ones where the space has them aligned."""
        if self.space.translation != "aligned":
            return translations
        return align(self.body, self.cameras, self.silhouettes, poses, translations)
