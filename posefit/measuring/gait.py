"""What a walk is like, left and right: cadence, steps and strides, speed, stance and width; and who walks backwards.

A step of a foot lasts from the other foot's strike to its own, a stride from one of its strikes to its next. Only those
count whose feet strike in turn, in which the person moves the way they face, and of which every frame is known. Of a
person who walks and stays in one place, as on a treadmill or before a camera that turns with them, times alone count.
"""

from collections.abc import Collection, Iterator
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

STEP_SECONDS = (0.33, 1.3)  # of a walk: 46 to 180 steps a minute
MIN_SPEED = 0.2  # metres a second
MIN_STEPS = 2  # of a walk
MIN_STEPS_SHARE = 1.0 / 3.0  # of the known time, which the steps last at least
# metres between the lines that the feet of a walk keep to; who dances or dodges goes
# wider
MAX_STEP_WIDTH = 0.35
RUNNING_FROUDE = 0.5  # the Froude number from which people run rather than walk
# share of a stride; a runner's foot stands shorter, judged by the rearmost toes
MIN_STANCE_SHARE = 0.57
# ours: of strides in one place, the standard deviation over the mean; those of a dance
# differ more
MAX_UNEVEN = 0.1
# ours: more than of a walk, as other motions stay in one place, too
MIN_STEPS_SHARE_IN_PLACE = 0.5
IN_PLACE = "the person stays in one place: on the spot, on a treadmill, or before a camera that turns with them"
CYCLE = 101  # moments of a stride, of which the last is the first of the next
GRAVITY = 9.81  # metres a second squared
TRAVEL_SECONDS = 0.5  # ours: over which the direction is measured
MIN_TRAVEL_SPEED = 0.3  # metres a second, ours: below it a person goes nowhere
WARNING_SHARE = 0.05  # ours: of frames, from which it is worth a warning


@dataclass(frozen=True, kw_only=True)
class Step:
    """A strike of a foot, with the step that ends in it and the stride that it begins; None where either is not known.

    Seconds count from the first frame.
    """

    foot: str  # left or right
    strike_seconds: float
    toe_off_seconds: float | None = None
    step_seconds: float | None = None
    # metres along the way that the person faces, from the other ankle at its strike
    step_length: float | None = None
    # metres across it, between both ankles at the strike
    step_width: float | None = None
    stride_seconds: float | None = None
    stride_length: float | None = None  # metres
    stance_share: float | None = None


@dataclass(frozen=True, kw_only=True)
class FootGait:
    """The means over a foot's steps, which end in its strikes, and over its strides; None where there is none."""

    steps: int = 0
    step_seconds: float | None = None
    step_length: float | None = None  # metres
    stride_length: float | None = None  # metres
    stance_share: float | None = None


@dataclass(frozen=True, kw_only=True)
class Gait:
    """The gait of a motion, with every step; None where it is no walk, with the reason in `why`.

    Strides and stance are None, too, where no stride is whole, and lengths and speed with a reason in `why_no_lengths`.
    """

    steps: list[Step] = field(default_factory=list, repr=False)
    why: str = ""  # empty where it is a walk
    why_no_lengths: str = ""
    left: FootGait = FootGait()
    right: FootGait = FootGait()
    cadence: float | None = None  # steps a minute
    speed: float | None = None  # metres a second
    step_length: float | None = None  # metres
    stride_length: float | None = None  # metres
    step_width: float | None = None  # metres
    stance_share: float | None = None

    def as_dict(self) -> dict[str, object]:
        """Return the gait as summary.json holds it."""
        counted = {"steps": len(_values(self.steps, "step_seconds"))}
        reasons = {
            "why": self.why or None,
            "why_no_lengths": self.why_no_lengths or None,
        }
        return {"walk": not self.why, **asdict(self), **counted, **reasons}


