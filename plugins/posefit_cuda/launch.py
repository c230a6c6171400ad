"""One launch per call and one block of threads per pose: from angles to areas.

The steps follow `posefit.geometry.kernels` and `posefit.silhouette.rasteriser`. A
thread takes one world axis of the frames, then joints, bones, and some words of a row.
First come functions that a device has as one instruction: each in plain Python for
numba's simulator, followed by the code that numba compiles for a device.
"""

import math

import numpy as np
from numba import cuda, float32, float64, int32, uint32
from numba.cuda.extending import overload

from posefit.geometry import kernels
from posefit.geometry.kernels import PI_HIGH, PI_LOW
from posefit.geometry.skeleton import ANGLES, BONES, JOINTS
from posefit.silhouette.outlines import FAR, FLAT, NEAR
from posefit.silhouette.rasteriser import HUGE, ONE, WINDOW, ZERO
from posefit.silhouette.spans import BLOCK
from posefit.silhouette.spans import STRIP_PIXELS as STRIP

THREADS = 64  # threads of a block
WORDS = 4  # words of a row that a thread fills together
_ANGLES = ANGLES
_BONES = len(BONES)
_JOINTS = len(JOINTS)
U, V, METRE = range(3)  # rows of `ends`, with a column per joint
# rows of `lines`, with a column per bone
X0, Y0, S0, X1, Y1, S1, XP, MP, PA, PB, XQ, MQ, QA, QB, LINES = range(15)
# rows of `bounds`: first and stop row of the blocks, first and last strip, and the
# cone's first row
ROW, STOP, FIRST, LAST, TOP, BOUNDS = range(6)


def on_device(function):
    """Return the version for a device of a function that is compiled for CPUs."""
    return cuda.jit(device=True)(getattr(function, "py_func", function))


sine_cosine_near_zero = on_device(kernels.sine_cosine_near_zero)
rotated = on_device(kernels.rotated)


def fused(factor, by, addend):
    """Return factor * by + addend in float32, rounded once, as on a CPU with FMA."""
    return np.float32(float(factor) * float(by) + float(addend))


@overload(fused)
def _fused_compiled(factor, by, addend):  # noqa: ARG001
    return lambda factor, by, addend: cuda.fma(factor, by, addend)


def single_root(square):
    """Return the square root of a float32 that is at least 0, as float32."""
    return np.float32(math.sqrt(square))


@overload(single_root)
def _single_root_compiled(square):  # noqa: ARG001
    return lambda square: math.sqrt(square)


def spanned(first, stop):
    """Return a uint32 with the bits from `first` to before `stop` set.

    Both are clipped to 0 to 32.
    """
    bits = (1 << min(max(int(stop), 0), 32)) - (1 << min(max(int(first), 0), 32))
    return np.uint32(max(bits, 0))


@overload(spanned)
def _spanned_compiled(first, stop):  # noqa: ARG001
    def compiled(first, stop):
        a = np.uint64(min(max(first, 0), 32))
        b = np.uint64(min(max(stop, 0), 32))
        if b <= a:
            return np.uint32(0)
        return np.uint32((np.uint64(1) << b) - (np.uint64(1) << a))

    return compiled


def floored(number):
    """Return a number rounded down, in its own type; infinity is not changed."""
    return np.floor(number)


@overload(floored)
def _floored_compiled(number):  # noqa: ARG001
    return lambda number: math.floor(number)


def ceiled(number):
    """Return a number rounded up, in its own type; infinity is not changed."""
    return np.ceil(number)


@overload(ceiled)
def _ceiled_compiled(number):  # noqa: ARG001
    return lambda number: math.ceil(number)


@cuda.jit(device=True)
def write_sine(i, angle, sines, cosines):
    """Write the sine and cosine of one angle, with the same polynomials as on a CPU."""
    turns = floored(angle * (1.0 / PI_HIGH) + 0.5)
    sign = 1.0 - 2.0 * (turns - 2.0 * floored(0.5 * turns))
    sine, cosine = sine_cosine_near_zero((angle - turns * PI_HIGH) - turns * PI_LOW)
    sines[i] = sign * sine
    cosines[i] = sign * cosine


