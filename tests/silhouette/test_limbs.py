"""One limb's candidates against the whole poses that they mean, pixel for pixel."""

from dataclasses import replace

import numpy as np
import pytest

from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES, LIMBS
from posefit.silhouette.cost import areas, pose_costs, project
from posefit.silhouette.drawn import PoseCount
from posefit.silhouette.limbs import SHARE, Limb
from posefit.silhouette.mask import Silhouette
from tests.cases import each


def observed(body: Body, camera: Camera, seed: int) -> Silhouette:
    """Return the silhouette of a random pose, a tenth of its pixels unknown."""
    rng = np.random.default_rng(seed)
    mask = project(body, camera, rng.normal(0.0, 0.3, ANGLES), np.zeros(3))
    return Silhouette.of(mask, rng.random(mask.shape) < 0.9)


@each("name", LIMBS)
def test_a_limb_counts_as_its_whole_poses_do(body: Body, name: str) -> None:
    rng, limb = np.random.default_rng(1), Limb.of(body, name)
    # in the picture, at its border, behind the camera and so near that some bones are
    for size, where in [((96, 72), 0.0), ((320, 240), 0.9), ((65, 90), -1.2), ((64, 48), 9.0), ((96, 72), 3.4)]:
        camera = Camera.around(np.zeros(3), 0.4, 3.5, size)
        place = where * (camera.rotation.T @ np.array([1.0, 0.0, 0.0] if where < 2.0 else [0.0, 0.0, -1.0]))
        poses = np.tile(rng.normal(0.0, 0.4, ANGLES), (7, 1))
        poses[:, limb.turns] += rng.normal(0.0, 0.8, (7, len(limb.turns)))
        silhouette = observed(body, camera, 2)
        whole = areas(body, camera, silhouette, poses, np.tile(place, (7, 1)))
        alone = limb.areas(camera, silhouette, poses[3], place, poses[:, limb.turns])
        np.testing.assert_array_equal(alone, whole)


@pytest.mark.pure
def test_its_costs_are_those_of_its_poses_even_uncompiled(body: Body) -> None:
    cameras = [Camera.around(np.zeros(3), yaw, 3.5, (40, 30)) for yaw in (0.0, 1.6, 3.0)]
    silhouettes = [observed(body, camera, 3) for camera in cameras]
    silhouettes[1] = Silhouette.of(silhouettes[1].mask, np.zeros_like(silhouettes[1].mask))  # nothing is known there
    limb, pose = Limb.of(body, "right leg"), np.random.default_rng(4).normal(0.0, 0.3, ANGLES)
    expected, _ = pose_costs(body, cameras, silhouettes, pose[None], np.zeros((1, 3)))
    assert limb.costs(cameras, silhouettes, pose, np.zeros(3), pose[None, limb.turns]).tolist() == expected.tolist()


def test_a_candidate_counts_as_a_share_of_a_pose(body: Body, camera: Camera) -> None:
    count, limb, silhouette = PoseCount(), Limb.of(body, "head"), observed(body, camera, 5)
    with count.counting():
        limb.areas(camera, silhouette, np.zeros(ANGLES), np.zeros(3), np.zeros((6, len(limb.turns))))
    assert count.poses == pytest.approx(6 * SHARE)


def test_a_limb_that_nobody_has_is_refused(body: Body) -> None:
    with pytest.raises(ValueError, match="limb must be one of left leg, .*, got 'tail'"):
        Limb.of(replace(body), "tail")
