"""Numbered instances: what "instance 17" is, wherever posefit numbers something.

An instance is a person, their pose or motion, and what cameras see of it. A number and the settings beside it mean the
same instance on every machine and in every version. Numbers 0 to 9,999 are for training and tuning; 10,000 to 19,999
are held out. A number alone is not a picture: the table says what else belongs to it, and what the number decides.

| what is numbered | beside the number | what the number decides | stream |
|---|---|---|---|
| a motion, in sweeps and environments | the motion, its frames | speed, phase, turn of the cameras | motion |
| what an environment shows of it | its arguments | noise, guesses of yaw and place, fitted body | scene |
| a problem of a suite | function, dimension | person, pose, cameras, box, noise | suite |

So a sweep's instance 17 of "walk" is the motion of an environment's instance 17 of "walk", and both differ from
instance 17 of a suite's function. Each row draws from a random stream of its own, `generator`: what one draws changes
nothing in another. Instance 0 of a motion is the motion as it is.
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

Stream = Literal["motion", "scene", "suite"]
# part of the seed of everything that an instance draws; published numbers depend on them
RNG_STREAMS: dict[Stream, int] = {"motion": 2013, "scene": 2012, "suite": 2026}

# how far the cadence of a built-in motion's instance is from its own at most
SPEED = 0.15
VIEW_DEGREES = 10.0  # how far the cameras of an instance are turned at most


def generator(stream: Stream, *numbers: int) -> np.random.Generator:
    """Return the random numbers of an instance: its number, or a suite's function and its number."""
    return np.random.default_rng([RNG_STREAMS[stream], *numbers])


def instance_number(number: object) -> int:
    """Return the number of an instance as an int. Raises InputError where there is no such instance."""
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
    """How an instance differs from the motion as it is."""

    speed: float  # the motion's own times this
    phase: float  # where in its cycle it begins, 0 to 1
    turn_degrees: float  # of all cameras, about the person
    start: float  # where in a file the frames begin, as a share of what is possible

    def views(self, view_degrees: Sequence[float]) -> list[float]:
        """Return the view angles of the instance, in degrees, from those of the motion as it is."""
        return [view + self.turn_degrees for view in view_degrees]


@lru_cache(maxsize=256)
def variation(number: int) -> Variation:
    """Return how an instance differs from the motion as it is, whatever the motion."""
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
    """Return so many frames of an instance of a motion: a built-in motion's name, a file or a motion.

    Raises InputError where a file has fewer frames.
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
