"""Names and clinical angles of whole bodies: zero where a person stands, and one sign for both sides."""

from pathlib import Path

import numpy as np
import pytest

from posefit.geometry.skeleton import ANGLES, JOINTS
from posefit.geometry.symmetry import mirrored_poses
from posefit.measuring.angles import COLUMNS, clinical_angles
from posefit.measuring.centres import CENTRES, PLACES, joint_centres
from posefit.measuring.segments import bone_rotations
from posefit.motion import built_in, recorded
from posefit.motion.bvh import read_bvh, write_bvh
from tests.cases import each
from tests.measuring.walker import angle

SKELETON = built_in.motion("walk", frames=1).skeleton


def measured(**turned: float) -> dict[str, float]:
    """Return the angles of the pose of rest with some angles, such as lfemur_x, set in degrees."""
    pose = np.zeros((1, ANGLES))
    for name, degrees in turned.items():
        pose[0, angle(*name.split("_"))] = np.radians(degrees)
    return {name: float(values[0]) for name, values in clinical_angles(SKELETON, pose).items()}


def test_the_centres_are_where_bones_meet() -> None:
    motion = built_in.motion("walk", frames=3)
    centres = joint_centres(motion)
    assert tuple(centres) == CENTRES
    for name, joint in (
        ("left_hip", "lhipjoint"),
        ("left_knee", "lfemur"),
        ("right_ankle", "rtibia"),
        ("right_shoulder", "rclavicle"),
        ("left_elbow", "lhumerus"),
        ("left_wrist", "lradius"),
    ):
        np.testing.assert_array_equal(centres[name], motion.joints[:, JOINTS.index(joint)])
    assert len(set(PLACES)) == len(JOINTS)
    assert PLACES[JOINTS.index("lowerback")] == "lumbar"  # not of the left side
    assert PLACES[JOINTS.index("lfoot")] == "left_ball"


def test_bones_turn_with_the_joints() -> None:
    motion = built_in.motion("jacks", frames=5)
    turned = bone_rotations(motion.skeleton, motion.poses)
    joints = motion.skeleton.joints(motion.poses)
    for bone, above in (("lfemur", "lhipjoint"), ("rradius", "rhumerus"), ("head", "upperneck"), ("lhand", "lwrist")):
        j = JOINTS.index(bone)
        expected = joints[:, j] - joints[:, JOINTS.index(above)]
        np.testing.assert_allclose(turned[:, j] @ motion.skeleton.offsets[j - 1], expected, atol=1e-9)


def test_legs_are_at_zero_where_they_stand_straight() -> None:
    angles = measured(lfemur_z=-20.0, rfemur_z=20.0)  # the legs of the pose of rest are apart by 20 degrees each
    assert [angles[name] for name in COLUMNS[:18]] == pytest.approx([0.0] * 18, abs=1e-3)


@each(("side", "inwards"), [("left", -20.0), ("right", 20.0)])
def test_a_leg_moves_in_clinical_words(side: str, inwards: float) -> None:
    def leg(**turned: float) -> dict[str, float]:
        angles = measured(**{f"{side[0]}{name}": value for name, value in turned.items()})
        return {
            name.removeprefix(f"{side}_"): round(value, 2)
            for name, value in angles.items()
            if name.startswith(side) and abs(value) > 1e-3 and "shoulder" not in name and "elbow" not in name
        }

    assert leg(femur_z=inwards, femur_x=-30.0) == {"hip_flexion": 30.0}
    assert leg(femur_z=inwards, tibia_x=60.0) == {"knee_flexion": 60.0}
    assert leg(femur_z=inwards, foot_x=-15.0) == {"ankle_dorsiflexion": 15.0}
    assert leg() == {"hip_adduction": -20.0}
    assert leg(femur_z=1.5 * inwards) == {"hip_adduction": 10.0}


@each("side", ["left", "right"])
def test_arms_at_rest_are_out_with_the_palms_down(side: str) -> None:
    rest = measured()
    assert rest[f"{side}_shoulder_plane"] == pytest.approx(0.0, abs=1e-6)
    assert rest[f"{side}_shoulder_elevation"] == pytest.approx(90.0)
    # the elbow's hinge is 30 degrees up from bending straight forwards, and the thumb points forwards
    assert rest[f"{side}_shoulder_internal_rotation"] == pytest.approx(-30.0)
    assert rest[f"{side}_elbow_flexion"] == pytest.approx(0.0, abs=1e-6)
    assert rest[f"{side}_elbow_pronation"] == pytest.approx(120.0)
    bent = measured(**{f"{side[0]}radius_x": 70.0})
    assert bent[f"{side}_elbow_flexion"] == pytest.approx(70.0)
    assert bent[f"{side}_elbow_adduction"] == pytest.approx(0.0, abs=1e-6)
    assert bent[f"{side}_elbow_pronation"] == pytest.approx(120.0)


def test_a_shoulder_near_its_pole_is_left_blank() -> None:
    # an arm that hangs, but for so many degrees
    for elevation, blank in ((3.0, True), (9.9, True), (10.1, False), (45.0, False)):
        angles = measured(lhumerus_z=0.0, lclavicle_z=-(90.0 - elevation))
        assert angles["left_shoulder_elevation"] == pytest.approx(elevation)
        assert np.isnan(angles["left_shoulder_plane"]) == blank
        assert np.isnan(angles["left_shoulder_internal_rotation"]) == blank


def test_a_mirrored_body_has_the_other_sides_angles_and_its_yaw_changes_none() -> None:
    poses = recorded.clip("02_01").motion().poses  # the skeleton is the same on both sides
    angles = clinical_angles(SKELETON, poses)
    mirrored = clinical_angles(SKELETON, mirrored_poses(SKELETON, poses))
    turned = clinical_angles(SKELETON, poses + 2.0 * np.eye(66)[0])
    for name, values in angles.items():
        side, _, angle_name = name.partition("_")
        exchanged = mirrored[f"{'right' if side == 'left' else 'left'}_{angle_name}"]
        np.testing.assert_allclose(exchanged, values, atol=1e-6, err_msg=name)
        np.testing.assert_allclose(turned[name], values, atol=1e-6, err_msg=name)


def test_the_knee_of_a_walk_bends_as_published() -> None:
    # Perry and Burnfield, Gait analysis, 2010: about 60 degrees in swing, about 20 in loading; hip 20 back, 25 forwards
    motion = recorded.clip("02_01").motion()
    angles = clinical_angles(motion.skeleton, motion.poses)
    for joint, low, high in (
        ("knee_flexion", (-5.0, 15.0), (50.0, 75.0)),
        ("hip_flexion", (-30.0, -5.0), (20.0, 40.0)),
        ("ankle_dorsiflexion", (-25.0, -5.0), (10.0, 25.0)),
    ):
        for side in ("left", "right"):
            values = angles[f"{side}_{joint}"]
            assert low[0] < values.min() < low[1]
            assert high[0] < values.max() < high[1]


def test_a_motion_that_went_through_bvh_has_the_same_angles(tmp_path: Path) -> None:
    pytest.importorskip("pybvh")
    motion = recorded.clip("02_01").motion()
    write_bvh(tmp_path / "walk.bvh", motion)
    again = read_bvh(tmp_path / "walk.bvh")
    for name, values in clinical_angles(again.skeleton, again.poses).items():
        np.testing.assert_allclose(values, clinical_angles(motion.skeleton, motion.poses)[name], atol=1e-4)
