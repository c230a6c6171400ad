"""Groups of poses and spreads, with a pose whose mirrored twin the camera cannot tell from it."""

from dataclasses import replace

import numpy as np
import pytest

from posefit.ambiguity.estimate import (
    RIGHT_ANGLE,
    LibraryPoses,
    Moment,
    States,
    camera_about,
    clusters_of,
    distance_mm,
    floor_mm,
    spread_mm,
    states_within,
    total,
)
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES, JOINTS, angle_index
from posefit.geometry.symmetry import mirrored_poses
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette

SKELETON = built_in.average_skeleton()  # whose sides are alike
BODY = Body.of(SKELETON)
PLACE = np.array([0.0, 0.9, 0.0])
FAR = 300.0  # metres: from there depth does not show


def stride() -> np.ndarray:
    """Return a pose that faces z: the left leg in front, the right one behind, the left arm lowered."""
    pose = np.zeros(ANGLES)
    for name, angle in (("lfemur", -0.5), ("rfemur", 0.5)):
        pose[angle_index(JOINTS.index(name))] = angle
    pose[angle_index(JOINTS.index("lhumerus")) + 2] = 1.0
    return pose


def seen_from(*azimuths: float) -> Moment:
    """Return what cameras far away see of the stride."""
    cameras = [Camera.around(PLACE, azimuth, FAR, (120, 120), 2.2 / FAR) for azimuth in azimuths]
    seen = [Silhouette.of(project(BODY, camera, stride(), PLACE)) for camera in cameras]
    return Moment(BODY, cameras, seen, PLACE, True)


def library() -> np.ndarray:
    poses = np.array([stride(), np.zeros(ANGLES)])
    return LibraryPoses.of([Motion("stride", SKELETON, poses, np.zeros((2, 3)), 30.0)], SKELETON).poses


def test_from_its_side_a_stride_and_its_mirrored_twin_weigh_the_same() -> None:
    moment = seen_from(0.5 * np.pi)
    states = states_within(moment, library(), 1.0)
    first, second = clusters_of(moment, states, states.weights(2.0))
    assert first.weight == pytest.approx(0.5, abs=0.02)
    assert second.weight == pytest.approx(0.5, abs=0.02)
    assert (first.image, second.image) == ("", "mirrored")
    assert first.away_mm == 0.0
    twin = mirrored_poses(SKELETON, stride()[None])[0]
    assert second.away_mm == pytest.approx(distance_mm(SKELETON, stride(), twin), abs=1.0)
    assert {int(states.rows[one.best]) for one in (first, second)} == {0, 2}


def test_two_twins_of_equal_weight_spread_by_half_of_what_they_are_apart() -> None:
    moment = seen_from(0.5 * np.pi)
    poses = np.array([stride(), mirrored_poses(SKELETON, stride()[None])[0]])
    states = States(np.arange(2), poses, np.tile(PLACE, (2, 1)), np.zeros(2))
    joints = SKELETON.joints(poses)
    half = 500.0 * np.linalg.norm(joints[0] - joints[1], axis=1)
    np.testing.assert_allclose(floor_mm(moment, states, states.weights(2.0)), half, atol=1e-9)
    moved = replace(states, translations=states.translations + [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    np.testing.assert_array_equal(
        floor_mm(moment, moved, moved.weights(2.0)), floor_mm(moment, states, states.weights(2.0))
    )


def test_half_way_between_front_and_side_the_twin_that_looks_alike_is_the_reflected_one() -> None:
    moment = seen_from(0.25 * np.pi)
    states = states_within(moment, library(), 1.0)
    clusters = clusters_of(moment, states, states.weights(2.0))
    assert [one.image for one in clusters] == ["", "reflected"]
    # who faces z, 45 degrees to the camera's left, comes; the other one goes: 2 (45) + 180 - 0 = 270 degrees
    yaws = sorted(round(float(np.degrees(states.poses[one.best, 0]))) for one in clusters)
    assert yaws == [-90, 0]


def test_a_second_camera_at_right_angles_tells_them_apart() -> None:
    one, both = seen_from(0.5 * np.pi), seen_from(0.5 * np.pi, np.pi)
    floors = []
    for moment in (one, both):
        states = states_within(moment, library(), 1.0)
        floors.append(total(floor_mm(moment, states, states.weights(2.0))))
    assert floors[0] > 100.0
    assert floors[1] < 20.0


def test_the_spread_is_the_root_mean_square_distance_from_the_weighted_mean() -> None:
    joints = np.zeros((2, 27, 3))
    joints[1, 5] = [0.0, 0.02, 0.0]
    # at equal weights both are 10 mm from the mean; at 1 to 3 they are 15 and 5: 0.25 (225) + 0.75 (25) = 75
    for weights, expected in (([0.5, 0.5], 10.0), ([1.0, 3.0], np.sqrt(75.0))):
        spreads = spread_mm(joints, np.array(weights))
        assert spreads[5] == pytest.approx(expected)
        assert np.count_nonzero(spreads) == 1
        assert total(spreads) == pytest.approx(expected / np.sqrt(27.0))


def test_of_very_many_poses_some_stand_for_all() -> None:
    moment = seen_from(0.5 * np.pi)
    twins = np.array([stride(), mirrored_poses(SKELETON, stride()[None])[0]])
    poses = np.tile(twins, (2500, 1))
    states = States(np.arange(5000), poses, np.tile(PLACE, (5000, 1)), np.zeros(5000))
    first, second = clusters_of(moment, states, states.weights(2.0))
    assert (len(first.members), len(second.members)) == (2500, 2500)
    assert first.weight == pytest.approx(0.5)
    assert first.spread_mm == pytest.approx(0.0, abs=1e-6)


def test_a_camera_that_is_turned_sees_the_place_as_before_from_the_side() -> None:
    camera, place = Camera.around(np.array([0.2, 1.1, 0.4]), 0.4, 5.0, (100, 80)), np.array([0.5, 0.8, 0.1])
    turned = camera_about(camera, place, RIGHT_ANGLE)
    for one, other in zip(camera.project(place), turned.project(place), strict=True):
        np.testing.assert_allclose(one, other)
    before, after = camera.position - place, turned.position - place
    assert before[[0, 2]] @ after[[0, 2]] == pytest.approx(0.0, abs=1e-12)
    assert after[1] == pytest.approx(before[1])
