"""Gait of walks, beside an independent slow twin and published ranges, and the reasons why a motion is no walk."""

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
    low, high = (90.0, 0.80, 0.45, 0.94, 0.0, 0.58), (138.0, 1.82, 0.93, 1.85, 0.25, 0.70)
    values = np.array(figures(gait), dtype=float)
    assert ((low < values) & (values < high)).all(), values


@each("clip", ["02_01", "16_15"])
def test_events_are_near_those_of_a_slow_twin(cmu: Path, clip: str) -> None:
    # O'Connor et al. 2007: the middle of the foot falls fastest just before it strikes and rises fastest at toe off
    folder = cmu / clip[:2]
    motion = read_clip(folder / f"{clip[:2]}.asf", folder / f"{clip}.amc", fps=120.0)
    events = gait_events(motion.resampled(30.0))
    joints = motion.joints
    off_by: dict[str, list[float]] = {"strike": [], "off": []}
    for side, letter in (("left", "l"), ("right", "r")):
        height = joints[:, [JOINTS.index(f"{letter}tibia"), JOINTS.index(f"{letter}toes")], 1].mean(axis=1)
        smooth = [np.mean(height[max(0, k - 3) : k + 4]) for k in range(len(height))]
        rising = [(smooth[k + 1] - smooth[k - 1]) * 60.0 for k in range(1, len(smooth) - 1)]
        around = {k: rising[k - 10 : k + 11] for k in range(10, len(rising) - 10)}
        lows = [(k + 1) / 120.0 for k, near in around.items() if rising[k] == min(near) < -0.25]
        tops = [(k + 1) / 120.0 for k, near in around.items() if rising[k] == max(near) > 0.25]
        for strike in events.strikes[side] / 30.0:
            off_by["strike"].append(min((low - strike for low in lows), key=abs))
        for off in events.offs[side] / 30.0:
            off_by["off"].append(min((top - off for top in tops), key=abs))
    assert len(off_by["strike"]) >= 4
    assert len(off_by["off"]) >= 4
    # the heel is farthest ahead a little before it is on the ground
    assert all(0.02 < seconds < 0.06 for seconds in off_by["strike"])
    assert all(abs(seconds) < 0.025 for seconds in off_by["off"])


def test_thirty_frames_a_second_are_as_good_as_120() -> None:
    fine, coarse = gait_of(walker(fps=120.0)), gait_of(walker(fps=30.0))
    assert figures(coarse) == pytest.approx(figures(fine), rel=0.03)


WALKER = walker()
WAITING = np.append(np.arange(len(WALKER)), np.full(999, len(WALKER) - 1))  # it stands still at the end


@each(
    ("motion", "why"),
    [
        (built_in.motion("jacks", frames=90), "no strikes of a foot detected"),
        (built_in.motion("squat", frames=90), "no strikes of a foot detected"),
        (built_in.motion("step", frames=90), "the person moves forwards at 0.00 m/s"),
        *((recorded.clip(name).motion(), "the person runs") for name in ("09_01", "127_06", "16_35", "49_04")),
        *((recorded.clip(name).motion(), "m wide") for name in ("05_16", "05_17", "127_24")),
        (walker(speed=-SPEED), "the person moves backwards at 1.00 m/s"),
        (WALKER.frames(0, 1), "no strikes of a foot detected"),
        (replace(WALKER, fps=10.0), "fewer than 12 frames a second"),
        (
            replace(WALKER, poses=WALKER.poses[WAITING], translations=WALKER.translations[WAITING]),
            "steps of a walk in 3.6 of 14.2 s",
        ),
    ],
)
def test_what_is_no_walk_has_a_reason_and_no_figures(motion: Motion, why: str) -> None:
    gait = gait_of(motion)
    assert why in gait.why
    assert figures(gait) == [None] * 6
    assert gait.as_dict()["walk"] is False


def test_events_need_twelve_frames_a_second() -> None:
    with pytest.raises(ValueError, match="fps must be at least 12 to find the events of gait, got 10"):
        gait_events(replace(WALKER, fps=10.0))


def test_steps_that_touch_an_unknown_frame_count_for_nothing() -> None:
    motion = walker()
    whole, holed = gait_of(motion), gait_of(motion, {100})  # between the strikes at 0.9 and 1.5 s
    timed = [[step.step_seconds is not None for step in gait.steps] for gait in (whole, holed)]
    assert timed == [[False, True, True, True, True, True, True], [False, True, False, True, True, True, True]]
    assert [step.stance_share is not None for step in holed.steps][:3] == [False, False, True]
    assert figures(holed) == pytest.approx(figures(whole), rel=0.01)
    assert figures(gait_of(motion, range(len(motion)))) == [None] * 6


def test_two_steps_are_enough_though_no_stride_is_whole() -> None:
    gait = gait_of(walker(seconds=2.5), {120})  # strikes at 0.3, 0.9, 1.5 and 2.1 s
    assert gait.cadence == pytest.approx(100.0, abs=1.0)
    assert gait.speed == pytest.approx(SPEED, abs=0.01)
    assert (gait.stride_length, gait.stance_share) == (None, None)
    assert gait_line(gait.as_dict()) == "gait: 100 steps a minute, step 0.60 m, speed 1.00 m/s, over 2 steps"


def test_a_strike_in_an_unknown_frame_does_not_count() -> None:
    strikes = [step.strike_seconds for step in gait_of(walker(), {89, 90, 91}).steps]
    assert strikes == pytest.approx([0.3, 1.5, 2.1, 2.7, 3.3, 3.9], abs=0.02)


def test_the_filter_passes_low_frequencies_without_a_shift() -> None:
    times = np.arange(200) / 100.0
    even = np.column_stack([times, 3.0 - 2.0 * times])
    np.testing.assert_allclose(low_pass(even, 6.0, 100.0), even, atol=1e-12)
    wave = np.sin(2.0 * np.pi * 6.0 * times)
    np.testing.assert_allclose(low_pass(wave, 6.0, 100.0)[50:150], np.sqrt(0.5) * wave[50:150], atol=2e-3)
