"""Simulated faults of masks: an occluder, holes, a rough edge, a shadow, blobs.

Every corruption has a strength: 0 changes nothing, and 1 is far worse than a good
extraction. Sizes are relative to the person.
"""

from collections.abc import Callable, Mapping

import cv2
import numpy as np

from posefit.silhouette.mask import Mask, box_of

# numbers of spots at strength 1
HOLES = 12
BLOBS = 8
# shares of the person's height: the mean radii of the spots
HOLE_RADIUS = 0.03
BLOB_RADIUS = 0.04
# share of the person's height: blobs lie up to this far to the left and right
BLOB_MARGIN = 0.3
# shares of the person's height at strength 1
SHADOW_HEIGHT = 0.25
EDGE_LENGTH = 0.02  # the length scale of the rough edge, and half its deviation


def corrupted(
    mask: Mask,
    noise: Mapping[str, float],
    rng: np.random.Generator,
    *,
    visibly: bool = True,
) -> Mask:
    """Return a mask with corruptions.

    Args:
        mask: (height, width).
        noise: The strength, 0 to 1, of corruptions by name; see `CORRUPTIONS`.
        rng: The source of random numbers.
        visibly: Whether a strength too small to change a pixel is doubled until it
            does.

    Returns:
        The corrupted mask, or `mask` itself if nothing of it would be left.
    """
    damaged = mask
    for name, corrupt in CORRUPTIONS.items():
        strength = noise.get(name, 0.0)
        if strength > 0.0 and damaged.any():
            before = damaged
            damaged = corrupt(before, strength, rng)
            # otherwise an unchanged frame would count as damaged
            while visibly and strength < 1.0 and np.array_equal(damaged, before):
                strength = min(2.0 * strength, 1.0)
                damaged = corrupt(before, strength, rng)
    return damaged if damaged.any() else mask


def _discs(
    mask: Mask, count: int, radius: float, rng: np.random.Generator, inside: bool
) -> Mask:
    """Return `count` round spots in or around the person.

    `radius` is their mean radius as a share of the person's height.
    """
    left, top, right, bottom = box_of(mask)
    height = bottom - top
    margin = BLOB_MARGIN * height
    drawn = np.zeros(mask.shape, dtype=np.uint8)
    person = np.argwhere(mask)  # (n, 2) rows and columns
    for _ in range(count):
        if inside:
            y, x = person[rng.integers(len(person))]
        else:
            x = rng.uniform(left - margin, right + margin)
            y = rng.uniform(top, bottom)
        pixels = max(1, round(radius * height * rng.uniform(0.5, 1.5)))
        cv2.circle(drawn, (int(x), int(y)), pixels, 1, -1)  # filled
    return drawn.astype(bool)


def holes(mask: Mask, strength: float, rng: np.random.Generator) -> Mask:
    """Return the mask with round holes, as if clothes matched the background."""
    spots = _discs(mask, round(HOLES * strength), HOLE_RADIUS, rng, inside=True)
    return np.asarray(mask & ~spots)


def blobs(mask: Mask, strength: float, rng: np.random.Generator) -> Mask:
    """Return the mask with round blobs around the person, as if other things moved."""
    spots = _discs(mask, round(BLOBS * strength), BLOB_RADIUS, rng, inside=False)
    return np.asarray(mask | spots)


def shadow(mask: Mask, strength: float, rng: np.random.Generator) -> Mask:
    """Return the mask with the person's shadow on the ground.

    Its length is `strength` times the person's height.
    """
    bottom = box_of(mask)[3]
    lean = rng.choice([-1.0, 1.0]) * rng.uniform(0.8, 1.2) * strength
    flat = SHADOW_HEIGHT * strength
    # the person sheared and flattened, with the feet in place
    matrix = np.array([[1.0, -lean, lean * bottom], [0.0, flat, (1.0 - flat) * bottom]])
    height, width = mask.shape
    cast = cv2.warpAffine(
        mask.astype(np.uint8), matrix, (width, height), flags=cv2.INTER_NEAREST
    )
    return np.asarray(mask | cast.astype(bool))


def occluder(mask: Mask, strength: float, rng: np.random.Generator) -> Mask:
    """Return the mask behind an upright bar.

    The bar's width is `strength` times half the person's width.
    """
    left, _, right, _ = box_of(mask)
    width = max(1, round(0.5 * strength * (right - left)))
    start = int(rng.integers(left, max(left + 1, right - width + 1)))
    behind = mask.copy()
    behind[:, start : start + width] = False
    return behind


def jitter(mask: Mask, strength: float, rng: np.random.Generator) -> Mask:
    """Return the mask with an edge that wanders in and out."""
    _, top, _, bottom = box_of(mask)
    length = EDGE_LENGTH * strength * (bottom - top)
    return wandering(mask, 0.0, 2.0 * length, max(1.0, length), rng)


def wandering(
    mask: Mask, rim: float, deviation: float, length: float, rng: np.random.Generator
) -> Mask:
    """Return a mask with its border moved outwards and roughened.

    Args:
        mask: (height, width).
        rim: How far the border moves outwards, in pixels.
        deviation: The standard deviation of the border around that, in pixels.
        length: The length scale of the roughness, in pixels.
        rng: The source of random numbers.

    Returns:
        The mask (height, width).
    """
    inside = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 3)
    outside = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 3)
    smooth = cv2.GaussianBlur(rng.standard_normal(mask.shape), (0, 0), length)
    # (height, width) pixels to the border, positive inside
    distance = inside - outside
    return np.asarray(
        distance + rim + deviation * smooth / max(float(smooth.std()), 1e-9) > 0.0
    )


CORRUPTIONS: dict[str, Callable[[Mask, float, np.random.Generator], Mask]] = {
    "occluder": occluder,
    "holes": holes,
    "jitter": jitter,
    "shadow": shadow,
    "blobs": blobs,
}
