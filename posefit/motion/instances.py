"""Numbered instances of motions and scenes: what "instance 17" means.

An instance is a person, their pose or motion, and the cameras' views of it. A number
means the same instance on every machine and in every version, provided that the other
settings are the same. Numbers 0 to 9,999 are for training and tuning; 10,000 to 19,999
are held out. The table lists, for each thing that is numbered, the other settings, and
the choices that the number makes.

| numbered | settings | decided by the number | stream |
|---|---|---|---|
| motion of a sweep, an environment | motion, frames | speed, phase, view | motion |
| scene of an environment | arguments | noise, guesses of yaw and place, body | scene |
| person of an environment | held_out_people | bones and girths | person |
| problem of a suite | function, dimension | person, pose, cameras, box, noise | suite |

So a sweep's instance 17 of "walk" is the motion of an environment's instance 17 of
"walk" without held-out people, and both differ from instance 17 of a suite's function.
Each row has a separate random stream, see `generator`: random numbers of one row do not
affect another. Instance 0 of a motion is the motion itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from posefit.errors import InputError
from posefit.motion import built_in
from posefit.motion.clips import load_motion
from posefit.motion.motion import Motion
from posefit.reading import quoted

TRAINING = range(10_000)  # instances to learn from and to tune on
HELD_OUT = range(10_000, 20_000)
INSTANCES = range(20_000)

Stream = Literal["motion", "scene", "person", "suite"]
# part of the seed of every instance: published numbers depend on these values
RNG_STREAMS: dict[Stream, int] = {
    "motion": 2013,
    "scene": 2012,
    "person": 2027,
    "suite": 2026,
}

# greatest relative change of a built-in motion's cadence in an instance
SPEED = 0.15
VIEW_DEGREES = 10.0  # greatest turn of an instance's cameras


def generator(stream: Stream, *numbers: int) -> np.random.Generator:
    """Return the random generator of an instance.

    Args:
        stream: A row of the table above.
        numbers: The instance's number, for a suite after the function's.
    """
    return np.random.default_rng([RNG_STREAMS[stream], *numbers])


def instance_number(number: object) -> int:
    """Return the number of an instance as an int.

    Raises:
        InputError: There is no such instance.
    """
    last = INSTANCES[-1]
    if isinstance(number, bool) or not isinstance(number, int | np.integer):
        raise InputError(
            f"instance must be a whole number from 0 to {last}, got {quoted(number)}"
        )
    if number not in INSTANCES:
        raise InputError(f"instance must lie in 0 to {last}, got {quoted(int(number))}")
    return int(number)


@dataclass(frozen=True)
class Variation:
    """How an instance differs from the motion itself.

    Attributes:
        speed: Factor of the motion's speed.
        phase: Where in its cycle the motion begins, 0 to 1.
        turn_degrees: Turn of all cameras about the person.
        start: Where in a file the frames begin: 0 at its start, 1 as late as possible.
    """

    speed: float
    phase: float
    turn_degrees: float
    start: float

    def views(self, view_degrees: Sequence[float]) -> list[float]:
        """Return the view angles of the instance, given the motion's, in degrees."""
        return [view + self.turn_degrees for view in view_degrees]


@lru_cache(maxsize=256)
def variation(number: int) -> Variation:
    """Return how an instance differs from its motion: the same for every motion."""
    # instance 0 is the motion itself, so that a plan without instances is unchanged
    if number == 0:
        return Variation(speed=1.0, phase=0.0, turn_degrees=0.0, start=0.0)
    rng = generator("motion", number)
    return Variation(
        speed=1.0 + SPEED * rng.uniform(-1.0, 1.0),
        phase=rng.uniform(),
        turn_degrees=VIEW_DEGREES * rng.uniform(-1.0, 1.0),
        start=rng.uniform(),
    )


def motion_of_instance(
    source: str | Motion, number: int, *, frames: int, fps: float
) -> Motion:
    """Return frames of an instance of a motion.

    Args:
        source: Name of a built-in motion, a file or a motion.
        number: The instance's number.
        frames: How many frames.
        fps: Frames per second.

    Raises:
        InputError: A file has fewer frames.
    """
    varied = variation(number)
    if isinstance(source, str) and source in built_in.names():
        return built_in.motion(
            source, frames=frames, fps=fps, speed=varied.speed, phase=varied.phase
        )
    motion = load_motion(source, fps)
    if frames > len(motion):
        name = source if isinstance(source, str) else source.name
        raise InputError(
            f"frames must be at most {len(motion)}, the length of {name}, got {frames}"
        )
    first = int(varied.start * (len(motion) - frames + 1))
    return motion.frames(first, first + frames)
