"""The two-way silhouette cost of many poses, over one view or several."""

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, Bits, writeable
from posefit.errors import InputError
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES, Skeleton
from posefit.silhouette import drawn, kernels
from posefit.silhouette.mask import Mask, Silhouette, unpack
from posefit.silhouette.rasteriser import View, strips_and_words
from posefit.silhouette.sharing import parts_of, work_through

SCALE = 100.0  # S
BETA = 0.5  # beta

Areas = NDArray[np.int64]  # (..., 3): R, B, Y
# where only the areas are wanted
_NO_IMAGES: Bits = np.empty((0, 0, 0), dtype=np.uint64)
T = TypeVar("T")


def drawing_of(body: Body, camera: Camera, silhouette: Silhouette) -> tuple[Any, ...]:
    """Return the arguments of `kernels.count_areas` before the poses. Made once, they hold for any number of calls."""
    return _drawing(
        body, camera, kernels.Observed(*silhouette.bits, silhouette.pixels), _NO_IMAGES
    )


def _drawing(
    body: Body, camera: Camera, observed: kernels.Observed, images: Bits
) -> tuple[Any, ...]:
    view = View(
        camera.rotation,
        camera.translation,
        camera.focal,
        camera.centre,
        camera.width,
        camera.height,
    )
    return body.skeleton.chain, body.radii, view, observed, images


def areas(
    body: Body,
    camera: Camera,
    silhouette: Silhouette,
    poses: Array,
    translations: Array,
    threads: int = 1,
) -> Areas:
    """Return R, B, Y (n, 3) in pixels of poses (n, 66) with their root at translations (n, 3). SAPSO (3).

    R is silhouette without body, B body without silhouette, Y both; unknown pixels are in none. A bone with an end
    nearer than 5 cm or behind the camera is not drawn. The counts do not depend on n or `threads`. They are made on
    the silhouette's device. Raises InputError where shapes do not fit or poses are not finite.
    """
    # Fresh, writeable arrays: numba would compile another kernel for read-only ones.
    poses = writeable(poses)
    translations = writeable(translations)
    n = len(poses)
    if poses.ndim != 2 or poses.shape[1] != ANGLES:
        raise InputError(f"poses must have shape (n, {ANGLES}), got {poses.shape}")
    if translations.shape != (n, 3):
        raise InputError(
            f"translations must have shape {(n, 3)}, got {translations.shape}"
        )
    _check_finite("poses", poses)
    _check_finite("translations", translations)
    if silhouette.mask.shape != (camera.height, camera.width):
        raise InputError(
            f"mask must have shape {(camera.height, camera.width)}, got {silhouette.mask.shape}"
        )
    drawn.count_poses(n, silhouette)
    if silhouette.device == "cuda":
        from posefit.silhouette.cuda.areas import areas_on_device

        return areas_on_device(body, camera, silhouette, poses, translations)
    counted = np.empty((n, 3), dtype=np.int64)
    drawing = drawing_of(body, camera, silhouette)

    def count(part: slice) -> None:
        kernels.count_areas(*drawing, poses[part], translations[part], counted[part])

    work_through(parts_of(n, threads), threads, lambda _: (), count)
    return counted


def _check_finite(name: str, values: Array) -> None:
    if not np.isfinite(values).all():
        raise InputError(
            f"{name} must be finite, got {np.count_nonzero(~np.isfinite(values))} numbers that are not"
        )


def check_square(cameras: Sequence[Camera]) -> None:
    """Raise InputError where the pixels of a camera are not square: discs are drawn where ellipses are seen."""
    for camera in cameras:
        if camera.square:
            continue
        across, down = camera.focal
        raise InputError(
            f"camera must have square pixels, focal lengths that are equal, got {across:g} and {down:g}: "
            "`posefit.track` resamples masks for that, and Camera.squared() is the camera of such masks"
        )


def pose_costs(
    body: Body,
    cameras: Sequence[Camera],
    silhouettes: Sequence[Silhouette],
    poses: Array,
    translations: Array,
    beta: float = BETA,
    threads: int = 1,
) -> tuple[Array, Areas]:
    """Return the cost (n,) of poses (n, 66) at translations (n, 3), and their R, B, Y (views, n, 3). SAPSO (3), (4).

    The cost is the mean over the views of which something is known. Each view is counted on its silhouette's device.
    Raises InputError where the pixels of a camera are not square.
    """
    check_square(cameras)
    views = zip(cameras, silhouettes, strict=True)
    counts = [areas(body, *view, poses, translations, threads) for view in views]
    costs = [mismatch(view, beta) for view in known_views(counts, silhouettes)]
    return mean_over_views(costs), counts[0][None] if len(counts) == 1 else np.stack(
        counts
    )


