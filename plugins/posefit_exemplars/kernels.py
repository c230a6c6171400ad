"""Poses to keep of clips, and those that a beam may go on to, in numba: plain functions over arrays."""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

from posefit.arrays import jit
from posefit.arrays.instructions import in_all_lanes

DIMENSIONS = 24  # of a code: what it leaves out of the joints is below 5 mm
TILE = 32  # codes side by side: four vector registers of AVX2, whose sums need not wait for each other


def lower(least: Any, start: Any, code: Any, tile: Any) -> None:
    """Lower `least` (TILE,) to `start` and the squared distances of the codes of a tile (DIMENSIONS, TILE) from one."""
    away = np.full(TILE, start, dtype=np.float32)
    for d in range(DIMENSIONS):
        away += (tile[d] - code[d]) ** 2
    least[:] = np.minimum(least, away)


@intrinsic
def _lower(typing_context: Any, least: Any, start: Any, code: Any, tile: Any) -> Any:  # noqa: ARG001
    return types.void(least, types.float32, code, tile), _build_lower


@overload(lower, inline="always")
def _lower_compiled(least, start, code, tile):  # noqa: ARG001
    return lambda least, start, code, tile: _lower(least, start, code, tile)  # type: ignore[call-arg]


def _build_lower(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Write `lower` as instructions for a whole tile at once."""
    vector, index = ir.VectorType(ir.FloatType(), TILE), ir.IntType(64)
    least, code, tile = (context.make_array(signature.args[k])(context, builder, arguments[k]).data for k in (0, 2, 3))

    def lanes(data: Any, at: int) -> Any:
        return builder.bitcast(builder.gep(data, [index(at)]), vector.as_pointer())

    away = in_all_lanes(builder, arguments[1], TILE)
    for d in range(DIMENSIONS):
        middle = in_all_lanes(builder, builder.load(builder.gep(code, [index(d)])), TILE)
        step = builder.fsub(builder.load(lanes(tile, TILE * d), align=4), middle)
        away = builder.fadd(away, builder.fmul(step, step, flags=("contract",)), flags=("contract",))
    before = builder.load(lanes(least, 0), align=4)
    nearer = builder.select(builder.fcmp_ordered("<", away, before), away, before)
    builder.store(nearer, lanes(least, 0), align=4)
    return context.get_dummy_value()


@jit
def keep_apart(codes, least, kept):
    """Return how many frames of a clip are kept, of codes (T, D), and write them to `kept` (T,).

    They are the first, the last, and each whose squared distance from the one kept before it is above `least`.
    """
    kept[0] = 0
    count, last = 1, len(codes) - 1
    for k in range(1, len(codes)):
        away = np.float32(0.0)
        for d in range(codes.shape[1]):
            step = codes[k, d] - codes[kept[count - 1], d]
            away += step * step
        if k == last or away > least:
            kept[count] = k
            count += 1
    return count


@jit
def nearest_codes(some, near, tiles, bounds, squares, places):
    """Write which `places` (n, count) of tiles are nearest to `some` codes (n, D), and their squared distances.

    Looked at are the groups `near` (n, g) each; see `cheapest_steps`. The nearest comes first; where there are fewer
    than `count`, squared distances are infinite.
    """
    away = np.empty(TILE, dtype=np.float32)
    squares[:], places[:] = np.inf, 0
    for i in range(len(some)):
        for g in near[i]:
            for t in range(bounds[g], bounds[g + 1]):
                away[:] = np.inf
                lower(away, np.float32(0.0), some[i], tiles[t])
                for k in range(TILE):
                    at = squares.shape[1] - 1
                    if away[k] < squares[i, at]:
                        while at > 0 and away[k] < squares[i, at - 1]:
                            squares[i, at], places[i, at] = squares[i, at - 1], places[i, at - 1]
                            at -= 1
                        squares[i, at], places[i, at] = away[k], TILE * t + k


@jit
def cheapest_steps(ahead, ways, totals, rows, near, tiles, bounds, scale, limit, least, owners, touched):
    """Return how many poses some states of a beam go on to, each by its cheapest step.

    `ahead` (speeds, n, D) is where clips go on, `ways` (speeds, n) what the root's way costs there; `rows` are the
    states of the beam, `near` (n, g) the groups that each looks at; `tiles` (T, D, TILE) are the codes of all poses,
    group by group from the tiles `bounds` (G + 1,) on. A step costs the squared distance of codes by `scale`. `least`
    (T TILE,) has to hold infinity; it gets the totals below `limit`, `owners` whose they are, and `touched` which
    places of tiles they are.
    """
    count = 0
    nearest = np.empty(TILE, dtype=np.float32)
    for r in rows:
        if totals[r] >= limit:
            continue
        enough = np.float32((limit - totals[r]) / scale)
        for g in near[r]:
            for t in range(bounds[g], bounds[g + 1]):
                nearest[:] = enough
                for s in range(len(ahead)):
                    lower(nearest, np.float32(ways[s, r] / scale), ahead[s, r], tiles[t])
                for k in range(TILE):
                    if nearest[k] < enough:
                        total, place = totals[r] + scale * nearest[k], TILE * t + k
                        if total < least[place]:
                            if least[place] == np.inf:
                                touched[count] = place
                                count += 1
                            least[place], owners[place] = total, r
    return count
