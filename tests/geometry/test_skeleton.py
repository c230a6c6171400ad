"""Kinematics by law and against a slow twin; bones and angles of limbs."""

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.geometry import kernels
from posefit.geometry.body import Body
from posefit.geometry.kernels import sine_cosine
from posefit.geometry.rotation import rotation_from_joint_angles
from posefit.geometry.skeleton import (
    ANGLES,
    BONES,
    INNER,
    JOINTS,
    LIMBS,
    Skeleton,
    angle_index,
    angles_of,
)
from posefit.motion.built_in import average_skeleton
from tests.cases import each
from tests.geometry.turns import about, chained


def test_polynomial_sines_are_numpys_over_many_turns() -> None:
    x = np.linspace(-50.0, 50.0, 100_001)
    s, c = np.transpose([sine_cosine(angle) for angle in x])
    np.testing.assert_allclose(s, np.sin(x), rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(c, np.cos(x), rtol=0.0, atol=1e-10)


def slow_joints(skeleton: Skeleton, pose: Array, place: Array) -> Array:
    angles = [
        pose[3 + 3 * INNER.index(j) :][:3] if j in INNER else np.zeros(3)
        for j in range(1, len(JOINTS))
    ]
    turns = [about(2, z) @ about(1, y) @ about(0, x) for x, y, z in angles]
    root = about(1, pose[0]) @ about(0, pose[1]) @ about(2, pose[2])
    return chained(root, place, turns, list(skeleton.axes), list(skeleton.offsets))


def test_shapes_are_checked() -> None:
    skeleton = average_skeleton()
    with pytest.raises(
        ValueError, match=r"poses must have shape \(..., 66\), got \(2, 65\)"
    ):
        skeleton.joints(np.zeros((2, 65)))
    with pytest.raises(
        ValueError, match=r"translations must have shape \(2, 3\), got \(3,\)"
    ):
        skeleton.joints(np.zeros((2, 66)), np.zeros(3))
    with pytest.raises(
        ValueError, match=r"offsets must have shape \(26, 3\), got \(25, 3\)"
    ):
        Skeleton("x", np.zeros((25, 3)), np.zeros((26, 3, 3)), ())


def test_free_angles_are_the_channels_and_the_root() -> None:
    channels = ("ltibia", ("rx",)), ("rfoot", ("rx", "rz")), ("rthumb", ("rx",))
    skeleton = Skeleton(
        "x", np.zeros((26, 3)), np.tile(np.eye(3), (26, 1, 1)), channels
    )
    tibia = angle_index(JOINTS.index("ltibia"))
    foot = angle_index(JOINTS.index("rfoot"))
    assert np.flatnonzero(skeleton.free).tolist() == [0, 1, 2, tibia, foot, foot + 2]


@pytest.mark.pure
def test_one_pose_equals_the_slow_twin_even_uncompiled() -> None:
    skeleton = average_skeleton()
    pose = np.random.default_rng(6).uniform(-3.0, 3.0, ANGLES)
    place = np.array([0.1, 0.2, 0.3])
    np.testing.assert_allclose(
        skeleton.joints(pose, place),
        slow_joints(skeleton, pose, place),
        rtol=0.0,
        atol=1e-9,
    )


def test_joints_equal_the_slow_twin_whatever_the_frames_of_the_angles() -> None:
    rng = np.random.default_rng(7)
    for share in (0.0, 0.5, 1.0):  # of the bones, those whose frame is turned
        axes = np.tile(np.eye(3), (26, 1, 1))
        turned = rng.random(26) < share
        axes[turned] = rotation_from_joint_angles(
            rng.uniform(-3.0, 3.0, (int(turned.sum()), 3))
        )
        skeleton = Skeleton("x", rng.normal(0.0, 0.3, (26, 3)), axes, ())
        poses = rng.uniform(-3.0, 3.0, (10, ANGLES))
        places = rng.normal(size=(10, 3))
        slow = [
            slow_joints(skeleton, pose, place)
            for pose, place in zip(poses, places, strict=True)
        ]
        np.testing.assert_allclose(
            skeleton.joints(poses, places), slow, rtol=0.0, atol=1e-9
        )
        led = skeleton.joints(poses.reshape(2, 5, ANGLES), places.reshape(2, 5, 3))
        np.testing.assert_array_equal(
            led.reshape(10, 27, 3), skeleton.joints(poses, places)
        )
        frames, sines, cosines = skeleton.frames(poses, places)
        assert frames.shape == (10, 27, 4, 3)
        np.testing.assert_allclose(frames[:, :, 3], slow, rtol=0.0, atol=1e-9)
        axes_of = frames[:, :, :3]
        np.testing.assert_allclose(
            axes_of @ axes_of.swapaxes(-1, -2),
            np.broadcast_to(np.eye(3), axes_of.shape),
            atol=1e-9,
        )
        np.testing.assert_allclose(sines, np.sin(poses), atol=1e-9)
        np.testing.assert_allclose(cosines, np.cos(poses), atol=1e-9)


@each("name", LIMBS)
def test_a_limbs_angles_move_all_of_its_bones_and_no_other(name: str) -> None:
    skeleton = average_skeleton()
    pose = np.zeros(66)
    pose[angles_of(LIMBS[name])] = 0.3
    moved = (
        np.abs(skeleton.joints(pose) - skeleton.joints(np.zeros(66))).max(axis=1) > 1e-9
    )
    assert set(np.flatnonzero(moved[1:])) == {BONES.index(bone) for bone in LIMBS[name]}


def test_a_joint_is_as_wide_as_the_widest_bone_that_meets_there() -> None:
    radii = np.zeros((26, 2))
    bones = {
        "lhipjoint": (0.1, 0.2),
        "rhipjoint": (0.3, 0.0),
        "lfemur": (0.15, 0.05),
        "head": (0.0, 0.4),
    }
    radii[[BONES.index(bone) for bone in bones]] = list(bones.values())
    joint_radii = Body(average_skeleton(), radii).joint_radii()
    by_hand = {"root": 0.3, "lhipjoint": 0.2, "lfemur": 0.05, "head": 0.4}
    np.testing.assert_allclose(joint_radii, [by_hand.get(name, 0.0) for name in JOINTS])


def test_radii_are_checked() -> None:
    skeleton = average_skeleton()
    with pytest.raises(
        ValueError, match=r"radii must have shape \(26, 2\), got \(2, 26\)"
    ):
        Body(skeleton, np.zeros((2, 26)))
    for bad, message in (
        (-0.1, "radii must not be negative, got -0.1"),
        (np.nan, "radii must be finite"),
    ):
        radii = np.ones((26, 2))
        radii[3, 1] = bad
        with pytest.raises(ValueError, match=message):
            Body(skeleton, radii)


def test_frames_of_any_number_of_poses_are_written_and_nothing_beyond_them() -> None:
    skeleton = average_skeleton()
    rng = np.random.default_rng(0)
    poses = rng.uniform(-1.0, 1.0, (9, ANGLES))
    places = rng.normal(size=(9, 3))
    room = np.full((24, len(JOINTS), 4, 3), np.nan)
    sines = np.full((24, ANGLES), np.nan)
    cosines = np.full((24, ANGLES), np.nan)
    kernels.place_frames(
        skeleton.chain, poses, places, sines[:9], cosines[:9], room[:9]
    )
    np.testing.assert_allclose(room[:9, :, 3], skeleton.joints(poses, places))
    for written in (room, sines, cosines):
        assert np.isnan(written[9:]).all()


def test_a_person_is_as_tall_as_people_are() -> None:
    body = Body.of(average_skeleton())
    assert 1.5 < body.stature < 2.0
    assert body.scaled(2.0, 2.0).stature == pytest.approx(2.0 * body.stature)
