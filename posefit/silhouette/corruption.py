"""What goes wrong with a silhouette on its way from a camera: holes, blobs, a cast shadow, an occluder, a rough edge.

Every corruption has a strength from 0, nothing, to 1, far more than a good extraction leaves. Sizes follow the person.
"""

from collections.abc import Callable, Mapping

import cv2
import numpy as np

from posefit.silhouette.mask import Mask, box_of

# how many at strength 1
HOLES = 12
BLOBS = 8
SHADOW = 0.25  # how tall a shadow is at strength 1, as a share of the person
EDGE = 0.02  # of the person's height: how far the edge wanders at strength 1


def corrupted(
    mask: Mask,
    noise: Mapping[str, float],
    rng: np.random.Generator,
    *,
    shows: bool = True,
) -> Mask:
    """Return a mask (height, width) with each corruption at its strength; one that would be empty stays as it was.

    A strength too small to change a pixel of this mask is doubled until it does, so that it `shows`.
    """
    spoilt = mask
    for name, corrupt in CORRUPTIONS.items():
        strength = noise.get(name, 0.0)
        if strength > 0.0 and spoilt.any():
            before = spoilt
            spoilt = corrupt(before, strength, rng)
            # otherwise a frame would count as damaged that is not
            while shows and strength < 1.0 and np.array_equal(spoilt, before):
                strength = min(2.0 * strength, 1.0)
                spoilt = corrupt(before, strength, rng)
    return spoilt if spoilt.any() else mask


def _discs(
    mask: Mask, count: int, radius: float, rng: np.random.Generator, inside: bool
) -> Mask:
    """Return round spots in or around the person, whose radii are about a share of the person's height."""
    left, top, right, bottom = box_of(mask)
    drawn = np.zeros(mask.shape, dtype=np.uint8)
    where = np.argwhere(mask)
    for _ in range(count):
        if inside:
            y, x = where[rng.integers(len(where))]
        else:
            x = rng.uniform(left - 0.3 * (bottom - top), right + 0.3 * (bottom - top))
            y = rng.uniform(top, bottom)
        cv2.circle(
            drawn,
            (int(x), int(y)),
            max(1, round(radius * (bottom - top) * rng.uniform(0.5, 1.5))),
            1,
            -1,
        )
    return drawn.astype(bool)


def holes(mask: Mask, strength: float, rng: np.random.Generator) -> Mask:
    """Return the mask with round holes, as where clothes look like the background."""
    return np.asarray(
        mask & ~_discs(mask, round(HOLES * strength), 0.03, rng, inside=True)
    )


def blobs(mask: Mask, strength: float, rng: np.random.Generator) -> Mask:
    """Return the mask with round blobs around the person, as where something else moves."""
    return np.asarray(
        mask | _discs(mask, round(BLOBS * strength), 0.04, rng, inside=False)
    )


def shadow(mask: Mask, strength: float, rng: np.random.Generator) -> Mask:
    """Return the mask with the person's shadow on the ground, as long as `strength` times the person."""
    bottom = box_of(mask)[3]
    lean = rng.choice([-1.0, 1.0]) * rng.uniform(0.8, 1.2) * strength
    flat = SHADOW * strength
    matrix = np.array([[1.0, -lean, lean * bottom], [0.0, flat, (1.0 - flat) * bottom]])
    height, width = mask.shape
    cast = cv2.warpAffine(
        mask.astype(np.uint8), matrix, (width, height), flags=cv2.INTER_NEAREST
    )
    return np.asarray(mask | cast.astype(bool))


def occluder(mask: Mask, strength: float, rng: np.random.Generator) -> Mask:
    """Return the mask behind an upright bar, as wide as `strength` times half the person."""
    left, _, right, _ = box_of(mask)
    wide = max(1, round(0.5 * strength * (right - left)))
    start = int(rng.integers(left, max(left + 1, right - wide + 1)))
    hidden = mask.copy()
    hidden[:, start : start + wide] = False
    return hidden


def jitter(mask: Mask, strength: float, rng: np.random.Generator) -> Mask:
    """Return the mask with an edge that wanders in and out."""
    _, top, _, bottom = box_of(mask)
    reach = EDGE * strength * (bottom - top)
    return wandering(mask, 0.0, 2.0 * reach, max(1.0, reach), rng)


def wandering(
    mask: Mask, rim: float, reach: float, length: float, rng: np.random.Generator
) -> Mask:
    """Return a mask (height, width) whose border is `rim` pixels outside of where it was, and wanders around that.

    `reach` is the standard deviation of how many pixels it wanders, and `length` the pixels over which it does.
    """
    inside = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 3)
    outside = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 3)
    smooth = cv2.GaussianBlur(rng.standard_normal(mask.shape), (0, 0), length)
    return np.asarray(
        inside - outside + rim + reach * smooth / max(float(smooth.std()), 1e-9) > 0.0
    )


CORRUPTIONS: dict[str, Callable[[Mask, float, np.random.Generator], Mask]] = {
    "occluder": occluder,
    "holes": holes,
    "jitter": jitter,
    "shadow": shadow,
    "blobs": blobs,
}
