"""Combinations of limbs against the whole poses that they mean, pixel for pixel."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pytest

from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.limbs import LIMBS
from posefit.geometry.skeleton import ANGLES
from posefit.silhouette.cost import areas, project
from posefit.silhouette.drawn import PoseCount
from posefit.silhouette.limbs import LimbMasks, LimbPoses, every_combination
from posefit.silhouette.mask import Silhouette

TWO: Mapping[str, Sequence[str]] = {"hand": ("rwrist", "rhand"), "leg": ("lfemur", "ltibia", "lfoot", "ltoes")}


def observed(body: Body, camera: Camera, seed: int) -> Silhouette:
    """Return the silhouette of a random pose, a tenth of its pixels unknown."""
    rng = np.random.default_rng(seed)
    mask = project(body, camera, rng.normal(0.0, 0.3, ANGLES), np.zeros(3))
    return Silhouette.of(mask, rng.random(mask.shape) < 0.9)


def candidates(seed: int, counts: Sequence[int], limbs: Mapping[str, Sequence[str]] = LIMBS) -> LimbPoses:
    rng = np.random.default_rng(seed)
    return LimbPoses(rng.normal(0.0, 0.3, ANGLES), [rng.normal(0.0, 0.5, (k, ANGLES)) for k in counts], limbs)


def assert_as_whole(body: Body, camera: Camera, poses: LimbPoses, where: Sequence[float], chosen: object) -> None:
    """Compare the areas of combinations with those of whole poses, each drawn by itself."""
    silhouette, place = observed(body, camera, 9), np.array(where)
    whole = poses.combined(np.array(chosen))
    counted = LimbMasks.draw(body, camera, poses, place).areas(silhouette, np.array(chosen))
    np.testing.assert_array_equal(counted, areas(body, camera, silhouette, whole, np.tile(place, (len(whole), 1))))


def test_all_combinations_have_the_areas_of_their_whole_poses(body: Body) -> None:
    for size in [(96, 72), (320, 240), (64, 48), (65, 90)]:
        camera = Camera.around(np.zeros(3), 0.4, 3.5, size)
        poses = candidates(0, (3, 2, 4, 1, 2))
        every = every_combination(poses.counts)
        assert every.tolist() == sorted(every.tolist())
        assert len({tuple(row) for row in every.tolist()}) == len(every) == 3 * 2 * 4 * 1 * 2
        assert_as_whole(body, camera, poses, (0.0, 0.1, 0.0), every)


def test_any_combinations_in_any_order_do_so_too(body: Body, camera: Camera) -> None:
    poses = candidates(1, (8, 8, 8, 8, 8))
    some = np.random.default_rng(2).integers(0, 8, (500, 5))
    some[100:110] = some[99]
    for count in (500, 1, 0):
        assert_as_whole(body, camera, poses, (0.0, 0.0, 0.0), some[:count])


def test_limbs_off_the_image_or_behind_the_camera_have_no_pixels(body: Body, camera: Camera) -> None:
    for where in [(0.9, 0.3, 0.0), (-1.2, 0.0, 0.0), (0.0, 0.0, 3.6), (9.0, 0.0, 0.0), (0.0, 0.0, 9.0)]:
        poses = candidates(3, (2, 2, 2, 2, 2))
        towards = camera.rotation.T @ np.array([where[0], where[1], -where[2]])
        assert_as_whole(body, camera, poses, towards.tolist(), every_combination(poses.counts))


@pytest.mark.pure
def test_one_combination_by_hand_even_uncompiled(body: Body) -> None:
    camera = Camera.around(np.zeros(3), 0.4, 3.5, (40, 30))
    poses, silhouette = candidates(5, (1, 2), TWO), observed(body, camera, 6)
    drawn = project(body, camera, poses.combined([[0, 1]])[0], np.zeros(3)) & silhouette.valid
    expected = [(silhouette.mask & ~drawn).sum(), (drawn & ~silhouette.mask).sum(), (drawn & silhouette.mask).sum()]
    masks = LimbMasks.draw(body, camera, poses, np.zeros(3))
    assert masks.areas(silhouette, [[0, 1]]).tolist() == [expected]


def test_a_combination_counts_as_a_pose(body: Body, camera: Camera) -> None:
    count, silhouette = PoseCount(), observed(body, camera, 7)
    with count.counting():
        LimbMasks.draw(body, camera, candidates(8, (2, 3), TWO), np.zeros(3)).areas(
            silhouette, [[0, 0], [1, 2], [0, 1]]
        )
    assert count.poses == 3


def test_what_does_not_fit_is_named(body: Body, camera: Camera) -> None:
    pose, some = np.zeros(ANGLES), np.zeros((2, ANGLES))
    poses = LimbPoses(pose, [some, some[:1]], TWO)
    masks, silhouette = LimbMasks.draw(body, camera, poses, np.zeros(3)), observed(body, camera, 8)
    cases: list[tuple[Callable[[], object], str]] = [
        (lambda: LimbPoses(pose, [some], TWO), r"candidates must be one array a limb \(2\), got 1"),
        (lambda: LimbPoses(pose, [some, some[0]], TWO), r"candidates of 'leg' must have shape \(K, 66\), got \(66,\)"),
        (lambda: LimbMasks.draw(body, camera, poses, np.zeros(2)), r"translation must have shape \(3,\), got \(2,\)"),
        (lambda: masks.areas(silhouette, [[0, 0, 0]]), r"whole numbers of shape \(m, 2\), got shape \(1, 3\) of int64"),
        (lambda: masks.areas(silhouette, [[0, 0], [0, 1]]), r"lie in 0 to the limbs' candidates \(2, 1\), got"),
        (lambda: masks.areas(silhouette, [[0, 0], [-1, 0]]), r"lie in 0 to the limbs' candidates \(2, 1\), got"),
        (lambda: masks.areas(Silhouette.of(np.ones((5, 5))), [[0, 0]]), r"mask must have shape \(72, 96\)"),
    ]
    for call, message in cases:
        with pytest.raises(ValueError, match=message):
            call()
