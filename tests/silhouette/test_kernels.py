"""The rasteriser against a slow twin, pixel for pixel, wherever the body is."""

import multiprocessing
import os
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest

from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import Array
from posefit.geometry.skeleton import ANGLES, PARENTS
from posefit.silhouette.cost import areas, project
from posefit.silhouette.mask import Silhouette
from tests.silhouette.twin import body_distance, hull_distance

TIE = 1e-3  # pixels; the kernel's rows are float32


def random_poses(rng: np.random.Generator, count: int) -> Array:
    poses = rng.normal(0.0, 0.4, (count, ANGLES))
    poses[:, 0] = rng.uniform(-np.pi, np.pi, count)
    return poses


def assert_equals_the_twin(body: Body, camera: Camera, pose: Array, translation: Array) -> bool:
    """Compare the masks; return whether no pixel was so near a border that rounding may decide it."""
    distance = body_distance(body, camera, pose, translation)
    drawn = project(body, camera, pose, translation)
    clear = np.abs(distance) > TIE
    np.testing.assert_array_equal(drawn[clear], (distance <= 0.0)[clear])
    return bool(clear.all())


def test_the_twin_agrees_with_a_fine_sweep_of_discs() -> None:
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-5.0, 15.0, (2, 400))
    for _ in range(20):
        first, second = rng.uniform(0.0, 10.0, (2, 2))
        r0, r1 = rng.uniform(0.2, 3.0, 2)
        t = np.linspace(0.0, 1.0, 20_001)[:, None]
        swept = np.hypot(x - (first[0] + t * (second - first)[0]), y - (first[1] + t * (second - first)[1])) - (
            r0 + t * (r1 - r0)
        )
        np.testing.assert_allclose(hull_distance(x, y, first, second, r0, r1), swept.min(axis=0), atol=2e-3)


def test_areas_equal_the_twin_on_1000_random_poses(body: Body, camera: Camera) -> None:
    rng = np.random.default_rng(1)
    mask = project(body, camera, random_poses(rng, 1)[0], np.zeros(3))
    valid = rng.random(mask.shape) < 0.9
    silhouette = Silhouette.of(mask, valid)
    compared = 0
    while compared < 1000:
        poses = random_poses(rng, 100)
        translations = rng.uniform(-0.4, 0.4, (100, 3))
        found = areas(body, camera, silhouette, poses, translations)
        for pose, translation, area in zip(poses, translations, found, strict=True):
            distance = body_distance(body, camera, pose, translation)
            if (np.abs(distance) < TIE).any():
                continue
            twin = (distance <= 0.0) & valid
            seen = mask & valid
            expected = [(seen & ~twin).sum(), (twin & ~seen).sum(), (seen & twin).sum()]
            assert area.tolist() == expected
            compared += 1
            if compared == 1000:
                break


@pytest.mark.parametrize("width", [1, 2, 63, 64, 65, 127, 129, 321])
def test_any_width_is_drawn(body: Body, width: int) -> None:
    rng = np.random.default_rng(width)
    camera = Camera.around(np.zeros(3), 0.0, 3.0, (width, 61), field_of_view=0.6)
    clear = [assert_equals_the_twin(body, camera, pose, np.zeros(3)) for pose in random_poses(rng, 12)]
    assert sum(clear) >= 4


@pytest.mark.parametrize("shift", [(0.9, 0.0), (-0.9, 0.3), (0.0, 0.8), (0.2, -0.9), (9.0, 0.0), (0.0, -9.0)])
def test_a_body_partly_or_wholly_off_the_image_is_cut(body: Body, camera: Camera, shift: tuple[float, float]) -> None:
    rng = np.random.default_rng(3)
    for pose in random_poses(rng, 5):
        assert_equals_the_twin(body, camera, pose, np.array([*shift, 0.0]))


def test_a_bone_behind_or_too_near_the_camera_is_not_drawn(body: Body, camera: Camera) -> None:
    rng = np.random.default_rng(4)
    towards = camera.rotation.T @ np.array([0.0, 0.0, -1.0])
    for depth in (3.2, 3.7, 3.95, 4.0, 4.4, 9.0):
        for pose in random_poses(rng, 3):
            assert_equals_the_twin(body, camera, pose, depth * towards)
    assert not project(body, camera, np.zeros(ANGLES), 9.0 * towards).any()


