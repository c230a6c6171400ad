"""The cost of a pose: how much its silhouettes differ from the observed ones."""

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
from posefit.geometry.camera import Camera, stacked
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
    threads: int = 1,
) -> Array:
    """Return the translations (n, 3) with which poses fill the silhouettes' boxes.

    Interpretation S4, `aligned`. The outermost disc of the body must touch each border
    of a box, and that is linear in the translation: `focal (x + t_x) +- focal radius =
    (border - centre) (z + t_z)`. All borders of all views are solved together, by least
    squares, starting from anchors (n, 3). A border at the edge of the image is unknown
    and does not count.

    Args:
        body: The body.
        cameras: One or several.
        silhouettes: One for each camera.
        poses: The poses (n, 66).
        anchors: Positions (n, 3) of the root in metres, from which the solution starts.
        threads: Number of threads. Does not change the result.

    Returns:
        The translations (n, 3) in metres.

    Example:
        >>> import numpy as np
        >>> from posefit import Body, Camera, Silhouette, load_motion, project
        >>> from posefit.plugin import align
        >>> walk = load_motion("walk")
        >>> body = Body.of(walk.skeleton)
        >>> place = walk.translations[0]
        >>> camera = Camera.around(place, azimuth=0.8, distance=3.5, size=(320, 240))
        >>> observed = Silhouette.of(project(body, camera, walk.poses[0], place))
        >>> start = place[None] + 0.1
        >>> aligned = align(body, [camera], [observed], walk.poses[:1], start)
        >>> bool(np.abs(aligned - place).max() < 0.05)
        True
    """
    translations = writeable(anchors.copy())
    radii = body.joint_radii()
    views = stacked(cameras)
    extents = np.array([silhouette.extent for silhouette in silhouettes])

    def move(part: slice) -> None:
        joints = writeable(body.skeleton.joints(poses[part]))
        move_to_borders(joints, radii, *views, extents, translations[part])

    work_through(parts_of(len(poses), threads), threads, lambda _: (), move)
    return translations


@dataclass(frozen=True, eq=False)
class SilhouetteCost:
    """The cost of proposals for one observation, a pure function. SAPSO (4).

    Call it with proposals (n, d) of its space for their costs (n,), 0 to 100: the mean
    over the views. The cost of a proposal has the same bits in any population
    and with any number of threads. A `Problem` counts the calls.

    Args:
        body: The person's body.
        cameras: One or several.
        silhouettes: One per camera, of its size.
        space: The box of proposals, which decodes them to poses.
        beta: Weight of the missed share, 0 to 1; the spilled share has 1 - beta.
        threads: Number of threads. Does not change the costs.
        blank: Whether all silhouettes may be empty, as in the middle of a track.

    Raises:
        InputError: The numbers of cameras and silhouettes or their sizes differ, all
            silhouettes are empty, pixels are not square, or `beta` or `threads` is out
            of range.

    Example:
        >>> import numpy as np
        >>> import posefit
        >>> walk = posefit.load_motion("walk")
        >>> body = posefit.Body.of(walk.skeleton)
        >>> place = walk.translations[0]
        >>> camera = posefit.Camera.around(place, 0.8, 3.5, (320, 240))
        >>> mask = posefit.project(body, camera, walk.poses[0], place)
        >>> prior = posefit.prior("pca")().fit(walk.poses[:, 3:])
        >>> reach = np.radians([45, 15, 15])
        >>> space = posefit.SearchSpace(prior, np.zeros(3), reach, place)
        >>> cost = posefit.SilhouetteCost(
        ...     body, [camera], [posefit.Silhouette.of(mask)], space
        ... )
        >>> cost(np.zeros((4, space.dimensions))).shape
        (4,)
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
                f"silhouettes must be one for each camera ({len(self.cameras)}),"
                f" got {len(self.silhouettes)}"
            )
        for camera, silhouette in zip(self.cameras, self.silhouettes, strict=True):
            if silhouette.size != (camera.width, camera.height):
                size = (camera.height, camera.width)
                raise InputError(
                    f"mask must have shape {size}, the camera's,"
                    f" got {silhouette.mask.shape}"
                )
        shown = any(silhouette.mask.any() for silhouette in self.silhouettes)
        if not self.blank and not shown:
            raise InputError("silhouettes must show a person, got an empty mask")
        check_square(self.cameras)
        between("beta", self.beta, 0.0, 1.0)
        at_least("threads", self.threads, 1)

    def __call__(self, proposals: Array) -> Array:
        """Return the cost (n,), 0 to 100, of proposals (n, d)."""
        if proposals.shape[1:] != (self.space.dimensions,):
            # checked here, so that the message has this shape, not that of one thread's
            # part
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
        """Return the same cost on every `factor`th pixel of every `factor`th row.

        The result is cached. It has the same space, and a proposal decodes to the same
        pose. See `posefit.silhouette.mask`.
        """
        if factor not in self._coarser:
            cameras = []
            silhouettes = []
            for camera, silhouette in zip(self.cameras, self.silhouettes, strict=True):
                cameras.append(coarser_camera(camera, factor))
                silhouettes.append(coarser_silhouette(silhouette, factor))
            self._coarser[factor] = replace(
                self,
                cameras=cameras,
                silhouettes=silhouettes,
                blank=True,  # a small silhouette may be empty
            )
        return self._coarser[factor]

    def decode(self, proposals: Array) -> tuple[Array, Array]:
        """Return the poses (n, 66) and translations (n, 3) of proposals (n, d).

        They are aligned if the translation of the space is `aligned`.
        """
        poses, translations = self.space.decode(proposals)
        return poses, self._aligned(poses, translations)

    def cost_and_areas(self, poses: Array, translations: Array) -> tuple[Array, Areas]:
        """Return the costs (n,) and R, B, Y (views, n, 3) of poses at translations.

        Args:
            poses: (n, 66).
            translations: (n, 3) metres, the roots.
        """
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
        """Whether a device rasterises the poses: all at once, without threads."""
        return any(silhouette.device is not None for silhouette in self.silhouettes)

    @cached_property
    def _drawings(self) -> Sequence[tuple[tuple[Any, ...], Silhouette]]:
        views = []
        for camera, silhouette in zip(self.cameras, self.silhouettes, strict=True):
            views.append((drawing_of(self.body, camera, silhouette), silhouette))
        return known_views(views, self.silhouettes)

    def _cost(self, poses: Array, translations: Array) -> Array:
        """Return the costs (n,) of decoded poses at translations, on one thread."""
        by_view = []
        for view in self._drawings:
            by_view.append(costs_in(*view, poses, translations, self.beta))
        return mean_over_views(by_view)

    def _aligned(self, poses: Array, translations: Array) -> Array:
        """Return the translations (n, 3) of decoded poses, aligned if needed."""
        if self.space.translation != "aligned":
            return translations
        return align(self.body, self.cameras, self.silhouettes, poses, translations)
