"""Poses of clips, what came after each of them, and groups of similar poses."""

from dataclasses import replace

import numpy as np
import pytest

from posefit.geometry.skeleton import MIRROR
from posefit.motion import built_in
from posefit.motion.built_in import average_skeleton
from posefit_exemplars.exemplars import (
    MIN_FRAME_DISTANCE,
    Exemplars,
    Tiles,
    about_vertical,
    exemplars_of,
    mirror_image,
)
from posefit_exemplars.kernels import DIMENSIONS, frames_apart, nearest_codes
from tests.cases import each

SKELETON = average_skeleton()


def test_similar_frames_are_kept_once_and_ends_of_clips_always() -> None:
    codes = np.array(
        [[0.0], [0.5], [0.9], [1.1], [5.0], [5.1], [5.2]], dtype=np.float32
    )
    assert frames_apart(codes, np.float32(1.0)).tolist() == [0, 3, 4, 6]
    assert frames_apart(codes[:2], np.float32(1.0)).tolist() == [0, 1]


def test_nearest_codes_equal_a_search_of_all_codes_in_the_groups() -> None:
    rng = np.random.default_rng(0)
    codes = rng.normal(size=(200, DIMENSIONS)).astype(np.float32)
    # one group is small, and one empty
    members = rng.permutation(200)
    bounds = np.array([0, 3, 100, 100, 200])
    tiles = Tiles.of(codes, members, bounds)
    some = codes[:5] + np.float32(0.1)
    for groups, looked_at in (([1, 3], members[3:]), ([2, 0], members[:3])):
        states, squares = nearest_codes(some, np.tile(groups, (5, 1)), tiles, 4)
        away = ((some[:, None] - codes[looked_at]) ** 2).sum(axis=2)
        order = np.argsort(away, axis=1)[:, :4]
        near = order.shape[1]
        np.testing.assert_array_equal(states[:, :near], looked_at[order])
        np.testing.assert_allclose(
            squares[:, :near], np.take_along_axis(away, order, axis=1), rtol=1e-5
        )
        assert np.isinf(squares[:, near:]).all()


@each("backwards", [False, True])
def test_a_pose_continues_with_its_clip_and_stops_at_the_clips_end(
    two: Exemplars, backwards: bool
) -> None:
    walk = built_in.motion("walk-a", frames=40)
    walk, begin, end = (
        (walk.reversed(), two.last_states[0], 0)
        if backwards
        else (walk, 0, two.last_states[0])
    )
    for seconds in (1.0 / 30.0, 0.5, 1.0):
        codes, turns, ways = two.continuation(
            np.array([begin]), -seconds if backwards else seconds
        )
        k = round(30.0 * seconds)
        assert (
            np.linalg.norm(codes - two.coding.of_poses(walk.poses[k : k + 1]))
            < MIN_FRAME_DISTANCE
        )
        assert turns[0] == pytest.approx(walk.poses[k, 0] - walk.poses[0, 0], abs=0.01)
        displacement = about_vertical(ways, walk.poses[:1, 0])[0]
        np.testing.assert_allclose(
            displacement, walk.translations[k] - walk.translations[0], atol=0.02
        )
    last, *_ = two.continuation(np.array([begin]), -99.0 if backwards else 99.0)
    np.testing.assert_allclose(last[0], two.codes[end], atol=1e-6)


def test_states_are_interpolated_between_frames_and_not_between_clips(
    two: Exemplars,
) -> None:
    ends = two.last_states
    codes, turns, ways = two.continuation(ends, 0.1)  # of both clips
    np.testing.assert_allclose(codes, two.codes[ends], atol=1e-6)
    assert np.abs(turns).max() == np.abs(ways).max() == 0.0
    halfway, *_ = two.continuation(np.array([0]), 0.5 * (two.times[1] - two.times[0]))
    np.testing.assert_allclose(
        halfway[0], 0.5 * (two.codes[0] + two.codes[1]), atol=1e-6
    )


def test_a_mirror_image_is_the_reflection_of_every_joint() -> None:
    walk = built_in.motion("run-a", frames=15)
    tilted = walk.poses + np.append([0.3, 0.2, 0.1], np.zeros(63))
    walk = replace(walk, poses=tilted, translations=walk.translations + [0.4, 0.0, 0.0])
    image = mirror_image(walk)
    true = SKELETON.joints(walk.poses, walk.translations) * [-1.0, 1.0, 1.0]
    joints = SKELETON.joints(image.poses, image.translations)
    # bones of the two sides are seldom equally long
    assert np.linalg.norm(joints - true[:, list(MIRROR)], axis=-1).max() < 0.03
    twice = mirror_image(image)
    np.testing.assert_allclose(twice.poses, walk.poses, atol=1e-9)
    np.testing.assert_allclose(twice.translations, walk.translations, atol=1e-12)


def test_no_motion_is_refused() -> None:
    with pytest.raises(
        ValueError, match="exemplars must have motions to learn from, got none"
    ):
        Exemplars.of([], SKELETON)


def test_states_are_made_once_for_the_same_motions() -> None:
    walk = built_in.motion("walk-a", frames=12)
    made = exemplars_of([walk], SKELETON)
    assert exemplars_of([replace(walk, poses=walk.poses.copy())], SKELETON) is made
    moved = replace(walk, translations=walk.translations + 1e-9)
    faster = replace(walk, fps=60.0)
    for motions in (
        [moved],
        [faster],
        *([walk.frames(0, k), walk.frames(k, 12)] for k in (4, 6)),
    ):
        assert exemplars_of(motions, SKELETON) is not made
        made = exemplars_of(motions, SKELETON)
