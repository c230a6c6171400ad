"""Which library poses fit a frame, and their clusters and spreads, with poses whose twins are known."""

from dataclasses import replace

import numpy as np
import pytest

from posefit.ambiguity.estimate import (
    RIGHT_ANGLE,
    YAWS,
    LibraryPoses,
    States,
    body_spread,
    camera_about,
    clusters_of,
    problem_of,
    shrink_factor,
    spaced_frames,
    spread_mm,
    states_within,
    turned_to,
)
from posefit.arrays import Array
from posefit.fitting.problem import PoseProblem
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES, JOINTS, angle_index
from posefit.geometry.symmetry import mirrored_poses
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit.uncertainty.modes import poses_apart
from tests.cases import each

SKELETON = built_in.average_skeleton()  # whose sides are equal
WALK = built_in.motion("walk")
BODY = Body.of(WALK.skeleton)
PLACE = np.array([0.3, 0.9, -0.2])
FAR = 300.0  # metres: from there depth does not show
STRIDE = np.zeros(ANGLES)  # faces z: the left leg in front, the right one behind, the left arm lowered
for _name, _axis, _angle in (("lfemur", 0, -0.5), ("rfemur", 0, 0.5), ("lhumerus", 2, 1.0)):
    STRIDE[angle_index(JOINTS.index(_name)) + _axis] = _angle
TWINS = np.array([STRIDE, mirrored_poses(SKELETON, STRIDE[None])[0]])
STRIDES = Motion("stride", SKELETON, np.array([STRIDE, np.zeros(ANGLES)]), np.zeros((2, 3)), 30.0)
LIBRARY = LibraryPoses.of([STRIDES], SKELETON).poses


def moment(pose: Array, *azimuths: float, known: bool = True, side: int = 96) -> PoseProblem:
    """Return what cameras four metres away show of a pose."""
    cameras = [Camera.around(PLACE, azimuth, 4.0, (side, side)) for azimuth in azimuths or (0.7,)]
    silhouettes = [Silhouette.of(project(BODY, camera, pose, PLACE)) for camera in cameras]
    return problem_of(BODY, cameras, silhouettes, PLACE if known else PLACE + [0.2, 0.1, 0.3], known)


def stride_from(*azimuths: float) -> PoseProblem:
    """Return what cameras far away show of the stride."""
    cameras = [Camera.around(PLACE, azimuth, FAR, (120, 120), 2.2 / FAR) for azimuth in azimuths]
    body = Body.of(SKELETON)
    silhouettes = [Silhouette.of(project(body, camera, STRIDE, PLACE)) for camera in cameras]
    return problem_of(body, cameras, silhouettes, PLACE, True)


def all_within(problem: PoseProblem, poses: Array, within: float) -> set[tuple[int, int]]:
    """Return the rows and yaws that cost at most `within` more than the least, all compared at full size."""
    turned = [turned_to(poses, np.full(len(poses), yaw)) for yaw in range(YAWS)]
    costs = np.array([problem.cost(some, problem.placed(some)) for some in turned])
    return {(int(row), int(yaw)) for yaw, row in np.argwhere(costs <= costs.min() + within)}


@each("known", [True, False])
@each("azimuths", [(0.7,), (0.0, 1.2)])
def test_no_pose_that_fits_is_missed(known: bool, azimuths: tuple[float, ...]) -> None:
    library = LibraryPoses.of([built_in.motion("march"), built_in.motion("run")], WALK.skeleton)
    frame = moment(WALK.poses[17], *azimuths, known=known, side=240)
    for within in (0.0, 1.0, 5.0):
        states = states_within(frame, library.poses, within)
        yaws = np.rint(np.mod(states.poses[:, 0], 2.0 * np.pi) * YAWS / (2.0 * np.pi)).astype(int) % YAWS
        assert set(zip(states.rows.tolist(), yaws.tolist(), strict=True)) == all_within(frame, library.poses, within)


def test_images_are_shrunk_where_the_person_is_large_in_the_known_ones() -> None:
    assert shrink_factor(moment(WALK.poses[0], side=32)) == 1
    two = moment(WALK.poses[0], 0.0, 1.0, side=480)
    assert shrink_factor(two) > 1
    unknown = Silhouette.of(np.zeros((480, 480)), np.zeros((480, 480)))
    partly = replace(two, silhouettes=[two.silhouettes[0], unknown])
    assert shrink_factor(partly) == shrink_factor(moment(WALK.poses[0], 0.0, side=480))


def test_the_true_pose_costs_nothing_and_stands_in_its_place() -> None:
    pose = turned_to(WALK.poses[17:18], np.array([13]))[0]
    states = states_within(moment(pose), WALK.poses, 0.0)
    assert (states.rows.tolist(), states.costs.tolist()) == ([17], [0.0])
    np.testing.assert_allclose(states.poses[0], pose)
    np.testing.assert_allclose(states.translations[0], PLACE)


def test_too_many_poses_to_compare_are_refused() -> None:
    with pytest.raises(ValueError, match=r"^within must be so little that at most 20,000 poses .*, got 1e\+06"):
        states_within(moment(WALK.poses[0], side=48), np.tile(WALK.poses, (5, 1)), 1e6)


