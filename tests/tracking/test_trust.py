"""Signs of trust worked by hand, and the sentence that they come to."""

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from posefit import load_motion
from posefit.evaluation.trust import (
    ONE_CAMERA,
    SIGNS,
    Trust,
    covered_pixels,
    depth_scatter,
    grade_of,
    hidden_share,
    longer_side,
    sentence,
    signs_against,
    stance_spread,
    training_distances,
    trust_line,
    trust_of,
)
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.geometry.skeleton import JOINTS
from posefit.geometry.symmetry import mirrored_poses
from posefit.motion.motion import Motion
from posefit.motion.steadiness import BALLS
from posefit.silhouette.mask import Silhouette
from posefit.uncertainty.modes import poses_apart
from tests.cases import each
from tests.tracking.scenes import exact_frames, tracked, viewed, walk

ALL = np.ones(60, dtype=bool)
FINE: dict[str, Any] = {
    name: sign.limits[0] if sign.limits else 90.0 for name, sign in SIGNS.items()
}
FINE |= {"frames": 100, "size_m": 1.8, "height_m": 1.8}


def test_the_longer_side_of_a_mask_is_that_of_its_bounding_box() -> None:
    mask = np.zeros((30, 40), dtype=bool)
    assert longer_side(mask) == 0
    mask[5:15, 4:8] = True
    assert longer_side(mask) == 10
    mask[15:, 4:8] = True  # cut by the edge
    assert longer_side(mask) == 0


def test_the_nearest_training_pose_is_that_of_comparing_all() -> None:
    motions = [load_motion("walk"), load_motion("run-a")]
    skeleton = motions[0].skeleton
    poses = motions[1].poses[::7] + 0.1
    facing = [np.concatenate([poses, mirrored_poses(skeleton, poses)])]
    facing += [motion.poses[::2].copy() for motion in motions]  # 15 a second
    for each_poses in facing:
        each_poses[:, 0] = 0.0
    expected = poses_apart(skeleton, facing[0], np.concatenate(facing[1:])).min(axis=1)
    np.testing.assert_allclose(
        training_distances(skeleton, poses, motions),
        expected.reshape(2, -1).min(axis=0),
        rtol=1e-12,
    )


def test_depth_scatter_is_the_deviation_from_a_smooth_path() -> None:
    time = np.arange(60) / 30.0
    assert depth_scatter(8.0 - 1.2 * time + 0.3 * time**2, ALL, 30.0) == pytest.approx(
        0.0, abs=1e-9
    )
    # 5 % to either side of a path that stays at 10 m
    alternating = 10.0 + 0.5 * (-1.0) ** np.arange(60)
    assert depth_scatter(alternating, ALL, 30.0) == pytest.approx(0.05, rel=0.15)
    depths = np.full(60, 8.0)
    usable = ALL.copy()
    depths[30], usable[30] = 80.0, False
    assert depth_scatter(depths, usable, 30.0) == pytest.approx(0.0, abs=1e-9)
    assert depth_scatter(depths, ~ALL, 30.0) is None


def test_stances_at_two_heights_are_half_of_that_apart() -> None:
    joints = np.zeros((16, len(JOINTS), 3))
    stands = np.zeros((16, 2), dtype=bool)
    # the left foot stands, is lifted, stands, is lifted
    joints[:, BALLS[0], 1] = np.repeat([0.0, 2.0, 0.03, 2.03], 4)
    stands[0:4, 0] = stands[8:12, 0] = True
    # the standard deviation of 0 and 3 cm
    assert stance_spread(joints, stands) == pytest.approx(0.015)
    assert stance_spread(joints[:8], stands[:8]) is None


@each(
    ("usable", "cut", "hidden"),
    [
        # nobody is missed before the person comes and after they have gone
        ("00101100", "00000000", 0.25),
        ("00000000", "00000000", 1.0),
        # in the middle of a gap no mask beside it says that the person left
        ("1100011011", "0001000000", 0.4),
        ("1100011011", "0011000000", 0.1),  # they are out of the picture
    ],
)
def test_frames_between_others_that_show_too_little_are_hidden(
    usable: str, cut: str, hidden: float
) -> None:
    assert (
        hidden_share(*(np.array([*digits]) == "1" for digits in (usable, cut)))
        == hidden
    )


def test_a_body_covers_half_of_what_moves() -> None:
    then = np.zeros((80, 80, 3), dtype=np.uint8)
    now = np.zeros((80, 80, 3), dtype=np.uint8)
    # an arm and a leg of 20 by 10 pixels move
    now[20:40, 10:20] = now[20:40, 40:50] = 255
    body = np.zeros((80, 80), dtype=bool)
    nothing = np.zeros((80, 80), dtype=bool)
    body[20:40, 10:20] = True
    inside, everything = covered_pixels(now, then, body, nothing, 60.0)
    assert everything == 2 * inside > 300  # but for the corners, which count as noise
    # light that flickers is no motion
    assert covered_pixels(then, then + 5, ~nothing, ~nothing, 60.0) == (0, 0)
    assert covered_pixels(now, then, nothing, nothing, 60.0) == (0, 0)