def test_full_hd_is_drawn(body: Body) -> None:
    camera = Camera.around(np.zeros(3), 0.7, 2.6, (1920, 1080))
    for pose in random_poses(np.random.default_rng(5), 3):
        assert_equals_the_twin(body, camera, pose, np.zeros(3))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_a_pose_that_is_no_number_draws_nothing_and_spoils_nothing(body: Body, camera: Camera, bad: float) -> None:
    pose = random_poses(np.random.default_rng(6), 1)
    silhouette = Silhouette.of(project(body, camera, pose[0], np.zeros(3)))
    poses, translations = np.repeat(pose, 3, axis=0), np.zeros((3, 3))
    translations[1] = bad
    found = areas(body, camera, silhouette, poses, translations)
    assert found[1].tolist() == [silhouette.mask.sum(), 0, 0]
    assert found[2].tolist() == [0, 0, silhouette.mask.sum()]


def test_masks_look_like_opencvs(body: Body) -> None:
    camera = Camera.around(np.zeros(3), 0.4, 3.0, (320, 240))
    for pose in random_poses(np.random.default_rng(7), 20):
        pixels, depths = camera.project(body.skeleton.joints(pose))
        image = np.zeros((240, 320), np.uint8)
        for bone, parent in enumerate(PARENTS[1:]):
            hull = []
            for joint, radius in zip((parent, bone + 1), body.radii[bone], strict=True):
                angles = np.linspace(0.0, 2.0 * np.pi, 64)
                circle = np.column_stack([np.cos(angles), np.sin(angles)])
                hull.append(pixels[joint] - 0.5 + camera.focal[0] / depths[joint] * radius * circle)
            points = cv2.convexHull(np.rint(np.vstack(hull) * 256).astype(np.int32))
            cv2.fillConvexPoly(image, points, 1, cv2.LINE_8, 8)
        ours = project(body, camera, pose, np.zeros(3))
        # OpenCV also sets the pixels that a border merely touches: a ring of half a pixel
        assert (ours & (image == 0)).sum() <= 2
        assert (ours & (image > 0)).sum() / (image > 0).sum() > 0.9


def test_the_same_bits_for_any_number_of_poses_and_threads(body: Body, camera: Camera) -> None:
    rng = np.random.default_rng(8)
    poses, translations = random_poses(rng, 1000), rng.uniform(-0.5, 0.5, (1000, 3))
    silhouette = Silhouette.of(project(body, camera, poses[0], translations[0]))
    together = areas(body, camera, silhouette, poses, translations)
    for count in (1, 40, 1000):
        for threads in (1, 2):
            some = areas(body, camera, silhouette, poses[:count], translations[:count], threads)
            np.testing.assert_array_equal(some, together[:count])


def test_four_threads_may_call_at_once(body: Body, camera: Camera) -> None:
    rng = np.random.default_rng(9)
    poses, translations = random_poses(rng, 400), rng.uniform(-0.5, 0.5, (400, 3))
    silhouette = Silhouette.of(project(body, camera, poses[0], translations[0]))
    alone = areas(body, camera, silhouette, poses, translations)
    with ThreadPoolExecutor(4) as pool:
        jobs = [pool.submit(areas, body, camera, silhouette, poses, translations, 1 + k % 2) for k in range(24)]
        for job in jobs:
            np.testing.assert_array_equal(job.result(), alone)


def _in_a_child(body: Body, camera: Camera, mask: Array, poses: Array, queue: "multiprocessing.Queue[Array]") -> None:
    queue.put(areas(body, camera, Silhouette.of(mask), poses, np.zeros((len(poses), 3)), 2))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_child_can_use_threads_too(body: Body, camera: Camera) -> None:
    poses = random_poses(np.random.default_rng(10), 80)
    mask = project(body, camera, poses[0], np.zeros(3))
    here = areas(body, camera, Silhouette.of(mask), poses, np.zeros((80, 3)), 2)
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_in_a_child, args=(body, camera, mask, poses, queue))
    child.start()
    np.testing.assert_array_equal(queue.get(timeout=30), here)
    child.join(30)
    assert child.exitcode == 0


@pytest.mark.pure
def test_three_poses_equal_the_twin_even_uncompiled(body: Body) -> None:
    camera = Camera.around(np.zeros(3), 0.4, 4.0, (70, 40), field_of_view=0.9)
    for pose in random_poses(np.random.default_rng(11), 3):
        assert_equals_the_twin(body, camera, pose, np.zeros(3))
        mask = project(body, camera, pose, np.zeros(3))
        counted = areas(body, camera, Silhouette.of(mask), pose[None], np.zeros((1, 3)))
        assert counted.tolist() == [[0, 0, mask.sum()]]
