"""Tops of a series, and how prominent they are."""

import numpy as np
import pytest

from posefit.measuring.events import _peaks


def test_a_peaks_prominence_is_its_height_above_the_way_to_a_higher_peak() -> None:
    # 5 falls to 1 on its left and to 3 on its right, where 6 is higher
    series = np.array([1.0, 5.0, 3.0, 6.0, 0.0, 2.0, 2.0, 2.0, 1.5])
    assert _peaks(series) == [(1, 2.0), (3, 5.0), (6, 0.5)]


@pytest.mark.parametrize("series", [[1.0], [1.0, 2.0], [3.0, 3.0, 3.0]])
def test_a_series_that_does_not_fall_on_both_sides_has_no_peak(
    series: list[float],
) -> None:
    assert _peaks(np.array(series)) == []


def test_peaks_equal_scipys() -> None:
    signal = pytest.importorskip("scipy.signal")
    rng = np.random.default_rng(7)
    for _ in range(50):
        series = np.round(np.cumsum(rng.standard_normal(80)), 1)
        places, properties = signal.find_peaks(series, prominence=0.0)
        found = _peaks(series)
        assert [place for place, _ in found] == places.tolist()
        np.testing.assert_allclose(
            [prominence for _, prominence in found], properties["prominences"]
        )
