"""Pixels of bodies counted against silhouettes: numba loops over arrays.

Bit images have the layout of `rasteriser`. The callers check shapes.
"""

from typing import NamedTuple

import numpy as np

from posefit.arrays import Bits, inlined, jit
from posefit.geometry.kernels import LANES, Chain, set_rows
from posefit.silhouette.rasteriser import (
    NONE,
    View,
    fill_pose,
    outline_poses,
    set_scene,
    work_arrays,
)
from posefit.silhouette.spans import STRIP_PIXELS, popcount

ONE_BIT = np.uint64(1)


class Observed(NamedTuple):
    """A silhouette, in the form that the kernels take."""

    person: Bits  # bit image of the person's pixels, all of them valid
    valid: Bits  # bit image of the known pixels
    pixels: int  # number of the person's pixels


@inlined
def count(image, person, valid, box):
    """Return the body's pixels and their overlap with the person; clear the image."""
    body = NONE
    overlap = NONE
    for strip in range(box.first_strip, box.last_strip + 1):
        words = image[strip][box.first_word : box.stop_word]
        shown = person[strip][box.first_word : box.stop_word]
        known = valid[strip][box.first_word : box.stop_word]
        for i in range(words.size):
            body += popcount(words[i] & known[i])
            overlap += popcount(words[i] & shown[i])
        for i in range(words.size):
            words[i] = NONE
    return body, overlap


@jit
def paint_bits(image, box, value, pixels):
    """OR `value` into pixels (height, width) where the body in a bit image is.

    Bits beyond the image's right border may be set; they have no pixel and are skipped.
    """
    height, width = pixels.shape
    words = (
        image.reshape(-1).view(np.uint32).reshape(image.shape[0], 2 * image.shape[1])
    )
    for y in range(2 * box.first_word, min(2 * box.stop_word, height)):
        for strip in range(box.first_strip, box.last_strip + 1):
            first = STRIP_PIXELS * strip
            word = np.uint64(words[strip, y])
            # From set bit to set bit: a branch for every pixel would be mispredicted at
            # every border.
            while word != NONE:
                lowest = word & (~word + ONE_BIT)
                x = first + np.intp(popcount(lowest - ONE_BIT))
                if x < width:
                    pixels[y, x] |= value
                word ^= lowest


@jit
def count_areas(chain, radii, view, observed, images, poses, translations, areas):
    """Write the areas (n, 3) R, B, Y of poses (n, 66).

    The bodies' bit images are written to `images` (n, strips, words), unless it is
    empty. `chain`, `view` and `observed` are plain tuples of the fields of Chain, View
    and Observed: each NamedTuple among the arguments takes numba as long as filling
    half a pose.
    """
    chain = Chain(chain[0], chain[1], chain[2], chain[3])
    view = View(view[0], view[1], view[2], view[3], view[4], view[5])
    observed = Observed(observed[0], observed[1], observed[2])
    n = poses.shape[0]
    silhouette = np.uint64(observed.pixels)
    person = observed.person
    valid = observed.valid
    rows = np.empty(LANES, np.int64)
    work = work_arrays(person.shape[0], person.shape[1])
    set_scene(work, 0, LANES, chain.offsets, radii, view)
    for first in range(0, n, LANES):
        set_rows(rows, first, n)
        stride = outline_poses(
            chain, poses, translations, rows, view.width, view.height, work
        )
        for lane in range(min(LANES, n - first)):
            image, box = fill_pose(lane, stride, work)
            i = first + lane
            if images.size:
                for strip in range(image.shape[0]):
                    for k in range(image.shape[1]):
                        images[i, strip, k] = image[strip, k]
            body, overlap = count(image, person, valid, box)
            areas[i, 0] = silhouette - overlap  # SAPSO (3)
            areas[i, 1] = body - overlap
            areas[i, 2] = overlap


@jit
def add_mismatch(areas, scale, beta, costs):
    """Add the mismatch of areas (n, 3) to costs (n,). SAPSO (4)."""
    for i in range(areas.shape[0]):
        r = float(areas[i, 0])
        b = float(areas[i, 1])
        y = float(areas[i, 2])
        # Interpretation S2: a term with the denominator 0 is 1.
        spilled = b / (b + y) if b + y > 0.0 else 1.0
        missed = r / (r + y) if r + y > 0.0 else 1.0
        costs[i] += scale * ((1.0 - beta) * spilled + beta * missed)  # SAPSO (4)
