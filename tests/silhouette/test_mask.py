import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posefit.silhouette.mask import Silhouette, pack, unpack


def test_pixel_65_is_bit_1_of_the_third_strip() -> None:
    mask = np.zeros((3, 70), dtype=bool)
    mask[2, 65] = True
    bits = pack(mask)
    assert bits.shape == (4, 4)
    assert bits.view(np.uint32)[2, 2] == 2
    assert bits.sum() == 2


def test_the_extent_is_the_border_of_the_persons_pixels_and_unknown_at_the_images_edge() -> None:
    nan = np.nan
    for rows, columns, extent in (
        ((3, 7), (5, 11), (5.0, 3.0, 11.0, 7.0)),
        ((2, 3), (3, 4), (3.0, 2.0, 4.0, 3.0)),
        ((3, 10), (0, 11), (nan, 3.0, 11.0, nan)),
        ((0, 10), (0, 20), (nan, nan, nan, nan)),
        ((0, 0), (0, 0), (nan, nan, nan, nan)),
    ):
        mask = np.zeros((10, 20))
        mask[slice(*rows), slice(*columns)] = 1
        np.testing.assert_array_equal(Silhouette.of(mask).extent, extent)


def test_shapes_are_checked() -> None:
    for shape in [(), (3,), (0, 3), (3, 0), (2, 2, 3)]:
        with pytest.raises(ValueError, match=r"mask must have shape \(height, width\), got \("):
            Silhouette.of(np.zeros(shape))
    with pytest.raises(ValueError, match=r"valid must have the mask's shape \(2, 3\), got \(3, 2\)"):
        Silhouette.of(np.zeros((2, 3)), np.zeros((3, 2)))


def test_any_value_but_0_is_the_person() -> None:
    for values in (np.array([[0, 255], [1, 0]], np.uint8), np.array([[0.0, 0.5], [-1.0, 0.0]])):
        assert Silhouette.of(values).mask.tolist() == [[False, True], [True, False]]
    silhouette = Silhouette.of(np.ones((2, 3)), np.array([[255, 0, 1], [0, 0, 2]]))
    assert silhouette.valid.tolist() == silhouette.mask.tolist() == [[True, False, True], [False, False, True]]
    assert silhouette.size == (3, 2)
    assert silhouette.pixels == 3


@given(st.integers(1, 150), st.integers(1, 10), st.integers(0, 2**32 - 1))
def test_the_bits_of_a_silhouette_lie_within_the_known_ones(width: int, height: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    silhouette = Silhouette.of(rng.random((height, width)) < 0.5, rng.random((height, width)) < 0.5)
    observed, valid = silhouette.bits
    assert not (observed & ~valid).any()
    np.testing.assert_array_equal(unpack(observed, width, height), silhouette.mask)


def test_small_pieces_apart_have_no_say_in_where_the_borders_are() -> None:
    mask = np.zeros((60, 80), dtype=bool)
    mask[10:50, 30:40] = True  # 400 pixels
    mask[5:9, 60:65] = True  # 20, five per cent of them
    assert Silhouette.of(mask).extent == (30.0, 10.0, 40.0, 50.0)
    mask[20:25, 60:65] = True  # 25, more than six per cent
    assert Silhouette.of(mask).extent == (30.0, 10.0, 65.0, 50.0)
    mask[50, 41] = True  # a corner touches no corner of the large piece's
    mask[50, 40] = True  # but this pixel's corner does: both are of the large piece
    assert Silhouette.of(mask).extent == (30.0, 10.0, 65.0, 51.0)
