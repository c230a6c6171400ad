"""Poses of clips, what came after each of them, and groups of poses that are alike."""

import numpy as np
import pytest

from posefit.motion import built_in
from posefit.motion.built_in import average_skeleton
from posefit.motion.motion import Motion
from posefit_exemplars.exemplars import DIMENSIONS, SAME, Exemplars, coded, groups, thinned

SKELETON = average_skeleton()


@pytest.fixture(scope="module")
def two() -> Exemplars:
    return Exemplars.of([built_in.motion("walk-a", frames=40), built_in.motion("run-a", frames=25)], SKELETON)


def test_codes_are_as_far_apart_as_joints_are() -> None:
    poses = built_in.motion("walk-a", frames=30).poses
    codes = coded(SKELETON, poses)
    assert codes.shape == (30, DIMENSIONS)
    facing = poses.copy()
    facing[:, 0] = 0.0
    joints = SKELETON.joints(facing)
    for i, j in ((0, 1), (0, 15), (7, 22)):
        true = np.sqrt(((joints[i] - joints[j]) ** 2).sum(axis=-1).mean())
        assert np.linalg.norm(codes[i] - codes[j]) == pytest.approx(true, abs=0.005)


def test_frames_that_are_alike_are_kept_once_but_ends_of_clips_always() -> None:
    codes = np.array([[0.0], [0.5], [0.9], [1.1], [5.0], [5.1], [5.2]], dtype=np.float32) * SAME
    assert thinned(codes, np.array([0, 0, 0, 0, 0, 1, 1])).tolist() == [0, 3, 4, 5, 6]


def test_what_comes_after_a_pose_lies_on_its_clip_and_stops_at_its_end(two: Exemplars) -> None:
    walk = built_in.motion("walk-a", frames=40)
    first = int(np.flatnonzero(two.clips == 0)[0])
    # two clips of one skeleton: codes of interpolated poses are what the clip's own frames have
    for seconds in (1.0 / 30.0, 0.5, 1.0):
        found, turns, _ = two.after(np.array([first]), seconds)
        k = round(30.0 * seconds)
        near = np.linalg.norm(two.codes[two.clips == 0] - found, axis=1).min()
        assert near < SAME
        assert turns[0] == pytest.approx(walk.poses[k, 0] - walk.poses[0, 0], abs=0.01)
    last, *_ = two.after(np.array([first]), 99.0)
    np.testing.assert_allclose(last[0], two.codes[two.lasts[0]], atol=1e-6)


def test_groups_begin_with_poses_that_are_as_unlike_as_can_be() -> None:
    line = np.array([[0.0], [1.0], [2.0], [3.0], [10.0]], dtype=np.float32)
    centres, owners = groups(line, 3)
    assert centres.tolist() == [0, 4, 3]  # 10 is farthest from 0, then 3 is
    assert owners.tolist() == [0, 0, 2, 2, 1]
    assert len(groups(line[[0, 0, 0]], 3)[0]) == 1  # no two groups of the same pose


def test_every_pose_is_in_one_group(two: Exemplars) -> None:
    assert sorted(two.of_groups(np.arange(len(two.centres))).tolist()) == list(range(len(two)))


def test_a_motion_of_one_frame_or_none_is_refused() -> None:
    walk = built_in.motion("walk-a", frames=1)
    with pytest.raises(ValueError, match="walk-a must have at least 2 frames to be followed, got 1"):
        Exemplars.of([walk], SKELETON)
    with pytest.raises(ValueError, match="exemplars must have motions to learn from, got none"):
        Exemplars.of([], SKELETON)


def test_a_turn_of_the_whole_body_makes_no_other_code() -> None:
    walk = built_in.motion("walk-a", frames=20)
    turned = walk.poses.copy()
    turned[:, 0] += 1.2
    both = coded(
        SKELETON, np.concatenate([Motion("turned", SKELETON, turned, walk.translations, 30.0).poses, walk.poses])
    )
    np.testing.assert_allclose(both[:20], both[20:], atol=1e-6)
