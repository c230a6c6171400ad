"""The other data of many rows, in packed arrays."""

import numpy as np

from posefit.report.stored import Ordered, Packed, Traces


def test_arrays_of_any_lengths_come_back_in_any_order() -> None:
    packed = Packed()
    values = [[1.5, 2.0], [], [3.0, 4.0, 5.0]]
    for each in values:
        packed.append(np.array(each))
    assert len(packed) == 3
    assert [packed[k].tolist() for k in range(3)] == values
    ordered = Ordered(packed, np.array([2, 0, 2]))
    assert [each.tolist() for each in ordered] == [values[2], values[0], values[2]]


def test_traces_keep_their_evaluations_and_costs() -> None:
    traces = Traces()
    used = [np.array(each, np.float32) for each in ([1, 4], [1, 3, 9], [1, 4], [])]
    costs = [np.linspace(9.0, 5.0, len(each), dtype=np.float32) for each in used]
    for trace in zip(used, costs, strict=True):
        traces.append(trace)
    assert len(traces) == 4
    for k in range(4):
        own_used, own_costs = traces[k]
        np.testing.assert_array_equal(own_used, used[k])
        np.testing.assert_array_equal(own_costs, costs[k])
