"""Joint angles, events and figures of gait by hand."""

import numpy as np
import pytest

from posefit.geometry.skeleton import BONES
from posefit.measuring.angles import joint_angles, joint_coordinates, shoulder_angles
from posefit.measuring.events import gait_events
from posefit.measuring.gait import GRAVITY, gait_of
from tests.measuring.walker import FIRST, SPEED, STANCE, STRIDE, walker

# Axes of a right side: columns are where X (forwards), Y (up) and Z (to the right) have gone.
NEUTRAL = np.eye(3)
# X up, Y back
DISTAL_END_FORWARDS = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
DISTAL_END_BACKWARDS = DISTAL_END_FORWARDS.T  # X down, Y forwards
# Y to the right, Z up
DISTAL_END_TO_THE_LEFT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
DISTAL_END_TO_THE_RIGHT = DISTAL_END_TO_THE_LEFT.T
# X to the left, Z forwards
TURNED_TO_THE_LEFT = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
HALF = np.sqrt(0.5)
# turned so about the vertical
LEFT_BY_45 = np.array([[HALF, 0.0, HALF], [0.0, 1.0, 0.0], [-HALF, 0.0, HALF]])


def degrees(angles: np.ndarray) -> list[float]:
    return [round(float(one), 6) + 0.0 for one in np.degrees(angles)]


# GROOD1983 (joint coordinate system)
def test_rotations_are_about_a_fixed_a_floating_and_a_fixed_axis() -> None:
    # forwards about the proximal Z first, then inwards about the floating axis, then about the distal Y
    assert degrees(joint_coordinates(NEUTRAL, DISTAL_END_FORWARDS)) == [90.0, 0.0, 0.0]
    assert degrees(joint_coordinates(NEUTRAL, LEFT_BY_45)) == [0.0, 0.0, 45.0]
    assert degrees(joint_coordinates(NEUTRAL, DISTAL_END_FORWARDS @ LEFT_BY_45)) == [
        90.0,
        0.0,
        45.0,
    ]
    sine = np.sin(np.radians(30.0))
    cosine = np.cos(np.radians(30.0))
    inwards = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
    assert degrees(
        joint_coordinates(NEUTRAL, DISTAL_END_FORWARDS @ inwards @ LEFT_BY_45)
    ) == [90.0, 30.0, 45.0]
    # how both lie in the world says nothing
    for whole in (DISTAL_END_FORWARDS, TURNED_TO_THE_LEFT):
        assert degrees(joint_coordinates(whole, whole @ inwards)) == [0.0, 30.0, 0.0]


def test_a_hip_bends_forwards_inwards_and_turns_inwards() -> None:  # WU2002 (hip)
    assert degrees(joint_angles("hip", NEUTRAL, NEUTRAL)) == [0.0, 0.0, 0.0]
    assert degrees(joint_angles("hip", NEUTRAL, DISTAL_END_FORWARDS)) == [
        90.0,
        0.0,
        0.0,
    ]
    assert degrees(joint_angles("hip", NEUTRAL, TURNED_TO_THE_LEFT)) == [0.0, 0.0, 90.0]
    assert degrees(joint_angles("hip", NEUTRAL, DISTAL_END_TO_THE_LEFT))[1] == 90.0
    assert degrees(joint_angles("hip", NEUTRAL, DISTAL_END_TO_THE_RIGHT))[1] == -90.0


def test_a_knee_bends_backwards() -> None:  # GROOD1983 (knee)
    assert degrees(joint_angles("knee", NEUTRAL, NEUTRAL)) == [0.0, 0.0, 0.0]
    assert degrees(joint_angles("knee", NEUTRAL, DISTAL_END_BACKWARDS)) == [
        90.0,
        0.0,
        0.0,
    ]
    assert degrees(joint_angles("knee", NEUTRAL, DISTAL_END_FORWARDS)) == [
        -90.0,
        0.0,
        0.0,
    ]
    assert degrees(joint_angles("knee", NEUTRAL, TURNED_TO_THE_LEFT)) == [
        0.0,
        0.0,
        90.0,
    ]
    assert degrees(joint_angles("knee", NEUTRAL, DISTAL_END_TO_THE_LEFT))[1] == 90.0


def test_toes_go_up_and_the_sole_inwards() -> None:  # WU2002 (ankle)
    # X of the foot points up
    assert degrees(joint_angles("ankle", NEUTRAL, DISTAL_END_FORWARDS)) == [
        90.0,
        0.0,
        0.0,
    ]
    # what was below is to the left
    assert degrees(joint_angles("ankle", NEUTRAL, DISTAL_END_TO_THE_LEFT))[1] == 90.0
    assert degrees(joint_angles("ankle", NEUTRAL, TURNED_TO_THE_LEFT)) == [
        0.0,
        0.0,
        90.0,
    ]