@cuda.jit(device=True)
def place_root(i, place, sines, cosines, frames):
    """Write world coordinate i of the root's three axes and of its position."""
    sy = sines[0]
    sp = sines[1]
    sr = sines[2]
    cy = cosines[0]
    cp = cosines[1]
    cr = cosines[2]
    if i == 0:
        frames[0, 0, i] = cy * cr + sy * sp * sr
        frames[0, 1, i] = sy * sp * cr - cy * sr
        frames[0, 2, i] = sy * cp
    elif i == 1:
        frames[0, 0, i] = cp * sr
        frames[0, 1, i] = cp * cr
        frames[0, 2, i] = -sp
    else:
        frames[0, 0, i] = cy * sp * sr - sy * cr
        frames[0, 1, i] = cy * sp * cr + sy * sr
        frames[0, 2, i] = cy * cp
    frames[0, 3, i] = place


@cuda.jit(device=True)
def place_bones(i, chain, sines, cosines, frames):
    """Write world coordinate i of all frames (27, 4, 3) except the root's.

    The world axes do not depend on each other, so that each has a thread.
    """
    starts, angles, turns, offsets = chain
    for b in range(starts.size):
        p = starts[b]
        a = angles[b]
        x = frames[p, 0, i]
        y = frames[p, 1, i]
        z = frames[p, 2, i]
        u = x * turns[b, 0, 0] + y * turns[b, 1, 0] + z * turns[b, 2, 0]
        v = x * turns[b, 0, 1] + y * turns[b, 1, 1] + z * turns[b, 2, 1]
        w = x * turns[b, 0, 2] + y * turns[b, 1, 2] + z * turns[b, 2, 2]
        if a >= 0:  # Rz @ Ry @ Rx
            u, v = rotated(u, v, sines[a + 2], cosines[a + 2])
            w, u = rotated(w, u, sines[a + 1], cosines[a + 1])
            v, w = rotated(v, w, sines[a], cosines[a])
        frames[b + 1, 0, i] = u
        frames[b + 1, 1, i] = v
        frames[b + 1, 2, i] = w
        frames[b + 1, 3, i] = (
            frames[p, 3, i] + u * offsets[b, 0] + v * offsets[b, 1] + w * offsets[b, 2]
        )


@cuda.jit(device=True)
def project_joint(j, frames, view, ends):
    """Write the projection of joint j in pixels, and the pixels per metre there.

    All are 0 if the joint is not drawn.
    """
    a = frames[j, 3, 0]
    b = frames[j, 3, 1]
    c = frames[j, 3, 2]
    x = view[0] * a + view[1] * b + view[2] * c + view[9]
    y = view[3] * a + view[4] * b + view[5] * c + view[10]
    z = view[6] * a + view[7] * b + view[8] * c + view[11]
    ends[U, j] = ends[V, j] = ends[METRE, j] = 0.0
    if NEAR <= z <= FAR:  # false for nan as well
        depth = 1.0 / z
        ends[U, j] = view[14] + view[12] * x * depth - 0.5
        ends[V, j] = view[15] + view[13] * y * depth - 0.5
        ends[METRE, j] = math.sqrt(view[12] * view[13]) * depth


@cuda.jit(device=True)
def write_segment(k, row, normal, gap, first, last, lines):
    """Write a tangent segment of cone k into four rows of `lines`, from `row` on.

    They are its column, its slope, and the first and last row that it crosses. It
    touches both discs (u, v, radius) in the direction `normal`.
    """
    x, y = normal
    u0, v0, r0 = first
    _, v1, r1 = last
    a = v0 + r0 * y
    b = v1 + r1 * y
    crosses = abs(x) > FLAT and gap > 0.0
    slope = -y / (x if crosses else 1.0)
    lines[row, k] = u0 + r0 * x - a * slope
    lines[row + 1, k] = slope
    lines[row + 2, k] = min(a, b) if crosses else 1.0
    lines[row + 3, k] = max(a, b) if crosses else 0.0


