"""Instances of a motion, numbered as in other benchmarks: sweeps and environments mean the same by a number.

Instance 0 is the motion as it is. Any other number changes the phase and the speed of a built-in motion a little, or
where in a file the frames begin, and turns the cameras by a few degrees. Other random choices for an instance,
such as noise, come from a generator of their own, so that they change none of this.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from posefit.errors import InputError
from posefit.motion import built_in
from posefit.motion.clips import load_motion
from posefit.motion.motion import Motion

RNG_STREAM_INSTANCE = 2013
# how far the cadence of a built-in motion's instance is from its own at most
SPEED = 0.15
VIEW_DEGREES = 10.0  # how far the cameras of an instance are turned at most


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
    rng = np.random.default_rng([RNG_STREAM_INSTANCE, number])
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
