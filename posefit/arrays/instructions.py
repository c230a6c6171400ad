"""Instructions for several numbers at once, where numba's loops would not say them so."""

from typing import Any

from llvmlite import ir


def in_all_lanes(builder: Any, value: Any, lanes: int) -> Any:
    """Return a vector that holds a value in each of its lanes."""
    lane = builder.insert_element(ir.Constant(ir.VectorType(value.type, lanes), ir.Undefined), value, ir.IntType(32)(0))
    return builder.shuffle_vector(lane, lane, ir.Constant(ir.VectorType(ir.IntType(32), lanes), [0] * lanes))
