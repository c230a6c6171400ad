"""What a track shows beside its masks, worked by hand, and the sentence that it comes to."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.geometry.skeleton import JOINTS
from posefit.motion.steadiness import BALLS
from posefit.tracking.table import table
from posefit.tracking.trust import (
    ONE_CAMERA,
    SIGNS,
    against,
    covered,
    depth_scatter,
    foot_share,
    grade_of,
    held_share,
    jerks,
    longer_side,
    sentence,
    size_ratio,
    stance_spread,
    trust_line,
    trust_of,
)
from tests.cases import each
from tests.tracking.viewing import right, viewed, walk

ALL = np.ones(60, dtype=bool)
FINE: dict[str, Any] = {
    "frames": 100,
    "size_ratio": 1.0,
    "size_m": 1.8,
    "height_m": 1.8,
    "depth_scatter": 0.01,
    "foot_share": 0.9,
    "stance_spread_m": 0.01,
    "explained": 0.95,
    "lost": 0.0,
    "unknown": 0.05,
    "held": 0.0,
    "iou": 0.88,
    "acceleration": 6.0,
}


def standing_body(heights: list[float], frames: int = 4) -> Any:
    """Return joints of somebody whose left foot stands at one height after the other, and is high up in between."""
    joints = np.zeros((2 * frames * len(heights), len(JOINTS), 3))
    joints[:, BALLS[1], 1] = 5.0
    for k, height in enumerate(heights):
        start = 2 * frames * k
        joints[start : start + frames, BALLS[0], 1] = height
        joints[start + frames : start + 2 * frames, BALLS[0], 1] = height + 2.0
    return joints


def test_the_longer_side_of_a_mask_is_that_of_its_bounding_box() -> None:
    mask = np.zeros((30, 40), dtype=bool)
    mask[5:15, 4:8] = True
    assert longer_side(mask) == 10


def test_a_mask_that_is_empty_or_cut_has_no_size() -> None:
    mask = np.zeros((30, 40), dtype=bool)
    assert longer_side(mask) == 0
    mask[20:, 4:8] = True
    assert longer_side(mask) == 0


def test_the_size_is_the_median_of_what_can_be_compared() -> None:
    assert size_ratio(np.array([90, 0, 80, 100]), np.array([100, 100, 100, 100])) == 0.9
    assert size_ratio(np.array([0, 50]), np.array([50, 0])) is None


def test_a_person_who_comes_nearer_evenly_or_speeds_up_scatters_by_nothing() -> None:
    time = np.arange(60) / 30.0
    assert depth_scatter(8.0 - 1.2 * time + 0.3 * time**2, ALL, 30.0) == pytest.approx(0.0, abs=1e-9)


def test_depth_that_alternates_scatters_by_nearly_all_of_it() -> None:
    depths = 10.0 + 0.5 * (-1.0) ** np.arange(60)  # 5 % to either side of a way that stays at 10 m
    assert depth_scatter(depths, ALL, 30.0) == pytest.approx(0.05, rel=0.15)


def test_frames_that_show_too_little_say_nothing_of_depth() -> None:
    depths, usable = np.full(60, 8.0), ALL.copy()
    depths[30], usable[30] = 80.0, False
    assert depth_scatter(depths, usable, 30.0) == pytest.approx(0.0, abs=1e-9)
    assert depth_scatter(depths, np.zeros(60, dtype=bool), 30.0) is None


def test_the_share_of_frames_with_a_standing_foot_is_that_of_usable_ones() -> None:
    joints = np.zeros((60, len(JOINTS), 3))
    joints[30:, BALLS, 0] = np.arange(30)[:, None]  # both feet slide by a metre a frame
    assert foot_share(joints, np.arange(60) < 29, 30.0) == 1.0
    assert foot_share(joints, np.arange(60) > 31, 30.0) == 0.0
    assert foot_share(joints, ~ALL, 30.0) is None


def test_stances_at_two_heights_are_half_of_that_apart() -> None:
    spread = stance_spread(standing_body([0.0, 0.03]), np.ones(16, dtype=bool), 5.0)
    assert spread == pytest.approx(0.015)  # the standard deviation of 0 and 3 cm


def test_frames_before_somebody_comes_and_after_he_has_gone_are_not_held() -> None:
    assert held_share(np.array([0, 0, 1, 0, 1, 1, 0, 0], dtype=bool)) == 0.25
    assert held_share(np.zeros(4, dtype=bool)) == 1.0


def test_joints_that_speed_up_evenly_accelerate_by_that() -> None:
    joints = np.zeros((60, len(JOINTS), 3))
    joints[:, :, 2] = 2.0 * (np.arange(60) / 30.0)[:, None] ** 2  # half of 4 m/s2 times the time squared
    joints[40:] += 9.0  # a jump where nobody is seen
    assert jerks(joints, np.arange(60) < 39, 30.0) == pytest.approx(4.0)
    assert jerks(joints, ~ALL, 30.0) is None


def test_a_single_stance_says_nothing_of_heights() -> None:
    assert stance_spread(standing_body([0.0]), np.ones(8, dtype=bool), 5.0) is None


def test_a_body_covers_half_of_what_moves() -> None:
    then, now = np.zeros((80, 80, 3), dtype=np.uint8), np.zeros((80, 80, 3), dtype=np.uint8)
    now[20:40, 10:20] = now[20:40, 40:50] = 255  # an arm and a leg of 20 by 10 pixels move
    body, seen = np.zeros((80, 80), dtype=bool), np.zeros((80, 80), dtype=bool)
    body[20:40, 10:20] = True
    inside, everything = covered(now, then, body, seen, 60.0)
    assert everything == 2 * inside > 300  # but for the corners, which count as noise


def test_where_nothing_moves_nothing_is_counted() -> None:
    image = np.full((80, 80, 3), 90, dtype=np.uint8)
    body = np.ones((80, 80), dtype=bool)
    assert covered(image, image + 5, body, body, 60.0) == (0, 0)  # light that flickers is no motion
    assert covered(image, image, ~body, ~body, 60.0) == (0, 0)


def test_a_track_without_a_sign_against_it_is_good_and_says_why() -> None:
    assert against(FINE) == []
    assert sentence(FINE, []).startswith("Trust: good. No sign speaks against it: 1.80 m tall, given 1.80 m, ")


@each(
    ("figures", "words"),
    [
        ({"unknown": 0.92}, "doubtful: left and right are unknown in 92% of the frames"),
        ({"lost": 0.63}, "do not use: the person is lost in 63% of the frames"),
        ({"held": 0.4}, "doubtful: the person is gone, or nearly, in 40% of the frames in between"),
        ({"iou": 0.41}, "do not use: the body and the mask overlap by 41% only"),
        ({"size_ratio": 0.8, "size_m": 1.44}, "doubtful: the person seems to be 1.44 m tall, not 1.80 m"),
        ({"size_ratio": 1.5, "size_m": 2.7}, "do not use: the person seems to be 2.70 m tall, not 1.80 m"),
        ({"depth_scatter": 0.3}, "do not use: the distance jumps by 30%"),
        ({"foot_share": 0.1}, "doubtful: a foot stands in 10% of the frames only"),
        ({"stance_spread_m": 0.3}, "doubtful: feet stand at heights 0.30 m apart"),
        ({"explained": 0.35}, "do not use: the body covers 35% of what moves only"),
        ({"acceleration": 30.0}, "doubtful: joints jerk, by 30 m/s2"),
        ({"frames": 2}, "doubtful: 2 frames that show the person are too few to judge by"),
    ],
)
def test_each_sign_alone_is_named_in_plain_words(figures: dict[str, Any], words: str) -> None:
    told = FINE | figures
    assert sentence(told, against(told)) == f"Trust: {words}."


def test_the_worst_sign_is_named_and_the_others_are_counted() -> None:
    told = FINE | {"unknown": 0.2, "lost": 0.4}
    assert sentence(told, against(told)) == (
        "Trust: doubtful: the person is lost in 40% of the frames, and 1 more sign speaks against it."
    )


def test_three_doubtful_signs_together_are_as_bad_as_a_useless_one() -> None:
    signs = against(FINE | {"unknown": 0.49, "lost": 0.24, "acceleration": 20.0})  # somebody who waves, one camera
    assert [grade for grade, _ in signs] == ["doubtful"] * 3
    assert grade_of(signs) == "useless"
    assert grade_of(signs[:2]) == "doubtful"


def test_what_is_not_known_speaks_neither_for_nor_against() -> None:
    unknown = FINE | {sign.name: None for sign in SIGNS if sign.name != "frames"} | {"size_m": None}
    assert against(unknown) == []


def rows_of(count: int, **told: float) -> list[dict[str, float]]:
    return [{"usable": 1.0, "lost": np.nan, "unknown_sides": np.nan, **told} for _ in range(count)]


def judged(scene: Scene, frames: list[Frame], **told: float) -> dict[str, Any]:
    return trust_of(scene, frames, frames, rows_of(len(frames), **told), 0.9)


def test_several_cameras_tell_the_size_of_a_right_track() -> None:
    scene = walk(30, (20.0, 110.0))
    trust = judged(scene, right(scene), lost=0.0, unknown_sides=0.0)
    assert trust["size_ratio"] == 1.0
    assert trust["grade"] == "good"
    assert trust["unknown_signs"] == {"explained": "there are masks alone"}


def test_several_cameras_see_that_the_height_given_is_too_small() -> None:
    scene = walk(30, (20.0, 110.0))
    trust = judged(replace(scene, body=scene.body.scaled(0.8, 0.8)), right(scene), lost=0.0, unknown_sides=0.0)
    assert trust["size_ratio"] == pytest.approx(1.25, abs=0.06)  # by perspective, and poses that rest on their root
    assert "the person seems to be" in trust["sentence"]


def test_one_camera_says_that_it_cannot_tell_the_size() -> None:
    scene = walk(30)
    trust = judged(scene, right(scene))
    assert trust["size_ratio"] is None
    assert trust["unknown_signs"]["size_ratio"] == ONE_CAMERA
    assert trust["unknown_signs"]["lost"] == "the method does not say"
    assert ONE_CAMERA in trust_line(trust)


def test_depth_is_that_of_what_was_found_before_it_was_steadied() -> None:
    scene = walk(30)
    told = right(scene)
    eye = scene.cameras[0].position
    shaken = [
        replace(frame, translation=eye + (frame.translation - eye) * (1.0 + 0.1 * (-1.0) ** k))
        for k, frame in enumerate(told)
    ]
    trust = trust_of(scene, shaken, told, rows_of(30), 0.9)
    assert trust["depth_scatter"] == pytest.approx(0.1, rel=0.3)
    assert "the distance jumps by 1" in trust["sentence"]


def test_a_track_whose_truth_is_known_says_nothing_of_trust(tmp_path: Path) -> None:
    scene = walk(2)
    viewed(tmp_path / "known", scene, right(scene))
    assert json.loads((tmp_path / "known" / "summary.json").read_text())["trust"] is None


def test_the_sentence_stands_on_top_of_everything_that_is_told(tmp_path: Path) -> None:
    scene = walk(3)
    page = viewed(tmp_path / "seen", replace(scene, truth=None), right(scene))
    summary = json.loads((tmp_path / "seen" / "summary.json").read_text())
    told = "Trust: doubtful: 3 frames that show the person are too few to judge by."
    assert summary["trust"]["sentence"] == told
    assert table(summary).splitlines()[0] == told
    assert f'"verdict":"{told} The method does not report' in page.read_text("utf-8").replace('": "', '":"')
    image = cv2.imread(str(tmp_path / "seen" / "summary.png"))
    assert image is not None
    assert (image[8:32].max(axis=2) > 200).any()  # of the sentence's letters