def test_an_arm_is_raised_in_a_plane_and_turned() -> None:  # WU2005 (shoulder)
    # abduction
    assert degrees(shoulder_angles(NEUTRAL, DISTAL_END_TO_THE_RIGHT)) == [
        0.0,
        90.0,
        0.0,
    ]
    # raised forwards, the front of the arm points up; from abduction it is reached by a turn to the left, which
    # leaves the front to the left: a quarter turn outwards brings it up
    assert degrees(shoulder_angles(NEUTRAL, DISTAL_END_FORWARDS)) == [90.0, 90.0, -90.0]
    assert degrees(shoulder_angles(NEUTRAL, DISTAL_END_BACKWARDS)) == [
        -90.0,
        90.0,
        90.0,
    ]
    # hanging: all of it is rotation
    assert degrees(shoulder_angles(NEUTRAL, LEFT_BY_45)) == [0.0, 0.0, 45.0]
    upside_down = np.diag([1.0, -1.0, -1.0])
    assert degrees(shoulder_angles(NEUTRAL, upside_down)) == [0.0, 180.0, 0.0]


def test_an_elbow_bends_forwards_and_the_palm_turns_inwards() -> None:  # WU2005 (elbow)
    assert degrees(joint_angles("elbow", NEUTRAL, DISTAL_END_FORWARDS)) == [
        90.0,
        0.0,
        0.0,
    ]
    assert degrees(
        joint_angles("elbow", NEUTRAL, DISTAL_END_FORWARDS @ TURNED_TO_THE_LEFT)
    ) == [90.0, 0.0, 90.0]
    assert degrees(joint_angles("elbow", NEUTRAL, DISTAL_END_TO_THE_LEFT))[1] == 90.0


def test_a_foot_strikes_where_it_is_farthest_ahead() -> None:  # ZENI2008 (heel strike)
    for yaw in (0.0, 2.0):
        strikes = gait_events(walker(yaw=yaw)).strikes
        assert strikes["left"] / 100.0 == pytest.approx(
            FIRST["l"] + STRIDE * np.arange(4), abs=0.01
        )
        assert strikes["right"] / 100.0 == pytest.approx(
            FIRST["r"] + STRIDE * np.arange(3), abs=0.01
        )
    still = gait_events(walker(speed=0.0)).strikes  # without any floor or way
    assert still["left"] == pytest.approx(
        gait_events(walker()).strikes["left"], abs=0.01
    )


# ZENI2008 (toe off)
def test_a_foot_lifts_off_where_its_toes_are_farthest_behind() -> None:
    offs = gait_events(walker()).offs
    first = FIRST["l"] + STANCE * STRIDE
    assert offs["left"] / 100.0 == pytest.approx(
        first + STRIDE * np.arange(3), abs=0.01
    )


def test_cadence_is_counted_in_a_minute() -> None:  # WHITTLE2007 (cadence)
    assert gait_of(walker()).cadence == pytest.approx(100.0, abs=0.5)


# WHITTLE2007 (step length)
def test_a_step_is_as_long_as_the_body_moves_meanwhile() -> None:
    gait = gait_of(walker(yaw=1.0))
    assert gait.step_length == pytest.approx(SPEED * STRIDE / 2.0, abs=0.005)
    assert gait.stride_length == pytest.approx(SPEED * STRIDE, abs=0.005)


def test_speed_is_the_length_of_the_steps_of_a_minute() -> None:  # WHITTLE2007 (speed)
    assert gait_of(walker(speed=1.3)).speed == pytest.approx(1.3, abs=0.01)


def test_stance_is_its_share_of_a_stride() -> None:  # WHITTLE2007 (stance)
    # this walker's foot turns about more sharply than a filter of 6 hertz leaves it, by 10 ms at either end
    assert gait_of(walker()).stance_share == pytest.approx(STANCE, abs=0.02)


# ALEXANDER1989 (Froude number)
def test_a_person_with_a_froude_number_above_a_half_runs() -> None:
    skeleton = walker().skeleton
    leg = float(
        np.linalg.norm(
            skeleton.offsets[[BONES.index("lfemur"), BONES.index("ltibia")]], axis=1
        ).sum()
    )
    for factor, runs in ((0.95, False), (1.05, True)):
        why = gait_of(walker(speed=factor * np.sqrt(0.5 * GRAVITY * leg))).why
        assert why.startswith("the person runs") == runs
