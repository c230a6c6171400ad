"""Tracks that shake, of motions whose smooth form is known."""

from dataclasses import replace

import numpy as np
import pytest

import posefit
from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit.motion import recorded
from posefit.motion.motion import Motion
from posefit.motion.steadiness import acceleration, slides, standing
from posefit.tracking.smoothing import path
from posefit.tracking.smoothing.path import Squares, Visibility, smooth_path
from posefit.tracking.smoothing.smooth import steadied

VIEWPOINT = np.array([0.0, 1.0, 6.0])


def walk() -> Motion:
    """Return a walk of a recorded person, three metres or more in front of a camera at `VIEWPOINT`, across its sight."""
    motion = recorded.clip("02_01").motion().resampled(30.0)
    places = motion.translations - motion.translations.mean(axis=0) * [1.0, 0.0, 1.0]
    ways = np.diff(places[:, [0, 2]], axis=0).sum(axis=0)
    turn = -np.arctan2(-ways[1], ways[0])
    cosine = np.cos(turn)
    sine = np.sin(turn)
    turned = places @ np.array(
        [[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]]
    )
    poses = motion.poses.copy()
    poses[:, 0] += turn
    return replace(motion, poses=poses, translations=turned)


def shaken(motion: Motion, seed: int = 0) -> Motion:
    """Return a motion as a search of each frame estimates it: depth worst; its angles are smooth, and off."""
    rng = np.random.default_rng(seed)
    poses = motion.poses.copy()
    places = motion.translations.copy()
    legs = list(path.LEGS)
    times = np.arange(len(motion)) / motion.fps
    waves = np.sin(2.0 * np.pi * times[:, None] + rng.uniform(0.0, 6.0, len(legs)))
    poses[:, legs] += np.radians(2.0) * waves * motion.skeleton.free[legs]
    places += rng.normal(0.0, [0.005, 0.005, 0.05], places.shape)
    return replace(motion, poses=poses, translations=places)


def smoothed(
    motion: Motion, viewpoints: Array = VIEWPOINT, usable: Array | None = None
) -> Motion:
    """Return a motion smoothed filmed from `viewpoints`, in all frames or those that are usable."""
    count = len(motion)
    visible = np.ones(count, dtype=bool) if usable is None else usable
    return smooth_path(
        motion, Visibility(visible, np.broadcast_to(viewpoints, (count, 3)))
    )


def test_the_least_of_the_squares_is_that_of_a_dense_solution() -> None:
    rng = np.random.default_rng(3)
    count = 7
    numbers = 3
    now, feet, ways = (
        rng.normal(size=size)
        for size in ((count, numbers), (count, 2), (count, 2, numbers))
    )
    squares = Squares(count, numbers)
    squares.add(slice(0, 3), np.eye(3) * 4.0, 4.0 * now)
    squares.add_bends(slice(1, 3), now[:, 1:], 5.0)
    squares.add_steps(np.array([2, 3]), feet, ways, 6.0)

    lines = [*(2.0 * np.eye(count * numbers))]
    values = [*(2.0 * now.reshape(-1))]
    for k in range(count - 2):
        for column in (1, 2):
            line = np.zeros((count, numbers))
            line[k : k + 3, column] = [5.0, -10.0, 5.0]
            lines.append(line.reshape(-1))
            values.append(
                5.0 * (now[k, column] - 2.0 * now[k + 1, column] + now[k + 2, column])
            )
    for k in (2, 3):
        for axis in range(2):
            line = np.zeros((count, numbers))
            line[k], line[k + 1] = -6.0 * ways[k, axis], 6.0 * ways[k + 1, axis]
            lines.append(line.reshape(-1))
            values.append(6.0 * (feet[k + 1, axis] - feet[k, axis]))
    expected = np.linalg.lstsq(np.array(lines), np.array(values), rcond=None)[
        0
    ].reshape(count, numbers)
    np.testing.assert_allclose(squares.least(), expected, atol=1e-10)


def test_a_track_that_shakes_becomes_smooth_and_its_feet_stand() -> None:
    motion = walk()
    estimate = shaken(motion)
    stands = standing(motion.joints, motion.fps)
    smooth = smoothed(estimate)
    before, after, true = (
        np.nanmean(acceleration(each.joints, 30.0))
        for each in (estimate, smooth, motion)
    )
    assert before > 5.0 * true
    assert after < 1.3 * true
    assert slides(estimate.joints, stands).mean() > 0.05
    assert slides(smooth.joints, stands).mean() < 0.02
    off, was = (
        np.linalg.norm(each.joints - motion.joints, axis=2).mean()
        for each in (smooth, estimate)
    )
    assert off < 0.6 * was
    others = np.setdiff1d(np.arange(66), path.LEGS)
    np.testing.assert_array_equal(smooth.poses[:, others], estimate.poses[:, others])


