import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posefit.silhouette.mask import Silhouette, pack, unpack


@given(st.integers(1, 200), st.integers(1, 20), st.integers(0, 2**32 - 1))
def test_unpacking_undoes_packing(width: int, height: int, seed: int) -> None:
    mask = np.random.default_rng(seed).random((height, width)) < 0.5
    np.testing.assert_array_equal(unpack(pack(mask), width), mask)


def test_pixel_65_is_bit_1_of_the_second_word() -> None:
    mask = np.zeros((3, 70), dtype=bool)
    mask[2, 65] = True
    bits = pack(mask)
    assert bits.shape[0] == 2
    assert bits[1, 2] == 2
    assert bits.sum() == 2


def test_the_extent_is_the_border_of_the_persons_pixels() -> None:
    mask = np.zeros((10, 20))
    mask[3:7, 5:11] = 1
    assert Silhouette.of(mask).extent == (5.0, 3.0, 11.0, 7.0)


def test_a_border_at_the_images_edge_is_unknown() -> None:
    mask = np.zeros((10, 20))
    mask[3:10, 0:11] = 1
    left, top, right, bottom = Silhouette.of(mask).extent
    assert np.isnan(left)
    assert np.isnan(bottom)
    assert (top, right) == (3.0, 11.0)


def test_unknown_pixels_are_not_the_persons() -> None:
    silhouette = Silhouette.of(np.ones((2, 3)), np.array([[1, 0, 1], [1, 1, 1]]))
    assert silhouette.mask.sum() == 5


def test_shapes_are_checked() -> None:
    with pytest.raises(ValueError, match=r"mask must have shape \(height, width\), got \(3,\)"):
        Silhouette.of(np.zeros(3))
    with pytest.raises(ValueError, match=r"valid must have the mask's shape \(2, 3\), got \(3, 2\)"):
        Silhouette.of(np.zeros((2, 3)), np.zeros((3, 2)))
