"""Units of length, recognised by how tall a person stands."""

import numpy as np
import pytest

from posefit.geometry.units import METRES, UNITS, Unit, metres_of, unit_of
from tests.cases import each


@each(("unit", "stature"), [(unit, stature) for unit in UNITS for stature in (1.2, 1.5, 1.74, 2.0)])
def test_a_stature_is_recognised_in_every_unit(unit: Unit, stature: float) -> None:
    assert unit_of(stature / METRES[unit]) == unit


def test_a_length_that_nobody_has_in_any_unit_is_none() -> None:
    for length in (0.0, -1.7, np.nan, np.inf, 0.01, 9.0, 10_000.0):
        assert unit_of(length) is None
    with pytest.raises(ValueError, match="unit must be one of m, cm, mm, inch, foot, cmu, got 'yard'"):
        metres_of("yard")  # type: ignore[arg-type]
