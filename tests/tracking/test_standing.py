"""Legs of people who stand in front of one camera: straighter from the front, bent where the masks show it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.fitting.cost import align
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.footage.scene import Scene, synthetic
from posefit.geometry.skeleton import BONES, JOINTS
from posefit.motion import built_in
from posefit.progress import QUIET
from posefit.silhouette.cost import BETA
from posefit.tracking import pipeline
from posefit.tracking.smoothing.contours import Borders
from posefit.tracking.smoothing.smooth import Smoothed, smooth
from posefit.tracking.smoothing.standing import (
    FLEXIONS,
    NEARER,
    standing_long,
    straightened,
    with_straight_legs,
)
from tests.tracking.scenes import exact_frames, frame_of, walk

FRAMES = 40
SIZE = (160, 160)
SKELETON = built_in.average_skeleton()


def flexed(degrees: float) -> Array:
    """Return the pose (66,) of a person whose knees are bent, with ankles below the hips."""
    pose = np.zeros(66)
    for hip, knee, ankle in FLEXIONS:
        pose[hip] = -0.5 * np.radians(degrees)
        pose[knee] = np.radians(degrees)
        pose[ankle] = -0.5 * np.radians(degrees)
    return pose


def bends(poses: Array) -> Array:
    """Return the flexion (..., 2) of both knees in degrees."""
    knees = [knee for _, knee, _ in FLEXIONS]
    return np.asarray(np.degrees(poses[..., knees]))


def standing(degrees: float, yaw: float) -> Scene:
    """Return a film of a person who stands with bent knees; at yaw 0 they face the camera."""
    walking = built_in.motion("walk", frames=FRAMES)
    pose = flexed(degrees)
    pose[0] = yaw
    still = replace(
        walking,
        poses=np.tile(pose, (FRAMES, 1)),
        translations=np.tile([0.0, 0.95, 0.0], (FRAMES, 1)),
    )
    return synthetic(still, (0.0,), SIZE, [], (None, None))


def filmed(scene: Scene) -> Scene:
    """Return a scene whose truth is unknown."""
    observations = [Observation(list(each.silhouettes)) for each in scene.observations]
    return replace(scene, truth=None, observations=observations)


def guessed(scene: Scene, degrees: float) -> list[Frame]:
    """Return frames whose knees are bent otherwise, and whose place fits the masks."""
    frames = []
    for frame, observation in zip(
        exact_frames(scene), scene.observations, strict=False
    ):
        pose = flexed(degrees)
        pose[0] = frame.pose[0]
        place = align(
            scene.body,
            scene.cameras,
            observation.silhouettes,
            pose[None],
            frame.translation[None],
        )[0]
        frames.append(frame_of(scene, pose, place, observation))
    return frames


def straight_or_not(
    scene: Scene, frames: list[Frame]
) -> tuple[Sequence[Frame], Array, Array]:
    """Return the tracked frames, and flexion of the smoothed ones before and after."""
    tracked = Smoothed(filmed(scene), frames, None)
    borders = Borders(tracked.scene.observations)
    smoothed = smooth(*tracked, BETA, borders)
    kept, again = with_straight_legs(tracked, smoothed, BETA, borders)
    before, after = (
        bends(np.array([frame.pose for frame in result.frames]))
        for result in (smoothed, again)
    )
    return kept, before, after


@pytest.mark.parametrize("side", "lr")
def test_an_ankle_moves_away_on_its_line_from_the_hip_and_the_foot_keeps_its_direction(
    side: str,
) -> None:
    pose = flexed(60.0)
    before, after = (
        SKELETON.joints(each[None])[0] for each in (pose, straightened(SKELETON, pose))
    )
    hip, ankle, ball = (
        JOINTS.index(side + bone) for bone in ("hipjoint", "tibia", "foot")
    )
    line = before[ankle] - before[hip]
    np.testing.assert_allclose(
        after[ankle] - after[hip], (1.0 + NEARER) * line, atol=1e-6
    )
    np.testing.assert_allclose(
        after[ball] - after[ankle], before[ball] - before[ankle], atol=1e-12
    )


@pytest.mark.parametrize(
    ("degrees", "expected"), [(20.0, 5.0), (3.0, 3.0), (0.0, 0.0), (-4.0, -4.0)]
)
def test_a_knee_is_left_bent_by_five_degrees_and_a_straighter_one_as_it_is(
    degrees: float, expected: float
) -> None:
    straight = straightened(SKELETON, flexed(degrees))
    np.testing.assert_allclose(bends(straight), expected, atol=1e-9)


def test_equal_bones_bend_by_the_law_of_cosines() -> None:
    legs = [f"{side}{bone}" for side in "lr" for bone in ("femur", "tibia")]
    lengths = SKELETON.lengths
    offsets = SKELETON.offsets.copy()
    for bone in map(BONES.index, legs):
        offsets[bone] *= 0.4 / lengths[bone]
    straight = straightened(replace(SKELETON, offsets=offsets), flexed(60.0))
    # 0.8 m times cos 30 degrees from hip to ankle, and 3 % more
    expected = 2.0 * np.degrees(np.arccos(1.03 * np.sqrt(0.75)))
    np.testing.assert_allclose(bends(straight), expected)


def test_a_person_seen_from_the_front_stands_straight() -> None:
    scene = standing(5.0, 0.0)
    frames = guessed(scene, 25.0)
    kept, before, after = straight_or_not(scene, frames)
    assert kept is not frames
    assert before.mean() > 18.0
    assert after.mean() < 12.0


def test_straighter_legs_are_a_guess_that_the_track_names() -> None:
    for yaw, bent, expected in ((0.0, 25.0, 1), (np.pi / 2.0, 30.0, 0)):
        scene = standing(5.0 if expected else bent, yaw)
        frames = guessed(scene, bent) if expected else exact_frames(scene)
        tracked = Smoothed(filmed(scene), frames, None)
        task = Task(scene.body, scene.cameras, 400, yaw=yaw, anchor=np.zeros(3))
        result = pipeline._smoothed(tracked, task, BETA, QUIET)
        named = [guess for guess in result.scene.guesses if "straighter legs" in guess]
        assert len(named) == expected


def test_knees_that_masks_show_bent_stay_bent() -> None:
    scene = standing(30.0, np.pi / 2.0)
    frames = exact_frames(scene)
    kept, before, after = straight_or_not(scene, frames)
    assert kept is frames
    np.testing.assert_array_equal(after, before)
    assert after.mean() > 25.0


def test_a_walker_stands_on_no_foot_for_long() -> None:
    scene = walk(FRAMES, (90.0,), SIZE)
    tracked = Smoothed(filmed(scene), exact_frames(scene), None)
    assert not standing_long(tracked).any()