def gait_of(motion: Motion, unknown: Collection[int] = ()) -> Gait:
    """Return the gait of a motion; `unknown` frames, by number, such as held or lost ones, count for nothing."""
    if motion.fps < MIN_FPS:
        return Gait(why=f"fewer than {MIN_FPS:g} frames a second")
    events = gait_events(motion)
    speed = float(
        ((events.pelvis[1:] - events.pelvis[:-1]) * events.heading[1:]).sum()
        / max(len(motion) - 1, 1)
        * motion.fps
    )
    in_place = abs(speed) < MIN_SPEED
    steps = list(
        _steps(
            events,
            motion.fps,
            motion.first,
            {number - motion.first for number in unknown},
            in_place,
        )
    )
    if why := _why_not(
        motion, events, steps, speed, (len(motion) - len(unknown)) / motion.fps
    ):
        return Gait(steps=steps, why=why)
    left, right = (
        _of_foot([step for step in steps if step.foot == side]) for side in SIDES
    )

    def mean(name: str) -> float | None:
        """Return the mean of the feet's means: the steps of one may be more, and of a limp are longer or shorter."""
        values = [
            value
            for foot in (left, right)
            if (value := getattr(foot, name)) is not None
        ]
        return float(np.mean(values)) if values else None

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
    """Yield every strike in the order of time, with what is known of its step and its stride; `in_place` no lengths."""
    least = -np.inf if in_place else MIN_SPEED
    strikes = sorted(
        (time, side) for side in SIDES for time in _known(events.strikes[side], unknown)
    )
    for k, (time, foot) in enumerate(strikes):
        other = "right" if foot == "left" else "left"
        measures: dict[str, float | None] = {}
        again = next(
            (later for later, side in strikes[k + 1 :] if side == foot), np.inf
        )
        off = next(
            (off for off in _known(events.offs[foot], unknown) if time < off < again),
            None,
        )
        if off is not None:
            measures["toe_off_seconds"] = (first + off) / fps
        before, foot_before = strikes[k - 1] if k else (time, foot)
        if foot_before == other and _walked(events, fps, before, time, unknown, least):
            measures |= _step(events, fps, foot, other, before, time)
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
    """Return the measures of a step of a foot, from the strike of the other one to its own."""
    struck = at_frames(events.ankles[foot], end)
    x, z = at_frames(events.heading, end)
    # both ankles at one moment: between two moments an error of the person's depth would count
    beside = struck - at_frames(events.ankles[other], end)
    return {
        "step_seconds": (end - start) / fps,
        # WHITTLE2007 (step length)
        "step_length": float(
            (struck - at_frames(events.ankles[other], start)) @ (x, z)
        ),
        "step_width": abs(float(beside @ (z, -x))),
    }


def _stride(
    events: GaitEvents,
    fps: float,
    foot: str,
    start: float,
    end: float,
    off: float | None,
) -> dict[str, float | None]:
    """Return the measures of a stride of a foot, from one of its strikes to the next; it lifts `off` in between."""
    moved = at_frames(events.ankles[foot], end) - at_frames(events.ankles[foot], start)
    return {
        "stride_seconds": (end - start) / fps,
        "stride_length": float(np.linalg.norm(moved)),
        # WHITTLE2007 (stance)
        "stance_share": None if off is None else (off - start) / (end - start),
    }


def _known(times: Array, unknown: set[int]) -> list[float]:
    """Return the times that do not lie beside a frame of which nothing is known."""
    return [
        float(time) for time in times if not {int(time), int(np.ceil(time))} & unknown
    ]


def _walked(
    events: GaitEvents,
    fps: float,
    start: float,
    end: float,
    unknown: set[int],
    least: float,
) -> bool:
    """Return whether the person walked on at `least` so fast from a strike to the next, with every frame known."""
    seconds = (end - start) / fps
    if not STEP_SECONDS[0] <= seconds <= STEP_SECONDS[1] or unknown & set(
        range(int(start), int(end) + 2)
    ):
        return False
    moved: Array = at_frames(events.pelvis, end) - at_frames(events.pelvis, start)
    return (
        float(moved @ at_frames(events.heading, 0.5 * (start + end))) >= least * seconds
    )


