"""What poses cost that are from landmarks, by hand, and masks that carry landmarks."""

from pathlib import Path

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.landmarks import (
    ARMS,
    DEVIATION,
    EXCHANGED,
    GROUPS,
    LEGS,
    MIRRORED,
    PERSISTENCE,
    exchanged_given,
    exchanged_next,
    landmark_costs,
    landmark_likelihoods,
    side_odds,
    usually_exchanged,
)
from posefit.footage.observations import Observations
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS, MIRROR
from posefit.motion import built_in
from tests.footage.conftest import read_masks

WALK = built_in.motion("walk-a", frames=8)
CAMERA = Camera.around(WALK.translations[3], 1.2, 4.0, (160, 120))


def landmarks_of(confidence: float, joints: tuple[str, ...] = JOINTS) -> Array:
    """Return landmarks (1, 27, 3) where some joints of a frame are."""
    pixels, _ = CAMERA.project(WALK.joints[3])
    return np.column_stack(
        [pixels, [confidence * (joint in joints) for joint in JOINTS]]
    )[None]


def costs(landmarks: Array, poses: Array) -> Array:
    return landmark_costs(likelihoods(landmarks, poses))


def likelihoods(landmarks: Array, poses: Array) -> Array:
    places = np.repeat(WALK.translations[3:4], len(poses), 0)
    return landmark_likelihoods(WALK.skeleton, [CAMERA], landmarks, poses, places)


def test_landmarks_at_the_joints_cost_least_and_as_little_as_their_sides_are_certain() -> (
    None
):
    # the other side is far off in each group but for those joints that lie on each other
    poses = (
        WALK.poses[3]
        + np.random.default_rng(0).normal(0.0, 0.1, (20, 66)) * WALK.skeleton.free
    )
    poses[0] = WALK.poses[3]
    by_pose = costs(landmarks_of(1.0), poses)
    assert by_pose.argmin() == 0
    assert -1e-9 <= by_pose[0] <= -np.log(1.0 - EXCHANGED).sum() + 1e-9


def test_one_joint_off_by_hand() -> None:
    landmarks = landmarks_of(0.5, ("lradius",))
    wrist = JOINTS.index("lradius")
    pixels, depths = CAMERA.project(WALK.joints[3])
    metre = np.sqrt(CAMERA.focal.prod()) / depths
    # three deviations to the side
    landmarks[0, wrist, 0] += 3.0 * DEVIATION * metre[wrist]
    other = (
        np.linalg.norm(landmarks[0, wrist, :2] - pixels[MIRROR[wrist]])
        / metre[MIRROR[wrist]]
        / DEVIATION
    )
    rare = EXCHANGED[ARMS]
    arms = (1.0 - rare) * (1.0 + 4.5) ** -0.5 + rare * (1.0 + 0.5 * other**2) ** -0.5
    # groups without landmarks cost nothing
    np.testing.assert_allclose(
        costs(landmarks, WALK.poses[3:4]), [-np.log(arms)], rtol=1e-9
    )


def test_exchanged_landmarks_are_expected_to_stay_so() -> None:
    # two frames by hand, summed over all four cases of a chain that is exchanged as often as usual in the long run
    first, second = (
        likelihoods(landmarks_of(0.5), WALK.poses[[3, frame]]) for frame in (5, 1)
    )
    usual = usually_exchanged(first)
    before = exchanged_given(first, usual[None])
    twice = landmark_costs(first) + landmark_costs(
        second, exchanged_next(before, 1.0 / 30.0)
    )
    total = np.zeros(first.shape[:2])
    for now, share in enumerate((1.0 - usual, usual)):
        for later, expected in enumerate((1.0 - usual, usual)):
            step = PERSISTENCE * (now == later) + (1.0 - PERSISTENCE) * expected
            total += share * np.exp(first[..., now]) * step * np.exp(second[..., later])
    np.testing.assert_allclose(twice, -np.log(total).sum(axis=1), rtol=1e-9)


def test_the_odds_of_sides_are_bounded_by_the_usual_shares() -> None:
    usual = EXCHANGED[[LEGS, ARMS]]
    most = np.log((1.0 - usual) / usual)
    landmarks = landmarks_of(1.0)
    right, wrong = (
        likelihoods(points, WALK.poses[3:4])[0]
        for points in (landmarks, landmarks[:, list(MIRROR)])
    )
    assert 0.3 * most.sum() < side_odds(right).sum() <= most.sum()
    assert (side_odds(right) <= most).all()
    np.testing.assert_allclose(side_odds(wrong), -side_odds(right), rtol=1e-9)
    assert not side_odds(likelihoods(landmarks_of(0.0), WALK.poses[3:4])[0]).any()


def test_legs_have_separate_odds_and_views_add_up() -> None:
    landmarks = landmarks_of(1.0)
    legs = GROUPS[LEGS]
    landmarks[0, legs] = landmarks[0, MIRRORED[legs]]  # the legs alone are exchanged
    right, crossed = (
        likelihoods(points, WALK.poses[3:4])[0]
        for points in (landmarks_of(1.0), landmarks)
    )
    np.testing.assert_allclose(
        side_odds(crossed), side_odds(right) * [-1.0, 1.0], rtol=1e-9
    )
    np.testing.assert_allclose(
        side_odds(np.concatenate([right, right])), 2.0 * side_odds(right), rtol=1e-9
    )


def test_landmarks_are_read_with_their_masks(tmp_path: Path) -> None:
    masks = np.zeros((3, 120, 160), dtype=np.uint8)
    masks[:, 20:90, 60:80] = 1
    landmarks = np.repeat(landmarks_of(0.7), 3, axis=0)
    landmarks[:, 0, 0] = [1.0, 2.0, 3.0]
    np.savez(tmp_path / "a.npz", masks=masks, landmarks=landmarks)
    np.savez(tmp_path / "b.npz", masks=masks)
    given, silent = (read_masks(tmp_path / name, (1, 3)) for name in ("a.npz", "b.npz"))
    observation = Observations([given, silent])[0]
    np.testing.assert_allclose(observation.landmarks[0], landmarks[1])
    assert not observation.landmarks[1].any()
    assert Observations([silent])[0].landmarks is None
    for wrong, message in (
        (landmarks[:2], "landmarks must be of shape"),
        (np.full_like(landmarks, np.nan), "finite"),
    ):
        np.savez(tmp_path / "c.npz", masks=masks, landmarks=wrong)
        with pytest.raises(InputError, match=message):
            read_masks(tmp_path / "c.npz", (None, None))
