"""Combine the views of real cameras with their calibrations into a `Scene`."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError, NoPersonError
from posefit.footage.facing import yaws_of
from posefit.footage.images import IMAGES
from posefit.footage.people import Persons, part_at, paste
from posefit.footage.quality import (
    apparent_size,
    apparent_sizes,
    disagreement,
    extent_of,
    meeting,
)
from posefit.footage.readers import ARRAYS
from posefit.footage.scene import Scene
from posefit.footage.views import Observations, View, undistorted
from posefit.geometry.body import Body
from posefit.geometry.calibration import (
    Calibration,
    Up,
    guessed_up,
    read_calibrations,
    upright,
)
from posefit.geometry.camera import Camera
from posefit.geometry.units import METRES, UNIT_NAMES, Unit
from posefit.motion.clips import FPS
from posefit.reading import cut, quoted
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Silhouette

GUESSED_UNITS: Sequence[Unit] = ("m", "cm", "mm", "inch")
# distance of a camera from its world's origin, in the calibration's unit. Above FAR the
# unit cannot be metres, and above FARTHER not even centimetres
FAR = 100.0
FARTHER = 1000.0
# metres: a camera lower than this is probably a mistake, because the world's origin is
# usually on the floor or in the first camera
BELOW = 1.0
SAME_SHAPE = 0.01  # share by which aspect ratios of masks and calibration may differ
Pairing = tuple[int, ...]  # for each source, the index of its camera
# a height of 0 or less, of a person behind a camera, would have no logarithm
LEAST_HEIGHT = 1e-9


def combined(
    views: Sequence[View],
    name: str,
    body: Body,
    known: Sequence[Camera | Calibration],
    view_degrees: float | None,
    up: Up | None,
    fps: float | None = None,
    unit: Unit | None = None,
) -> Scene:
    """Return the scene of what cameras saw at the same times.

    The person is first searched where the rays through the middles of the masks meet.
    With a single camera, the distance follows from the person's size in the image.

    Args:
        views: What each camera saw.
        name: Name of the scene.
        body: The person's body.
        known: The cameras of `calibrated`. Empty for one view without a camera, which
            gets a guess: level, 40 degrees across.
        view_degrees: Which way the person faces at first, relative to the first camera.
        up: Which axis of the calibrations points up; None to guess it.
        fps: Frames per second; None for what the views state.
        unit: Unit of the calibrations; None to guess it.

    Raises:
        InputError: Views and cameras do not fit each other.
        NoPersonError: Several cameras cannot all see one person of this size.

    """
    rate, stated = _rate(views, fps)
    guesses = [guess for view in views for guess in view.guesses]
    if not stated and len(views[0]) > 1:
        guesses.append(f"{rate:g} frames a second")
    if not known:
        guesses.append(
            "a level camera, 40 degrees across: distances and sizes are as good as that"
        )
    world, metres, of_cameras = world_of(known, up, unit)
    if known:
        cameras = []
        straight = []
        for camera, view in zip(known, views, strict=True):
            without_distortion = _straight(world, metres, camera, view)
            cameras.append(without_distortion.camera)
            straight.append(without_distortion.view)
            guesses += without_distortion.said
        views = straight
    else:
        cameras = [Camera.around(np.zeros(3), 0.0, 0.0, views[0].size)]
    # several cameras distinguish front and back themselves
    facings = views[0].facings if len(views) == 1 else None
    yaws = yaws_of(() if facings is None else facings, cameras[0], rate)
    observations = Observations(views, yaws)
    apparent = apparent_sizes(observations, cameras) if len(views) > 1 else None
    if apparent is not None:
        miss, tall = apparent
        if unit is None:
            factor, guess = _by_height(miss, tall, known, metres, body.stature)
            if guess:
                of_cameras["unit"] = guess
            cameras = [
                replace(camera, translation=factor * camera.translation)
                for camera in cameras
            ]
            miss = factor * miss
            tall = factor * tall
        if wrong := disagreement(miss, tall, body.stature):
            raise NoPersonError(f"{name}: {wrong}")
    first = observations[observations.first]
    yaw = first.yaw
    if view_degrees is not None:
        to_camera = -cameras[0].rotation[2]
        yaw = float(np.arctan2(to_camera[0], to_camera[2]) - np.radians(view_degrees))
    warnings = [warning for view in views for warning in view.warnings]
    return Scene(
        name=name,
        body=body,
        cameras=cameras,
        fps=rate,
        count=len(observations),
        yaw=yaw,
        anchor=place_of(first.silhouettes, cameras, body.stature),
        truth=None,
        observations=observations,
        placing="given" if known else "guessed",
        warnings=[*warnings, *_unequal(views)],
        guesses=[*guesses, *of_cameras.values()],
        pictures=views[0].pictures,
        first=int(views[0].numbers[0]),
        camera_moves=views[0].moves,
    )


class _Fitted(NamedTuple):
    """The unit of calibrations that fits the person's height."""

    factor: float  # to multiply lengths with
    guess: str  # what to say about it; "" if the unit guessed before fits


