"""Forward kinematics in numba: plain functions over arrays, shapes checked by the callers.

LANES poses are moved at a time, side by side in vector registers. All numbers of them are in one flat array, LANES of a
kind after those of another: offsets known to the compiler are what lets it see that loops over lanes may run in
registers. A bone stands here as plain Python, and below it as numba compiles it.
"""

from collections.abc import Sequence
from functools import cache, partial, reduce
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.cgutils import unpack_tuple
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

from posefit.arrays import Array, inlined, jit
from posefit.arrays.calling import address_of, call
from posefit.arrays.instructions import in_all_lanes

LANES = 4  # poses side by side: one vector register of AVX2; with more, a call for one pose takes longer

# pi in two parts, so that angles of many turns keep their digits; then Taylor's coefficients on [-pi/2, pi/2],
# where the first term left out is below 1e-10.
_PI_HIGH, _PI_LOW = 3.141592653589793, 1.2246467991473532e-16

# Where rows of lanes begin: angles that are not 0 in all lanes, each in a slot, and the root's three; their sines and
# cosines; the root's place in the world; a matrix (3, 4) from there to the frame that joints are placed in; bones
# (26, 3) in their own frames; axes (27, 3) of three coordinates; and joints, each coordinate of all 27 in turn.
_ANGLES, _BONES, _JOINTS = 66, 26, 27
_ANGLE, _SINE, _COSINE = (kind * _ANGLES * LANES for kind in range(3))
_PLACE = 3 * _ANGLES * LANES
_VIEW = _PLACE + 3 * LANES
_OFFSET = _VIEW + 12 * LANES
_AXES = _OFFSET + 3 * _BONES * LANES
X, Y, Z = (_AXES + (9 + i) * _JOINTS * LANES for i in range(3))
_END = Z + _JOINTS * LANES
_STILL = -1  # the slot of an angle that is 0 in all lanes
NATURAL = 0x7FFFFFFF  # an index that is provably not negative needs no check whether it counts from the end
_FREEDOM = ("contract", "nsz")  # in rounding: what `jit` allows


class Chain(NamedTuple):
    """A skeleton as the kernel wants it; bones in an order where parents come first."""

    parents: NDArray[np.int64]  # (26,) joint a bone starts from; it ends in joint b + 1
    angles: NDArray[np.int64]  # (26,) index in the pose of the bone's rx, or -1 where it cannot turn
    turns: Array  # (26, 3, 3) parent's frame from this bone's frame, at rest
    turned: NDArray[np.bool_]  # (26,) whether that is more than the identity, as it is for a third of the bones
    offsets: Array  # (26, 3) the bone in its own frame


def chain(parents: NDArray[np.int64], angles: NDArray[np.int64], axes: Array, offsets: Array) -> Chain:
    """Return the constant part of every bone's transform, from rest frames (26, 3, 3) and bone vectors (26, 3)."""
    before = np.concatenate([np.eye(3)[None], axes])[parents]
    turns = np.swapaxes(before, 1, 2) @ axes
    own = np.einsum("bji,bj->bi", axes, offsets)
    turned = np.abs(turns - np.eye(3)).max(axis=(1, 2)) > 1e-12
    return Chain(parents.astype(np.int64), angles.astype(np.int64), turns, turned, own)


def place_bone(chain: Any, b: Any, slots: Any, lanes: Any) -> None:
    """Write the frame of the joint in which bone b ends, from that of the joint it starts from."""
    parent, a, turn = chain.parents[b], chain.angles[b], chain.turns[b]

    def row(first: int, k: int) -> Any:
        return lanes[first + LANES * k : first + LANES * (k + 1)]

    for i in range(3):
        frame = [row(_AXES, 9 * parent + 3 * k + i) for k in range(3)]
        if chain.turned[b]:
            u, v, w = frame
            frame = [u * turn[0, k] + v * turn[1, k] + w * turn[2, k] for k in range(3)]
        for k in (2, 1, 0) if a >= 0 else ():  # Rz @ Ry @ Rx
            if slots[a + k] != _STILL:
                sine, cosine = row(_SINE, slots[a + k]), row(_COSINE, slots[a + k])
                first, second = frame[(k + 1) % 3], frame[(k + 2) % 3]
                frame[(k + 1) % 3] = first * cosine + second * sine
                frame[(k + 2) % 3] = second * cosine - first * sine
        place = row(X, _JOINTS * i + parent)
        for k, axis in enumerate(frame):
            row(_AXES, 9 * (b + 1) + 3 * k + i)[:] = axis
            place = place + axis * row(_OFFSET, 3 * b + k)
        row(X, _JOINTS * i + b + 1)[:] = place


