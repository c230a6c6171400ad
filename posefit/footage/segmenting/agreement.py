"""Do several cameras see one person, and is he as large as he should be? Their masks say so before any search."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array
from posefit.footage.masks import Views
from posefit.geometry.camera import Camera
from posefit.silhouette.mask import Silhouette

FRAMES = 20  # that are looked at, spread over the footage
APART = 0.7  # of the person's height: rays to the middles of his masks that pass each other by more do not meet in him
SHORT, TALL = 0.45, 1.9  # times his height: what he may seem to be, from above, crouching, or with his arms up


def extent_of(silhouette: Silhouette) -> tuple[Array, float]:
    """Return the middle (2,) and the height in pixels of a silhouette's bounding box."""
    rows, columns = np.flatnonzero(silhouette.mask.any(axis=1)), np.flatnonzero(silhouette.mask.any(axis=0))
    middle = 0.5 * np.array([columns[0] + columns[-1] + 1, rows[0] + rows[-1] + 1])
    return middle, float(rows[-1] + 1 - rows[0])


def meeting(cameras: Sequence[Camera], middles: Sequence[Array]) -> tuple[Array, Array]:
    """Return where (3,) the rays of cameras through pixels (2,) meet best, and how far (n,) it is from each."""
    rays = [
        camera.rotation.T @ np.array([*((middle - camera.centre) / camera.focal), 1.0])
        for camera, middle in zip(cameras, middles, strict=True)
    ]
    across = [np.eye(3) - np.outer(ray, ray) / (ray @ ray) for ray in rays]
    positions = [camera.position for camera in cameras]
    place = np.linalg.lstsq(
        np.sum(across, axis=0), np.sum([a @ p for a, p in zip(across, positions, strict=True)], axis=0)
    )[0]
    return place, np.array([np.linalg.norm(a @ (place - p)) for a, p in zip(across, positions, strict=True)])


def disagreement(views: Views, cameras: Sequence[Camera], stature: float) -> str | None:
    """Return what is wrong between the masks of several cameras and a person of a height in metres, if anything."""
    shown = [k for k in range(len(views)) if all(masks.is_usable(k) for masks in views.masks)]
    if not shown:
        return None
    misses, seem = [], []
    for k in np.unique(np.linspace(0, len(shown) - 1, FRAMES).astype(int)):
        extents = [extent_of(silhouette) for silhouette in views[shown[k]].silhouettes]
        place, away = meeting(cameras, [middle for middle, _ in extents])
        depths = [float((camera.rotation @ place + camera.translation)[2]) for camera in cameras]
        misses.append(2.0 * away.max())
        heights = zip(cameras, extents, depths, strict=True)
        seem.append([tall * depth / camera.focal[1] for camera, (_, tall), depth in heights])
    miss, tall = float(np.median(misses)), np.median(seem, axis=0)
    looked = "the masks show only parts of him, or somebody else, or the calibrations are in another order"
    if miss > APART * stature:
        return f"expected cameras that see one person, got views that pass each other by {miss:.1f} m: {looked}"
    wrong = np.flatnonzero((tall < SHORT * stature) | (tall > TALL * stature))
    if len(wrong):
        k = int(wrong[0])
        return f"expected a person of {stature:.2f} m, got masks {tall[k]:.2f} m tall in view {k + 1}: {looked}"
    return None
