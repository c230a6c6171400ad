"""Whether several cameras can see one person: where their rays meet, and how tall."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array
from posefit.footage.observations import Observations
from posefit.geometry.camera import Camera
from posefit.silhouette.foreground import SAMPLES
from posefit.silhouette.mask import Silhouette, box_of

# share of the person's height by which rays through the middles of masks may miss each
# other
MAX_MISS = 0.7
# limits of a person's apparent height over the real one: crouching or seen from above,
# and with the arms up
MIN_APPARENT_HEIGHT = 0.45
MAX_APPARENT_HEIGHT = 1.9


def extent_of(silhouette: Silhouette) -> tuple[Array, float]:
    """Return the middle (2,) and the height of a silhouette's box, in pixels."""
    left, top, right, bottom = box_of(silhouette.mask)
    return 0.5 * np.array([left + right, top + bottom]), float(bottom - top)


def meeting(cameras: Sequence[Camera], middles: Sequence[Array]) -> tuple[Array, Array]:
    """Return where the rays of cameras meet best.

    Args:
        cameras: n cameras.
        middles: The pixel (2,) of each camera that its ray passes through.

    Returns:
        The point (3,) with the least squared distances from all rays, and its distance
        (n,) from each ray.
    """
    positions = [camera.position for camera in cameras]
    # the projection (3, 3) onto the plane across each ray
    across = list[Array]()
    for camera, middle in zip(cameras, middles, strict=True):
        in_camera = np.array([*((middle - camera.centre) / camera.focal), 1.0])
        ray = camera.rotation.T @ in_camera
        across.append(np.eye(3) - np.outer(ray, ray) / (ray @ ray))
    rays = list(zip(across, positions, strict=True))
    # the normal equations of the least squares
    left = np.sum(across, axis=0)
    right = np.sum([plane @ position for plane, position in rays], axis=0)
    place = np.linalg.lstsq(left, right)[0]
    away = [np.linalg.norm(plane @ (place - position)) for plane, position in rays]
    return place, np.array(away)


# the middle (2,) and the height of the person in each camera's picture, in pixels
Extents = Sequence[tuple[Array, float]]


def shared_extents(observations: Observations) -> list[Extents]:
    """Return the person's extents in some of the frames that all views show."""
    count = len(observations)
    each = [view.usable[:count] for view in observations.views]
    usable = np.flatnonzero(np.all(each, axis=0)).tolist()
    if not usable:
        return []
    shared = list[Extents]()
    for k in np.unique(np.linspace(0, len(usable) - 1, SAMPLES).astype(int)):
        silhouettes = observations[usable[k]].silhouettes
        shared.append([extent_of(silhouette) for silhouette in silhouettes])
    return shared


def apparent_sizes(
    cameras: Sequence[Camera], frames: Sequence[Extents]
) -> tuple[float, Array]:
    """Return the medians of `apparent_size` over frames."""
    misses = []
    heights = []
    for extents in frames:
        miss, tall = apparent_size(cameras, extents)
        misses.append(miss)
        heights.append(tall)
    return float(np.median(misses)), np.asarray(np.median(heights, axis=0))


def apparent_size(cameras: Sequence[Camera], extents: Extents) -> tuple[float, Array]:
    """Return how well several cameras agree on a person's place and height.

    Args:
        cameras: n cameras.
        extents: The middle (2,) and the height of the person in each picture, in
            pixels.

    Returns:
        By how much the rays through the middles miss each other, and how tall (n,) the
        person is in each view, both in the cameras' unit. A height is negative if the
        rays meet behind that camera.
    """
    place, away = meeting(cameras, [middle for middle, _ in extents])
    heights = list[float]()
    for camera, (_, tall) in zip(cameras, extents, strict=True):
        depth = (camera.rotation @ place + camera.translation)[2]
        heights.append(tall * depth / camera.focal[1])
    return 2.0 * float(away.max()), np.array(heights)


def disagreement(miss: float, tall: Array, stature: float) -> str | None:
    """Return why cameras cannot all see one person; None if they can.

    Args:
        miss: By how much their rays miss each other, see `apparent_size`.
        tall: (n,) how tall the person seems in each view.
        stature: The person's height. All are in metres.
    """
    reasons = (
        "the masks show only parts of the person, or another one, "
        "or the calibrations are in another order or unit, or lead from the camera to "
        "the world"
    )
    if miss > MAX_MISS * stature:
        return (
            "expected cameras that see one person, got views that disagree by "
            f"{miss:.1f} m: {reasons}"
        )
    wrong = np.flatnonzero(
        (tall < MIN_APPARENT_HEIGHT * stature) | (tall > MAX_APPARENT_HEIGHT * stature)
    )
    if len(wrong):
        k = int(wrong[0])
        return (
            f"expected a person of {stature:.2f} m, got masks {tall[k]:.2f} m tall in "
            f"view {k + 1}: {reasons}"
        )
    return None
