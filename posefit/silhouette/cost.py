"""The two-way silhouette cost of many poses, over one view or several."""

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from posefit.arrays import Array, Bits, writeable
from posefit.errors import InputError
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES, Skeleton
from posefit.silhouette import drawn, kernels
from posefit.silhouette.mask import Areas, Mask, Silhouette, unpack
from posefit.silhouette.rasteriser import View, strips_and_words
from posefit.silhouette.sharing import parts_of, work_through

SCALE = 100.0  # S
BETA = 0.5  # beta

# passed in place of images if only the areas are needed
_NO_IMAGES: Bits = np.empty((0, 0, 0), dtype=np.uint64)
T = TypeVar("T")


def drawing_of(body: Body, camera: Camera, silhouette: Silhouette) -> tuple[Any, ...]:
    """Return the arguments of `kernels.count_areas` that come before the poses.

    They can be used for any number of calls.
    """
    observed = kernels.Observed(*silhouette.bits, silhouette.pixels)
    return _drawing(body, camera, observed, _NO_IMAGES)


def _drawing(
    body: Body, camera: Camera, observed: kernels.Observed, images: Bits
) -> tuple[Any, ...]:
    """Return what `drawing_of` does, as plain tuples: see `kernels.count_areas`."""
    view = View(
        camera.rotation,
        camera.translation,
        camera.focal,
        camera.centre,
        camera.width,
        camera.height,
    )
    chain = tuple(body.skeleton.chain)
    return chain, body.radii, tuple(view), tuple(observed), images


def areas(
    body: Body,
    camera: Camera,
    silhouette: Silhouette,
    poses: Array,
    translations: Array,
    threads: int = 1,
) -> Areas:
    """Return the areas R, B, Y of poses. SAPSO (3).

    R is the silhouette without the body, B the body without the silhouette, Y their
    overlap; unknown pixels are in none of them. A bone is not drawn if one of its ends
    is nearer than 5 cm or behind the camera. Pixels are counted on the silhouette's
    device.

    Args:
        body: The body.
        camera: The camera.
        silhouette: The silhouette in the camera's image.
        poses: (n, 66).
        translations: (n, 3) metres, the positions of the root.
        threads: The number of threads; does not change the result.

    Returns:
        R, B, Y (n, 3) in pixels.

    Raises:
        InputError: If shapes do not match, or if a number is not finite.

    Example:
        >>> from posefit import Body, Camera, Silhouette, areas, load_motion, project
        >>> walk = load_motion("walk")
        >>> body = Body.of(walk.skeleton)
        >>> place = walk.translations[0]
        >>> camera = Camera.around(place, azimuth=0.8, distance=3.5, size=(320, 240))
        >>> mask = project(body, camera, walk.poses[0], place)
        >>> counts = areas(
        ...     body, camera, Silhouette.of(mask), walk.poses[:1], walk.translations[:1]
        ... )
        >>> counts[0, :2].tolist(), bool(counts[0, 2] == mask.sum())
        ([0, 0], True)
    """
    # writeable arrays: numba would compile another kernel for read-only ones
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
            f"mask must have shape {(camera.height, camera.width)}, "
            f"got {silhouette.mask.shape}"
        )
    drawn.count_poses(n, silhouette)
    if silhouette.device is not None:
        return silhouette.device.areas(body, camera, silhouette, poses, translations)
    counted = np.empty((n, 3), dtype=np.int64)
    drawing = drawing_of(body, camera, silhouette)

    def count(part: slice) -> None:
        kernels.count_areas(*drawing, poses[part], translations[part], counted[part])

    work_through(parts_of(n, threads), threads, lambda _: (), count)
    return counted


def _check_finite(name: str, values: Array) -> None:
    """Raise InputError if some values are not finite."""
    finite = np.isfinite(values)
    if not finite.all():
        raise InputError(
            f"{name} must be finite, "
            f"got {np.count_nonzero(~finite)} numbers that are not"
        )


