"""A person walks backwards where the pelvis faces away from its way."""

from dataclasses import replace

import numpy as np

from posefit.measuring.gait import backwards, backwards_warning
from posefit.motion import built_in
from posefit.motion.motion import Motion
from tests.cases import each

WALK = built_in.motion("walk", frames=60)  # at 30 frames a second


def turned(degrees: float) -> Motion:
    return replace(WALK, poses=WALK.poses + np.radians(degrees) * np.eye(66)[0])


@each(("degrees", "back"), [(0.0, False), (60.0, False), (120.0, True), (180.0, True)])
def test_a_person_who_faces_away_from_their_way_walks_backwards(degrees: float, back: bool) -> None:
    # half of half a second, beyond which nothing is known, is 8 frames
    assert backwards(turned(degrees)).tolist() == [False] * 8 + [back] * 44 + [False] * 8


@each(("speed", "back"), [(0.29, False), (0.31, True)])
def test_below_30_cm_a_second_a_person_has_no_way(speed: float, back: bool) -> None:
    places = np.array([0.0, 1.0, 0.0]) + np.arange(60)[:, None] / 30.0 * speed * np.array([0.0, 0.0, -1.0])
    assert backwards(replace(WALK, poses=np.zeros((60, 66)), translations=places)).any() == back


def test_unknown_frames_and_those_about_them_count_for_nothing() -> None:
    assert np.flatnonzero(backwards(turned(180.0), {30})).tolist() == [*range(8, 22), *range(39, 52)]
    assert not backwards(turned(180.0).frames(0, 16)).any()


def test_a_few_frames_are_not_worth_a_warning() -> None:
    assert backwards_warning(np.arange(100) < 4) == ""
    assert backwards_warning(np.arange(100) < 5).startswith("the person seems to walk backwards in 5 of 100 frames")
