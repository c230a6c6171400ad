"""Poses of clips, what came after each of them, and groups of poses that are alike."""

import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.geometry.skeleton import MIRROR
from posefit.motion import built_in
from posefit.motion.built_in import average_skeleton
from posefit.motion.motion import Motion
from posefit_exemplars import exemplars
from posefit_exemplars.exemplars import (
    DIMENSIONS,
    SAME,
    Coding,
    Exemplars,
    about_vertical,
    exemplars_of,
    groups,
    mirror_image,
    thinned_frames,
)
from posefit_exemplars.kernels import STRETCH

SKELETON = average_skeleton()


def facing(poses: Array) -> Array:
    """Return joints (K, 27, 3) of bodies turned to yaw 0."""
    turned = poses.copy()
    turned[:, 0] = 0.0
    return SKELETON.joints(turned)


def test_codes_are_as_far_apart_as_joints_are_and_never_farther() -> None:
    coding = Coding.of(SKELETON, [built_in.motion("walk-a", frames=30).poses])
    assert DIMENSIONS % STRETCH == 0
    for name, least in (("walk-a", 0.005), ("walk-b", 0.02)):  # what it was made of, and another clip
        poses = built_in.motion(name, frames=30).poses
        codes = coding.coded(poses)
        assert codes.shape == (30, DIMENSIONS)
        joints = facing(poses)
        for i, j in ((0, 1), (0, 15), (7, 22)):
            true = np.sqrt(((joints[i] - joints[j]) ** 2).sum(axis=-1).mean())
            assert true - least < np.linalg.norm(codes[i] - codes[j]) < true + 1e-6


def test_a_turn_of_the_whole_body_makes_no_other_code() -> None:
    walk = built_in.motion("walk-a", frames=20)
    turned = walk.poses.copy()
    turned[:, 0] += 1.2
    coding = Coding.of(SKELETON, [walk.poses])
    np.testing.assert_allclose(coding.coded(turned), coding.coded(walk.poses), atol=1e-6)


def test_frames_that_are_alike_are_kept_once_but_ends_of_clips_always() -> None:
    codes = np.array([[0.0], [0.5], [0.9], [1.1], [5.0], [5.1], [5.2]], dtype=np.float32) * SAME
    assert thinned_frames(codes).tolist() == [0, 3, 4, 6]
    assert thinned_frames(codes[:2]).tolist() == [0, 1]


def test_codes_are_the_same_however_the_poses_are_divided_into_clips() -> None:
    walk = built_in.motion("walk-a", frames=30).poses
    whole, parts = Coding.of(SKELETON, [walk]), Coding.of(SKELETON, [walk[:7], walk[7:]])
    apart = [np.linalg.norm(one.coded(walk)[:, None] - one.coded(walk), axis=-1) for one in (whole, parts)]
    np.testing.assert_allclose(*apart, atol=1e-5)


def test_groups_begin_with_poses_that_are_as_unlike_as_can_be() -> None:
    line = np.array([[0.0], [1.0], [2.0], [3.0], [10.0]], dtype=np.float32)
    centres, owners = groups(line, 3)
    assert centres.tolist() == [0, 4, 3]  # 10 is farthest from 0, then 3 is
    assert owners.tolist() == [0, 0, 2, 2, 1]
    assert len(groups(line[[0, 0, 0]], 3)[0]) == 1  # no two groups of the same pose


def test_every_pose_is_in_one_group_that_of_its_nearest_centre(two: Exemplars) -> None:
    assert sorted(two.of_groups(np.arange(len(two.centres))).tolist()) == list(range(len(two)))
    np.testing.assert_array_equal(two.grouped, two.codes[two.members])
    away = np.linalg.norm(two.codes[:, None] - two.codes[two.centres], axis=-1)
    np.testing.assert_allclose(away[np.arange(len(two)), two.owners], away.min(axis=1), atol=1e-6)
    for group in range(len(two.centres)):
        assert (two.owners[two.of_groups(np.array([group]))] == group).all()


def test_what_comes_after_a_pose_lies_on_its_clip_and_stops_at_its_end(two: Exemplars) -> None:
    walk = built_in.motion("walk-a", frames=40)
    for seconds in (1.0 / 30.0, 0.5, 1.0):
        found, turns, ways = two.after(np.array([0]), seconds)
        k = round(30.0 * seconds)
        assert np.linalg.norm(found - two.coding.coded(walk.poses[k : k + 1])) < SAME
        assert turns[0] == pytest.approx(walk.poses[k, 0] - walk.poses[0, 0], abs=0.01)
        went = about_vertical(ways, walk.poses[:1, 0])[0]
        np.testing.assert_allclose(went, walk.translations[k] - walk.translations[0], atol=0.02)
    last, *_ = two.after(np.array([0]), 99.0)
    np.testing.assert_allclose(last[0], two.codes[two.lasts[0]], atol=1e-6)