def _by_height(
    miss: float,
    tall: Array,
    known: Sequence[Camera | Calibration],
    metres: float,
    stature: float,
) -> _Fitted:
    """Return the unit in which the person's height is about right.

    Args:
        miss: By how much rays miss each other, see `apparent_sizes`.
        tall: The person's height in each view, in the unit guessed before.
        known: The cameras. A calibration may state that it is in metres, or that its
            unit may be any length if no usual one fits.
        metres: The unit guessed before, in metres.
        stature: The person's height in metres.

    """
    scales = {camera.scale for camera in known if isinstance(camera, Calibration)}
    height = float(np.median(tall))
    # a person behind the cameras says nothing about the unit
    unit_is_open = bool(scales - {"metres"})
    if not (unit_is_open and height > 0.0):
        return _Fitted(1.0, "")
    unit = unit_of_heights(height / metres / stature)
    factor = METRES[unit] / metres
    if "free" in scales and disagreement(factor * miss, factor * tall, stature):
        factor = stature / height
        length = f"{factor * metres:.4g} m"
        guess = f"the calibration's unit is {length}, by the person's height"
        return _Fitted(factor, guess)
    if METRES[unit] == metres:
        return _Fitted(factor, "")
    return _Fitted(factor, f"the calibration is in {UNIT_NAMES[unit]}")


@dataclass(frozen=True, eq=False)
class Straightening:
    """Turns a camera's views into those of a camera without distortion.

    That camera has square pixels, which the rasteriser needs.
    """

    camera: Camera  # the camera without distortion
    lens: Calibration  # the real camera
    maps: tuple[Any, Any]  # OpenCV's maps from the one to the other

    def of(self, view: View) -> View:
        """Return what the camera without distortion would have seen."""
        pictures = view.pictures and partial(self._pictures, view.pictures)
        straight = undistorted(view, self.lens, self.maps, self.camera)
        return replace(straight, pictures=pictures)

    def _pictures(self, pictures: Callable[[], Iterator[Image]]) -> Iterator[Image]:
        for image in pictures():
            straight = cv2.remap(image, *self.maps, cv2.INTER_LINEAR)
            yield np.asarray(straight, dtype=np.uint8)


def straightening(
    known: Camera | Calibration,
    size: tuple[int, int],
    filmed: tuple[int, int] | None = None,
    world: Array | None = None,
    metres: float = 1.0,
) -> tuple[Camera, Straightening | None, list[str]]:
    """Return a camera without distortion, and how to turn masks into what it sees.

    This is the only place that removes distortion and makes pixels square.

    Args:
        known: The camera, or its calibration.
        size: Width and height of the masks.
        filmed: Width and height of the video that they were segmented from.
        world: Rotation (3, 3) that turns the calibration's world so that +y is up.
        metres: The calibration's unit in metres.

    Returns:
        The camera without distortion, with square pixels; the straightening, or None if
        the masks fit this camera already; sentences for the user.

    Raises:
        InputError: The masks are not from this camera.

    """
    said = list[str]()
    lens = Calibration.of(known, "") if isinstance(known, Camera) else known
    if isinstance(known, Camera) and (known.width, known.height) == size:
        camera = known
    else:
        stated = lens.size
        lens = _fitting(lens, filmed or size, scaled=filmed is None)
        # the world of a `Camera` is upright already
        if world is None or isinstance(known, Camera):
            world = np.eye(3)
        camera = lens.in_metres(metres).camera(size, world)
        if stated not in (None, filmed or size):
            said.append(_resized(known, filmed or size))
    square = camera.squared()
    if square is not camera:
        ratio = camera.focal[0] / camera.focal[1]
        said.append(
            f"pixels are not square, fx is {ratio:.3g} fy: {size[0]}x{size[1]} becomes "
            f"{square.width}x{square.height}"
        )
    if square is camera and not lens.distorted:
        return camera, None, said
    return square, Straightening(square, lens, lens.maps(size, square)), said


