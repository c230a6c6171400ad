"""Which poses are compared, and that none of those that fit is missed."""

from dataclasses import replace

import numpy as np
import pytest

from posefit.ambiguity.estimate import YAWS, LibraryPoses, Moment, States, spaced_frames, states_within, turned_to
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES
from posefit.geometry.symmetry import mirrored_poses
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from tests.cases import each

WALK = built_in.motion("walk")
BODY = Body.of(WALK.skeleton)


def moment(pose: np.ndarray, known: bool = True, azimuths: tuple[float, ...] = (0.7,), side: int = 96) -> Moment:
    place = np.array([0.3, 0.9, -0.2])
    cameras = [Camera.around(place, azimuth, 4.0, (side, side)) for azimuth in azimuths]
    seen = [Silhouette.of(project(BODY, camera, pose, place)) for camera in cameras]
    return Moment(BODY, cameras, seen, place if known else place + [0.2, 0.1, 0.3], known)


def all_of(moment: Moment, poses: np.ndarray, within: float) -> set[tuple[int, int]]:
    """Return what is within so much of the least, by looking at all poses at all yaws at full size."""
    costs = []
    for yaw in range(YAWS):
        turned = turned_to(poses, np.full(len(poses), yaw))
        costs.append(moment.costs(turned, moment.placed(turned)))
    table = np.array(costs)
    return {(int(row), int(yaw)) for yaw, row in np.argwhere(table <= table.min() + within)}


def found(states: States) -> set[tuple[int, int]]:
    yaws = np.rint(np.mod(states.poses[:, 0], 2.0 * np.pi) * YAWS / (2.0 * np.pi)).astype(int) % YAWS
    return set(zip(states.rows.tolist(), yaws.tolist(), strict=True))


@each("known", [True, False])
@each("azimuths", [(0.7,), (0.0, 1.2)])
def test_none_of_those_that_fit_is_missed(known: bool, azimuths: tuple[float, ...]) -> None:
    library = LibraryPoses.of([built_in.motion("march"), built_in.motion("run")], WALK.skeleton)
    seen = moment(WALK.poses[17], known, azimuths, 240)
    for within in (0.0, 1.0, 5.0):
        assert found(states_within(seen, library.poses, within)) == all_of(seen, library.poses, within)


def test_a_small_picture_is_looked_at_first_where_the_person_is_large() -> None:
    assert moment(WALK.poses[0], side=32).factor == 1
    assert moment(WALK.poses[0], side=480).factor > 1


def test_what_is_not_known_has_no_say_in_how_small_the_picture_is() -> None:
    one = moment(WALK.poses[0], azimuths=(0.0, 1.0), side=480)
    blind = Silhouette.of(np.zeros((480, 480)), np.zeros((480, 480)))
    assert replace(one, silhouettes=[one.silhouettes[0], blind]).factor == one.only([0]).factor


def test_a_pose_that_was_seen_costs_nothing_and_stands_where_it_stood() -> None:
    pose = turned_to(WALK.poses[17:18], np.array([13]))[0]
    states = states_within(moment(pose), WALK.poses, 0.0)
    assert states.rows.tolist() == [17]
    assert states.costs.tolist() == [0.0]
    np.testing.assert_allclose(states.poses[0], pose)
    np.testing.assert_allclose(states.translations[0], [0.3, 0.9, -0.2])


def test_more_than_can_be_compared_is_a_mistake_that_says_how_many() -> None:
    with pytest.raises(ValueError, match=r"^within must be so little that at most 20,000 poses .*, got 1e\+06"):
        states_within(moment(WALK.poses[0], side=48), np.tile(WALK.poses, (5, 1)), 1e6)


def test_weights_fall_by_e_for_each_temperature_above_the_least() -> None:
    states = States(np.arange(3), np.zeros((3, ANGLES)), np.zeros((3, 3)), np.array([5.0, 7.0, 5.0]))
    weights = states.weights(2.0)
    assert weights.sum() == pytest.approx(1.0)
    assert weights[1] / weights[0] == pytest.approx(np.exp(-1.0))
    assert weights[2] == weights[0]


def test_a_clip_that_stands_still_is_one_pose_whatever_it_faces() -> None:
    poses = np.zeros((4, ANGLES))
    poses[:, 0] = [0.0, 1.0, 2.0, 3.0]
    assert spaced_frames(WALK.skeleton, poses).tolist() == [0]


def test_poses_of_a_clip_are_two_centimetres_from_each_other() -> None:
    rows = spaced_frames(WALK.skeleton, WALK.poses)
    facing = WALK.poses.copy()
    facing[:, 0] = 0.0
    joints = WALK.skeleton.joints(facing)
    steps = np.sqrt(((joints[rows[1:]] - joints[rows[:-1]]) ** 2).sum(axis=2).mean(axis=1))
    assert rows[0] == 0
    assert steps.min() > 0.02


def test_the_second_half_of_the_library_are_mirror_images_of_the_first() -> None:
    other = Motion("other", WALK.skeleton, WALK.poses[:1], WALK.translations[:1], 30.0)
    library = LibraryPoses.of([WALK, other], WALK.skeleton)
    half = len(library) // 2
    np.testing.assert_array_equal(library.poses[half:], mirrored_poses(WALK.skeleton, library.poses[:half]))
    assert (library.is_mirrored(half - 1), library.is_mirrored(half)) == (False, True)
    for row in (half - 1, 2 * half - 1):
        assert (library.names[library.clips[row]], library.frames[row]) == ("other", 0)
