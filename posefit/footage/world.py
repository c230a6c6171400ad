"""The axes and the unit of the cameras' world."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.agreement import disagreement
from posefit.geometry.calibration import Calibration, Up, guessed_up, upright
from posefit.geometry.camera import Camera
from posefit.geometry.units import METRES, UNIT_NAMES, Unit
from posefit.reading import quoted

GUESSED_UNITS: Sequence[Unit] = ("m", "cm", "mm", "inch")
# greatest distance of a camera from its world's origin in metres, and in centimetres. A
# larger number must be of a smaller unit
METRES_REACH = 100.0
CENTIMETRES_REACH = 1000.0
# metres: a camera lower than this is probably a mistake, because the world's origin is
# usually on the floor or in the first camera
MAX_BELOW = 1.0
# a height of 0 or less, of a person behind a camera, would have no logarithm
LEAST_HEIGHT = 1e-9


def world_of(
    given: Sequence[Camera | Calibration], up: Up | None, unit: Unit | None
) -> tuple[Array, float, dict[str, str]]:
    """Return the axes and the unit of the cameras' world.

    Args:
        given: The cameras. A `Camera` is upright and in metres already.
        up: Which axis of the calibrations points up; None to guess it.
        unit: The calibrations' unit; None to guess it from their distances.

    Returns:
        The rotation (3, 3) that turns calibrations upright, their unit in metres, and
        the guesses by what they are about.

    Raises:
        InputError: A unit is given for a file that states another one.
    """
    calibrations = [camera for camera in given if isinstance(camera, Calibration)]
    guesses = dict[str, str]()
    if up is None and (guess := guessed_up(calibrations)):
        guesses["up"] = guess
    distances = list[float]()
    for calibration in calibrations:
        if calibration.scale == "metres":
            if unit not in (None, "m"):
                raise InputError(
                    f"unit must be left out for {quoted(calibration.name)}, which is "
                    f"in metres, got {quoted(unit)}"
                )
        elif calibration.translation is not None:
            distances.append(float(np.linalg.norm(calibration.translation)))
    if unit is None and distances:
        unit = _unit_of_distances(distances)
        guesses["unit"] = f"the calibration is in {UNIT_NAMES[unit]}"
    for calibration in calibrations:
        if calibration.rotation is None:
            guesses["place"] = (
                "the camera is level, which its calibration does not state"
            )
        if calibration.size is None:
            guesses["size"] = (
                "the calibration is for pictures of this size, which it does not state"
            )
    world = upright(calibrations, up)
    metres = METRES[unit or "m"]
    lowest = 0.0
    for calibration in calibrations:
        place = calibration.in_metres(metres).position
        if place is not None:
            lowest = min(lowest, float(world[1] @ place))
    if lowest < -MAX_BELOW:
        guesses["below"] = (
            f"a camera is {-lowest:.1f} m below the origin of the world: is its "
            "translation the camera's position?"
        )
    return world, metres, guesses


def _unit_of_distances(distances: Sequence[float]) -> Unit:
    """Return the likely unit of the cameras' distances from their world's origin."""
    farthest = max(distances)
    if farthest <= METRES_REACH:
        return "m"
    return "cm" if farthest <= CENTIMETRES_REACH else "mm"


def unit_of_heights(ratio: float) -> Unit:
    """Return the likely unit of calibrations.

    Args:
        ratio: The person's height in that unit, over their height in metres.
    """
    return min(GUESSED_UNITS, key=lambda unit: abs(np.log(ratio * METRES[unit])))


def has_guessed_unit(camera: Camera | Calibration) -> bool:
    """Return whether the unit of a camera's lengths is a guess."""
    return isinstance(camera, Calibration) and camera.scale != "metres"


class _FittingUnit(NamedTuple):
    """The unit of calibrations that fits the person's height."""

    factor: float  # on the lengths of the calibrations
    guess: str  # what to say about it; "" if the unit guessed before fits


# takes a factor for the lengths of calibrations whose unit is a guess; returns by how
# much rays then miss each other, and the person's height in each view, as
# `apparent_size`
Measured = Callable[[float], tuple[float, Array]]


def unit_by_height(
    measured: Measured,
    given: Sequence[Camera | Calibration],
    metres: float,
    stature: float,
) -> _FittingUnit:
    """Return the unit in which the person's height is about right.

    Args:
        measured: Measures the person, given the factor on the lengths of calibrations
            whose unit is a guess.
        given: The cameras. A calibration may state that it is in metres, or that its
            unit may be any length if no usual one fits.
        metres: The unit guessed before, in metres.
        stature: The person's height in metres.
    """
    if not any(has_guessed_unit(camera) for camera in given):
        return _FittingUnit(1.0, "")
    _, tall = measured(1.0)
    height = float(np.median(tall))
    all_guessed = all(has_guessed_unit(camera) for camera in given)
    if not all_guessed:
        unit = _unit_beside_known(measured, metres, stature)
    elif height > 0.0:
        unit = unit_of_heights(height / metres / stature)
    else:
        # a person behind the cameras says nothing about the unit
        return _FittingUnit(1.0, "")
    factor = METRES[unit] / metres
    is_free = any(getattr(camera, "scale", None) == "free" for camera in given)
    if is_free and all_guessed and disagreement(*measured(factor), stature):
        factor = stature / height
        length = f"{factor * metres:.4g} m"
        guess = f"the calibration's unit is {length}, by the person's height"
        return _FittingUnit(factor, guess)
    if METRES[unit] == metres:
        return _FittingUnit(factor, "")
    return _FittingUnit(factor, f"the calibration is in {UNIT_NAMES[unit]}")


def _unit_beside_known(measured: Measured, metres: float, stature: float) -> Unit:
    """Return the unit of some calibrations, given others whose unit is known.

    A wrong unit moves some cameras and not the others, so that the views disagree about
    the person's height.
    """

    def misfit(unit: Unit) -> float:
        _, tall = measured(METRES[unit] / metres)
        heights = np.maximum(tall, LEAST_HEIGHT)
        return float(np.abs(np.log(heights / stature)).max())

    return min(GUESSED_UNITS, key=misfit)