@each(
    ("changes", "words"),
    [
        (
            {"unknown": 0.92},
            "doubtful: left and right are unknown in 92% of the frames",
        ),
        (
            {"training_mm": 75.0},
            "doubtful: with one camera, depth follows the training motions, and the nearest is 75 mm away",
        ),
        ({"lost": 0.63}, "do not use: the person is lost in 63% of the frames"),
        (
            {"hidden": 0.4},
            "doubtful: the person is mostly hidden in 40% of the frames between the "
            "first and the last that show them",
        ),
        (
            {"cropped": 1.0, "training_mm": 218.0},
            "do not use: the picture's border cuts the mask above and below in 100% of the frames: masks cropped to "
            "the person do not show where they are, and 1 more sign counts against it",
        ),
        ({"iou": 0.41}, "do not use: the body and the mask overlap by only 41%"),
        (
            {"size_ratio": 0.8, "size_m": 1.44},
            "doubtful: the person seems to be 1.44 m tall, not 1.80 m",
        ),
        (
            {"size_ratio": 1.5, "size_m": 2.7},
            "do not use: the person seems to be 2.70 m tall, not 1.80 m",
        ),
        ({"depth_scatter": 0.3}, "do not use: the distance jumps by 30%"),
        (
            {"foot_share": 0.1},
            "doubtful: a foot is on the ground in only 10% of the frames",
        ),
        (
            {"stance_spread_m": 0.3},
            "doubtful: feet touch the ground at heights 0.30 m apart",
        ),
        ({"explained": 0.35}, "do not use: the body covers only 35% of what moves"),
        ({"acceleration": 30.0}, "doubtful: joints move jerkily, at 30 m/s2"),
        ({"frames": 2}, "doubtful: only 2 frames to judge the person by"),
        (
            {"unknown": 0.3, "lost": 0.4},
            "doubtful: the person is lost in 40% of the frames, and 1 more sign counts against it",
        ),
    ],
)
def test_the_worst_sign_is_named_and_the_others_are_counted(
    changes: dict[str, Any], words: str
) -> None:
    figures = FINE | changes
    assert sentence(figures, signs_against(figures)) == f"Trust: {words}."


# docs/howto/trust.md: from where on a sign makes a track doubtful, and from where on it is not to be used
LIMITS: dict[str, tuple[tuple[float, float | None], ...]] = {
    "size_ratio": ((1.08, 1.30), (0.92, 0.70)),
    "depth_scatter": ((0.04, 0.20),),
    "foot_share": ((0.20, None),),
    "stance_spread_m": ((0.15, 0.60),),
    "explained": ((0.70, 0.40),),
    "lost": ((0.15, 0.50),),
    "unknown": ((0.20, None),),
    "training_mm": ((60.0, 200.0),),
    "cropped": ((0.25, 0.60),),
    "frontal": ((0.50, None),),
    "hidden": ((0.25, 0.60),),
    "iou": ((0.65, 0.45),),
    "acceleration": ((14.0, 60.0),),
}


def test_a_sign_speaks_against_a_track_from_the_pages_limits_on() -> None:
    assert LIMITS.keys() == {name for name, sign in SIGNS.items() if sign.limits}
    for name, limits in LIMITS.items():
        best = FINE[name]
        for doubtful, unusable in limits:
            for limit, before, after in (
                (doubtful, "good", "doubtful"),
                (unusable, "doubtful", "do not use"),
            ):
                if limit is None:
                    continue
                for share, word in ((0.98, before), (1.02, after)):
                    figures = FINE | {name: best + share * (limit - best)}
                    words = sentence(figures, signs_against(figures))
                    assert words.startswith(f"Trust: {word}"), (name, limit, share)


def test_a_track_without_a_sign_against_it_is_good() -> None:
    assert signs_against(FINE) == []
    assert sentence(FINE, []).startswith(
        "Trust: good. No sign counts against it: size 1.80 m, the fitted body's 1.80 m, "
    )
    unknown = FINE | dict.fromkeys(SIGNS) | {"size_m": None}
    assert signs_against(unknown) == []


def test_three_doubtful_signs_together_are_as_bad_as_an_unusable_one() -> None:
    # a person waves, one camera
    signs = signs_against(FINE | {"unknown": 0.49, "lost": 0.24, "acceleration": 20.0})
    assert [grade for grade, _ in signs] == ["doubtful"] * 3
    assert grade_of(signs) == "do not use"
    assert grade_of(signs[:2]) == "doubtful"


def trusted(
    scene: Scene,
    tracked: list[Frame] | None = None,
    reported: float = 0.0,
    training: Sequence[Motion] = (),
) -> Trust:
    """Return the trust in the true track of a scene that a tracker estimated as `tracked`."""
    frames = exact_frames(scene)
    row = {
        "usable": 1.0,
        "lost": reported,
        "unknown_sides": reported,
        "interval_mm": 1e3 * reported,
    }
    table = {name: np.full(len(frames), value) for name, value in row.items()}
    return trust_of(scene, tracked or frames, frames, table, 0.9, training)


