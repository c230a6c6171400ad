"""What a walk is like: cadence, lengths of steps and strides, speed, stance and the width of steps.

A step of a foot lasts from the other foot's strike to its own, a stride from one of its strikes to its next. Only those
count whose feet strike in turn, in which the person moves on the way that he faces, and of which every frame is known.
"""

from collections.abc import Collection, Iterator
from dataclasses import asdict, dataclass, field, fields
from itertools import pairwise

import numpy as np

from posefit.arrays import Array
from posefit.measuring.events import SLOWEST, GaitEvents, at_frames, gait_events
from posefit.measuring.segments import SIDES
from posefit.motion.motion import Motion

STEP_SECONDS = (0.25, 1.5)  # a step outside of which is no step of a walk: 40 to 240 a minute
LEAST_SPEED = 0.2  # metres a second
LEAST_STEPS = 2  # of a walk
WALK = 0.5  # share of a stride that a foot stands at least: with less, there are moments when neither does


@dataclass(frozen=True, kw_only=True)
class Step:
    """A strike of a foot, with the step that ends in it and the stride that it begins; None where either is not known.

    Seconds count from the first frame.
    """

    foot: str  # left or right
    strike_seconds: float
    toe_off_seconds: float | None = None
    step_seconds: float | None = None
    step_length: float | None = None  # metres along the way that the person faces, from ankle to ankle
    step_width: float | None = None  # metres across it
    stride_seconds: float | None = None
    stride_length: float | None = None  # metres
    stance_share: float | None = None


@dataclass(frozen=True, kw_only=True)
class Gait:
    """What a motion's gait is like, with every step; None where it is no walk, and `why` says so in a few words."""

    steps: list[Step] = field(default_factory=list, repr=False)
    why: str = ""  # empty where it is a walk
    cadence: float | None = None  # steps a minute
    speed: float | None = None  # metres a second
    step_length: float | None = None  # metres
    stride_length: float | None = None  # metres
    step_width: float | None = None  # metres
    stance_share: float | None = None

    def as_dict(self) -> dict[str, object]:
        """Return what summary.json says of it."""
        counted = sum(one.step_seconds is not None for one in self.steps)
        told = {one.name: getattr(self, one.name) for one in fields(self) if one.name not in ("steps", "why")}
        return {"walk": not self.why, "why": self.why or None, "steps": counted, **told}

    def __str__(self) -> str:
        if self.why:
            return f"no figures of gait: {self.why}"
        shown = (self.cadence, self.step_length, self.speed, self.stance_share)
        cadence, length, speed, stance = (0.0 if one is None else one for one in shown)
        return (
            f"walk: {cadence:.0f} steps a minute, step {length:.2f} m, {speed:.2f} m/s, "
            f"stance {100.0 * stance:.0f} % of a stride"
        )


def gait_of(motion: Motion, unknown: Collection[int] = ()) -> Gait:
    """Return the gait of a motion; `unknown` frames, such as held or lost ones, count for nothing."""
    if motion.fps < SLOWEST:
        return Gait(why=f"it has fewer than {SLOWEST:g} frames a second")
    events = gait_events(motion)
    steps = list(_steps(events, motion.fps, sorted(unknown)))
    if sum(one.step_seconds is not None for one in steps) < LEAST_STEPS:
        return Gait(steps=steps, why=_why_not(events, motion.fps))
    stance = _mean(steps, "stance_share")
    if stance is None:
        return Gait(steps=steps, why="it has no whole stride")
    if stance < WALK:
        return Gait(steps=steps, why="both feet leave the ground, as in a run")
    step_seconds, stride_seconds = _mean(steps, "step_seconds"), _mean(steps, "stride_seconds")
    stride_length = _mean(steps, "stride_length")
    assert step_seconds is not None and stride_seconds is not None and stride_length is not None
    return Gait(
        steps=steps,
        cadence=cadence(step_seconds),
        speed=stride_length / stride_seconds,
        step_length=_mean(steps, "step_length"),
        stride_length=stride_length,
        step_width=_mean(steps, "step_width"),
        stance_share=stance,
    )


def cadence(step_seconds: float) -> float:
    """Return how many steps there are in a minute."""
    return 60.0 / step_seconds


def stance_share(strike: float, toe_off: float, next_strike: float) -> float:
    """Return for which share of its stride a foot is on the ground."""
    return (toe_off - strike) / (next_strike - strike)


def _steps(events: GaitEvents, fps: float, unknown: list[int]) -> Iterator[Step]:
    """Yield every strike in the order of time, with what is known of its step and its stride."""
    strikes = sorted((float(time), side) for side in SIDES for time in events.strikes[side])
    for k, (time, foot) in enumerate(strikes):
        told: dict[str, float] = {}
        if k and strikes[k - 1][1] != foot and _walked(events, fps, strikes[k - 1][0], time, unknown):
            other = next(side for side in SIDES if side != foot)
            apart = at_frames(events.ankles[foot], time) - at_frames(events.ankles[other], time)
            x, z = at_frames(events.heading, time)
            told["step_seconds"] = (time - strikes[k - 1][0]) / fps
            told["step_length"] = float(apart @ (x, z))
            told["step_width"] = abs(float(apart @ (z, -x)))
        following = strikes[k + 1 : k + 3]
        in_turn = [side for _, side in following] == [side for side in SIDES if side != foot] + [foot]
        times = [time, *(one for one, _ in following)]
        if in_turn and all(_walked(events, fps, *pair, unknown) for pair in pairwise(times)):
            end = times[-1]
            moved = at_frames(events.ankles[foot], end) - at_frames(events.ankles[foot], time)
            told["stride_seconds"] = (end - time) / fps
            told["stride_length"] = float(np.linalg.norm(moved))
            offs = [one for one in events.offs[foot] if time < one < end]
            if len(offs) == 1:
                told["toe_off_seconds"] = offs[0] / fps
                told["stance_share"] = stance_share(time, offs[0], end)
        yield Step(foot=foot, strike_seconds=time / fps, **told)


def _walked(events: GaitEvents, fps: float, start: float, end: float, unknown: list[int]) -> bool:
    """Return whether somebody walked on from one strike to the next, and whether every frame of it is known."""
    seconds = (end - start) / fps
    if not STEP_SECONDS[0] <= seconds <= STEP_SECONDS[1] or any(start - 1.0 < k < end + 1.0 for k in unknown):
        return False
    return _forwards(events, start, end) >= LEAST_SPEED * seconds


def _forwards(events: GaitEvents, start: float, end: float) -> float:
    """Return how far the pelvis moved on the way that it faces, in metres."""
    moved: Array = at_frames(events.pelvis, end) - at_frames(events.pelvis, start)
    return float(moved @ at_frames(events.heading, 0.5 * (start + end)))


def _why_not(events: GaitEvents, fps: float) -> str:
    last = len(events.pelvis) - 1.0
    strikes = sum(len(events.strikes[side]) for side in SIDES)
    if strikes <= LEAST_STEPS:
        return f"{strikes or 'no'} strike{'' if strikes == 1 else 's'} of a foot found"
    speed = _speed(events, fps, last)
    if speed < LEAST_SPEED:
        return f"the person moves forwards at {speed:.2f} m/s"
    return "the feet do not strike in turn, or too little of it is known"


def _speed(events: GaitEvents, fps: float, last: float) -> float:
    moved = ((events.pelvis[1:] - events.pelvis[:-1]) * events.heading[1:]).sum()
    return float(moved * fps / last)


def _mean(steps: list[Step], name: str) -> float | None:
    values = [value for one in steps if (value := asdict(one)[name]) is not None]
    return float(np.mean(values)) if values else None
