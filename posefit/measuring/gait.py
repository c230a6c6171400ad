"""Measures of a walk, left and right: cadence, steps, strides, speed, stance, width.

It also finds people who walk backwards. A step of a foot lasts from the other foot's
strike to its own, a stride from one of its strikes to the next. A step or a stride
counts if the feet strike in turn, if the person moves the way they face, and if every
frame of it is known. If a person walks in one place, as on a treadmill or in front of
a camera that turns with them, only times count.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.skeleton import BONES, both
from posefit.measuring.angles import clinical_angles
from posefit.measuring.events import MIN_FPS, GaitEvents, gait_events
from posefit.measuring.segments import SIDES
from posefit.motion.motion import Motion, at_frames
from posefit.motion.steadiness import runs

STEP_SECONDS = (0.33, 1.3)  # a step of a walk: 46 to 180 steps per minute
MIN_SPEED = 0.2  # metres per second
MIN_STEPS = 2  # fewest steps of a walk
MIN_STEPS_SHARE = 1.0 / 3.0  # least share of the known time that the steps last
# metres between the lines on which the feet of a walk strike; in dancing or dodging it
# is wider
MAX_STEP_WIDTH = 0.35
RUNNING_FROUDE = 0.5  # the Froude number above which people run rather than walk
# share of a stride; judged by the rearmost toes, a runner's stance is shorter
MIN_STANCE_SHARE = 0.57
# ours: standard deviation of strides in one place over their mean; in a dance it is
# larger
MAX_UNEVEN = 0.1
# ours: greater than MIN_STEPS_SHARE, because other motions are in one place, too
MIN_STEPS_SHARE_IN_PLACE = 0.5
IN_PLACE = (
    "the person stays in one place: on the spot, on a treadmill, "
    "or in front of a camera that turns with them"
)
CYCLE = 101  # samples of a stride; the last is the first of the next stride
GRAVITY = 9.81  # metres per second squared
TRAVEL_SECONDS = 0.5  # ours: time over which the direction of travel is measured
MIN_TRAVEL_SPEED = 0.3  # metres per second, ours: a slower person has no direction
WARNING_SHARE = 0.05  # ours: share of frames from which a warning is given


@dataclass(frozen=True, kw_only=True)
class Step:
    """A strike of a foot, with the step that it ends and the stride that it begins.

    Unknown values are None. Seconds count from the first frame, lengths are metres.

    Attributes:
        foot: "left" or "right".
        strike_seconds: Time of the strike.
        toe_off_seconds: Time of the next toe off.
        step_seconds: Duration of the step.
        step_length: Distance from the other ankle at its strike, in the direction that
            the person faces.
        step_width: Distance between the ankles at the strike, across that direction.
        stride_seconds: Duration of the stride.
        stride_length: Distance from this strike to the foot's next one.
        stance_share: Share of the stride in which the foot is on the ground.
    """

    foot: str
    strike_seconds: float
    toe_off_seconds: float | None = None
    step_seconds: float | None = None
    step_length: float | None = None
    step_width: float | None = None
    stride_seconds: float | None = None
    stride_length: float | None = None
    stance_share: float | None = None


@dataclass(frozen=True, kw_only=True)
class FootGait:
    """Means over the steps that end in a foot's strikes, and over its strides.

    A mean is None if there are no values. Lengths are metres.
    """

    steps: int = 0
    step_seconds: float | None = None
    step_length: float | None = None
    stride_length: float | None = None
    stance_share: float | None = None


@dataclass(frozen=True, kw_only=True)
class Gait:
    """The gait of a motion, with every step.

    If it is not a walk, all measures are None. Strides and stance are also None if no
    stride is complete.

    Attributes:
        steps: Every strike, with its measures.
        why: Why it is not a walk; empty if it is one.
        why_no_lengths: Why lengths and speed are None; empty if they are known.
        left: Means of the left foot.
        right: Means of the right foot.
        cadence: Steps per minute.
        speed: Metres per second.
        step_length: Mean length of a step, in metres.
        stride_length: Mean length of a stride, in metres.
        step_width: Mean width of a step, in metres.
        stance_share: Mean share of a stride in which the foot is on the ground.
    """

    steps: list[Step] = field(default_factory=list, repr=False)
    why: str = ""
    why_no_lengths: str = ""
    left: FootGait = FootGait()
    right: FootGait = FootGait()
    cadence: float | None = None
    speed: float | None = None
    step_length: float | None = None
    stride_length: float | None = None
    step_width: float | None = None
    stance_share: float | None = None

    def as_dict(self) -> dict[str, object]:
        """Return the gait in the form of summary.json."""
        counted = {"steps": len(_values(self.steps, "step_seconds"))}
        reasons = {
            "why": self.why or None,
            "why_no_lengths": self.why_no_lengths or None,
        }
        return {"walk": not self.why, **asdict(self), **counted, **reasons}


def gait_of(motion: Motion, unseen: Collection[int] = ()) -> Gait:
    """Return the gait of a motion.

    Args:
        motion: The motion.
        unseen: Numbers of frames to ignore, such as held or lost ones.

    Returns:
        The gait, with `why` if it has no figures.

    Example:
        >>> from posefit import gait_of, load_motion
        >>> gait = gait_of(load_motion("16_15"))
        >>> 90.0 < gait.cadence < 130.0
        True
    """
    if motion.fps < MIN_FPS:
        return Gait(why=f"fewer than {MIN_FPS:g} frames a second")
    events = gait_events(motion)
    moved = events.pelvis[1:] - events.pelvis[:-1]  # (T - 1, 2)
    distance = (moved * events.heading[1:]).sum()
    speed = float(distance / max(len(motion) - 1, 1) * motion.fps)
    in_place = abs(speed) < MIN_SPEED
    unknown = {number - motion.first for number in unseen}
    steps = list(_steps(events, motion.fps, motion.first, unknown, in_place))
    known = (len(motion) - len(unseen)) / motion.fps
    if why := _why_not(motion, events, steps, speed, known):
        return Gait(steps=steps, why=why)
    left = _of_foot([step for step in steps if step.foot == "left"])
    right = _of_foot([step for step in steps if step.foot == "right"])

    def mean(name: str) -> float | None:
        """Return the mean of the feet's means.

        One foot may have more steps, and the feet of a limp differ.
        """
        return _mean([left, right], name)

    seconds = mean("step_seconds")
    length = mean("step_length")
    assert seconds is not None
    cadence = 60.0 / seconds  # WHITTLE2007 (cadence)
    return Gait(
        steps=steps,
        why_no_lengths=IN_PLACE if in_place else "",
        left=left,
        right=right,
        cadence=cadence,
        # WHITTLE2007 (speed)
        speed=None if length is None else length * cadence / 60.0,
        step_length=length,
        stride_length=mean("stride_length"),
        step_width=_mean(steps, "step_width"),
        stance_share=mean("stance_share"),
    )


def _of_foot(steps: list[Step]) -> FootGait:
    names = ("step_seconds", "step_length", "stride_length", "stance_share")
    return FootGait(
        steps=len(_values(steps, "step_seconds")),
        **{name: _mean(steps, name) for name in names},
    )


def _steps(
    events: GaitEvents, fps: float, first: int, unknown: set[int], in_place: bool
) -> Iterator[Step]:
    """Yield every strike in order of time, with its step and stride if they are known.

    `first` is the number of the first frame, from which `unknown` frames are counted.
    With `in_place` steps and strides have no lengths.
    """
    least = -np.inf if in_place else MIN_SPEED
    strikes = []
    for side in SIDES:
        strikes += [(time, side) for time in _known(events.strikes[side], unknown)]
    strikes.sort()
    for k, (time, foot) in enumerate(strikes):
        other = "right" if foot == "left" else "left"
        measures: dict[str, float | None] = {}
        next_strikes = (later for later, side in strikes[k + 1 :] if side == foot)
        again = next(next_strikes, np.inf)  # this foot strikes again
        lifts = _known(events.offs[foot], unknown)
        off = next((lift for lift in lifts if time < lift < again), None)
        if off is not None:
            measures["toe_off_seconds"] = (first + off) / fps
        before, foot_before = strikes[k - 1] if k else (time, foot)
        if foot_before == other and _walked(events, fps, before, time, unknown, least):
            measures |= _step(events, fps, foot, other, before, time)
        # a stride: the other foot, then this one again
        following = strikes[k + 1 : k + 3]
        times = [time, *(later for later, _ in following)]
        in_turn = [side for _, side in following] == [other, foot]
        if in_turn and all(
            _walked(events, fps, *pair, unknown, least) for pair in pairwise(times)
        ):
            measures |= _stride(events, fps, foot, time, times[-1], off)
        if in_place:
            measures |= {"step_length": None, "stride_length": None}
        yield Step(foot=foot, strike_seconds=(first + time) / fps, **measures)


def _step(
    events: GaitEvents, fps: float, foot: str, other: str, start: float, end: float
) -> dict[str, float | None]:
    """Return the measures of a step, from the other foot's strike to the foot's own."""
    struck = at_frames(events.ankles[foot], end)
    x, z = at_frames(events.heading, end)
    # both ankles at the same time: an error of the person's depth would count otherwise
    between = struck - at_frames(events.ankles[other], end)
    advance = struck - at_frames(events.ankles[other], start)
    return {
        "step_seconds": (end - start) / fps,
        # WHITTLE2007 (step length)
        "step_length": float(advance @ (x, z)),
        "step_width": abs(float(between @ (z, -x))),
    }


def _stride(
    events: GaitEvents,
    fps: float,
    foot: str,
    start: float,
    end: float,
    off: float | None,
) -> dict[str, float | None]:
    """Return the measures of a stride of a foot, between two of its strikes.

    `off` is when it lifts off in between, or None.
    """
    moved = at_frames(events.ankles[foot], end) - at_frames(events.ankles[foot], start)
    return {
        "stride_seconds": (end - start) / fps,
        "stride_length": float(np.linalg.norm(moved)),
        # WHITTLE2007 (stance)
        "stance_share": None if off is None else (off - start) / (end - start),
    }


def _known(times: Array, unknown: set[int]) -> list[float]:
    """Return the times that do not lie next to an unknown frame."""
    known = []
    for time in times:
        if not {int(time), int(np.ceil(time))} & unknown:
            known.append(float(time))
    return known


def _walked(
    events: GaitEvents,
    fps: float,
    start: float,
    end: float,
    unknown: set[int],
    least: float,
) -> bool:
    """Return whether the person walked from a strike to the next, at least so fast.

    All frames must be known, and the time must be that of a step of a walk.
    """
    seconds = (end - start) / fps
    frames = set(range(int(start), int(end) + 2))
    if not STEP_SECONDS[0] <= seconds <= STEP_SECONDS[1] or unknown & frames:
        return False
    moved: Array = at_frames(events.pelvis, end) - at_frames(events.pelvis, start)
    heading = at_frames(events.heading, 0.5 * (start + end))
    return float(moved @ heading) >= least * seconds


def _why_not(
    motion: Motion, events: GaitEvents, steps: list[Step], speed: float, known: float
) -> str:
    """Return why a motion is not a walk, or "" if it is one.

    Args:
        motion: The motion.
        events: Its events.
        steps: Its steps.
        speed: Forwards, in metres per second.
        known: Seconds that are known.
    """
    strikes = sum(len(events.strikes[side]) for side in SIDES)
    if strikes <= MIN_STEPS:
        plural = "" if strikes == 1 else "s"
        return f"{strikes or 'no'} strike{plural} of a foot detected"
    if speed <= -MIN_SPEED:
        return f"the person moves backwards at {-speed:.2f} m/s"
    stance = _values(steps, "stance_share")
    froude = speed**2 / (GRAVITY * _leg(motion))  # ALEXANDER1989 (Froude number)
    if froude > RUNNING_FROUDE or (stance and np.mean(stance) < MIN_STANCE_SHARE):
        if speed >= MIN_SPEED:
            how = f", at {speed:.1f} m/s"
        else:
            how = " in one place"
        return f"the person runs{how}"
    timed = _values(steps, "step_seconds")
    if len(timed) < MIN_STEPS:
        return (
            "the feet do not strike in turn at the pace of a walk, "
            "or too little is known"
        )
    in_place = abs(speed) < MIN_SPEED
    if in_place:
        least = MIN_STEPS_SHARE_IN_PLACE
    else:
        least = MIN_STEPS_SHARE
    if sum(timed) < least * known:
        return f"steps of a walk in {sum(timed):.1f} of {known:.1f} s"
    strides = _values(steps, "stride_seconds")
    if in_place and (
        len(strides) < MIN_STEPS or np.std(strides) > MAX_UNEVEN * np.mean(strides)
    ):
        return "the person stays in one place, without even strides"
    width = _mean(steps, "step_width")
    if width is not None and width > MAX_STEP_WIDTH:
        return f"steps are {width:.2f} m wide"
    return ""


def _leg(motion: Motion) -> float:
    bones = [BONES.index(bone) for bone in (*both("femur"), *both("tibia"))]
    return float(motion.skeleton.lengths[bones].sum()) / 2.0


def _values(measured: Sequence[Step | FootGait], name: str) -> list[float]:
    values = []
    for each in measured:
        value = getattr(each, name)
        if value is not None:
            values.append(value)
    return values


def _mean(measured: Sequence[Step | FootGait], name: str) -> float | None:
    values = _values(measured, name)
    if not values:
        return None
    return float(np.mean(values))


def stride_curves(motion: Motion, gait: Gait, angle: str) -> dict[str, Array]:
    """Return an angle over the whole strides of each foot.

    Args:
        motion: The motion.
        gait: Its gait.
        angle: A name of `clinical_angles` without the side.

    Returns:
        Degrees (strides, 101) by side.
    """
    angles = clinical_angles(motion.skeleton, motion.poses)
    curves = {}
    for side in SIDES:
        series = angles[f"{side}_{angle}"]
        strides = []
        for step in gait.steps:
            if step.foot == side and step.stride_seconds is not None:
                start = step.strike_seconds * motion.fps - motion.first
                seconds = np.linspace(0.0, step.stride_seconds, CYCLE)
                strides.append(at_frames(series, start + seconds * motion.fps))
        curves[side] = np.array(strides).reshape(-1, CYCLE)
    return curves


def walks_backwards(motion: Motion, unseen: Collection[int] = ()) -> NDArray[np.bool_]:
    """Return the frames (T,) in which the root faces away from the direction of travel.

    That direction is measured over the half second around a frame, on the ground, if
    all of it is known. A person slower than 0.3 m/s has none. A heading more than 90
    degrees from it faces away. Frames in a row in which the root moves by less than the
    length of a leg are not a walk: the hips of a person who squats move back, too.

    Args:
        motion: The motion.
        unseen: Numbers of frames to ignore.
    """
    count = len(motion)
    half = max(round(0.5 * TRAVEL_SECONDS * motion.fps), 1)
    back = np.zeros(count, dtype=bool)
    if count <= 2 * half:
        return back
    yaws = motion.poses[half : count - half, 0]
    ground = motion.translations[:, [0, 2]]
    way = ground[2 * half :] - ground[: -2 * half]
    headings = np.column_stack([np.sin(yaws), np.cos(yaws)])  # (T - 2 half, 2)
    away = np.asarray((way * headings).sum(axis=1) < 0.0)
    frame_known = np.isin(motion.first + np.arange(count), [*unseen], invert=True)
    known = np.asarray(sliding_window_view(frame_known, 2 * half + 1).all(axis=1))
    fast = np.linalg.norm(way, axis=1) > MIN_TRAVEL_SPEED * 2 * half / motion.fps
    back[half : count - half] = away & fast & known
    for start, stop in runs(back):
        path = ground[stop - 1 + half] - ground[start - half]
        if np.linalg.norm(path) < _leg(motion):
            back[start:stop] = False
    return back


def backwards_warning(back: NDArray[np.bool_]) -> str:
    """Return a warning about frames in which the person walks backwards.

    It is empty if they are few.
    """
    if back.mean() < WARNING_SHARE:
        return ""
    return (
        f"the person seems to walk backwards in {back.sum()} of {len(back)} frames: "
        "if they walked forwards, the track faces the wrong way there"
    )
