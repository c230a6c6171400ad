"""The cost by hand, and the areas by law."""

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES
from posefit.motion.built_in import average_skeleton
from posefit.silhouette.cost import areas, mismatch, project
from posefit.silhouette.mask import Silhouette


def scene(seed: int, count: int) -> tuple[Array, Array, Silhouette, Camera, Body]:
    """Return poses, translations and what a camera saw of the first one, a tenth of its pixels unknown."""
    rng = np.random.default_rng(seed)
    body, camera = Body.of(average_skeleton()), Camera.around(np.zeros(3), 0.4, 3.0, (101, 75))
    poses, translations = rng.normal(0.0, 0.4, (count, ANGLES)), rng.uniform(-0.6, 0.6, (count, 3))
    mask = project(body, camera, poses[0], translations[0])
    return poses, translations, Silhouette.of(mask, rng.random(mask.shape) < 0.9), camera, body


@pytest.mark.pure
def test_the_mismatch_by_hand() -> None:
    # 100 (0.5 * 20 / 50 + 0.5 * 10 / 40), and 100 (0.5 * 10 / 20 + 0.5 * 30 / 40)
    np.testing.assert_allclose(mismatch(np.array([[10, 20, 30], [30, 10, 10]])), [32.5, 62.5])
    # beta weighs what is missed: 100 (0.75 * 10 / 20 + 0.25 * 30 / 40)
    np.testing.assert_allclose(mismatch(np.array([[30, 10, 10]]), 0.25), 56.25)
    assert mismatch(np.array([[0, 0, 30], [5, 7, 0]])).tolist() == [0.0, 100.0]
    # Interpretation S2: no body seen, no silhouette seen, neither; each empty denominator makes its term 1
    assert mismatch(np.array([[9, 0, 0], [0, 9, 0], [0, 0, 0]])).tolist() == [100.0, 100.0, 100.0]
    assert mismatch(np.zeros((0, 3), dtype=np.int64)).shape == (0,)


def test_any_layout_and_type_of_array_gives_the_same_areas() -> None:
    poses, translations, silhouette, camera, body = scene(4, 6)
    given = [array.astype(np.float32).astype(np.float64) for array in (poses, translations)]
    expected = areas(body, camera, silhouette, given[0], given[1])
    frozen = [array.copy() for array in given]
    for array in frozen:
        array.setflags(write=False)
    strided = [np.repeat(array, 2, axis=0)[::2] for array in given]
    for same in (frozen, strided, [np.asfortranarray(one) for one in given], [one.astype(np.float32) for one in given]):
        np.testing.assert_array_equal(areas(body, camera, silhouette, same[0], same[1]), expected)
    assert areas(body, camera, silhouette, np.zeros((0, ANGLES)), np.zeros((0, 3)), threads=2).shape == (0, 3)


@pytest.mark.pure
def test_areas_of_two_poses_by_counting_even_uncompiled() -> None:
    rng = np.random.default_rng(7)
    body, camera = Body.of(average_skeleton()), Camera.around(np.zeros(3), 0.4, 4.0, (40, 30))
    poses, translations = rng.normal(0.0, 0.4, (2, ANGLES)), rng.uniform(-0.3, 0.3, (2, 3))
    masks = [project(body, camera, p, t) for p, t in zip(poses, translations, strict=True)]
    valid = rng.random((30, 40)) < 0.9
    seen = masks[0] & valid
    expected = [[(seen & ~m).sum(), (m & valid & ~seen).sum(), (seen & m).sum()] for m in masks]
    found = areas(body, camera, Silhouette.of(masks[0], valid), poses, translations)
    np.testing.assert_array_equal(found, expected)


def test_shapes_that_do_not_fit_are_refused_before_the_kernel_sees_them(body: Body, camera: Camera) -> None:
    silhouette = Silhouette.of(np.ones((camera.height, camera.width)))
    for poses, translations, seen, message in (
        (np.zeros((2, 40)), np.zeros((2, 3)), silhouette, r"poses must have shape \(n, 66\), got \(2, 40\)"),
        (np.zeros((3, 66)), np.zeros((1, 3)), silhouette, r"translations must have shape \(3, 3\), got \(1, 3\)"),
        (np.zeros((1, 66)), np.zeros((1, 3)), Silhouette.of(np.ones((10, 10))), r"mask must have shape \(72, 96\)"),
    ):
        with pytest.raises(ValueError, match=message):
            areas(body, camera, seen, poses, translations)
    with pytest.raises(ValueError, match=r"pose and translation must have shapes"):
        project(body, camera, np.zeros(40), np.zeros(3))
