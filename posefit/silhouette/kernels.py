"""Pixels of bodies and limbs counted against silhouettes: numba loops over arrays. Shapes are checked by the callers.

Bit images are as `rasteriser` makes them.
"""

import numpy as np

from posefit.arrays import inlined, jit
from posefit.geometry.kernels import Chain
from posefit.silhouette.rasteriser import NONE, STRIP_PIXELS, View, draw_pose, popcount, scratch


@inlined
def count(image, observed, valid, box):
    """Return the pixels of the body and of its overlap with the observed silhouette, and clear the image."""
    body, overlap = NONE, NONE
    for strip in range(box[2], box[3] + 1):
        words = image[strip][box[0] : box[1]]
        person = observed[strip][box[0] : box[1]]
        known = valid[strip][box[0] : box[1]]
        for i in range(words.size):
            body += popcount(words[i] & known[i])
            overlap += popcount(words[i] & person[i])
        for i in range(words.size):
            words[i] = NONE
    return body, overlap


@jit
def paint_bits(image, box, value, pixels):
    """OR `value` into the pixels (height, width) of the body in a bit image.

    Bits past the image's right border may be set and count for nothing: no pixel stands for them.
    """
    height, width = pixels.shape
    words = image.reshape(-1).view(np.uint32).reshape(image.shape[0], 2 * image.shape[1])
    for y in range(2 * box[0], min(2 * box[1], height)):
        for w in range(box[2], box[3] + 1):
            x = STRIP_PIXELS * w
            word = words[w, y]
            while (word != 0) & (x < width):
                if word & np.uint32(1):
                    pixels[y, x] |= value
                word >>= np.uint32(1)
                x += 1


@jit
def count_areas(
    parents,
    angles,
    turns,
    turned,
    offsets,
    radii,
    rotation,
    translation,
    focal,
    centre,
    width,
    height,
    observed,
    valid,
    pixels,
    poses,
    translations,
    areas,
):
    """Write the areas (n, 3) R, B, Y of poses (n, 66): `observed` and `valid` are bit images, observed within valid.

    Of the observed silhouette's pixels there are so many. First come the fields of `Chain`, then radii, then those of
    `View`: one by one, since to take a tuple apart costs a call twice as much as its arrays do.
    """
    chain = Chain(parents, angles, turns, turned, offsets)
    view = View(rotation, translation, focal, centre, width, height)
    work = scratch(view, parents.size, poses.shape[1])
    silhouette = np.uint64(pixels)
    for i in range(poses.shape[0]):
        image, box = draw_pose(chain, radii, view, poses[i], translations[i], work)
        body, overlap = count(image, observed, valid, box)
        areas[i, 0] = silhouette - overlap
        areas[i, 1] = body - overlap
        areas[i, 2] = overlap


@jit
def add_mismatch(areas, scale, beta, costs):
    """Add the mismatch of areas (n, 3) to costs (n,). SAPSO (4)."""
    for i in range(areas.shape[0]):
        r, b, y = float(areas[i, 0]), float(areas[i, 1]), float(areas[i, 2])
        # Interpretation S2: an empty denominator makes its term 1.
        spilled = b / (b + y) if b + y > 0.0 else 1.0
        missed = r / (r + y) if r + y > 0.0 else 1.0
        costs[i] += scale * ((1.0 - beta) * spilled + beta * missed)  # SAPSO (4)


@jit
def draw_bones(chain, radii, view, poses, translations, images, boxes):
    """Write the bit images (n, strips, words) and boxes (n, 4) of poses (n, 66), whose bones have radii (n, 26, 2).

    A box is as `rasteriser` makes it.
    """
    work = scratch(view, chain.parents.size, poses.shape[1])
    for i in range(poses.shape[0]):
        image, box = draw_pose(chain, radii[i], view, poses[i], translations[i], work)
        for w in range(box[2], box[3] + 1):
            images[i, w][box[0] : box[1]] = image[w][box[0] : box[1]]
            image[w][box[0] : box[1]] = NONE
        for k in range(4):
            boxes[i, k] = box[k]


@jit
def put(limb, image, added, observed, valid):
    """OR a limb's words into an image; return how many pixels are new, of those known and of those observed.

    The new pixels are written to `added`.
    """
    body, overlap = NONE, NONE
    for i in range(limb.size):
        new = limb[i] & ~image[i]
        added[i] = new
        image[i] |= new
        body += np.uint64(popcount(new & valid[i]))
        overlap += np.uint64(popcount(new & observed[i]))
    return body, overlap


@jit
def would_add(limb, image, observed, valid):
    """Return what `put` would, and put nothing."""
    body, overlap = NONE, NONE
    for i in range(limb.size):
        new = limb[i] & ~image[i]
        body += np.uint64(popcount(new & valid[i]))
        overlap += np.uint64(popcount(new & observed[i]))
    return body, overlap


@jit
def take_away(image, added):
    """Clear the pixels of an image that `put` has added."""
    for i in range(image.size):
        image[i] ^= added[i]


@jit
def count_combinations(images, spans, first, combinations, order, observed, valid, areas):
    """Write the areas (m, 3) -Y, B, Y of combinations (m, L): image 0 with, of each limb, the candidate of that index.

    `images` (1 + candidates, words) has limb k's candidates from index `first[k]` on, and their pixels lie in `spans`
    (1 + candidates, 2). In the given order (m,), limbs are put one upon the other, the last one only counted; those
    that a combination shares with the one before it, from the first on, stay.
    """
    limbs = combinations.shape[1]
    image, added = images[0].copy(), np.empty((limbs, images.shape[1]), np.uint64)
    body, overlap = np.zeros(limbs + 1, np.uint64), np.zeros(limbs + 1, np.uint64)
    held = np.full(limbs, -1)
    body[0], overlap[0] = would_add(image, np.zeros_like(image), observed, valid)
    standing = 0
    for i in order:
        shared = 0
        while shared < standing and combinations[i, shared] == held[shared]:
            shared += 1
        for k in range(standing - 1, shared - 1, -1):
            a, b = spans[first[k] + held[k]]
            take_away(image[a:b], added[k, a:b])
        for k in range(shared, limbs):
            at = first[k] + combinations[i, k]
            a, b = spans[at]
            if k < limbs - 1:
                held[k] = combinations[i, k]
                more, shown = put(images[at, a:b], image[a:b], added[k, a:b], observed[a:b], valid[a:b])
            else:
                more, shown = would_add(images[at, a:b], image[a:b], observed[a:b], valid[a:b])
            body[k + 1], overlap[k + 1] = body[k] + more, overlap[k] + shown
        standing = limbs - 1
        y = np.int64(overlap[limbs])
        areas[i, 0] = -y
        areas[i, 1] = np.int64(body[limbs]) - y
        areas[i, 2] = y