def mean_over_views(costs: Sequence[Array]) -> Array:
    """Return the mean (n,) of costs (n,), one array a view."""
    if len(costs) == 1:
        return costs[0]
    # sums of three or more depend on their order in the last digit, and views have none
    return np.asarray(np.mean(np.sort(costs, axis=0), axis=0))


def known_views(views: Sequence[T], silhouettes: Sequence[Silhouette]) -> Sequence[T]:
    """Return those views of which something is known; all of them where nothing is."""
    return [
        view
        for view, silhouette in zip(views, silhouettes, strict=True)
        if silhouette.known
    ] or views


def only_camera(
    cameras: Sequence[Camera], silhouettes: Sequence[Silhouette]
) -> Camera | None:
    """Return the camera that alone sees the person, and so cannot see how far away they are; None where several do."""
    seeing = known_views(cameras, silhouettes)
    return seeing[0] if len(seeing) == 1 else None


def costs_in(
    drawing: tuple[Any, ...],
    silhouette: Silhouette,
    poses: Array,
    translations: Array,
    beta: float = BETA,
) -> Array:
    """Return the cost (n,) of poses (n, 66) at translations (n, 3), with what `drawing_of` says of the silhouette.

    The arrays are as the kernel wants them: a search calls this for every population, and nothing is checked again.
    """
    drawn.count_poses(len(poses), silhouette)
    counted = np.empty((len(poses), 3), dtype=np.int64)
    kernels.count_areas(*drawing, poses, translations, counted)
    return mismatch(counted, beta)


def compile_kernels() -> None:
    """Compile what every cost needs, before processes are started each of which would compile it."""
    point = Body(
        Skeleton("point", np.zeros((26, 3)), np.tile(np.eye(3), (26, 1, 1)), ()),
        np.zeros((26, 2)),
    )
    camera = Camera.around(np.zeros(3), 0.0, 1.0, (8, 8))
    place = np.zeros((1, 3))
    pose = np.zeros((1, ANGLES))
    point.skeleton.joints(pose, place)
    pose_costs(point, [camera], [Silhouette.of(np.ones((8, 8)))], pose, place)


def mismatch(areas: Areas, beta: float = BETA) -> Array:
    """Return the cost (n,) of areas R, B, Y (n, 3), 0 to 100. SAPSO (4), Interpretation S2.

    Raises InputError where the areas have another shape.
    """
    counts = np.asarray(areas)
    if counts.ndim != 2 or counts.shape[1] != 3 or counts.dtype.kind not in "iuf":
        raise InputError(
            f"areas must be numbers of shape (n, 3), got {counts.dtype} of shape {counts.shape}"
        )
    costs = np.zeros(len(counts))
    kernels.add_mismatch(counts, SCALE, beta, costs)
    return costs


def project(body: Body, camera: Camera, pose: Array, translation: Array) -> Mask:
    """Return the mask (height, width) of one body, pose (66,), root at translation (3,)."""
    if np.shape(pose) != (ANGLES,) or np.shape(translation) != (3,):
        came = f"{np.shape(pose)} and {np.shape(translation)}"
        raise InputError(
            f"pose and translation must have shapes {(ANGLES,)} and (3,), got {came}"
        )
    return np.asarray(
        masks_of(body, camera, np.asarray(pose)[None], np.asarray(translation)[None])[0]
    )


def masks_of(body: Body, camera: Camera, poses: Array, translations: Array) -> Mask:
    """Return the masks (n, height, width) of bodies, poses (n, 66), roots at translations (n, 3)."""
    drawn.count_poses(len(poses))
    _check_finite("pose", poses)
    _check_finite("translation", translations)
    nothing = np.zeros(strips_and_words(camera.width, camera.height), dtype=np.uint64)
    images = np.empty((len(poses), *nothing.shape), dtype=np.uint64)
    drawing = _drawing(body, camera, kernels.Observed(nothing, nothing, 0), images)
    uncounted = np.empty((len(poses), 3), dtype=np.int64)
    kernels.count_areas(*drawing, writeable(poses), writeable(translations), uncounted)
    return unpack(images, camera.width, camera.height)
