"""Forward kinematics in numba: plain functions over arrays, shapes checked by the callers.

A bone stands here as plain Python, and below it as numba compiles it, four numbers at a time: its loops would not have
it in vector registers.
"""

from collections.abc import Sequence
from functools import partial, reduce
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.cgutils import unpack_tuple
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

from posefit.arrays import Array, inlined, jit

# pi in two parts, so that angles of many turns keep their digits; then Taylor's coefficients on [-pi/2, pi/2],
# where the first term left out is below 1e-10.
_PI_HIGH, _PI_LOW = 3.141592653589793, 1.2246467991473532e-16

_ROWS, _COLUMNS = 4, 4  # of a frame; the last row is padding, the last column the place of its origin
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


def place_bone(chain: Any, b: Any, sines: Any, cosines: Any, frames: Any) -> None:
    """Write the frame of the joint in which bone b ends, from that of the joint it starts from.

    Each of `frames` (27, 4, 4) is three axes and an origin: three world coordinates, and a fourth number to fill up.
    """
    a, turn, offset = chain.angles[b], chain.turns[b], chain.offsets[b]
    for i in range(_ROWS - 1):
        u, v, w, place = (frames[chain.parents[b], k, i] for k in range(_COLUMNS))
        if chain.turned[b]:
            u, v, w = (u * turn[0, k] + v * turn[1, k] + w * turn[2, k] for k in range(3))
        if a >= 0:  # Rz @ Ry @ Rx
            u, v = u * cosines[a + 2] + v * sines[a + 2], v * cosines[a + 2] - u * sines[a + 2]
            u, w = u * cosines[a + 1] - w * sines[a + 1], w * cosines[a + 1] + u * sines[a + 1]
            v, w = v * cosines[a] + w * sines[a], w * cosines[a] - v * sines[a]
        frames[b + 1, 0, i], frames[b + 1, 1, i], frames[b + 1, 2, i] = u, v, w
        frames[b + 1, 3, i] = place + u * offset[0] + v * offset[1] + w * offset[2]


@intrinsic
def _place_bone(typing_context: Any, chain: Any, b: Any, sines: Any, cosines: Any, frames: Any) -> Any:  # noqa: ARG001
    return types.void(chain, types.int64, sines, cosines, frames), _build_bone


@overload(place_bone, inline="always")
def _place_bone_compiled(chain, b, sines, cosines, frames):  # noqa: ARG001
    return lambda chain, b, sines, cosines, frames: _place_bone(chain, b, sines, cosines, frames)  # type: ignore[call-arg]


