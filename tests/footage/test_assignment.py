"""Which blob is whose: compared with SciPy's solver, and by hand."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from posefit.footage.assignment import cheapest_pairs


@pytest.mark.parametrize("seed", range(40))
def test_the_pairs_cost_as_little_as_scipys(seed: int) -> None:
    rng = np.random.default_rng(seed)
    costs = rng.uniform(size=rng.integers(1, 9, 2))
    # so far apart that they cannot be one person
    costs[rng.random(costs.shape) < 0.3] = 1e6
    rows, columns = linear_sum_assignment(costs)
    assert cheapest_pairs(costs) == list(zip(rows, columns, strict=True))


def test_the_nearest_pair_is_given_up_for_a_smaller_sum() -> None:
    # 0 and 0 are the nearest, but 1 + 3 is less than 0 + 9
    assert cheapest_pairs(np.array([[0.0, 1.0], [3.0, 9.0]])) == [(0, 1), (1, 0)]


def test_of_equal_costs_each_row_has_another_column() -> None:
    pairs = cheapest_pairs(np.zeros((3, 5)))
    assert [row for row, _ in pairs] == [0, 1, 2]
    assert len({column for _, column in pairs}) == 3
