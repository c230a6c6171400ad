"""Half and quarter size: the same rays, fewer of them."""

from dataclasses import replace

import numpy as np
import pytest

from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES
from posefit.silhouette.cost import project
from posefit.silhouette.drawn import PoseCount, count_poses
from posefit.silhouette.mask import Silhouette
from posefit.silhouette.pyramid import coarser_camera, coarser_silhouette
from tests.silhouette.twin import body_distance

TIE = 1e-3  # pixels; the kernel's rows are float32


def test_half_and_quarter_size_by_hand() -> None:
    camera = Camera(320, 240, np.array([300.0, 310.0]), np.array([160.0, 120.0]), np.eye(3), np.zeros(3))
    half, quarter = coarser_camera(camera, 2), coarser_camera(camera, 4)
    assert (half.width, half.height, quarter.width, quarter.height) == (160, 120, 80, 60)
    np.testing.assert_allclose(half.focal, [150.0, 155.0])
    # pixels 1, 3, 5, ...: the centre of pixel 0 at half size, 0.5, is that of pixel 1, 1.5; so 160 is (160 - 1.5) / 2 + 0.5
    np.testing.assert_allclose(half.centre, [79.75, 59.75])
    # pixels 2, 6, 10, ...: 160 is (160 - 2.5) / 4 + 0.5
    np.testing.assert_allclose(quarter.centre, [39.875, 29.875])
    assert coarser_camera(replace(camera, width=5, height=3), 2).width == 2
    assert coarser_camera(replace(camera, width=5, height=3), 2).height == 1


def test_a_body_seen_small_is_the_body_drawn_at_full_size_and_looked_at_there(body: Body) -> None:
    for size in [(96, 72), (101, 75), (321, 240)]:
        for factor in [1, 2, 3, 4, 7]:
            camera = Camera.around(np.zeros(3), 0.4, 3.5, size)
            rng, first = np.random.default_rng(0), factor // 2
            for _ in range(5):
                pose, place = rng.normal(0.0, 0.4, ANGLES), rng.uniform(-0.4, 0.4, 3)
                whole = Silhouette.of(project(body, camera, pose, place), rng.random(size[::-1]) < 0.8)
                clear = np.abs(body_distance(body, camera, pose, place)) > TIE
                few = (slice(first, None, factor),) * 2
                small = project(body, coarser_camera(camera, factor), pose, place)
                np.testing.assert_array_equal(small[clear[few]], project(body, camera, pose, place)[few][clear[few]])
                coarse = coarser_silhouette(whole, factor)
                np.testing.assert_array_equal(coarse.mask, whole.mask[few])
                np.testing.assert_array_equal(coarse.valid, whole.valid[few])


def test_the_borders_are_those_at_full_size() -> None:
    mask = np.zeros((40, 60), dtype=bool)
    mask[10:31, 7:60] = True  # to the right it is cut by the image
    left, top, right, bottom = coarser_silhouette(Silhouette.of(mask), 2).extent
    assert np.isnan(right)
    # 7 is (7 - 1.5) / 2 + 0.5, 10 is (10 - 1.5) / 2 + 0.5, 31 is (31 - 1.5) / 2 + 0.5
    assert (left, top, bottom) == (3.25, 4.75, 15.25)


def test_a_pose_in_a_smaller_picture_counts_by_its_pixels() -> None:
    count, half = PoseCount(), coarser_silhouette(Silhouette.of(np.ones((8, 8))), 2)
    with count.counting():
        count_poses(3, half)
        count_poses(2, coarser_silhouette(half, 2))
    assert count.poses == 3 / 4 + 2 / 16


def test_a_factor_that_leaves_no_pixel_is_refused(camera: Camera) -> None:
    for factor in [0, -1, 73, 2.0, True, None]:
        with pytest.raises(
            ValueError, match=f"factor must be a whole number from 1 to the smaller side 72, got {factor}"
        ):
            coarser_camera(camera, factor)
        with pytest.raises(ValueError, match="factor must be a whole number"):
            coarser_silhouette(Silhouette.of(np.ones((72, 96))), factor)
