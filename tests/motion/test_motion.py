"""A clip is cut and resampled without blur; how its joints accelerate and feet slide."""

import numpy as np
import pytest

from posefit.geometry.rotation import geodesic, rotation_from_root_angles
from posefit.geometry.skeleton import BONES, JOINTS, Skeleton
from posefit.motion.motion import Motion
from posefit.motion.steadiness import acceleration, slides, standing
from tests.cases import each

SKELETON = Skeleton(
    "stick",
    np.ones((26, 3)),
    np.tile(np.eye(3), (26, 1, 1)),
    tuple((bone, ()) for bone in BONES),
)


def clip(frames: int, fps: float = 120.0) -> Motion:
    rng = np.random.default_rng(3)
    steps = rng.uniform(-0.3, 0.3, (frames, 66))
    return Motion(
        "clip", SKELETON, np.cumsum(steps, axis=0), rng.normal(size=(frames, 3)), fps
    )


@each(
    ("poses", "translations", "fps", "message"),
    [
        (
            np.zeros((2, 62)),
            np.zeros((2, 3)),
            30.0,
            r"poses must have shape \(frames, 66\), got \(2, 62\)",
        ),
        (
            np.zeros((0, 66)),
            np.zeros((0, 3)),
            30.0,
            "poses must contain at least 1 frame, got 0",
        ),
        (
            np.full((1, 66), np.nan),
            np.zeros((1, 3)),
            30.0,
            "poses must be finite, got 66 that are not",
        ),
        (
            np.zeros((2, 66)),
            np.zeros((3, 3)),
            30.0,
            r"translations must have shape \(2, 3\), got \(3, 3\)",
        ),
        (
            np.zeros((2, 66)),
            np.zeros((2, 3)),
            np.nan,
            r"fps must lie in 0.001 to 1e\+06, got nan",
        ),
    ],
)
def test_mistakes_are_named(
    poses: np.ndarray, translations: np.ndarray, fps: float, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Motion("m", SKELETON, poses, translations, fps)


@each(("start", "stop"), [(3, 3), (-1, 4), (0, 11), (5, 2)])
def test_frames_outside_the_clip_are_refused(start: int, stop: int) -> None:
    with pytest.raises(
        ValueError, match=rf"start < stop <= 10, got start {start} and stop {stop}"
    ):
        clip(10).frames(start, stop)


@each(("frames", "kept"), [(1, 1), (4, 1), (5, 2), (9, 3), (343, 86)])
def test_a_whole_ratio_takes_every_kth_frame_unchanged(frames: int, kept: int) -> None:
    motion = clip(frames)
    slow = motion.resampled(30.0)
    assert len(slow) == kept
    assert slow.fps == 30.0
    np.testing.assert_array_equal(slow.poses, motion.poses[::4])
    np.testing.assert_array_equal(slow.translations, motion.translations[::4])


@each(
    ("frames", "fps", "new", "kept"),
    # times k / new up to (frames - 1) / fps: 0.05 s at 50 Hz is k = 0, 1, 2; 0.1 s at 30 Hz is k = 0 ... 3
    [
        (7, 120.0, 50.0, 3),
        (11, 100.0, 30.0, 4),
        (2, 30.0, 120.0, 5),
        (1, 30.0, 120.0, 1),
        (2, 30.0, 29.0, 1),
    ],
)
def test_times_stay_within_the_clip(
    frames: int, fps: float, new: float, kept: int
) -> None:
    assert len(clip(frames, fps).resampled(new)) == kept


def test_between_frames_joints_are_linear_and_the_root_lies_half_way_on_the_shortest_arc() -> (
    None
):
    motion = clip(5, 20.0)
    fast = motion.resampled(40.0)
    np.testing.assert_allclose(fast.poses[::2], motion.poses, atol=1e-12)
    np.testing.assert_allclose(
        fast.poses[1::2, 3:],
        (motion.poses[1:, 3:] + motion.poses[:-1, 3:]) / 2,
        atol=1e-12,
    )
    middle = (motion.translations[1:] + motion.translations[:-1]) / 2
    np.testing.assert_allclose(fast.translations[1::2], middle, atol=1e-12)
    roots = rotation_from_root_angles(motion.poses[:, :3])
    between = rotation_from_root_angles(fast.poses[1::2, :3])
    whole = geodesic(roots[:-1], roots[1:])
    np.testing.assert_allclose(geodesic(roots[:-1], between), whole / 2, atol=1e-9)
    np.testing.assert_allclose(geodesic(between, roots[1:]), whole / 2, atol=1e-9)


def test_a_root_that_turns_on_and_on_keeps_its_turns() -> None:
    poses = (7.0 + 0.5 * np.arange(40)[:, None]) * np.eye(1, 66)
    fast = Motion("spin", SKELETON, poses, np.zeros((40, 3)), 30.0).resampled(45.0)
    np.testing.assert_allclose(
        fast.poses[:, 0], 7.0 + np.arange(len(fast)) / 3.0, atol=1e-9
    )


def test_a_motion_is_not_resampled_to_more_frames_than_fit_into_memory() -> None:
    motion = clip(100, fps=0.1)
    for fps, message in (
        (1000.0, "must have at most 200000 frames when it is resampled"),
        (1e-300, "fps must lie in"),
    ):
        with pytest.raises(ValueError, match=message):
            motion.resampled(fps)


LEFT = JOINTS.index("lfoot")
RIGHT = JOINTS.index("rfoot")


def still(frames: int) -> np.ndarray:
    """Return joints (T, 27, 3) of a person whose joints all stay 1 m above the ground, but for the feet, on it."""
    joints = np.ones((frames, len(JOINTS), 3))
    joints[:, [LEFT, RIGHT], 1] = 0.0
    return joints


@each(("fps", "left_out"), [(30.0, 1), (120.0, 4), (25.0, 1)])
def test_a_falling_body_has_the_same_acceleration_at_any_rate(
    fps: float, left_out: int
) -> None:
    times = np.arange(40) / fps
    joints = still(40)
    joints[..., 1] -= 0.5 * 9.81 * times[:, None] ** 2
    accelerations = acceleration(joints, fps)
    np.testing.assert_allclose(accelerations[left_out:-left_out], 9.81)
    assert np.isnan([accelerations[:left_out], accelerations[-left_out:]]).all()


def test_a_lifted_or_fast_foot_is_not_on_the_ground() -> None:
    joints = still(60)
    joints[20:40, LEFT, 1] = 0.2
    joints[:, RIGHT, 0] += np.arange(60) / 30.0  # a metre a second
    stands = standing(joints, 30.0)
    assert stands[:19, 0].all()
    assert not stands[20:40, 0].any()
    assert not stands[:, 1].any()


def test_a_step_is_as_long_as_a_foot_creeps_along_the_ground() -> None:
    joints = still(60)
    joints[20:40, LEFT, 1] = 0.2  # two steps of the left foot, one of the right
    # 5 mm a frame, 15 cm a second
    joints[40:, LEFT] += np.arange(20)[:, None] * [0.003, 0.0, 0.004]
    stands = standing(joints, 30.0)
    lengths = slides(joints, stands)
    assert (len(lengths), lengths[0], lengths[2]) == (3, 0.0, 0.0)
    assert lengths[1] == pytest.approx(0.005 * (stands[40:, 0].sum() - 1))


def test_the_lowest_place_of_the_feet_is_the_ground_wherever_that_is() -> None:
    rising = still(300)
    # 30 cm in ten seconds: a track that drifts
    rising[..., 1] += 0.03 * np.arange(300)[:, None] / 30.0
    assert standing(rising, 30.0).all()


@each(("fps", "first"), [(30.0, 25), (48.0, 40), (240.0, 200), (36.0, 30)])
def test_a_resampled_part_begins_at_the_same_second(fps: float, first: int) -> None:
    part = clip(120).frames(100, 120).resampled(fps)
    assert (part.first, part.first / part.fps) == (first, pytest.approx(100 / 120.0))
    assert clip(120).frames(100, 101).resampled(fps).first == first


def test_a_motion_twice_reversed_is_itself_until_it_is_changed() -> None:
    motion = clip(4, 30.0)
    backwards = motion.reversed()
    np.testing.assert_array_equal(backwards.poses, motion.poses[::-1])
    np.testing.assert_array_equal(backwards.translations, motion.translations[::-1])
    assert backwards.reversed() is motion
    part = backwards.frames(0, 2).reversed()
    np.testing.assert_array_equal(part.poses, motion.poses[2:])
