"""Poses that have nearly the same silhouette: what each operator does to joints, and how much of the outline it keeps."""

from collections.abc import Callable

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import rotation_from_root_angles
from posefit.geometry.skeleton import (
    ANGLES,
    INNER,
    JOINTS,
    LIMBS,
    MIRROR,
    Skeleton,
    angle_index,
)
from posefit.geometry.symmetry import (
    exchanged_limbs,
    facing,
    mirrored_poses,
    reflected_poses,
    turned_poses,
)
from posefit.motion import built_in
from tests.cases import each

WALK = built_in.motion("walk", frames=30)
SKELETON = WALK.skeleton  # symmetric
TOWARDS = 0.4  # radians

Operator = Callable[[Skeleton, Array], Array]
OPERATORS: dict[str, Operator] = {
    "mirrored": mirrored_poses,
    "turned": lambda _, poses: turned_poses(poses),
    "reflected": lambda skeleton, poses: reflected_poses(skeleton, poses, TOWARDS),
    "legs": lambda skeleton, poses: exchanged_limbs(skeleton, poses, "legs"),
    "arms": lambda skeleton, poses: exchanged_limbs(skeleton, poses, "arms"),
}


def drawn(count: int = 20) -> Array:
    """Return poses of a body that leans and turns every way, free of what the motions of a walk have in common."""
    rng = np.random.default_rng(3)
    poses = np.zeros((count, ANGLES))
    poses[:, :3] = rng.uniform(-1.2, 1.2, (count, 3)) * [2.5, 1.0, 1.0]
    for j in INNER:
        if JOINTS[j] not in ("lhipjoint", "rhipjoint"):
            poses[:, angle_index(j) : angle_index(j) + 3] = rng.uniform(
                -1.2, 1.2, (count, 3)
            )
    return poses


def lopsided() -> Skeleton:
    """Return a skeleton whose rest frames are no mirror images, as nothing makes a .bvh or .asf file have them."""
    turn = rotation_from_root_angles(
        np.random.default_rng(1).uniform(-1.0, 1.0, (26, 3))
    )
    return Skeleton(
        "lopsided", SKELETON.offsets, turn @ SKELETON.axes, SKELETON.channels
    )


@each("name", OPERATORS)
@each("skeleton", [SKELETON, lopsided()])
def test_twice_is_as_before(name: str, skeleton: Skeleton) -> None:
    poses = drawn()
    twice = OPERATORS[name](skeleton, OPERATORS[name](skeleton, poses))
    np.testing.assert_allclose(
        skeleton.joints(twice), skeleton.joints(poses), atol=1e-9
    )
    assert not np.allclose(
        skeleton.joints(OPERATORS[name](skeleton, poses)),
        skeleton.joints(poses),
        atol=0.05,
    )


@each("skeleton", [SKELETON, lopsided()])
def test_mirrored_joints_are_reflected_in_the_sagittal_plane(
    skeleton: Skeleton,
) -> None:
    poses = drawn()
    across = np.stack(
        [np.cos(poses[:, 0]), np.zeros(len(poses)), -np.sin(poses[:, 0])], axis=1
    )
    joints = skeleton.joints(poses)[:, MIRROR]
    expected = (
        joints
        - 2.0 * np.einsum("njk,nk->nj", joints, across)[..., None] * across[:, None]
    )
    np.testing.assert_allclose(
        skeleton.joints(mirrored_poses(skeleton, poses)), expected, atol=1e-9
    )


def test_reflected_joints_are_those_of_the_other_side_at_the_other_depth() -> None:
    poses = drawn()
    sight = np.array([np.sin(TOWARDS), 0.0, np.cos(TOWARDS)])
    joints = SKELETON.joints(poses)[:, MIRROR]
    expected = joints - 2.0 * (joints @ sight)[..., None] * sight
    np.testing.assert_allclose(
        SKELETON.joints(reflected_poses(SKELETON, poses, TOWARDS)), expected, atol=1e-9
    )


def test_a_left_leg_that_is_forward_becomes_a_right_one_by_hand() -> None:
    poses = np.zeros((1, ANGLES))
    left, right = (angle_index(JOINTS.index(name)) for name in ("lfemur", "rfemur"))
    poses[0, left : left + 3] = [-0.5, 0.1, 0.2]
    for exchanged in (
        mirrored_poses(SKELETON, poses),
        exchanged_limbs(SKELETON, poses, "legs"),
    ):
        np.testing.assert_allclose(exchanged[0, right : right + 3], [-0.5, -0.1, -0.2])
        np.testing.assert_allclose(exchanged[0, left : left + 3], 0.0)
    np.testing.assert_array_equal(exchanged_limbs(SKELETON, poses, "arms"), poses)


@each("limbs", ["legs", "arms"])
def test_exchanged_limbs_leave_everything_else_where_it_is(limbs: str) -> None:
    poses = drawn()
    moved = {
        name for limb in LIMBS for name in LIMBS[limb] if limb.endswith(limbs[:-1])
    }
    still = [k for k, name in enumerate(JOINTS) if name not in moved]
    exchanged = exchanged_limbs(SKELETON, poses, limbs)  # type: ignore[arg-type]
    np.testing.assert_array_equal(
        SKELETON.joints(exchanged)[:, still], SKELETON.joints(poses)[:, still]
    )
    np.testing.assert_array_equal(exchanged[:, :3], poses[:, :3])


def test_limbs_that_are_none_are_a_mistake() -> None:
    with pytest.raises(
        ValueError, match="limbs must be one of legs, arms, got 'wings'"
    ):
        exchanged_limbs(SKELETON, drawn(), "wings")  # type: ignore[arg-type]


def test_facing_is_the_yaw_of_who_looks_at_the_camera() -> None:
    place = np.array([1.0, 0.0, 2.0])
    assert facing(Camera.around(place, 0.7, 4.0, (160, 120)), place) == pytest.approx(
        0.7
    )
