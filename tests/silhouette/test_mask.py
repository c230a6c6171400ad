"""Masks and their bits; areas by law and the cost by hand; half and quarter size: the same rays, fewer of them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posefit import Body, Camera, areas, project
from posefit.geometry.skeleton import ANGLES
from posefit.silhouette.drawn import PoseCount, count_poses
from posefit.silhouette.mask import (
    Silhouette,
    coarser_camera,
    coarser_silhouette,
    pack,
    unpack,
)
from tests.silhouette.twin import TIE, body_distance


def test_pixel_65_is_bit_1_of_the_third_strip() -> None:
    mask = np.zeros((3, 70), dtype=bool)
    mask[2, 65] = True
    bits = pack(mask)
    assert (bits.shape, bits.view(np.uint32)[2, 2], bits.sum()) == ((4, 4), 2, 2)


def test_the_extent_is_the_border_of_the_persons_pixels_and_unknown_at_the_images_edge() -> (
    None
):
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
        with pytest.raises(
            ValueError, match=r"mask must have shape \(height, width\), got \("
        ):
            Silhouette.of(np.zeros(shape))
    with pytest.raises(
        ValueError, match=r"valid must have the mask's shape \(2, 3\), got \(3, 2\)"
    ):
        Silhouette.of(np.zeros((2, 3)), np.zeros((3, 2)))


def test_silhouettes_whose_pixels_are_all_known_share_them_and_cannot_change_them() -> (
    None
):
    first = Silhouette.of(np.eye(3))
    second = Silhouette.of(np.zeros((3, 3)))
    assert first.valid is second.valid
    assert first.valid.all()
    with pytest.raises(ValueError, match="read-only"):
        first.valid[0, 0] = False
    assert Silhouette.of(np.zeros((3, 4))).valid.shape == (3, 4)


def test_any_value_but_0_is_the_person() -> None:
    for values in (
        np.array([[0, 255], [1, 0]], np.uint8),
        np.array([[0.0, 0.5], [-1.0, 0.0]]),
    ):
        assert Silhouette.of(values).mask.tolist() == [[False, True], [True, False]]
    silhouette = Silhouette.of(np.ones((2, 3)), np.array([[255, 0, 1], [0, 0, 2]]))
    assert (
        silhouette.valid.tolist()
        == silhouette.mask.tolist()
        == [[True, False, True], [False, False, True]]
    )
    assert (silhouette.size, silhouette.pixels) == ((3, 2), 3)


@given(st.integers(1, 150), st.integers(1, 10), st.integers(0, 2**32 - 1))
def test_the_bits_of_a_silhouette_lie_within_the_known_ones(
    width: int, height: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    silhouette = Silhouette.of(
        rng.random((height, width)) < 0.5, rng.random((height, width)) < 0.5
    )
    observed, valid = silhouette.bits
    assert not (observed & ~valid).any()
    np.testing.assert_array_equal(unpack(observed, width, height), silhouette.mask)


def test_small_separate_pieces_do_not_move_the_borders() -> None:
    mask = np.zeros((60, 80), dtype=bool)
    mask[10:50, 30:40] = True  # 400 pixels
    mask[5:9, 60:65] = True  # 20, five per cent of them
    assert Silhouette.of(mask).extent == (30.0, 10.0, 40.0, 50.0)
    mask[20:25, 60:65] = True  # 25, more than six per cent
    assert Silhouette.of(mask).extent == (30.0, 10.0, 65.0, 50.0)
    mask[50, 41] = True  # a corner touches no corner of the large piece's
    mask[50, 40] = True  # but this pixel's corner does: both are of the large piece
    assert Silhouette.of(mask).extent == (30.0, 10.0, 65.0, 51.0)


def test_half_and_quarter_size_by_hand() -> None:
    camera = Camera(
        320,
        240,
        np.array([300.0, 310.0]),
        np.array([160.0, 120.0]),
        np.eye(3),
        np.zeros(3),
    )
    half = coarser_camera(camera, 2)
    quarter = coarser_camera(camera, 4)
    assert (half.width, half.height, quarter.width, quarter.height) == (
        160,
        120,
        80,
        60,
    )
    np.testing.assert_allclose(half.focal, [150.0, 155.0])
    # pixels 1, 3, 5, ...: the centre of pixel 0 at half size, 0.5, is that of pixel 1, 1.5; so 160 is (160 - 1.5) / 2 + 0.5
    np.testing.assert_allclose(half.centre, [79.75, 59.75])
    # pixels 2, 6, 10, ...: 160 is (160 - 2.5) / 4 + 0.5
    np.testing.assert_allclose(quarter.centre, [39.875, 29.875])
    small = coarser_camera(replace(camera, width=5, height=3), 2)
    assert (small.width, small.height) == (2, 1)


def test_a_coarser_picture_has_every_kth_pixel_of_the_full_size(
    body: Body,
) -> None:
    for size in [(96, 72), (101, 75), (321, 240)]:
        for factor in [1, 2, 3, 4, 7]:
            camera = Camera.around(np.zeros(3), 0.4, 3.5, size)
            rng = np.random.default_rng(0)
            first = factor // 2
            for _ in range(5):
                pose = rng.normal(0.0, 0.4, ANGLES)
                place = rng.uniform(-0.4, 0.4, 3)
                whole = Silhouette.of(
                    project(body, camera, pose, place), rng.random(size[::-1]) < 0.8
                )
                clear = np.abs(body_distance(body, camera, pose, place)) > TIE
                few = (slice(first, None, factor),) * 2
                small = project(body, coarser_camera(camera, factor), pose, place)
                np.testing.assert_array_equal(
                    small[clear[few]],
                    project(body, camera, pose, place)[few][clear[few]],
                )
                coarse = coarser_silhouette(whole, factor)
                np.testing.assert_array_equal(coarse.mask, whole.mask[few])
                np.testing.assert_array_equal(coarse.valid, whole.valid[few])


def test_the_borders_are_at_full_size() -> None:
    mask = np.zeros((40, 60), dtype=bool)
    mask[10:31, 7:60] = True  # to the right it is cut by the image
    left, top, right, bottom = coarser_silhouette(Silhouette.of(mask), 2).extent
    assert np.isnan(right)
    # 7 is (7 - 1.5) / 2 + 0.5, 10 is (10 - 1.5) / 2 + 0.5, 31 is (31 - 1.5) / 2 + 0.5
    assert (left, top, bottom) == (3.25, 4.75, 15.25)
    assert replace(coarser_silhouette(Silhouette.of(mask), 2), device=object()).extent[
        :2
    ] == (3.25, 4.75)


def test_a_pose_in_a_smaller_picture_counts_by_its_pixels() -> None:
    count = PoseCount()
    half = coarser_silhouette(Silhouette.of(np.ones((8, 8))), 2)
    with count.counting():
        count_poses(3, half)
        count_poses(2, coarser_silhouette(half, 2))
    assert count.poses == 3 / 4 + 2 / 16


def test_a_factor_that_leaves_no_pixel_is_refused(camera: Camera) -> None:
    for factor in [0, 73, 2.0, True, None]:
        with pytest.raises(
            ValueError,
            match=f"factor must be a whole number from 1 to .* 72, got {factor}",
        ):
            coarser_camera(camera, factor)


def test_any_layout_and_type_of_array_gives_the_same_areas(
    body: Body, camera: Camera
) -> None:
    rng = np.random.default_rng(4)
    given = [
        rng.normal(0.0, 0.4, (6, many)).astype(np.float32).astype(np.float64)
        for many in (ANGLES, 3)
    ]
    silhouette = Silhouette.of(project(body, camera, given[0][0], given[1][0]))
    expected = areas(body, camera, silhouette, given[0], given[1])
    frozen = [array.copy() for array in given]
    for array in frozen:
        array.setflags(write=False)
    strided = [np.repeat(array, 2, axis=0)[::2] for array in given]
    for same in (
        frozen,
        strided,
        [np.asfortranarray(one) for one in given],
        [one.astype(np.float32) for one in given],
    ):
        np.testing.assert_array_equal(
            areas(body, camera, silhouette, same[0], same[1]), expected
        )
    assert areas(
        body, camera, silhouette, np.zeros((0, ANGLES)), np.zeros((0, 3)), threads=2
    ).shape == (0, 3)


def test_shapes_that_do_not_fit_are_refused_before_the_kernel_sees_them(
    body: Body, camera: Camera
) -> None:
    silhouette = Silhouette.of(np.ones((camera.height, camera.width)))
    for poses, translations, seen, message in (
        (
            np.zeros((2, 40)),
            np.zeros((2, 3)),
            silhouette,
            r"poses must have shape \(n, 66\), got \(2, 40\)",
        ),
        (
            np.zeros((3, 66)),
            np.zeros((1, 3)),
            silhouette,
            r"translations must have shape \(3, 3\), got \(1, 3\)",
        ),
        (
            np.zeros((1, 66)),
            np.zeros((1, 3)),
            Silhouette.of(np.ones((10, 10))),
            r"mask must have shape \(72, 96\)",
        ),
    ):
        with pytest.raises(ValueError, match=message):
            areas(body, camera, seen, poses, translations)
    with pytest.raises(ValueError, match=r"pose and translation must have shapes"):
        project(body, camera, np.zeros(40), np.zeros(3))