def test_several_cameras_show_the_size_and_one_cannot() -> None:
    scene = walk(30, (20.0, 110.0))
    trust = trusted(scene)
    assert (trust.size_ratio, trust.grade) == (1.0, "good")
    assert trust.unknown_signs == {
        "explained": "there are only masks",
        **dict.fromkeys(("training_mm", "frontal"), "several cameras see the depth"),
    }
    trust = trusted(replace(scene, body=scene.body.scaled(0.8, 0.8)))
    # by perspective, and poses that rest on their root
    assert trust.size_ratio == pytest.approx(1.25, abs=0.06)
    assert "the person seems to be" in trust.sentence
    trust = trusted(walk(30), reported=np.nan)
    assert trust.size_ratio is None
    assert trust.unknown_signs["size_ratio"] == ONE_CAMERA
    for name in ("lost", "unknown", "interval_mm"):
        assert trust.unknown_signs[name] == "the method does not report it"
    assert trust.unknown_signs["training_mm"] == "the method learned from no motion"
    assert ONE_CAMERA in trust_line(asdict(trust))


def test_motion_says_nothing_where_the_camera_moves() -> None:
    scene = walk(30, (20.0, 110.0))
    camera = scene.cameras[0]
    pictures = [
        np.full((camera.height, camera.width, 3), 90 * (k // 3 % 2), dtype=np.uint8)
        for k in range(30)
    ]
    scene = replace(scene, pictures=lambda: iter(pictures))
    assert trusted(scene).grade == "do not use"
    trust = trusted(replace(scene, camera_moves=True))
    assert (trust.grade, trust.unknown_signs["explained"]) == (
        "good",
        "the camera moves",
    )


def test_masks_cropped_to_the_person_are_the_reason() -> None:
    scene = walk(30)
    cropped = []
    for observation in scene.observations:
        mask = observation.silhouettes[0].mask
        box = np.ix_(np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0)))
        large = cv2.resize(
            mask[box].astype(np.uint8),
            mask.shape[::-1],
            interpolation=cv2.INTER_NEAREST,
        )
        cropped.append(replace(observation, silhouettes=[Silhouette.of(large)]))
    assert trusted(scene).cropped == 0.0
    trust = trusted(replace(scene, observations=cropped))
    assert (
        "cuts the mask above and below in 100% of the frames: masks cropped"
        in trust.against[0]
    )


def test_a_track_by_one_camera_is_doubtful_far_from_what_was_learned() -> None:
    scene = walk(30)
    motion = scene.truth
    assert trusted(scene, training=[motion]).grade == "good"
    # radians, at every joint
    bent = replace(motion, poses=motion.poses + 0.1 * (np.arange(66) >= 3))
    trust = trusted(scene, training=[bent])
    assert trust.training_mm > 60.0
    assert trust.against[0].startswith(
        "with one camera, depth follows the training motions, and the nearest is "
    )
    assert trust.grade == "doubtful"
    assert trusted(walk(30, (20.0, 110.0)), training=[bent]).training_mm is None


def test_a_track_by_one_camera_is_doubtful_from_the_front_and_the_back() -> None:
    for view, share in ((0.0, 1.0), (180.0, 1.0), (45.0, 0.0), (90.0, 0.0)):
        trust = trusted(walk(30, (view,)))
        assert trust.frontal == share
        assert trust.grade == ("doubtful" if share else "good")
    assert trusted(walk(30, (0.0, 90.0))).frontal is None


def test_depth_is_that_of_the_track_before_it_was_smoothed() -> None:
    scene = walk(30)
    eye = scene.cameras[0].position
    shaken = [
        replace(
            frame,
            translation=eye + (frame.translation - eye) * (1.0 + 0.1 * (-1.0) ** k),
        )
        for k, frame in enumerate(exact_frames(scene))
    ]
    trust = trusted(scene, shaken)
    assert trust.depth_scatter == pytest.approx(0.1, rel=0.3)
    assert "the distance jumps by 1" in trust.sentence


def test_the_verdict_is_on_top_of_every_output_if_the_truth_is_unknown(
    tmp_path: Path,
) -> None:
    scene = walk(3)
    viewed(tmp_path / "known", scene, exact_frames(scene))
    assert (
        json.loads((tmp_path / "known" / "summary.json").read_text())["trust"] is None
    )
    page = viewed(tmp_path / "unknown", replace(scene, truth=None), exact_frames(scene))
    summary = json.loads((tmp_path / "unknown" / "summary.json").read_text())
    expected = "Trust: doubtful: only 3 frames to judge the person by."
    assert summary["trust"]["sentence"] == expected
    assert (
        str(tracked(replace(scene, truth=None), exact_frames(scene))).splitlines()[0]
        == expected
    )
    assert f'"verdict":"{expected} The method does not report' in page.read_text(
        "utf-8"
    ).replace('": "', '":"')
    image = cv2.imread(str(tmp_path / "unknown" / "summary.png"))
    assert (image[8:32].max(axis=2) > 200).any()  # of the sentence's letters
