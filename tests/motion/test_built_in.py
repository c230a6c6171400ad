"""The built-in motions look like people, repeat themselves, and differ where a test needs them to."""

import json
from importlib.resources import files
from typing import Any

import numpy as np
import pytest

from posefit.geometry.skeleton import INNER, JOINTS, MIRROR, angle_index
from posefit.motion import built_in
from posefit.motion.motion import Motion
from tests.cases import each

KINDS = ("walk", "run", "march", "jacks", "squat", "jump", "step", "arms-out", "wave")
GAITS = ("walk", "run", "arms-out", "wave")
DRAWN = {"arms-out": "lr", "wave": "r"}  # whose arms are not the clip's
CYCLE = 240  # frames
TURNS = 2.0 * np.pi * np.arange(CYCLE) / CYCLE

each_motion = each("name", built_in.names())
each_gait = each("name", [name for name in built_in.names() if name.startswith(GAITS)])


def stored() -> dict[str, Any]:
    return dict(
        json.loads(
            (files("posefit.motion") / "built_in.json").read_text(encoding="utf-8")
        )["motions"]
    )


def means(name: str, key: str) -> float:
    """Return a style's number, or the mean over a kind's styles."""
    styles = [name] if name in stored() else built_in.other_styles(name)
    return float(np.mean([stored()[style][key] for style in styles]))


def cycle(name: str, cycles: int = 1, **settings: Any) -> Motion:
    """Return whole cycles of a motion, CYCLE frames each."""
    return built_in.motion(
        name, frames=cycles * CYCLE, fps=CYCLE / means(name, "period"), **settings
    )


def test_the_other_styles_of_a_motion_never_contain_it() -> None:
    assert built_in.names() == KINDS + tuple(stored())
    assert built_in.other_styles("walk-b") == ("walk-a", "walk-c")
    for name in built_in.names():
        others = built_in.other_styles(name)
        assert others
        assert name not in others
        assert {built_in.activity_of(other) for other in others} == {
            built_in.activity_of(name)
        }


@each_motion
def test_a_motion_repeats_itself_one_travel_further_without_jumps(name: str) -> None:
    motion = cycle(name, 2)
    np.testing.assert_allclose(motion.poses[CYCLE:], motion.poses[:CYCLE], atol=1e-9)
    travel = [0.0, 0.0, means(name, "speed") * means(name, "period")]
    moved = motion.translations[CYCLE:] - motion.translations[:CYCLE]
    np.testing.assert_allclose(moved, np.tile(travel, (CYCLE, 1)), atol=1e-9)
    assert not motion.poses[:, ~motion.skeleton.free].any()
    steps = np.linalg.norm(np.diff(motion.joints, axis=0), axis=-1) * motion.fps
    # m/s; a runner's foot swings forward at two to three times the pace
    assert steps.max() < 12.0


@each_gait
def test_a_gait_goes_along_z_on_feet_that_hardly_slide_with_limbs_in_step(
    name: str,
) -> None:
    motion = cycle(name)
    joints = motion.joints
    assert np.abs(motion.translations[:, 0]).max() < 0.1
    # along z, which yaw 0 faces; +x is on the left
    assert (np.diff(motion.translations[:, 2]) > 0.0).all()
    assert abs(np.degrees(motion.poses[:, 0].mean())) < 5.0
    assert (
        joints[:, JOINTS.index("lhipjoint"), 0]
        > joints[:, JOINTS.index("rhipjoint"), 0]
    ).all()
    lowest = joints[..., 1].min(axis=1)
    assert 0.025 < lowest.min() < 0.035
    # only a runner flies
    assert lowest.max() < (0.08 if name.startswith("walk") else 0.15)
    for foot in ("lfoot", "rfoot"):
        path = joints[:, JOINTS.index(foot)]
        down = path[:, 1] < path[:, 1].min() + 0.015
        slides = np.linalg.norm(
            np.gradient(path, 1.0 / motion.fps, axis=0)[down][:, [0, 2]], axis=1
        )
        assert slides.mean() < 0.2 * means(name, "speed")
    ahead = joints[..., 2] - motion.translations[:, None, 2]
    for arm, leg in (("lwrist", "rfoot"), ("rwrist", "lfoot")):
        if arm[0] not in DRAWN.get(built_in.activity_of(name), ""):
            assert (
                np.corrcoef(ahead[:, JOINTS.index(arm)], ahead[:, JOINTS.index(leg)])[
                    0, 1
                ]
                > 0.5
            )
    left, right = (angle_index(JOINTS.index(bone)) for bone in ("lfemur", "rfemur"))
    swing = motion.poses[:, right] - motion.poses[:, left]
    assert swing @ np.cos(TURNS) > 0.0  # the left thigh is ahead at phase 0
    assert abs(swing @ np.sin(TURNS)) < 1e-3 * (swing @ np.cos(TURNS))


@each_motion
def test_twice_the_speed_is_every_second_frame_and_a_phase_starts_later(
    name: str,
) -> None:
    slow = built_in.motion(name, frames=39)
    fast = built_in.motion(name, frames=20, speed=2.0)
    np.testing.assert_allclose(fast.poses, slow.poses[::2], atol=1e-12)
    np.testing.assert_allclose(fast.translations, slow.translations[::2], atol=1e-12)
    plain = cycle(name, 2)
    shifted = cycle(name, phase=0.25)
    np.testing.assert_allclose(
        shifted.poses, plain.poses[CYCLE // 4 : CYCLE // 4 + CYCLE], atol=1e-9
    )
    np.testing.assert_allclose(
        cycle(name, phase=1.0).poses, cycle(name).poses, atol=1e-9
    )


def test_the_skeleton_is_its_own_mirror_image_and_an_adults() -> None:
    skeleton = built_in.average_skeleton()
    flip = np.diag([-1.0, 1.0, 1.0])
    other = np.array(MIRROR)[1:] - 1
    np.testing.assert_allclose(
        skeleton.offsets, skeleton.offsets[other] @ flip, atol=1e-12
    )
    np.testing.assert_allclose(
        skeleton.axes, flip @ skeleton.axes[other] @ flip, atol=1e-12
    )
    np.testing.assert_allclose(
        skeleton.axes @ skeleton.axes.mT, np.tile(np.eye(3), (26, 1, 1)), atol=1e-9
    )
    # from the sole to the head's joint
    assert 1.4 < np.ptp(skeleton.joints(np.zeros(66))[:, 1]) < 1.8
    assert {bone for bone, _ in skeleton.channels} <= {JOINTS[joint] for joint in INNER}


def test_mistakes_are_named() -> None:
    for ask in (built_in.motion, built_in.other_styles):
        with pytest.raises(
            ValueError,
            match=r"one of walk, run, march, .* got 'wlak'; did you mean 'walk'\?",
        ):
            ask("wlak")
    for settings, message in (
        ({"frames": 0}, "frames must be a whole number of at least 1, got 0"),
        ({"fps": 0.0}, "fps and speed must be positive, got 0.0 and 1.0"),
        ({"phase": np.nan}, "phase must be finite, got nan"),
    ):
        with pytest.raises(ValueError, match=message):
            built_in.motion("walk", **settings)
