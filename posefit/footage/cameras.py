"""Combine the views of real cameras with their calibrations into a `Scene`."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError, NoPersonError
from posefit.fitting.tracker import Observation
from posefit.footage.agreement import (
    apparent_size,
    apparent_sizes,
    disagreement,
    extent_of,
    meeting,
    shared_extents,
)
from posefit.footage.facing import yaws_of
from posefit.footage.observations import Observations
from posefit.footage.options import SourceOptions
from posefit.footage.people import Persons, Tracklet, part_at, paste
from posefit.footage.scene import Scene
from posefit.footage.straightening import calibration_for, straightening
from posefit.footage.views import View
from posefit.footage.world import (
    LEAST_HEIGHT,
    has_guessed_unit,
    unit_by_height,
    world_of,
)
from posefit.geometry.body import Body
from posefit.geometry.calibration import Calibration
from posefit.geometry.camera import Camera
from posefit.motion.clips import FPS
from posefit.silhouette.mask import Mask, Silhouette


def combined(
    views: Sequence[View],
    body: Body,
    given: Sequence[Camera | Calibration],
    options: SourceOptions,
) -> Scene:
    """Return the scene of what cameras saw at the same times.

    The search for the person begins where the rays through the middles of the masks
    meet. With a single camera, the distance follows from the person's size in the
    image.

    Args:
        views: What each camera saw.
        body: The person's body.
        given: The cameras of `calibrated`. Empty for one view without a camera, which
            gets a guess: level, 40 degrees across.
        options: `up` and `unit` of the calibrations, `fps`, and `view_degrees`: which
            way the person faces at first, relative to the first camera.

    Raises:
        InputError: Views and cameras do not fit each other.
        NoPersonError: Several cameras cannot all see one person of this size.
    """
    name = Path(views[0].name).stem
    rate, stated = _rate(views, options.fps)
    guesses = [guess for view in views for guess in view.guesses]
    if not stated and len(views[0]) > 1:
        guesses.append(f"{rate:g} frames a second")
    if not given:
        guesses.append(
            "a level camera, 40 degrees across: distances and sizes are only as good "
            "as this guess"
        )
    world, metres, of_cameras = world_of(given, options.up, options.unit)
    cameras, views, notes = _straightened(views, given, world, metres)
    # several cameras distinguish front and back themselves
    facings = views[0].facings if len(views) == 1 else None
    yaws = yaws_of(() if facings is None else facings, cameras[0], rate)
    observations = Observations(views, yaws)
    if len(views) > 1:
        unit = metres, options.unit is None
        try:
            cameras, guess = _with_checked_unit(
                observations, cameras, given, unit, body.stature
            )
        except NoPersonError as error:
            raise NoPersonError(f"{name}: {error}") from None
        if guess:
            of_cameras["unit"] = guess
    first = observations[observations.first]
    warnings = [warning for view in views for warning in view.warnings]
    return Scene(
        name=name,
        body=body,
        cameras=cameras,
        fps=rate,
        count=len(observations),
        yaw=_first_yaw(options.degrees, cameras[0], first),
        anchor=place_of(first.silhouettes, cameras, body.stature),
        truth=None,
        observations=observations,
        placing="given" if given else "guessed",
        warnings=[*warnings, *_unequal(views)],
        guesses=[*guesses, *notes, *of_cameras.values()],
        pictures=views[0].pictures,
        first=int(views[0].numbers[0]),
        camera_moves=views[0].moves,
    )


def _straightened(
    views: Sequence[View],
    given: Sequence[Camera | Calibration],
    world: Array,
    metres: float,
) -> tuple[list[Camera], list[View], list[str]]:
    """Return cameras without distortion, what they saw, and sentences for the user.

    A camera that is not given is level, 40 degrees across. `world` and `metres` are the
    axes and the unit of the calibrations, see `world_of`.
    """
    if not given:
        guessed = Camera.around(np.zeros(3), 0.0, 0.0, views[0].size)
        return [guessed], [*views], []
    cameras = list[Camera]()
    straight = list[View]()
    notes = list[str]()
    for each, view in zip(given, views, strict=True):
        camera, correction, camera_notes = straightening(
            each, view.size, view.filmed, world, metres
        )
        cameras.append(camera)
        straight.append(view if correction is None else correction.of(view))
        notes += camera_notes
    return cameras, straight, notes


def _with_checked_unit(
    observations: Observations,
    cameras: Sequence[Camera],
    given: Sequence[Camera | Calibration],
    unit: tuple[float, bool],
    stature: float,
) -> tuple[list[Camera], str]:
    """Return cameras in a unit in which the person has about their height.

    Args:
        observations: What the cameras saw.
        cameras: The cameras without distortion.
        given: The same cameras as the user gave them.
        unit: The unit of the calibrations in metres, and whether it is a guess.
        stature: The person's height in metres.

    Returns:
        The cameras, in another unit if the guessed one was wrong, and a sentence about
        that, "" if the unit is not changed.

    Raises:
        NoPersonError: The cameras cannot all see one person of this size.
    """
    frames = shared_extents(observations)
    if not frames:
        return [*cameras], ""

    def scaled(factor: float) -> list[Camera]:
        """Return the cameras with lengths in a guessed unit times a factor."""
        result = list[Camera]()
        for camera, as_given in zip(cameras, given, strict=True):
            if has_guessed_unit(as_given):
                camera = replace(camera, translation=factor * camera.translation)
            result.append(camera)
        return result

    def measured(factor: float) -> tuple[float, Array]:
        return apparent_sizes(scaled(factor), frames)

    metres, is_guess = unit
    factor = 1.0
    guess = ""
    if is_guess:
        factor, guess = unit_by_height(measured, given, metres, stature)
    if wrong := disagreement(*measured(factor), stature):
        raise NoPersonError(wrong)
    return scaled(factor), guess


def _first_yaw(
    view_degrees: Sequence[float], camera: Camera, first: Observation
) -> float | None:
    """Return which way the person faces at first, in radians about the vertical.

    This is what the user gave relative to the camera, or else what the segmenter
    reported, which may be None.
    """
    if not view_degrees:
        return first.yaw
    to_camera = -camera.rotation[2]
    towards = np.arctan2(to_camera[0], to_camera[2])
    return float(towards - np.radians(view_degrees[0]))


def same_person(
    given: Sequence[Camera | Calibration],
    first: View,
    size: tuple[int, int],
    persons: Persons,
    filmed: tuple[int, int] | None = None,
) -> int:
    """Return the number of the person in another view whom the first view follows.

    For this person, the rays of both cameras meet, and the height is the same in both
    views and all frames. The height counts because the rays of level cameras always
    meet.

    Args:
        given: The cameras of both views.
        first: The first view, in which one person is followed.
        size: Width and height of the other view's masks.
        persons: The people in the other view.
        filmed: Width and height of the video that those masks were segmented from.
    """
    fitted = list[Camera | Calibration]()
    cameras = list[Camera]()
    films = zip(given, (first.size, size), (first.filmed, filmed), strict=True)
    for camera, pixels, film in films:
        if isinstance(camera, Calibration):
            camera = calibration_for(camera, film or pixels, scaled=film is None)
            cameras.append(camera.camera(pixels, np.eye(3)))
        else:
            cameras.append(camera)
        fitted.append(camera)
    differences = list[float]()
    for person in persons:
        misses = list[float]()
        heights = list[Array]()
        for k in np.flatnonzero(first.usable).tolist():
            mask = _mask_alone(person, k, size)
            if mask is None:
                continue
            silhouettes = (first.silhouette(k), Silhouette.of(mask))
            extents = [*map(_extent, fitted, silhouettes)]
            miss, tall = apparent_size(cameras, extents)
            misses.append(miss)
            heights.append(np.maximum(tall, LEAST_HEIGHT))
        differences.append(_difference(misses, heights))
    return 1 + int(np.argmin(differences))


def _mask_alone(
    person: Sequence[Tracklet], frame: int, size: tuple[int, int]
) -> Mask | None:
    """Return the mask of a person in a frame; None if it does not show them alone.

    A person behind another has no reliable height.
    """
    part = part_at(person, frame)
    if part is None:
        return None
    shown, hidden = part.detections[frame]
    if hidden is not None:
        return None
    mask = np.zeros(size[::-1], dtype=bool)
    paste(shown, mask)
    return mask


def _difference(misses: Sequence[float], heights: Sequence[Array]) -> float:
    """Return how unlikely it is that two views show one person.

    Args:
        misses: By how much the rays of both cameras miss each other in each frame.
        heights: (2,) the person's height in both views of each frame, in the same unit.

    Returns:
        The typical miss in heights, and the spread of the heights' logarithms, added;
        infinite without any frame.
    """
    if not misses:
        return np.inf
    height = float(np.median(heights))
    relative = [miss / height for miss in misses]
    spread = np.std(np.log(np.array(heights)))
    return float(np.median(relative) + spread)


def _extent(given: Camera | Calibration, silhouette: Silhouette) -> tuple[Array, float]:
    """Return the middle (2,) of a silhouette without distortion, and its height.

    Both are in pixels.
    """
    middle, tall = extent_of(silhouette)
    height, width = silhouette.mask.shape
    if not isinstance(given, Camera):
        middle = given.straightened(np.array([*middle, 0.0]), (width, height))[:2]
    return middle, tall


def _unequal(views: Sequence[View]) -> list[str]:
    """Return a warning if views differ in length."""
    lengths = [len(view) for view in views]
    if len(set(lengths)) == 1:
        return []
    came = ", ".join(
        f"{view.name} {length}" for view, length in zip(views, lengths, strict=True)
    )
    return [
        f"the videos differ in length; the first {min(lengths)} frames are used of "
        f"{came}"
    ]


def _rate(views: Sequence[View], fps: float | None) -> tuple[float, bool]:
    """Return the frame rate of views, and whether it is known or a guess.

    It is `fps` if given, or else what the files state, or else 30. Raises InputError if
    views of masks differ in their rates or in their number of frames.
    """
    first = views[0]
    for view in views[1:]:
        if view.filmed is None and len(view) != len(first):
            came = f"{len(first)} of {first.name} and {len(view)} of {view.name}"
            raise InputError(f"views must have the same frames, got {came}")
    if fps is not None:
        return fps, True
    stated = [(view.fps, view.name) for view in views if view.fps is not None]
    for rate, name in stated[1:]:
        if views[0].filmed is None and rate != stated[0][0]:
            came = f"{stated[0][0]:g} Hz of {stated[0][1]} and {rate:g} Hz of {name}"
            raise InputError(
                f"views must have the same frame rate, got {came}: "
                "convert one of them, or give the rate of all as fps"
            )
    return (stated[0][0], True) if stated else (FPS, False)


def place_of(
    silhouettes: Sequence[Silhouette], cameras: Sequence[Camera], stature: float
) -> Array:
    """Return about where (3,) the root of a person is, in metres.

    Args:
        silhouettes: One per camera; at least one shows the person.
        cameras: One camera, or several.
        stature: The person's height in metres.
    """
    seeing = list[Camera]()
    middles = list[Array]()
    heights = list[float]()
    for camera, silhouette in zip(cameras, silhouettes, strict=True):
        if silhouette.mask.any():
            middle, tall = extent_of(silhouette)
            seeing.append(camera)
            middles.append(middle)
            heights.append(tall)
    if len(seeing) > 1:
        place, _ = meeting(seeing, middles)
        return place
    camera = seeing[0]
    depth = camera.focal[1] * stature / heights[0]
    across = (middles[0] - camera.centre) / camera.focal * depth
    in_camera = np.array([*across, depth])
    return np.asarray(camera.rotation.T @ (in_camera - camera.translation))