@cuda.jit(device=True)
def write_cone(k, start, radii, ends, size, lines, bounds):
    """Write the bounds, the discs and the tangent segments of cone k.

    Its rows are empty if it is invisible.
    """
    strips, width, height = size
    bounds[ROW, k] = bounds[STOP, k] = 0
    u0 = ends[U, start]
    v0 = ends[V, start]
    r0 = ends[METRE, start] * radii[k, 0]
    u1 = ends[U, k + 1]
    v1 = ends[V, k + 1]
    r1 = ends[METRE, k + 1] * radii[k, 1]
    top = min(max(ceiled(min(v0 - r0, v1 - r1)), 0.0), float(height))
    bottom = max(min(floored(max(v0 + r0, v1 + r1)) + 1.0, float(height)), 0.0)
    left = min(max(ceiled(min(u0 - r0, u1 - r1)), 0.0), float(width))
    right = max(min(floored(max(u0 + r0, u1 + r1)) + 1.0, float(width)), 0.0)
    if not (
        top < bottom
        and left < right
        and min(ends[METRE, start], ends[METRE, k + 1]) > 0.0
    ):
        return
    bounds[ROW, k] = int(top) // BLOCK * BLOCK
    bounds[STOP, k] = min((int(bottom) + BLOCK - 1) // BLOCK * BLOCK, height)
    bounds[FIRST, k] = min(int(left) // STRIP, strips - 2)
    bounds[LAST, k] = (int(right) - 1) // STRIP
    bounds[TOP, k] = int(top)
    dx = u1 - u0
    dy = v1 - v0
    dr = r0 - r1
    dd = dx * dx + dy * dy
    gap = dd - dr * dr
    # the two unit normals n with n . (c1 - c0) = r0 - r1: along the axis, plus or minus
    # across it
    along = dr / max(dd, 1e-30)
    across = math.sqrt(max(gap, 0.0)) / max(dd, 1e-30)
    px = along * dx - across * dy
    py = along * dy + across * dx
    qx = along * dx + across * dy
    qy = along * dy - across * dx
    v0 -= top
    v1 -= top
    lines[X0, k] = u0
    lines[Y0, k] = v0
    lines[S0, k] = r0 * r0
    lines[X1, k] = u1
    lines[Y1, k] = v1
    lines[S1, k] = r1 * r1
    write_segment(k, XP, (px, py), gap, (u0, v0, r0), (u1, v1, r1), lines)
    write_segment(k, XQ, (qx, qy), gap, (u0, v0, r0), (u1, v1, r1), lines)


@cuda.jit(device=True)
def crossing(k, y, lines):
    """Return the first and last column of cone k in row y, counted from its first row.

    If the cone does not cross the row, the first column is HUGE. All numbers are
    float32, as on a CPU.
    """
    low = HUGE
    high = -HUGE
    if lines[PA, k] <= y <= lines[PB, k]:
        x = fused(lines[MP, k], y, lines[XP, k])
        low = high = x
    if lines[QA, k] <= y <= lines[QB, k]:
        x = fused(lines[MQ, k], y, lines[XQ, k])
        low = min(low, x)
        high = max(high, x)
    away = y - lines[Y0, k]
    square = fused(-away, away, lines[S0, k])
    if square >= ZERO:
        half = single_root(square)
        low = min(low, lines[X0, k] - half)
        high = max(high, lines[X0, k] + half)
    away = y - lines[Y1, k]
    square = fused(-away, away, lines[S1, k])
    if square >= ZERO:
        half = single_root(square)
        low = min(low, lines[X1, k] - half)
        high = max(high, lines[X1, k] + half)
    return low, high


@cuda.jit(device=True)
def word_of(low, high, strip, first, last, start):
    """Return the bits of a span in one strip; the cone has strips `first` to `last`.

    Columns are counted from the first pixel of the window of two strips that begins at
    strip `start`. A CPU does the same, so that both round in the same way.
    """
    if strip < first or strip > last:
        return np.uint32(0)
    column = np.float32(STRIP * start)
    stop = min(np.float32(STRIP * (last + 1)) - column, WINDOW)
    a = np.int32(ceiled(max(low - column, ZERO)))
    b = np.int32(min(high - column + ONE, stop))
    before = STRIP * (strip - start)
    return spanned(a - before, b - before)


@cuda.jit(device=True)
def fill(row, strip, strips, lines, bounds, words):
    """Write `WORDS` words of a row of pixels, from a strip on, filled by all cones."""
    for k in range(WORDS):
        words[k] = np.uint32(0)
    for b in range(_BONES):
        first = bounds[FIRST, b]
        last = bounds[LAST, b]
        if (
            bounds[ROW, b] <= row < bounds[STOP, b]
            and first < strip + WORDS
            and strip <= last
        ):
            low, high = crossing(b, np.float32(row - bounds[TOP, b]), lines)
            for k in range(WORDS):
                start = first + ((strip + k - first) & ~1)
                words[k] |= word_of(
                    low, high, strip + k, first, last, min(start, strips - 2)
                )
                # the last window of two overlaps the one before it
                if start == strips - 3 and last == strips - 1:
                    words[k] |= word_of(
                        low, high, strip + k, max(first, strips - 2), last, strips - 2
                    )


@cuda.jit(device=True)
def bound(b, bounds, box):
    """Widen the body's box of rows and strips by cone b, if it is drawn."""
    if bounds[ROW, b] < bounds[STOP, b]:
        cuda.atomic.min(box, 0, bounds[ROW, b])
        cuda.atomic.max(box, 1, bounds[STOP, b])
        cuda.atomic.min(box, 2, bounds[FIRST, b])
        cuda.atomic.max(box, 3, bounds[LAST, b])


@cuda.jit(device=True)
def add_counts(row, strip, strips, words, observed, valid, counts):
    """Count the known pixels and the person's pixels in some words of a row."""
    body = np.int32(0)
    overlap = np.int32(0)
    for k in range(WORDS):
        if words[k] != np.uint32(0) and strip + k < strips:
            body += np.int32(cuda.popc(np.uint32(words[k] & valid[strip + k, row])))
            overlap += np.int32(
                cuda.popc(np.uint32(words[k] & observed[strip + k, row]))
            )
    if body > 0:
        cuda.atomic.add(counts, 0, body)
        cuda.atomic.add(counts, 1, overlap)


@cuda.jit
def count_on_device(chain, radii, view, size, observed, poses, translations, areas):
    """Write the areas R, B, Y of poses, one pose per block.

    Args:
        chain: The skeleton, a `Chain`.
        radii: Radii (26, 2) of the bones' cones, in metres.
        view: Rotation, translation, focal lengths and centre in one array (16,).
        size: Width and height in pixels.
        observed: The bit images (strips, rows) of the person and of valid pixels, as
            32-bit words in the layout of `rasteriser`, and the number of the person's
            pixels (1,).
        poses: The poses (n, 66).
        translations: The positions (n, 3) of their roots, in metres.
        areas: The areas (n, 3) in pixels, which are written.
    """
    width, height = size
    person, valid, pixels = observed
    starts = chain[0]
    sines = cuda.shared.array(_ANGLES, float64)
    cosines = cuda.shared.array(_ANGLES, float64)
    frames = cuda.shared.array((_JOINTS, 4, 3), float64)
    ends = cuda.shared.array((3, _JOINTS), float64)
    lines = cuda.shared.array((LINES, _BONES), float32)
    bounds = cuda.shared.array((BOUNDS, _BONES), int32)
    box = cuda.shared.array(4, int32)
    counts = cuda.shared.array(2, int32)
    words = cuda.local.array(WORDS, uint32)
    i = cuda.blockIdx.x
    thread = cuda.threadIdx.x
    threads = cuda.blockDim.x
    strips = person.shape[0]

    # after each step the threads wait, because the next one reads what all have written
    for a in range(thread, _ANGLES, threads):
        write_sine(a, poses[i, a], sines, cosines)
    if thread == 0:
        counts[0] = 0
        counts[1] = 0
        # an empty box, which `bound` widens
        box[0] = height
        box[1] = 0
        box[2] = strips
        box[3] = -1
    cuda.syncthreads()
    if thread < 3:
        place_root(thread, translations[i, thread], sines, cosines, frames)
        place_bones(thread, chain, sines, cosines, frames)
    cuda.syncthreads()
    for j in range(thread, _JOINTS, threads):
        project_joint(j, frames, view, ends)
    cuda.syncthreads()
    for b in range(thread, _BONES, threads):
        write_cone(b, starts[b], radii, ends, (strips, width, height), lines, bounds)
        bound(b, bounds, box)
    cuda.syncthreads()
    # only the part of the picture that the body can cover
    rows = max(box[1] - box[0], 0)
    across = (box[3] - box[2]) // WORDS + 1
    for item in range(thread, rows * across, threads):
        row = box[0] + item % rows
        strip = box[2] + item // rows * WORDS
        fill(row, strip, strips, lines, bounds, words)
        add_counts(row, strip, strips, words, person, valid, counts)
    cuda.syncthreads()
    if thread == 0:
        body = counts[0]
        overlap = counts[1]
        areas[i, 0] = pixels[0] - overlap
        areas[i, 1] = body - overlap
        areas[i, 2] = overlap
