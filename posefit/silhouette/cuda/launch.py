"""One pose a block of threads: kinematics, cones, bits and their count, in one launch."""

import numpy as np
from numba import cuda, float32, float64, int32, uint32

from posefit.geometry.skeleton import ANGLES, BONES, JOINTS
from posefit.silhouette.cuda.cones import (
    BOUNDS,
    FIRST,
    LAST,
    LINES,
    ROW,
    STOP,
    TOP,
    crossing,
    project_joint,
    word_of,
    write_cone,
)
from posefit.silhouette.cuda.kinematics import place_bones, place_root, write_sine

THREADS = 64  # of a block
MOST = 32  # silhouettes that one launch compares a drawing with
WORDS = 4  # of a row that a thread fills at a time
_ANGLES, _BONES, _JOINTS = ANGLES, len(BONES), len(JOINTS)


@cuda.jit(device=True)
def fill(row, strip, strips, lines, bounds, words):
    """Write `WORDS` words of a row of pixels, from a strip on: those of every cone together."""
    for k in range(WORDS):
        words[k] = np.uint32(0)
    for b in range(_BONES):
        first, last = bounds[FIRST, b], bounds[LAST, b]
        if bounds[ROW, b] <= row < bounds[STOP, b] and first < strip + WORDS and strip <= last:
            low, high = crossing(b, np.float32(row - bounds[TOP, b]), lines)
            for k in range(WORDS):
                start = first + ((strip + k - first) & ~1)
                words[k] |= word_of(low, high, strip + k, first, last, min(start, strips - 2))
                if start == strips - 3 and last == strips - 1:  # the last window of two overlaps the one before it
                    words[k] |= word_of(low, high, strip + k, max(first, strips - 2), last, strips - 2)


@cuda.jit(device=True)
def bound(b, bounds, box):
    """Widen the rows and strips of the whole body by those of cone b, if it is drawn."""
    if bounds[ROW, b] < bounds[STOP, b]:
        cuda.atomic.min(box, 0, bounds[ROW, b])
        cuda.atomic.max(box, 1, bounds[STOP, b])
        cuda.atomic.min(box, 2, bounds[FIRST, b])
        cuda.atomic.max(box, 3, bounds[LAST, b])


@cuda.jit(device=True)
def add_counts(row, strip, strips, words, observed, valid, counts):
    """Add how many pixels of some words of a row are known, and how many are the person's, for each silhouette."""
    for s in range(observed.shape[0]):
        body, overlap = np.int32(0), np.int32(0)
        for k in range(WORDS):
            if words[k] != np.uint32(0) and strip + k < strips:
                body += np.int32(cuda.popc(np.uint32(words[k] & valid[s, strip + k, row])))
                overlap += np.int32(cuda.popc(np.uint32(words[k] & observed[s, strip + k, row])))
        if body > 0:
            cuda.atomic.add(counts, (s, 0), body)
            cuda.atomic.add(counts, (s, 1), overlap)


@cuda.jit
def count_on_device(
    starts,
    angles,
    turned,
    turns,
    offsets,
    radii,
    view,
    width,
    height,
    observed,
    valid,
    pixels,
    poses,
    translations,
    areas,
):
    """Write the areas (n, silhouettes, 3) R, B, Y of poses (n, 66), one a block, each drawn once.

    First come the fields of `Chain`, then radii, then a view (16,): rotation, translation, focal lengths, centre.
    `observed` and `valid` (silhouettes, strips, rows) are bit images as `rasteriser` makes them, in 32-bit words;
    of each silhouette's pixels there are so many (silhouettes,).
    """
    sines = cuda.shared.array(_ANGLES, float64)
    cosines = cuda.shared.array(_ANGLES, float64)
    frames = cuda.shared.array((_JOINTS, 4, 3), float64)
    ends = cuda.shared.array((3, _JOINTS), float64)
    lines = cuda.shared.array((LINES, _BONES), float32)
    bounds = cuda.shared.array((BOUNDS, _BONES), int32)
    box = cuda.shared.array(4, int32)
    counts = cuda.shared.array((MOST, 2), int32)
    words = cuda.local.array(WORDS, uint32)
    i, thread, threads = cuda.blockIdx.x, cuda.threadIdx.x, cuda.blockDim.x
    strips = observed.shape[1]

    for a in range(thread, _ANGLES, threads):
        write_sine(a, poses[i, a], sines, cosines)
    for s in range(thread, MOST, threads):
        counts[s, 0] = counts[s, 1] = 0
    if thread == 0:
        box[0], box[1], box[2], box[3] = height, 0, strips, -1
    cuda.syncthreads()
    if thread < 3:
        place_root(thread, translations[i, thread], sines, cosines, frames)
        place_bones(thread, starts, angles, turned, turns, offsets, sines, cosines, frames)
    cuda.syncthreads()
    for j in range(thread, _JOINTS, threads):
        project_joint(j, frames, view, ends)
    cuda.syncthreads()
    for b in range(thread, _BONES, threads):
        write_cone(b, starts[b], radii, ends, strips, width, height, lines, bounds)
        bound(b, bounds, box)
    cuda.syncthreads()
    rows, across = max(box[1] - box[0], 0), (box[3] - box[2]) // WORDS + 1
    for item in range(thread, rows * across, threads):
        row, strip = box[0] + item % rows, box[2] + item // rows * WORDS
        fill(row, strip, strips, lines, bounds, words)
        add_counts(row, strip, strips, words, observed, valid, counts)
    cuda.syncthreads()
    for s in range(thread, observed.shape[0], threads):
        body, overlap = counts[s, 0], counts[s, 1]
        areas[i, s, 0] = pixels[s] - overlap
        areas[i, s, 1] = body - overlap
        areas[i, s, 2] = overlap