def _why_not(
    motion: Motion, events: GaitEvents, steps: list[Step], speed: float, known: float
) -> str:
    """Return why a motion at a speed, of which so many seconds are known, is no walk; empty where it is one."""
    strikes = sum(len(events.strikes[side]) for side in SIDES)
    if strikes <= MIN_STEPS:
        return (
            f"{strikes or 'no'} strike{'' if strikes == 1 else 's'} of a foot detected"
        )
    if speed <= -MIN_SPEED:
        return f"the person moves backwards at {-speed:.2f} m/s"
    stance = _values(steps, "stance_share")
    froude = speed**2 / (GRAVITY * _leg(motion))  # ALEXANDER1989 (Froude number)
    if froude > RUNNING_FROUDE or (stance and np.mean(stance) < MIN_STANCE_SHARE):
        return "the person runs" + (
            f", at {speed:.1f} m/s" if speed >= MIN_SPEED else " in one place"
        )
    timed = _values(steps, "step_seconds")
    if len(timed) < MIN_STEPS:
        return "the feet do not strike in turn at the pace of a walk, or too little is known"
    in_place = abs(speed) < MIN_SPEED
    if sum(timed) < (MIN_STEPS_SHARE_IN_PLACE if in_place else MIN_STEPS_SHARE) * known:
        return f"steps of a walk in {sum(timed):.1f} of {known:.1f} s"
    strides = _values(steps, "stride_seconds")
    if in_place and (
        len(strides) < MIN_STEPS or np.std(strides) > MAX_UNEVEN * np.mean(strides)
    ):
        return "the person stays in one place, without even strides"
    width = _mean(steps, "step_width")
    return (
        f"steps are {width:.2f} m wide"
        if width is not None and width > MAX_STEP_WIDTH
        else ""
    )


def _leg(motion: Motion) -> float:
    bones = [BONES.index(bone) for kind in ("femur", "tibia") for bone in both(kind)]
    return float(motion.skeleton.lengths[bones].sum()) / 2.0


def _values(steps: list[Step], name: str) -> list[float]:
    return [value for step in steps if (value := getattr(step, name)) is not None]


def _mean(steps: list[Step], name: str) -> float | None:
    return float(np.mean(values)) if (values := _values(steps, name)) else None


def stride_curves(motion: Motion, gait: Gait, angle: str) -> dict[str, Array]:
    """Return an angle of `clinical_angles` over the whole strides of each foot, by side (n, 101): degrees."""
    angles = clinical_angles(motion.skeleton, motion.poses)
    curves = {}
    for side in SIDES:
        strides = [
            at_frames(
                angles[f"{side}_{angle}"],
                start + np.linspace(0.0, step.stride_seconds, CYCLE) * motion.fps,
            )
            for step in gait.steps
            if step.foot == side and step.stride_seconds is not None
            for start in [step.strike_seconds * motion.fps - motion.first]
        ]
        curves[side] = np.array(strides).reshape(-1, CYCLE)
    return curves


def walks_backwards(motion: Motion, unknown: Collection[int] = ()) -> NDArray[np.bool_]:
    """Return in which frames (T,) the root faces away from its way; `unknown` frames, by number, count for nothing.

    The way of a frame is that of the half second about it, over the ground, as far as all of it is known. A person who
    moves slower than 0.3 m/s has none. A heading is away from the way where it lies more than 90 degrees from it.
    """
    count = len(motion)
    half = max(round(0.5 * TRAVEL_SECONDS * motion.fps), 1)
    back = np.zeros(count, dtype=bool)
    if count <= 2 * half:
        return back
    yaws = motion.poses[half : count - half, 0]
    ground = motion.translations[:, [0, 2]]
    way = ground[2 * half :] - ground[: -2 * half]
    away = np.asarray(
        (way * np.column_stack([np.sin(yaws), np.cos(yaws)])).sum(axis=1) < 0.0
    )
    frame_known = np.isin(motion.first + np.arange(count), [*unknown], invert=True)
    known = np.asarray(sliding_window_view(frame_known, 2 * half + 1).all(axis=1))
    fast = np.linalg.norm(way, axis=1) > MIN_TRAVEL_SPEED * 2 * half / motion.fps
    back[half : count - half] = away & fast & known
    return back


def backwards_warning(back: NDArray[np.bool_]) -> str:
    """Return a warning about frames in which the person walks backwards; empty where they are few."""
    if back.mean() < WARNING_SHARE:
        return ""
    return (
        f"the person seems to walk backwards in {back.sum()} of {len(back)} frames: expected to face the direction "
        "of travel; if they do, the track faces the wrong way there"
    )
