"""Walks are measured, and what is no walk is called so; steps beside an independent slow twin, and published ranges."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from posefit.geometry.skeleton import JOINTS
from posefit.measuring.events import gait_events, low_pass
from posefit.measuring.gait import Gait, gait_of
from posefit.motion import built_in, recorded
from posefit.motion.amc import read_clip
from posefit.motion.motion import Motion
from posefit.tracking.table import gait_line
from tests.cases import each
from tests.measuring.walker import SPEED, walker

WALKS = ("02_01", "05_01", *(f"16_{k}" for k in (*range(12, 19), *range(20, 33), 47, 58)))


def figures(gait: Gait) -> list[object]:
    return [gait.cadence, gait.speed, gait.step_length, gait.stride_length, gait.step_width, gait.stance_share]


@each("name", WALKS)
def test_walks_of_real_people_are_as_published(name: str) -> None:
    # Whittle, Gait analysis, 2007, table of normal ranges, 15 to 64 years, both sexes; some of these people stroll
    gait = gait_of(recorded.clip(name).motion())
    assert gait.why == ""
    assert 90.0 < gait.cadence < 138.0  # type: ignore[operator]
    assert 0.80 < gait.speed < 1.82  # type: ignore[operator]
    assert 0.94 < gait.stride_length < 1.85  # type: ignore[operator]
    assert 0.45 < gait.step_length < 0.93  # type: ignore[operator]
    assert 0.58 < gait.stance_share < 0.70  # type: ignore[operator]
    assert 0.0 < gait.step_width < 0.25  # type: ignore[operator]


@each("clip", ["02_01", "16_15"])
def test_events_are_near_those_of_a_slow_twin(cmu: Path, clip: str) -> None:
    # O'Connor et al. 2007: the middle of the foot falls fastest just before it strikes and rises fastest at toe off
    folder = cmu / clip[:2]
    motion = read_clip(folder / f"{clip[:2]}.asf", folder / f"{clip}.amc", fps=120.0)
    events = gait_events(motion.resampled(30.0))
    joints = motion.skeleton.joints(motion.poses, motion.translations)
    off_by: dict[str, list[float]] = {"strike": [], "off": []}
    for side, letter in (("left", "l"), ("right", "r")):
        height = [
            (joints[k, JOINTS.index(f"{letter}tibia"), 1] + joints[k, JOINTS.index(f"{letter}toes"), 1]) / 2.0
            for k in range(len(motion))
        ]
        smooth = [sum(height[max(0, k - 3) : k + 4]) / len(height[max(0, k - 3) : k + 4]) for k in range(len(height))]
        rising = [(smooth[k + 1] - smooth[k - 1]) * 60.0 for k in range(1, len(smooth) - 1)]
        lows = [
            (k + 1) / 120.0 for k in range(10, len(rising) - 10) if rising[k] == min(rising[k - 10 : k + 11]) < -0.25
        ]
        tops = [
            (k + 1) / 120.0 for k in range(10, len(rising) - 10) if rising[k] == max(rising[k - 10 : k + 11]) > 0.25
        ]
        for strike in events.strikes[side] / 30.0:
            off_by["strike"].append(min((one - strike for one in lows), key=abs))
        for off in events.offs[side] / 30.0:
            off_by["off"].append(min((one - off for one in tops), key=abs))
    assert len(off_by["strike"]) >= 4
    assert len(off_by["off"]) >= 4
    # the heel is farthest ahead a little before it is on the ground
    assert all(0.02 < one < 0.06 for one in off_by["strike"])
    assert all(abs(one) < 0.025 for one in off_by["off"])


def test_a_rate_of_thirty_says_what_one_of_120_says() -> None:
    fine, coarse = gait_of(walker(fps=120.0)), gait_of(walker(fps=30.0))
    assert figures(coarse) == pytest.approx(figures(fine), rel=0.03)


@each(
    ("name", "why"),
    [
        ("jacks", "no strikes of a foot detected"),
        ("squat", "no strikes of a foot detected"),
        ("step", "the person moves forwards at 0.00 m/s"),
    ],
)
def test_what_is_no_walk_is_called_so(name: str, why: str) -> None:
    gait = gait_of(built_in.motion(name, frames=90))
    assert gait.why == why
    assert figures(gait) == [None] * 6
    assert gait.as_dict()["walk"] is False


@each("name", ["09_01", "127_06", "16_35", "49_04"])
def test_a_run_is_no_walk(name: str) -> None:
    assert "runs" in gait_of(recorded.clip(name).motion()).why


@each("name", ["05_16", "05_17", "127_24"])
def test_steps_aside_are_no_walk(name: str) -> None:
    assert gait_of(recorded.clip(name).motion()).why.endswith("m wide")


def test_who_walks_backwards_is_not_measured_as_if_he_walked_forwards() -> None:
    assert gait_of(walker(speed=-SPEED)).why == "the person moves backwards at 1.00 m/s"


def test_a_single_frame_has_no_gait() -> None:
    assert gait_of(walker().frames(0, 1)).why == "no strikes of a foot detected"


def test_too_few_frames_a_second_are_told() -> None:
    slow = replace(walker(), fps=10.0)
    assert gait_of(slow).why == "fewer than 12 frames a second"
    with pytest.raises(ValueError, match="fps must be at least 12 to find the events of gait, got 10"):
        gait_events(slow)


def test_steps_that_touch_an_unknown_frame_count_for_nothing() -> None:
    motion = walker()
    whole, holed = gait_of(motion), gait_of(motion, {100})  # between the strikes at 0.9 and 1.5 s
    timed = [[one.step_seconds is not None for one in gait.steps] for gait in (whole, holed)]
    assert timed == [[False, True, True, True, True, True, True], [False, True, False, True, True, True, True]]
    assert [one.stance_share is not None for one in holed.steps][:3] == [False, False, True]
    assert figures(holed) == pytest.approx(figures(whole), rel=0.01)
    assert figures(gait_of(motion, range(len(motion)))) == [None] * 6


def test_two_steps_are_enough_though_no_stride_is_whole() -> None:
    gait = gait_of(walker(seconds=2.5), {120})  # strikes at 0.3, 0.9, 1.5 and 2.1 s
    assert gait.cadence == pytest.approx(100.0, abs=1.0)
    assert gait.speed == pytest.approx(SPEED, abs=0.01)
    assert (gait.stride_length, gait.stance_share) == (None, None)
    assert gait_line(gait.as_dict()) == "gait: 100 steps a minute, step 0.60 m, speed 1.00 m/s, over 2 steps"


def test_a_strike_in_an_unknown_frame_is_none() -> None:
    strikes = [one.strike_seconds for one in gait_of(walker(), {89, 90, 91}).steps]
    assert strikes == pytest.approx([0.3, 1.5, 2.1, 2.7, 3.3, 3.9], abs=0.02)


def test_a_walk_that_is_a_small_part_of_a_motion_says_nothing_of_it() -> None:
    motion = walker()
    still = np.repeat(np.arange(len(motion)), np.where(np.arange(len(motion)) == len(motion) - 1, 1000, 1))
    longer = Motion("waits", motion.skeleton, motion.poses[still], motion.translations[still], motion.fps)
    assert gait_of(longer).why == "steps of a walk in 3.6 of 14.2 s"


def test_the_filter_passes_what_is_slow_and_shifts_nothing() -> None:
    times = np.arange(200) / 100.0
    even = np.column_stack([times, 3.0 - 2.0 * times])
    np.testing.assert_allclose(low_pass(even, 6.0, 100.0), even, atol=1e-12)
    wave = np.sin(2.0 * np.pi * 6.0 * times)
    np.testing.assert_allclose(low_pass(wave, 6.0, 100.0)[50:150], np.sqrt(0.5) * wave[50:150], atol=2e-3)