def check_square(cameras: Sequence[Camera]) -> None:
    """Raise InputError if a camera's pixels are not square.

    Discs would be drawn instead of the ellipses that such a camera sees.
    """
    for camera in cameras:
        if camera.square:
            continue
        across, down = camera.focal
        raise InputError(
            f"camera must have square pixels, focal lengths that are equal, "
            f"got {across:g} and {down:g}: `posefit.track` resamples masks for that, "
            "and Camera.squared() is the camera of such masks"
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
    """Return the costs of poses, and their areas. SAPSO (3), (4).

    The cost is the mean over the views with known pixels. Each view is counted on its
    silhouette's device.

    Args:
        body: The body.
        cameras: The camera of each view.
        silhouettes: The silhouette of each view.
        poses: (n, 66).
        translations: (n, 3) metres, the positions of the root.
        beta: The weight of missed silhouette; spilled body has the weight 1 - `beta`.
        threads: The number of threads; does not change the result.

    Returns:
        The costs (n,), 0 to 100, and the areas R, B, Y (views, n, 3) in pixels.

    Raises:
        InputError: If the pixels of a camera are not square, if shapes do not match, or
            if a number is not finite.

    Example:
        >>> from posefit import Body, Camera, Silhouette
        >>> from posefit import load_motion, pose_costs, project
        >>> walk = load_motion("walk")
        >>> body = Body.of(walk.skeleton)
        >>> place = walk.translations[0]
        >>> camera = Camera.around(place, azimuth=0.8, distance=3.5, size=(320, 240))
        >>> observed = Silhouette.of(project(body, camera, walk.poses[0], place))
        >>> costs, _ = pose_costs(
        ...     body, [camera], [observed], walk.poses[:9], walk.translations[:9]
        ... )
        >>> float(costs[0]), bool(costs[8] > 5.0)
        (0.0, True)
    """
    check_square(cameras)
    counts = []
    for camera, silhouette in zip(cameras, silhouettes, strict=True):
        counts.append(areas(body, camera, silhouette, poses, translations, threads))
    costs = [mismatch(view, beta) for view in known_views(counts, silhouettes)]
    # one view need not be copied
    stacked = counts[0][None] if len(counts) == 1 else np.stack(counts)
    return mean_over_views(costs), stacked


def mean_over_views(costs: Sequence[Array]) -> Array:
    """Return the mean (n,) of costs (n,), one array for each view."""
    if len(costs) == 1:
        return costs[0]
    # The last digit of a sum of three or more depends on their order; that of the views
    # must not change the mean.
    return np.asarray(np.mean(np.sort(costs, axis=0), axis=0))


def known_views(views: Sequence[T], silhouettes: Sequence[Silhouette]) -> Sequence[T]:
    """Return the views whose silhouettes have known pixels, or else all views."""
    known = []
    for view, silhouette in zip(views, silhouettes, strict=True):
        if silhouette.known:
            known.append(view)
    return known or views


def only_camera(
    cameras: Sequence[Camera], silhouettes: Sequence[Silhouette]
) -> Camera | None:
    """Return the only camera with known pixels; None if there are several.

    A single camera does not see how far away the person is.
    """
    seeing = known_views(cameras, silhouettes)
    return seeing[0] if len(seeing) == 1 else None


def costs_in(
    drawing: tuple[Any, ...],
    silhouette: Silhouette,
    poses: Array,
    translations: Array,
    beta: float = BETA,
) -> Array:
    """Return the costs (n,) of poses (n, 66) at translations (n, 3), without checks.

    `drawing` comes from `drawing_of`. The arrays must be float64, in C order and
    writeable. Nothing is checked, since a search calls this for every population.
    """
    drawn.count_poses(len(poses), silhouette)
    counted = np.empty((len(poses), 3), dtype=np.int64)
    costs = np.zeros(len(poses))
    kernels.count_areas(*drawing, poses, translations, counted)
    kernels.add_mismatch(counted, SCALE, beta, costs)
    return costs


def compile_kernels() -> None:
    """Compile the kernels that every cost needs.

    Called before processes are started, each of which would compile them otherwise.
    """
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
    """Return the costs (n,), 0 to 100, of areas. SAPSO (4), Interpretation S2.

    Args:
        areas: R, B, Y (n, 3) in pixels.
        beta: The weight of missed silhouette; spilled body has the weight 1 - `beta`.

    Returns:
        The costs (n,).

    Raises:
        InputError: If the areas are not numbers of this shape.

    Example:
        >>> from posefit import mismatch
        >>> mismatch([[0, 0, 50], [50, 50, 0], [50, 0, 50]]).tolist()
        [0.0, 100.0, 25.0]
    """
    counts = np.asarray(areas)
    if counts.ndim != 2 or counts.shape[1] != 3 or counts.dtype.kind not in "iuf":
        raise InputError(
            f"areas must be numbers of shape (n, 3), "
            f"got {counts.dtype} of shape {counts.shape}"
        )
    costs = np.zeros(len(counts))
    kernels.add_mismatch(counts, SCALE, beta, costs)
    return costs


def project(body: Body, camera: Camera, pose: Array, translation: Array) -> Mask:
    """Return the mask of one body.

    Args:
        body: The body.
        camera: The camera.
        pose: (66,).
        translation: (3,) metres, the position of the root.

    Returns:
        The mask (height, width) in the camera's image.

    Raises:
        InputError: If shapes do not match, or if a number is not finite.

    Example:
        >>> from posefit import Body, Camera, load_motion, project
        >>> walk = load_motion("walk")
        >>> place = walk.translations[0]
        >>> camera = Camera.around(place, azimuth=0.8, distance=3.5, size=(320, 240))
        >>> mask = project(Body.of(walk.skeleton), camera, walk.poses[0], place)
        >>> mask.shape, bool(mask.any())
        ((240, 320), True)
    """
    if np.shape(pose) != (ANGLES,) or np.shape(translation) != (3,):
        came = f"{np.shape(pose)} and {np.shape(translation)}"
        raise InputError(
            f"pose and translation must have shapes {(ANGLES,)} and (3,), got {came}"
        )
    poses = np.asarray(pose)[None]
    translations = np.asarray(translation)[None]
    return np.asarray(masks_of(body, camera, poses, translations)[0])


def masks_of(body: Body, camera: Camera, poses: Array, translations: Array) -> Mask:
    """Return the masks (n, height, width) of poses (n, 66) at translations (n, 3)."""
    drawn.count_poses(len(poses))
    _check_finite("pose", poses)
    _check_finite("translation", translations)
    nothing = np.zeros(strips_and_words(camera.width, camera.height), dtype=np.uint64)
    images = np.empty((len(poses), *nothing.shape), dtype=np.uint64)
    drawing = _drawing(body, camera, kernels.Observed(nothing, nothing, 0), images)
    unused = np.empty((len(poses), 3), dtype=np.int64)  # areas
    kernels.count_areas(*drawing, writeable(poses), writeable(translations), unused)
    return unpack(images, camera.width, camera.height)