def test_what_is_between_two_frames_is_interpolated_and_no_clip_goes_on_as_another(two: Exemplars) -> None:
    ends = two.lasts
    codes, turns, ways = two.after(ends, 0.1)  # of both clips
    np.testing.assert_allclose(codes, two.codes[ends], atol=1e-6)
    assert np.abs(turns).max() == np.abs(ways).max() == 0.0
    half = 0.5 * (two.times[1] - two.times[0])
    np.testing.assert_allclose(two.after(np.array([0]), half)[0][0], 0.5 * (two.codes[0] + two.codes[1]), atol=1e-6)


def test_a_way_goes_where_the_body_faces() -> None:
    ahead = np.array([[0.0, 0.5, 2.0]])
    np.testing.assert_allclose(about_vertical(ahead, np.array([0.5 * np.pi])), [[2.0, 0.5, 0.0]], atol=1e-12)


def test_a_mirror_image_is_the_reflection_of_every_joint() -> None:
    walk = built_in.motion("run-a", frames=15)
    tilted = walk.poses + np.append([0.3, 0.2, 0.1], np.zeros(63))
    walk = replace(walk, poses=tilted, translations=walk.translations + [0.4, 0.0, 0.0])
    image = mirror_image(walk)
    true = SKELETON.joints(walk.poses, walk.translations) * [-1.0, 1.0, 1.0]
    found = SKELETON.joints(image.poses, image.translations)
    # bones of the two sides are seldom equally long
    assert np.linalg.norm(found - true[:, list(MIRROR)], axis=-1).max() < 0.03
    again = mirror_image(image)
    np.testing.assert_allclose(again.poses, walk.poses, atol=1e-9)
    np.testing.assert_allclose(again.translations, walk.translations, atol=1e-12)


def test_both_a_clip_and_its_mirror_image_are_learned_from() -> None:
    walk = built_in.motion("walk-a", frames=20)
    both, one = (Exemplars.of([walk], SKELETON, mirrored=mirrored) for mirrored in (True, False))
    assert (len(both.lasts), len(one.lasts)) == (2, 1)
    np.testing.assert_array_equal(both.poses[both.clips == 0], one.poses)
    image = mirror_image(walk)
    own = both.poses[both.clips == 1]
    assert np.abs(own[:, None] - image.poses).max(axis=2).min(axis=1).max() < 1e-12


def test_poses_are_drawn_by_the_root_of_the_size_of_their_group(two: Exemplars) -> None:
    # three groups, of 1, 4 and 16 poses: drawn as 1 to 2 to 4, and all poses of a group alike
    owners = np.repeat([0, 1, 2], [1, 4, 16])
    made = replace(two, owners=owners, members=np.arange(21)[::-1], bounds=np.array([0, 16, 20, 21]))
    drawn = made.drawn(70_000, np.random.default_rng(0))
    counts = np.bincount(drawn, minlength=21)
    assert counts[0] == pytest.approx(10_000, rel=0.05)
    np.testing.assert_allclose(counts[1:5], 5_000, rtol=0.06)
    np.testing.assert_allclose(counts[5:], 2_500, rtol=0.08)


def test_states_of_the_same_motions_are_made_once_and_of_others_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exemplars, "_latest", None)
    walk = built_in.motion("walk-a", frames=12)
    made = exemplars_of([walk], SKELETON, False)
    again = Motion(walk.name, walk.skeleton, walk.poses.copy(), walk.translations.copy(), walk.fps)
    assert exemplars_of([again], SKELETON, False) is made
    others = (
        ([walk], True),
        ([replace(walk, poses=walk.poses + 1e-9)], False),
        ([replace(walk, translations=walk.translations + 1e-9)], False),
        ([replace(walk, fps=60.0)], False),
        ([walk.frames(0, 4), walk.frames(4, 12)], False),
        ([walk.frames(0, 6), walk.frames(6, 12)], False),  # the same frames, of the same names, cut elsewhere
    )
    for motions, mirrored in others:
        other = exemplars_of(motions, SKELETON, mirrored)
        assert other is not made
        made = other


def test_threads_that_learn_from_different_motions_each_get_their_own_states(monkeypatch: pytest.MonkeyPatch) -> None:
    motions = [built_in.motion(name, frames=2) for name in ("walk-a", "run-a")]
    monkeypatch.setattr(Exemplars, "of", lambda given, skeleton, mirrored: given[0].name)
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            made = list(pool.map(lambda k: exemplars_of([motions[k % 2]], SKELETON, False), range(1000)))
    finally:
        sys.setswitchinterval(interval)
    assert made == [motions[k % 2].name for k in range(1000)]


def test_a_motion_of_one_frame_or_none_is_refused() -> None:
    walk = built_in.motion("walk-a", frames=1)
    with pytest.raises(ValueError, match="walk-a must have at least 2 frames to be followed, got 1"):
        Exemplars.of([walk], SKELETON)
    with pytest.raises(ValueError, match="exemplars must have motions to learn from, got none"):
        Exemplars.of([], SKELETON)