def _build_bone(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Write `place_bone` as instructions for the four rows of a column."""
    number, index = ir.DoubleType(), ir.IntType(64)
    column = ir.VectorType(number, _ROWS)
    chain, b, *others = arguments
    kinds = *signature.args[0].types, *signature.args[2:]
    arrays = zip(kinds, [*unpack_tuple(builder, chain), *others], strict=True)
    parents, angles, turns, turned, offsets, sines, cosines, frames = (
        context.make_array(kind)(context, builder, array).data for kind, array in arrays
    )

    def entry(data: Any, *at: Any) -> Any:
        return builder.load(builder.gep(data, [reduce(builder.add, at)]))

    def times(size: int, value: Any) -> Any:
        return builder.mul(value, index(size))

    def place_of(joint: Any, k: int) -> Any:
        at = builder.add(times(_ROWS * _COLUMNS, joint), index(_ROWS * k))
        return builder.bitcast(builder.gep(frames, [at]), column.as_pointer())

    def in_all_rows(value: Any) -> Any:
        lane = builder.insert_element(ir.Constant(column, ir.Undefined), value, ir.IntType(32)(0))
        return builder.shuffle_vector(lane, lane, ir.Constant(ir.VectorType(ir.IntType(32), _ROWS), [0] * _ROWS))

    product = partial(builder.fmul, flags=_FREEDOM)
    total = partial(builder.fadd, flags=_FREEDOM)
    difference = partial(builder.fsub, flags=_FREEDOM)

    def changed_where(condition: Any, axes: Sequence[Any], change: Any) -> list[Any]:
        before = builder.block
        with builder.if_then(condition):
            others = change(*axes)
            within = builder.block
        chosen = [builder.phi(column) for _ in axes]
        for either, old, new in zip(chosen, axes, others, strict=True):
            either.add_incoming(old, before)
            either.add_incoming(new, within)
        return chosen

    def at_rest(u: Any, v: Any, w: Any) -> list[Any]:
        p, q, r = ([in_all_rows(entry(turns, times(9, b), index(3 * row + k))) for k in range(3)] for row in range(3))
        return [total(total(product(u, p[k]), product(v, q[k])), product(w, r[k])) for k in range(3)]

    def rotated(u: Any, v: Any, w: Any) -> tuple[Any, Any, Any]:
        sine, cosine = ([in_all_rows(entry(of, angle, index(k))) for k in range(3)] for of in (sines, cosines))

        def turned_by(k: int, first: Any, second: Any) -> tuple[Any, Any]:
            return (
                total(product(first, cosine[k]), product(second, sine[k])),
                difference(product(second, cosine[k]), product(first, sine[k])),
            )

        u, v = turned_by(2, u, v)
        w, u = turned_by(1, w, u)
        v, w = turned_by(0, v, w)
        return u, v, w

    parent, own, angle = entry(parents, b), builder.add(b, index(1)), entry(angles, b)
    axes = [builder.load(place_of(parent, k), align=8) for k in range(3)]
    axes = changed_where(builder.trunc(entry(turned, b), ir.IntType(1)), axes, at_rest)
    axes = changed_where(builder.icmp_signed(">=", angle, index(0)), axes, rotated)
    origin = builder.load(place_of(parent, 3), align=8)
    for k in range(3):
        builder.store(axes[k], place_of(own, k), align=8)
        origin = total(origin, product(axes[k], in_all_rows(entry(offsets, times(3, b), index(k)))))
    builder.store(origin, place_of(own, 3), align=8)
    return context.get_dummy_value()


@inlined
def sines_cosines(angles, sines, cosines):
    """Write the sine and cosine of each angle. A plain loop of polynomials, so that it runs in vector registers."""
    for i in range(angles.size):
        turns = np.floor(angles[i] * (1.0 / _PI_HIGH) + 0.5)
        x = (angles[i] - turns * _PI_HIGH) - turns * _PI_LOW
        sign = 1.0 - 2.0 * (turns - 2.0 * np.floor(0.5 * turns))
        z = x * x
        s = -1.0 / 1307674368000.0
        s = s * z + 1.0 / 6227020800.0
        s = s * z - 1.0 / 39916800.0
        s = s * z + 1.0 / 362880.0
        s = s * z - 1.0 / 5040.0
        s = s * z + 1.0 / 120.0
        s = s * z - 1.0 / 6.0
        sines[i] = sign * (x + x * z * s)
        c = 1.0 / 20922789888000.0
        c = c * z - 1.0 / 87178291200.0
        c = c * z + 1.0 / 479001600.0
        c = c * z - 1.0 / 3628800.0
        c = c * z + 1.0 / 40320.0
        c = c * z - 1.0 / 720.0
        c = c * z + 1.0 / 24.0
        c = c * z - 0.5
        cosines[i] = sign * (1.0 + z * c)


@inlined
def place_frames(chain, pose, translation, sines, cosines, frames):
    """Write the frames (27, 4, 4) of the joints of one pose (66,): three axes and an origin, as `place_bone` has them.

    `sines` and `cosines` (66,) are scratch.
    """
    sines_cosines(pose, sines, cosines)
    sy, sp, sr = sines[0], sines[1], sines[2]
    cy, cp, cr = cosines[0], cosines[1], cosines[2]
    root = frames[0]
    root[0, 0] = cy * cr + sy * sp * sr
    root[1, 0] = sy * sp * cr - cy * sr
    root[2, 0] = sy * cp
    root[0, 1] = cp * sr
    root[1, 1] = cp * cr
    root[2, 1] = -sp
    root[0, 2] = cy * sp * sr - sy * cr
    root[1, 2] = cy * sp * cr + sy * sr
    root[2, 2] = cy * cp
    for i in range(3):
        root[3, i] = translation[i]
    for b in range(chain.parents.size):
        place_bone(chain, b, sines, cosines, frames)


@inlined
def place_joints(chain, pose, translation, sines, cosines, frames, joints):
    """Write the joints (27, 3) of one pose (66,), and what `place_frames` does."""
    place_frames(chain, pose, translation, sines, cosines, frames)
    for j in range(joints.shape[0]):
        for i in range(3):
            joints[j, i] = frames[j, 3, i]


@inlined
def empty_frames(joints):
    """Return room for the frames of so many joints, no number of it undefined."""
    frames = np.empty((joints, 4, 4))
    for j in range(joints):
        for k in range(4):
            frames[j, k, 3] = 0.0
    return frames


@jit
def joint_positions(chain, poses, translations):
    """Return the joints (n, 27, 3) of poses (n, 66) with their root at translations (n, 3)."""
    n, count = poses.shape[0], chain.parents.size + 1
    joints = np.empty((n, count, 3))
    sines, cosines = np.empty(poses.shape[1]), np.empty(poses.shape[1])
    frames = empty_frames(count)
    for i in range(n):
        place_joints(chain, poses[i], translations[i], sines, cosines, frames, joints[i])
    return joints