@intrinsic
def _place_bone(typing_context: Any, chain: Any, b: Any, slots: Any, lanes: Any) -> Any:  # noqa: ARG001
    return types.void(chain, types.int64, slots, lanes), _build_bone


@overload(place_bone, inline="always")
def _place_bone_compiled(chain, b, slots, lanes):  # noqa: ARG001
    return lambda chain, b, slots, lanes: _place_bone(chain, b, slots, lanes)  # type: ignore[call-arg]


def _build_bone(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Write `place_bone` as instructions for all lanes at once."""
    number, index = ir.DoubleType(), ir.IntType(64)
    vector = ir.VectorType(number, LANES)
    chain, b, *others = arguments
    kinds = *signature.args[0].types, *signature.args[2:]
    arrays = zip(kinds, [*unpack_tuple(builder, chain), *others], strict=True)
    parents, angles, turns, turned, _, slots, lanes = (
        context.make_array(kind)(context, builder, array).data for kind, array in arrays
    )

    def entry(data: Any, *at: Any) -> Any:
        return builder.load(builder.gep(data, [reduce(builder.add, at)]))

    def times(size: int, value: Any) -> Any:
        return builder.mul(value, index(size))

    def row_of(first: int, value: Any) -> Any:
        place = builder.gep(lanes, [builder.add(times(LANES, value), index(first))])
        return builder.bitcast(place, vector.as_pointer())

    def row(first: int, value: Any) -> Any:
        return builder.load(row_of(first, value), align=8)

    product = partial(builder.fmul, flags=_FREEDOM)
    total = partial(builder.fadd, flags=_FREEDOM)
    difference = partial(builder.fsub, flags=_FREEDOM)

    def changed_where(condition: Any, frame: Sequence[Any], change: Any) -> list[Any]:
        before = builder.block
        with builder.if_then(condition):
            others = change(frame)
            within = builder.block
        chosen = [builder.phi(vector) for _ in frame]
        for either, old, new in zip(chosen, frame, others, strict=True):
            either.add_incoming(old, before)
            either.add_incoming(new, within)
        return chosen

    # a frame is nine vectors: the first coordinate of each axis, then the second, then the third
    def at_rest(frame: Sequence[Any]) -> list[Any]:
        turn = [in_all_lanes(builder, entry(turns, times(9, b), index(k)), LANES) for k in range(9)]
        return [
            total(total(product(u, turn[k]), product(v, turn[3 + k])), product(w, turn[6 + k]))
            for u, v, w in (frame[:3], frame[3:6], frame[6:])
            for k in range(3)
        ]

    def rotated(frame: Sequence[Any]) -> Sequence[Any]:
        for k in (2, 1, 0):
            slot = entry(slots, angle, index(k))
            frame = changed_where(builder.icmp_signed(">=", slot, index(0)), frame, partial(turned_by, k, slot))
        return frame

    def turned_by(k: int, slot: Any, frame: Sequence[Any]) -> list[Any]:
        sine, cosine, changed = row(_SINE, slot), row(_COSINE, slot), list(frame)
        for i in (0, 3, 6):
            first, second = i + (k + 1) % 3, i + (k + 2) % 3
            changed[first] = total(product(frame[first], cosine), product(frame[second], sine))
            changed[second] = difference(product(frame[second], cosine), product(frame[first], sine))
        return changed

    parent, angle = entry(parents, b), entry(angles, b)
    frame = [row(_AXES + LANES * (3 * k + i), times(9, parent)) for i in range(3) for k in range(3)]
    frame = changed_where(builder.trunc(entry(turned, b), ir.IntType(1)), frame, at_rest)
    frame = changed_where(builder.icmp_signed(">=", angle, index(0)), frame, rotated)
    for i, first in enumerate((X, Y, Z)):
        place = row(first, parent)
        for k in range(3):
            axis = frame[3 * i + k]
            builder.store(axis, row_of(_AXES + LANES * (9 + 3 * k + i), times(9, b)), align=8)
            place = total(place, product(axis, row(_OFFSET + LANES * k, times(3, b))))
        builder.store(place, row_of(first + LANES, b), align=8)
    return context.get_dummy_value()


@inlined
def sine_cosine(angle):
    """Return the sine and cosine of an angle. Polynomials, so that they run in vector registers."""
    turns = np.floor(angle * (1.0 / _PI_HIGH) + 0.5)
    x = (angle - turns * _PI_HIGH) - turns * _PI_LOW
    sign = 1.0 - 2.0 * (turns - 2.0 * np.floor(0.5 * turns))
    z = x * x
    s = -1.0 / 1307674368000.0
    s = s * z + 1.0 / 6227020800.0
    s = s * z - 1.0 / 39916800.0
    s = s * z + 1.0 / 362880.0
    s = s * z - 1.0 / 5040.0
    s = s * z + 1.0 / 120.0
    s = s * z - 1.0 / 6.0
    c = 1.0 / 20922789888000.0
    c = c * z - 1.0 / 87178291200.0
    c = c * z + 1.0 / 479001600.0
    c = c * z - 1.0 / 3628800.0
    c = c * z + 1.0 / 40320.0
    c = c * z - 1.0 / 720.0
    c = c * z + 1.0 / 24.0
    c = c * z - 0.5
    return sign * (x + x * z * s), sign * (1.0 + z * c)


@inlined
def empty_lanes():
    """Return room for LANES poses in the world's frame: the slots of angles and the angles in them, and numbers."""
    lanes = np.empty(_END)
    for k in range(12 * LANES):
        lanes[_VIEW + k] = 1.0 if k // LANES % 5 == 0 else 0.0
    return np.empty(2 * _ANGLES, np.int64), lanes


@inlined
def set_view(lanes, first, stop, rotation, translation, focal, centre):
    """Place the joints of some lanes in a camera's picture: x and y in pixels, times the depth, and the depth."""
    for i in range(translation.size):
        for j in range(translation.size + 1):
            own, depth = (rotation[i, j], rotation[2, j]) if j < 3 else (translation[i], translation[2])
            value = focal[i] * own + centre[i] * depth if i < 2 else depth
            for lane in range(first, stop):
                lanes[_VIEW + LANES * (4 * i + j) + lane] = value


@inlined
def set_offsets(lanes, first, stop, offsets):
    """Give some lanes the bones of a body (26, 3)."""
    for b in range(offsets.shape[0]):  # numbers known to the compiler would have it write out every turn
        for i in range(offsets.shape[1]):
            for lane in range(first, stop):
                lanes[_OFFSET + LANES * (3 * b + i) + lane] = offsets[b, i]


@jit
def place_lanes(chain, poses, places, rows, slots, lanes):
    """Write axes and joints of the poses (n, 66), their roots at places (n, 3), that are in these rows (LANES,)."""
    for a in range(_ANGLES):
        slots[a] = 0
    for lane in range(LANES):
        row = poses[rows[lane]]
        for a in range(_ANGLES):
            slots[a] |= row[a] != 0.0
    count = 0
    for a in range(_ANGLES):
        if slots[a] != 0 or a < 3:
            slots[a], slots[_ANGLES + count] = count, a
            count += 1
        else:
            slots[a] = _STILL
    for lane in range(LANES):
        pose, place = poses[rows[lane]], places[rows[lane]]
        for k in range(count):
            lanes[_ANGLE + LANES * k + lane] = pose[slots[_ANGLES + k] & NATURAL]
        for i in range(3):
            lanes[_PLACE + LANES * i + lane] = place[i]
    for k in range(LANES * count):
        lanes[_SINE + k], lanes[_COSINE + k] = sine_cosine(lanes[_ANGLE + k])
    for k in range(LANES):
        sy, sp, sr = lanes[_SINE + k], lanes[_SINE + LANES + k], lanes[_SINE + 2 * LANES + k]
        cy, cp, cr = lanes[_COSINE + k], lanes[_COSINE + LANES + k], lanes[_COSINE + 2 * LANES + k]
        ux, uy, uz = cy * cr + sy * sp * sr, cp * sr, cy * sp * sr - sy * cr
        vx, vy, vz = sy * sp * cr - cy * sr, cp * cr, cy * sp * cr + sy * sr
        wx, wy, wz = sy * cp, -sp, cy * cp
        x, y, z = lanes[_PLACE + k], lanes[_PLACE + LANES + k], lanes[_PLACE + 2 * LANES + k]
        for i in range(3):
            at = _VIEW + 4 * LANES * i + k
            a, b, c = lanes[at], lanes[at + LANES], lanes[at + 2 * LANES]
            lanes[_AXES + LANES * i + k] = a * ux + b * uy + c * uz
            lanes[_AXES + LANES * (3 + i) + k] = a * vx + b * vy + c * vz
            lanes[_AXES + LANES * (6 + i) + k] = a * wx + b * wy + c * wz
            lanes[X + LANES * _JOINTS * i + k] = a * x + b * y + c * z + lanes[at + 3 * LANES]
    for b in range(_BONES):
        place_bone(chain, b, slots, lanes)


@cache
def kinematics() -> Any:
    """Return the address of `place_lanes`, which whatever moves poses calls: it takes seconds to compile."""
    whole, flags, rows = np.empty(0, np.int64), np.empty(0, np.bool_), np.empty((0, 3))
    some = Chain(whole, whole, np.empty((0, 3, 3)), flags, rows)
    return address_of(place_lanes, (some, rows, rows, whole, whole, np.empty(0)))


@jit
def place_frames(kinematics, chain, poses, places, sines, cosines, frames):
    """Write the frames (27, 4, 3) of the joints of a pose (1, 66) at a place (1, 3): three axes and an origin each.

    And the sine and cosine (66,) of its angles.
    """
    slots, lanes = empty_lanes()
    set_offsets(lanes, 0, LANES, chain.offsets)
    call(kinematics, (chain, poses, places, np.zeros(LANES, np.int64), slots, lanes))
    for a in range(_ANGLES):
        moves, at = slots[a] != _STILL, LANES * (slots[a] & NATURAL)
        sines[a], cosines[a] = lanes[_SINE + at] if moves else 0.0, lanes[_COSINE + at] if moves else 1.0
    read_joints(lanes, 0, frames[:, 3])
    for j in range(_JOINTS):
        for k in range(3):
            for i in range(3):
                frames[j, k, i] = lanes[_AXES + LANES * (9 * j + 3 * k + i)]


@inlined
def read_joints(lanes, lane, joints):
    """Write the joints (27, 3) of a lane."""
    for j in range(_JOINTS):
        for i in range(3):
            joints[j, i] = lanes[X + LANES * (_JOINTS * i + j) + lane]


@jit
def joint_positions(kinematics, chain, poses, places):
    """Return the joints (n, 27, 3) of poses (n, 66) with their roots at places (n, 3)."""
    n, rows = poses.shape[0], np.empty(LANES, np.int64)
    joints, (slots, lanes) = np.empty((n, _JOINTS, 3)), empty_lanes()
    set_offsets(lanes, 0, LANES, chain.offsets)
    for first in range(0, n, LANES):
        for lane in range(LANES):
            rows[lane] = min(first + lane, n - 1)
        call(kinematics, (chain, poses, places, rows, slots, lanes))
        for lane in range(min(LANES, n - first)):
            read_joints(lanes, lane, joints[first + lane])
    return joints