def test_angles_that_one_camera_sees_are_filtered_over_a_thirtieth_of_a_second() -> (
    None
):
    motion = walk()
    poses = np.zeros((40, 66))
    viewpoints = np.full((40, 3), np.nan)
    poses[10, 5] = poses[30, 5] = 1.0
    poses[:, 0] = [np.pi - 0.01, 0.01 - np.pi] * 20  # to either side of half a turn
    viewpoints[:20] = VIEWPOINT
    seen = Visibility(viewpoints[:, 0] > 1, viewpoints)
    for fps in (30.0, 60.0):
        steady = steadied(
            Motion("", motion.skeleton, poses, np.zeros((40, 3)), fps), seen
        )
        weights = np.exp(-0.5 * (np.arange(-9, 10) * 30.0 / fps) ** 2)
        np.testing.assert_allclose(
            steady.poses[8:13, 5], (weights / weights.sum())[7:12], atol=2e-4
        )
        # several cameras see it
        np.testing.assert_array_equal(steady.poses[20:], poses[20:])
        np.testing.assert_allclose(
            np.abs(wrapped(steady.poses[:, 0])), np.pi, atol=0.011
        )


def test_depth_has_a_high_weight_with_several_cameras_and_a_low_one_with_one() -> None:
    # one camera, then several: a person who comes in is 10 cm too far at first, and then in place
    motion = walk()
    alone = 15
    places = motion.translations.copy()
    viewpoints = np.full((len(motion), 3), np.nan)
    places[:alone, 2] -= 0.1
    several = smoothed(replace(motion, translations=places), viewpoints.copy())
    viewpoints[:alone] = VIEWPOINT
    single = smoothed(replace(motion, translations=places), viewpoints)
    off, was = (
        np.abs(each.translations - motion.translations)[:, 2]
        for each in (single, several)
    )
    assert off[alone - 5 : alone].mean() < 0.7 * was[alone - 5 : alone].mean()
    assert off[alone + 5 :].max() < 0.02


def test_frames_that_are_not_usable_are_bridged_and_outliers_count_little() -> None:
    motion = walk()
    usable = np.ones(len(motion), dtype=bool)
    usable[:4] = usable[20:25] = False
    places = motion.translations.copy()
    places[~usable] += [200.0, 30.0, -500.0]
    places[40, 2] -= 20.0
    smooth = smoothed(replace(motion, translations=places), usable=usable)
    off = np.linalg.norm(smooth.translations - motion.translations, axis=1)
    assert off[20:25].max() < 0.05
    assert off[40] < 0.1
    assert np.linalg.norm(smooth.translations[0] - motion.translations[4]) < 0.3


def test_tracks_of_any_length_are_smoothed_long_ones_in_windows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for frames in (1, 2, 3):
        assert len(smoothed(walk().frames(0, frames))) == frames
    estimate = shaken(walk())
    whole = smoothed(estimate)
    monkeypatch.setattr(path, "PATH_WINDOW", 30)
    monkeypatch.setattr(path, "PATH_OVERLAP", 25)
    assert np.abs(smoothed(estimate).translations - whole.translations).max() < 0.02


def test_a_track_is_smoothed_on_demand_and_has_the_cost_of_its_smooth_poses() -> None:
    options = {"frames": (0, 8), "translation": "aligned", "evaluations": 400}
    rough, smooth = (
        posefit.track("walk", **options, smooth=smooth) for smooth in (None, True)
    )
    assert (rough.summary["smooth"], smooth.summary["smooth"]) == (False, True)
    assert smooth.summary["acceleration"] < rough.summary["acceleration"]
    assert smooth.summary["cost"] != rough.summary["cost"]
    assert [frame.evaluations for frame in smooth.frames] == [
        frame.evaluations for frame in rough.frames
    ]
    with pytest.raises(
        ValueError,
        match="smooth needs a translation that is .* aligned, got known",
    ):
        posefit.track("walk", frames=(0, 3), smooth=True)
