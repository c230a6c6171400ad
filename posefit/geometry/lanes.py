"""One bone at a time, four numbers at a time: what numba's loops would not say in vector registers.

The function stands here as plain Python, and below it as numba compiles it.
"""

from collections.abc import Sequence
from functools import partial, reduce
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.cgutils import unpack_tuple
from numba.extending import intrinsic, overload

_ROWS, _COLUMNS = 4, 4  # of a frame; the last row is padding, the last column the place of its origin
_FREEDOM = ("contract", "nsz")  # in rounding: what `jit` allows


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


@intrinsic  # type: ignore[untyped-decorator]
def _place_bone(typing_context: Any, chain: Any, b: Any, sines: Any, cosines: Any, frames: Any) -> Any:  # noqa: ARG001
    return types.void(chain, types.int64, sines, cosines, frames), _build_bone


@overload(place_bone, inline="always")  # type: ignore[untyped-decorator]
def _place_bone_compiled(chain, b, sines, cosines, frames):  # type: ignore[no-untyped-def]  # noqa: ARG001
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
