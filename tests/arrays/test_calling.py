"""A compiled function calls another one by its address."""

import numpy as np

from posefit.arrays import jit
from posefit.arrays.calling import address_of, call


@jit
def scale(values, factor, results):  # type: ignore[no-untyped-def]
    for i in range(values.size):
        results[i] = factor * values[i]


@jit
def add(values, factor, results):  # type: ignore[no-untyped-def]
    for i in range(values.size):
        results[i] = factor + values[i]


@jit
def apply(address, values, results):  # type: ignore[no-untyped-def]
    call(address, (values, 3.0, results))


def test_one_compiled_loop_calls_whatever_stands_at_an_address() -> None:
    values, results = np.array([1.0, 2.0]), np.empty(2)
    values.flags.writeable = False
    for function, expected in ((scale, [3.0, 6.0]), (add, [4.0, 5.0])):
        address = address_of(function, (values, 3.0, results))
        assert address == address_of(function, (values, 7.0, results))
        apply(address, values, results)
        np.testing.assert_array_equal(results, expected)