def _resized(known: Camera | Calibration, size: tuple[int, int]) -> str:
    """Return the sentence about pictures that differ in size from their calibration."""
    calibration = Calibration.of(known, "") if isinstance(known, Camera) else known
    width, height = calibration.size or size
    came = f"{size[0]}x{size[1]}"
    change = f"is scaled to {came}"
    if calibration.padded(size) is not None:
        change = f"holds for {came}, with rows or columns more or less at the end"
    name = f" {quoted(calibration.name)}" if calibration.name else ""
    return f"the calibration{name} of {width}x{height} {change}"


class _Straight(NamedTuple):
    """A camera without distortion, and what it saw."""

    camera: Camera
    view: View
    said: list[str]  # sentences for the user


def _straight(
    world: Array, metres: float, known: Camera | Calibration, view: View
) -> _Straight:
    """Return a view without distortion, and its camera, see `straightening`."""
    camera, how, said = straightening(known, view.size, view.filmed, world, metres)
    return _Straight(camera, view if how is None else how.of(view), said)


def same_person(
    known: Sequence[Camera | Calibration],
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
        known: The cameras of both views.
        first: The first view, in which one person is followed.
        size: Width and height of the other view's masks.
        persons: The people in the other view.
        filmed: Width and height of the video that those masks were segmented from.

    """
    fitted = list[Camera | Calibration]()
    cameras = list[Camera]()
    films = zip(known, (first.size, size), (first.filmed, filmed), strict=True)
    for camera, pixels, film in films:
        if isinstance(camera, Calibration):
            camera = _fitting(camera, film or pixels, scaled=film is None)
            cameras.append(camera.camera(pixels, np.eye(3)))
        else:
            cameras.append(camera)
        fitted.append(camera)
    differences = list[float]()
    for person in persons:
        misses = list[float]()  # by how much rays miss each other
        heights = list[Array]()  # (2,) of the person in both views
        for k in np.flatnonzero(first.usable).tolist():
            part = part_at(person, k)
            if part is None:
                continue
            shown, hidden = part.detections[k]
            # a person behind another has no reliable height
            if hidden is not None:
                continue
            mask = np.zeros(size[::-1], dtype=bool)
            paste(shown, mask)
            silhouettes = (first.silhouette(k), Silhouette.of(mask))
            extents = [*map(_extent, fitted, silhouettes)]
            miss, tall = apparent_size(cameras, extents)
            misses.append(miss)
            heights.append(np.maximum(tall, LEAST_HEIGHT))
        if not misses:
            differences.append(np.inf)
            continue
        height = float(np.median(heights))
        relative = [miss / height for miss in misses]
        spread = np.std(np.log(np.array(heights)))
        differences.append(float(np.median(relative) + spread))
    return 1 + int(np.argmin(differences))


def _extent(known: Camera | Calibration, silhouette: Silhouette) -> tuple[Array, float]:
    """Return the middle (2,) of a silhouette without distortion, and its height.

    Both are in pixels.
    """
    middle, tall = extent_of(silhouette)
    height, width = silhouette.mask.shape
    if not isinstance(known, Camera):
        middle = known.straightened(np.array([*middle, 0.0]), (width, height))[:2]
    return middle, tall


def world_of(
    known: Sequence[Camera | Calibration], up: Up | None, unit: Unit | None
) -> tuple[Array, float, dict[str, str]]:
    """Return the axes and the unit of the cameras' world.

    Args:
        known: The cameras. A `Camera` is upright and in metres already.
        up: Which axis of the calibrations points up; None to guess it.
        unit: The calibrations' unit; None to guess it from their distances.

    Returns:
        The rotation (3, 3) that turns calibrations upright, their unit in metres, and
        the guesses by what they are about.

    Raises:
        InputError: A unit is given for a file that states another one.

    """
    calibrations = [camera for camera in known if isinstance(camera, Calibration)]
    guesses = dict[str, str]()
    if up is None and (guess := guessed_up(calibrations)):
        guesses["up"] = guess
    distances = list[float]()
    for calibration in calibrations:
        if calibration.scale == "metres":
            if unit not in (None, "m"):
                raise InputError(
                    f"unit must be left out for {quoted(calibration.name)}, whose unit "
                    f"is known, got {quoted(unit)}"
                )
        elif calibration.translation is not None:
            distances.append(float(np.linalg.norm(calibration.translation)))
    if unit is None and distances:
        unit = _unit_of_distances(distances)
        guesses["unit"] = f"the calibration is in {UNIT_NAMES[unit]}"
    for calibration in calibrations:
        if calibration.rotation is None:
            guesses["place"] = (
                "the camera stands level, which its calibration does not state"
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
    if lowest < -BELOW:
        guesses["below"] = (
            f"a camera stands {-lowest:.1f} m below its world's origin: is its "
            "translation its place?"
        )
    return world, metres, guesses


def _unit_of_distances(distances: Sequence[float]) -> Unit:
    """Return the likely unit of the cameras' distances from their world's origin."""
    farthest = max(distances)
    if farthest <= FAR:
        return "m"
    return "cm" if farthest <= FARTHER else "mm"


def unit_of_heights(ratio: float) -> Unit:
    """Return the likely unit of calibrations.

    Args:
        ratio: The person's height in that unit, over their height in metres.

    """
    return min(GUESSED_UNITS, key=lambda unit: abs(np.log(ratio * METRES[unit])))


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
            came = f"{stated[0][0]:g} of {stated[0][1]} and {rate:g} of {name}"
            raise InputError(
                f"views must have one frame rate, frames a second, got {came}"
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


def listed(
    cameras: Sequence[Camera | Calibration | str | Path],
) -> list[Camera | Calibration]:
    """Return cameras, after reading those that are files.

    A file may hold several cameras, which are for several views in their order. Raises
    InputError if a file is not a calibration.
    """
    known = list[Camera | Calibration]()
    for camera in cameras:
        if isinstance(camera, Camera | Calibration):
            known.append(camera)
            continue
        mistake = _mistaken_for_calibration(Path(camera))
        if mistake:
            raise InputError(
                f"{camera}: expected a calibration of the camera, got {mistake}"
            )
        known += read_calibrations(camera)
    return known


def _mistaken_for_calibration(path: Path) -> str:
    """Return what a path is if it cannot be a calibration, or else ""."""
    suffix = path.suffix.lower()
    if suffix in ARRAYS:
        return "a file of masks"
    if suffix in IMAGES:
        return "an image"
    return "a folder" if path.is_dir() else ""


def calibrated(
    cameras: Sequence[Camera | Calibration | str | Path],
    filmed: Sequence[tuple[int, int] | None],
    names: Sequence[str] = (),
) -> list[Camera | Calibration]:
    """Return the camera of each view, or an empty list for one view without a camera.

    Args:
        cameras: Cameras, calibrations, or their files, in the order of the views.
        filmed: Width and height of each view's video; None for masks.
        names: Names of the views' sources. If the cameras have the same names, they are
            paired by these and not by order.

    Raises:
        InputError: Cameras and views do not fit each other.

    """
    known = listed(cameras)
    views = len(filmed)
    if not known and views > 1:
        raise InputError(
            f"camera must be given for each of several views, {views}, got none"
        )
    if known and len(known) != views:
        calibrations = [each for each in known if isinstance(each, Calibration)]
        came = ", ".join(calibration.name for calibration in calibrations)
        chosen = ""
        if len(known) > views and came:
            chosen = f": {cut(came)}; FILE:NAME is one of a file"
        raise InputError(
            f"camera must be given for each view, {views}, got {len(known)}{chosen}"
        )
    if views > 1 and any(
        isinstance(camera, Calibration) and camera.rotation is None for camera in known
    ):
        raise InputError(
            "camera must say where each of several cameras stands, got a file without "
            "rotation"
        )
    if views > 1 and len(names) == views:
        known = [known[k] for k in order_by_name(known, names)]
    for camera, size in zip(known, filmed, strict=False):
        if isinstance(camera, Calibration) and size is not None:
            _fitting(camera, size, scaled=False)
    return known


def order_by_name(
    cameras: Sequence[Camera | Calibration], sources: Sequence[str]
) -> list[int]:
    """Return which camera took each source, by their names or else in order.

    Words that all names share and leading zeros do not count: walk-a.mp4 and walk-b.mp4
    are from the cameras a and b, or cam_a and cam_b.

    Args:
        cameras: The cameras; only calibrations have names.
        sources: The names of the sources, one per camera.

    Returns:
        For each source, the index of its camera.

    Raises:
        InputError: The names can be paired in several ways.

    """
    in_order = list(range(len(cameras)))
    names = [camera.name for camera in cameras if isinstance(camera, Calibration)]
    if len(names) < len(cameras):
        return in_order
    # files may be named after the cameras, or the folders that they are in
    stems = [Path(source).stem for source in sources]
    folders = [Path(source).parent.name for source in sources]
    orders = set[Pairing]()
    for given in (stems, folders, sources):
        order = _order_by_words(names, given)
        if order is not None:
            orders.add(order)
    if not orders:
        order = _order_by_part(names, stems)
        if order is not None:
            orders.add(order)
    if len(orders) > 1:
        raise InputError(
            "cameras must have names that only fit one order of the sources, got "
            f"{cut(', '.join(names))} for {cut(', '.join(sources))}; "
            "give one file a camera, of other names"
        )
    return list(*orders) if orders else in_order


def _order_by_words(names: Sequence[str], given: Sequence[str]) -> Pairing | None:
    """Return the order in which cameras and sources have the same names; None if none.

    Names are compared by all of their words, or else without the words that all share.
    """
    for words_of in (_all_words, _own_words):
        of_sources = words_of(given)
        of_cameras = words_of(names)
        are_unique = len(set(of_sources)) == len(of_sources)
        if are_unique and set(of_sources) == set(of_cameras):
            return tuple(of_cameras.index(words) for words in of_sources)
    return None


def _order_by_part(names: Sequence[str], given: Sequence[str]) -> Pairing | None:
    """Return the order in which the name of each source contains one camera's name.

    None if a source contains none or several of them, or if two contain the same.
    """
    words = [f" {' '.join(_words(name))} " for name in names]
    order = list[int]()
    for source in given:
        text = f" {' '.join(_words(source))} "
        found = [k for k, name in enumerate(words) if name.strip() and name in text]
        if len(found) != 1:
            return None
        order += found
    return tuple(order) if len(set(order)) == len(names) else None


def _words(name: str) -> tuple[str, ...]:
    """Return the words and numbers of a name, in lower case, without leading zeros."""
    words = list[str]()
    for part in re.findall(r"[0-9]+|[^\W\d_]+", name.casefold()):
        if part.isdigit():
            part = part.lstrip("0") or "0"
        words.append(part)
    return tuple(words)


def _all_words(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the words of each name."""
    return [_words(name) for name in names]


def _own_words(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the words of each name without common ones at the beginning or the end."""
    every = _all_words(names)
    shortest = min(len(words) for words in every)
    before = 0
    while before < shortest and len({words[before] for words in every}) == 1:
        before += 1
    after = 0
    remaining = shortest - before
    while after < remaining and len({words[-1 - after] for words in every}) == 1:
        after += 1
    return [words[before : len(words) - after] for words in every]


def _fitting(
    calibration: Calibration, size: tuple[int, int], *, scaled: bool
) -> Calibration:
    """Return the calibration for pictures of a size.

    `scaled` pictures may have another size of the same shape. Raises InputError for any
    other size, because cameras often film with only a part of the sensor then, and it
    is not known which.
    """
    padded = calibration.padded(size)
    if padded is not None:
        return padded
    name = f" {quoted(calibration.name)}" if calibration.name else ""
    if calibration.size is None:
        middle = "x".join(f"{value:g}" for value in calibration.matrix[:2, 2])
        raise InputError(
            f"camera{name} must be of {size[0]}x{size[1]}, got a centre of {middle}"
        )
    width, height = calibration.size
    if scaled and abs(size[0] * height / (size[1] * width) - 1.0) <= SAME_SHAPE:
        return calibration
    raise InputError(
        f"camera{name} must be calibrated for {size[0]}x{size[1]}, got {width}x{height}"
    )