def test_library_poses_are_two_centimetres_apart_whatever_their_yaw_and_then_mirrored() -> None:
    still = np.zeros((4, ANGLES))
    still[:, 0] = [0.0, 1.0, 2.0, 3.0]
    assert spaced_frames(WALK.skeleton, still).tolist() == [0]
    rows = spaced_frames(WALK.skeleton, WALK.poses)
    joints = WALK.skeleton.joints(turned_to(WALK.poses, np.zeros(len(WALK.poses), dtype=int)))
    steps = np.sqrt(((joints[rows[1:]] - joints[rows[:-1]]) ** 2).sum(axis=2).mean(axis=1))
    assert rows[0] == 0
    assert steps.min() > 0.02
    other = Motion("other", WALK.skeleton, WALK.poses[:1], WALK.translations[:1], 30.0)
    library = LibraryPoses.of([WALK, other], WALK.skeleton)
    half = len(library) // 2
    np.testing.assert_array_equal(library.poses[half:], mirrored_poses(WALK.skeleton, library.poses[:half]))
    assert (library.is_mirrored(half - 1), library.is_mirrored(half)) == (False, True)
    for row in (half - 1, 2 * half - 1):
        assert (library.names[library.clips[row]], library.frames[row]) == ("other", 0)


def test_a_stride_and_its_mirrored_twin_have_equal_weights_in_a_side_view() -> None:
    frame = stride_from(0.5 * np.pi)
    states = states_within(frame, LIBRARY, 1.0)
    clusters = clusters_of(frame, states, states.posterior(2.0))
    assert [cluster.weight for cluster in clusters] == pytest.approx([0.5, 0.5], abs=0.02)
    assert [cluster.image for cluster in clusters] == ["", "mirrored"]
    apart = 1e3 * poses_apart(SKELETON, TWINS[:1], TWINS[1:])[0, 0]
    assert [cluster.away_mm for cluster in clusters] == pytest.approx([0.0, apart], abs=1.0)
    assert {int(states.rows[cluster.best]) for cluster in clusters} == {0, 2}


def test_half_way_between_front_and_side_the_twin_is_the_reflected_one() -> None:
    frame = stride_from(0.25 * np.pi)
    states = states_within(frame, LIBRARY, 1.0)
    clusters = clusters_of(frame, states, states.posterior(2.0))
    assert [cluster.image for cluster in clusters] == ["", "reflected"]
    # the one faces z, 45 degrees to the camera's left, the other 2 (45) + 180 - 0 = 270 degrees
    yaws = sorted(round(float(np.degrees(states.poses[cluster.best, 0]))) for cluster in clusters)
    assert yaws == [-90, 0]


def test_a_second_camera_at_right_angles_distinguishes_twins() -> None:
    spreads = []
    for frame in (stride_from(0.5 * np.pi), stride_from(0.5 * np.pi, np.pi)):
        states = states_within(frame, LIBRARY, 1.0)
        spreads.append(body_spread(spread_mm(SKELETON, states.poses, states.posterior(2.0).weights)))
    assert spreads[0] > 100.0
    assert spreads[1] < 20.0


def test_the_spread_is_the_root_mean_square_distance_from_the_weighted_mean() -> None:
    apart = 1e3 * np.linalg.norm(np.subtract(*SKELETON.joints(TWINS)), axis=1)
    # at equal weights both are a half from the mean; at 1 to 3 they are 3/4 and 1/4: 1/4 (9/16) + 3/4 (1/16) = 3/16
    for weights, share in (([0.5, 0.5], 0.5), ([1.0, 3.0], np.sqrt(3.0) / 4.0)):
        spreads = spread_mm(SKELETON, TWINS, np.array(weights))
        np.testing.assert_allclose(spreads, share * apart, atol=1e-9)
        assert body_spread(spreads) == pytest.approx(share * np.sqrt((apart**2).mean()))


def test_of_very_many_poses_a_sample_finds_the_clusters() -> None:
    states = States(np.arange(5000), np.tile(TWINS, (2500, 1)), np.tile(PLACE, (5000, 1)), np.zeros(5000))
    first, second = clusters_of(stride_from(0.5 * np.pi), states, states.posterior(2.0))
    assert (len(first.members), len(second.members)) == (2500, 2500)
    assert first.weight == pytest.approx(0.5)
    assert first.spread_mm == pytest.approx(0.0, abs=1e-6)


def test_a_turned_camera_shows_the_same_place_from_the_side() -> None:
    camera, place = Camera.around(np.array([0.2, 1.1, 0.4]), 0.4, 5.0, (100, 80)), np.array([0.5, 0.8, 0.1])
    turned = camera_about(camera, place, RIGHT_ANGLE)
    for before, after in zip(camera.project(place), turned.project(place), strict=True):
        np.testing.assert_allclose(before, after)
    origin, position = camera.position - place, turned.position - place
    assert origin[[0, 2]] @ position[[0, 2]] == pytest.approx(0.0, abs=1e-12)
    assert position[1] == pytest.approx(origin[1])
