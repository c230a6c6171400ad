"""Gait of walks, beside an independent slow twin and published ranges; why a motion is no walk; who walks backwards."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.geometry.skeleton import BONES
from posefit.measuring.events import gait_events, low_pass
from posefit.measuring.gait import (
    Gait,
    backwards_warning,
    gait_of,
    stride_curves,
    walks_backwards,
)
from posefit.motion import built_in, recorded
from posefit.motion.motion import Motion
from posefit.output.text import detailed, gait_line
from tests.cases import each
from tests.files import csv_rows
from tests.measuring.walker import SPEED, STANCE, STRIDE, angle, walker

WALKS = (
    "02_01",
    "05_01",
    *(f"16_{k}" for k in (*range(12, 19), *range(20, 33), 47, 58)),
)


def figures(gait: Gait) -> list[object]:
    return [
        gait.cadence,
        gait.speed,
        gait.step_length,
        gait.stride_length,
        gait.step_width,
        gait.stance_share,
    ]


@each("name", WALKS)
def test_walks_of_real_people_are_as_published(name: str) -> None:
    # Whittle, Gait analysis, 2007, table of normal ranges, 15 to 64 years, both sexes; some of these people stroll
    gait = gait_of(recorded.clip(name).motion())
    assert gait.why == ""
    low = (90.0, 0.80, 0.45, 0.94, 0.0, 0.58)
    high = (138.0, 1.82, 0.93, 1.85, 0.25, 0.70)
    values = np.array(figures(gait), dtype=float)
    assert ((low < values) & (values < high)).all(), values


def test_thirty_frames_a_second_are_as_good_as_120() -> None:
    fine = gait_of(walker(fps=120.0))
    coarse = gait_of(walker(fps=30.0))
    assert figures(coarse) == pytest.approx(figures(fine), rel=0.03)


WALKER = walker()
LONGER = np.append(np.arange(len(WALKER)), np.full(999, len(WALKER) - 1))
# still at the end
WAITING = replace(
    WALKER, poses=WALKER.poses[LONGER], translations=WALKER.translations[LONGER]
)


@each(
    ("motion", "why"),
    [
        (built_in.motion("jacks", frames=90), "no strikes of a foot detected"),
        (built_in.motion("squat", frames=90), "no strikes of a foot detected"),
        (recorded.clip("05_07").motion(), "steps of a walk in 4.6 of 9.9 s"),  # a dance
        # some work
        (
            recorded.clip("14_23").motion(),
            "the person stays in one place, without even strides",
        ),
        *(
            (recorded.clip(name).motion(), "the person runs")
            for name in ("09_01", "127_06", "16_35", "49_04")
        ),
        *(
            (recorded.clip(name).motion(), "m wide")
            for name in ("05_16", "05_17", "127_24")
        ),
        (walker(speed=-SPEED), "the person moves backwards at 1.00 m/s"),
        (WALKER.frames(0, 1), "no strikes of a foot detected"),
        (replace(WALKER, fps=10.0), "fewer than 12 frames a second"),
        (WAITING, "steps of a walk in 3.6 of 14.2 s"),
    ],
)
def test_a_motion_that_is_not_a_walk_has_a_reason_and_no_figures(
    motion: Motion, why: str
) -> None:
    gait = gait_of(motion)
    assert why in gait.why
    assert figures(gait) == [None] * 6
    assert gait.as_dict()["walk"] is False


def test_events_need_twelve_frames_a_second() -> None:
    with pytest.raises(
        ValueError, match="fps must be at least 12 to find the events of gait, got 10"
    ):
        gait_events(replace(WALKER, fps=10.0))


def test_steps_that_touch_an_unknown_frame_count_for_nothing() -> None:
    motion = walker()
    # between the strikes at 0.9 and 1.5 s
    whole = gait_of(motion)
    holed = gait_of(motion, {100})
    timed = [
        [step.step_seconds is not None for step in gait.steps]
        for gait in (whole, holed)
    ]
    assert timed == [
        [False, True, True, True, True, True, True],
        [False, True, False, True, True, True, True],
    ]
    assert [step.stance_share is not None for step in holed.steps][:3] == [
        False,
        False,
        True,
    ]
    assert figures(holed) == pytest.approx(figures(whole), rel=0.01)
    assert figures(gait_of(motion, range(len(motion)))) == [None] * 6
    strikes = [step.strike_seconds for step in gait_of(motion, {89, 90, 91}).steps]
    assert strikes == pytest.approx([0.3, 1.5, 2.1, 2.7, 3.3, 3.9], abs=0.02)


def test_two_steps_are_enough_though_no_stride_is_whole() -> None:
    gait = gait_of(walker(seconds=2.5), {120})  # strikes at 0.3, 0.9, 1.5 and 2.1 s
    assert gait.cadence == pytest.approx(100.0, abs=1.0)
    assert gait.speed == pytest.approx(SPEED, abs=0.01)
    assert (gait.stride_length, gait.stance_share) == (None, None)
    assert gait_line(gait.as_dict()) == (
        "gait: 100 steps a minute, 1.00 m/s, over 2 steps; left and right: step - and 0.60 m, step - and 0.60 s"
    )


LIMPS = [  # step lengths in metres and times in seconds, of left and right
    ((-0.05, 0.47), (0.5, 0.7)),
    ((0.47, -0.05), (0.7, 0.5)),
    ((0.30, 0.60), (0.6, 0.6)),
    ((0.62, 0.35), (0.45, 0.75)),
    ((0.20, 0.50), (0.75, 0.45)),
    ((0.55, 0.50), (0.65, 0.55)),
]


def limping(
    lengths: tuple[float, float],
    seconds: tuple[float, float],
    speed: float | None = None,
) -> Motion:
    """Return a walker with such steps: a step is as long as the body moves meanwhile, and the foot is farther ahead.

    Half a stance apart, a stiff leg's ankle is as far ahead of the hip as the sine of its swing times the leg.
    """
    stride = sum(seconds)
    even = sum(lengths) / stride * np.array(seconds)
    leg = float(
        WALKER.skeleton.lengths[[BONES.index("lfemur"), BONES.index("ltibia")]].sum()
    )
    apart = lengths[0] - even[0]  # of the ankles, ahead of the hips, at their strikes
    assert lengths[1] - even[1] == pytest.approx(-apart)
    swing = np.arcsin((0.3 + 0.5 * np.array([apart, -apart])) / leg)
    first = {"l": 0.3, "r": 0.3 + seconds[1]}
    assert stride == pytest.approx(STRIDE)
    forwards = sum(lengths) / stride if speed is None else speed
    return walker(6.0, 30.0, forwards, 0.7, first, dict(zip("lr", swing, strict=True)))


@each(("lengths", "seconds"), LIMPS)
def test_left_and_right_of_a_limp_are_apart(
    lengths: tuple[float, float], seconds: tuple[float, float]
) -> None:
    gait = gait_of(limping(lengths, seconds))
    assert gait.why == gait.why_no_lengths == ""
    for foot, length, time in zip(
        (gait.left, gait.right), lengths, seconds, strict=True
    ):
        assert foot.step_length == pytest.approx(length, abs=0.04)
        assert foot.step_seconds == pytest.approx(time, abs=0.03)
        assert foot.stride_length == pytest.approx(sum(lengths), abs=0.01)
        assert foot.stance_share == pytest.approx(STANCE, abs=0.03)
    assert gait.left.steps + gait.right.steps == gait.as_dict()["steps"] >= 8
    if lengths == LIMPS[0][0]:
        assert (
            "left and right: step -0.05 and 0.47 m, step 0.50 and 0.70 s, stance "
            in gait_line(gait.as_dict())
        )


@each(("lengths", "seconds"), LIMPS)
def test_walking_in_place_gives_only_times(
    lengths: tuple[float, float], seconds: tuple[float, float]
) -> None:
    # a belt that moves a little slower than they
    gait = gait_of(limping(lengths, seconds, 0.05))
    assert gait.cadence == pytest.approx(100.0, abs=1.0)
    assert [gait.left.step_seconds, gait.right.step_seconds] == pytest.approx(
        seconds, abs=0.03
    )
    assert [
        gait.speed,
        gait.step_length,
        gait.stride_length,
        gait.left.step_length,
    ] == [None] * 4
    line = gait_line(gait.as_dict())
    assert line.endswith(
        "; no lengths: the person stays in one place: on the spot, on a treadmill, or in front of a camera that turns with them"
    )


def test_a_stride_of_the_knee_lasts_from_strike_to_strike() -> None:
    motion = walker(fps=100.0)
    bent = np.zeros(motion.poses.shape)
    # a fifth of a degree a frame
    bent[:, angle("ltibia", "x")] = np.radians(10.0 + 0.2 * np.arange(len(motion)))
    curves = stride_curves(
        replace(motion, poses=motion.poses + bent), gait_of(motion), "knee_flexion"
    )
    assert curves["left"].shape == (3, 101)
    assert curves["right"].shape == (2, 101)
    # 120 frames a stride
    assert np.diff(curves["left"]) == pytest.approx(0.24, abs=0.01)
    assert curves["left"][:, 0] - curves["right"][0, 0] == pytest.approx(
        [16.0, 40.0, 64.0], abs=1.0
    )
    assert np.ptp(curves["right"]) == pytest.approx(0.0, abs=1e-9)


def test_the_filter_passes_low_frequencies_without_a_shift() -> None:
    times = np.arange(200) / 100.0
    even = np.column_stack([times, 3.0 - 2.0 * times])
    np.testing.assert_allclose(low_pass(even, 6.0, 100.0), even, atol=1e-12)
    wave = np.sin(2.0 * np.pi * 6.0 * times)
    np.testing.assert_allclose(
        low_pass(wave, 6.0, 100.0)[50:150], np.sqrt(0.5) * wave[50:150], atol=2e-3
    )


WALK = built_in.motion("walk", frames=60)  # at 30 frames a second


def turned(degrees: float) -> Motion:
    return replace(WALK, poses=WALK.poses + np.radians(degrees) * np.eye(66)[0])


@each(("degrees", "back"), [(0.0, False), (60.0, False), (120.0, True), (180.0, True)])
def test_a_person_who_faces_away_from_their_way_walks_backwards(
    degrees: float, back: bool
) -> None:
    # half of half a second, beyond which nothing is known, is 8 frames
    assert (
        walks_backwards(turned(degrees)).tolist()
        == [False] * 8 + [back] * 44 + [False] * 8
    )


@each(("speed", "back"), [(0.29, False), (0.31, True)])
def test_below_30_cm_a_second_a_person_has_no_way(speed: float, back: bool) -> None:
    places = np.array([0.0, 1.0, 0.0]) + np.arange(120)[
        :, None
    ] / 30.0 * speed * np.array([0.0, 0.0, -1.0])
    assert (
        walks_backwards(
            replace(WALK, poses=np.zeros((120, 66)), translations=places)
        ).any()
        == back
    )


@each(("metres", "back"), [(0.4, False), (1.2, True)])
def test_hips_that_go_back_by_less_than_a_leg_are_no_walk(
    metres: float, back: bool
) -> None:
    # the hips go back and forth once in two seconds, as in a squat
    places = np.zeros((90, 3))
    places[:, 1] = 1.0
    places[:, 2] = 0.5 * metres * np.cos(np.pi * np.arange(90) / 30.0)
    motion = replace(WALK, poses=np.zeros((90, 66)), translations=places)
    assert walks_backwards(motion).any() == back


def test_unknown_frames_and_their_neighbours_do_not_count() -> None:
    assert np.flatnonzero(walks_backwards(turned(180.0), {30})).tolist() == [
        *range(8, 22),
        *range(39, 52),
    ]
    assert not walks_backwards(turned(180.0).frames(0, 16)).any()


def test_a_few_frames_are_not_worth_a_warning() -> None:
    assert backwards_warning(np.arange(100) < 4) == ""
    assert backwards_warning(np.arange(100) < 5).startswith(
        "the person seems to walk backwards in 5 of 100 frames"
    )


def test_a_track_of_a_walk_has_its_gait(tmp_path: Path) -> None:
    out = tmp_path / "out"
    tracked = posefit.track("walk", size=(160, 120), out=out)
    gait = json.loads((out / "summary.json").read_text())["gait"]
    assert gait == tracked.summary["gait"]
    assert gait["walk"] is True
    true = gait_of(tracked.truth)
    assert gait["cadence"] == pytest.approx(true.cadence, abs=3.0)
    assert gait["speed"] == pytest.approx(true.speed, abs=0.05)
    assert gait_line(gait) in detailed(tracked.content).splitlines()
    assert gait_line(gait).startswith(
        f"gait: {gait['cadence']:.0f} steps a minute, {gait['speed']:.2f} m/s, over "
    )
    steps = csv_rows(out / "gait.csv")
    assert sum(step["step_seconds"] != "" for step in steps) == gait["steps"]


def test_a_track_of_no_walk_reports_why_and_a_single_frame_nothing() -> None:
    quick: dict[str, Any] = {"size": (80, 60), "evaluations": 30}
    track = posefit.track("jacks", frames=(0, 20), **quick)
    assert track.summary["gait"]["walk"] is False
    assert (
        "no figures of gait: no strikes of a foot detected" in str(track).splitlines()
    )
    assert "gait" not in str(posefit.fit("walk", **quick).track)


def test_unknown_frames_have_their_numbers_as_filmed() -> None:
    motion = walker(fps=30.0)
    later = replace(motion, first=1000)
    holed = gait_of(motion, {100})
    shifted = gait_of(later, {1100})
    assert figures(shifted) == figures(holed) != figures(gait_of(motion))
    assert gait_of(later, {100}).left.steps == gait_of(motion).left.steps
    back = turned(180.0)
    np.testing.assert_array_equal(
        walks_backwards(replace(back, first=7), {37}), walks_backwards(back, {30})
    )
