"""The scene of real cameras: their masks or videos, with their calibrations."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError, NoPersonError
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

AROUND = 0.5  # seconds before and after a frame whose facings are averaged
# the mean of unit vectors is at least so long: facings may not contradict each other
AGREEMENT = 0.6
GUESSED_UNITS: Sequence[Unit] = ("m", "cm", "mm", "inch")
# of a camera from its world's origin: no metres, and no centimetres either
FAR = 100.0
FARTHER = 1000.0
# metres: the origin is on the floor as a rule, or in the first camera
BELOW = 1.0
SAME_SHAPE = 0.01  # by how much the aspect ratios of masks and calibration may differ


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
    """Return the scene of what cameras, those of `calibrated`, saw at the same times; true poses are unknown.

    One view without a camera gets a guess: level, 40 degrees across. The person is first searched where the rays
    through the middles of the masks meet; with a single camera, as far away as their size in the image implies. Raises
    InputError where views and cameras do not fit each other, or several cameras cannot see one person of this size.
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
    scales = {camera.scale for camera in known if isinstance(camera, Calibration)}
    unit_is_open = unit is None and bool(scales - {"metres"})
    if known:
        cameras, views, said = map(
            list,
            zip(*map(partial(_straight, world, metres), known, views), strict=True),
        )
        guesses += [sentence for sentences in said for sentence in sentences]
    else:
        cameras = [Camera.around(np.zeros(3), 0.0, 0.0, views[0].size)]
    # several cameras distinguish front and back themselves
    facings = views[0].facings if len(views) == 1 else None
    yaws = yaws_of(() if facings is None else facings, cameras[0], rate)
    observations = Observations(views, yaws)
    if len(views) > 1 and (apparent := apparent_sizes(observations, cameras)):
        miss, tall = apparent
        if unit_is_open and np.median(tall) > 0.0:
            likely_unit = unit_of_heights(
                float(np.median(tall)) / metres / body.stature
            )
            if METRES[likely_unit] != metres:
                of_cameras["unit"] = f"the calibration is in {UNIT_NAMES[likely_unit]}"
            factor = METRES[likely_unit] / metres
            if "free" in scales and disagreement(
                factor * miss, factor * tall, body.stature
            ):
                factor = body.stature / float(np.median(tall))
                of_cameras["unit"] = (
                    f"the calibration's unit is {factor * metres:.4g} m, by the person's height"
                )
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
        warnings=[warning for view in views for warning in view.warnings]
        + _unequal(views),
        guesses=[*guesses, *of_cameras.values()],
        pictures=views[0].pictures,
        first=int(views[0].numbers[0]),
        camera_moves=views[0].moves,
    )


@dataclass(frozen=True, eq=False)
class Straightening:
    """How what a camera saw becomes what one without distortion sees, whose pixels are square."""

    camera: Camera
    lens: Calibration
    maps: tuple[Any, Any]

    def of(self, view: View) -> View:
        """Return a view of the straight camera."""
        pictures = view.pictures and partial(self._pictures, view.pictures)
        straight = undistorted(view, self.lens, self.maps, self.camera)
        return replace(straight, pictures=pictures)

    def _pictures(self, pictures: Callable[[], Iterator[Image]]) -> Iterator[Image]:
        for image in pictures():
            yield np.asarray(
                cv2.remap(image, *self.maps, cv2.INTER_LINEAR), dtype=np.uint8
            )


def straightening(
    known: Camera | Calibration,
    size: tuple[int, int],
    filmed: tuple[int, int] | None = None,
    world: Array | None = None,
    metres: float = 1.0,
) -> tuple[Camera, Straightening | None, list[str]]:
    """Return the camera of masks, how they are straightened for it, and what is to be said of that.

    This is the one place where a lens' distortion is taken off, and where pixels that are not square become square.

    Args:
        known: The camera, or its calibration.
        size: Width and height of the masks.
        filmed: Width and height of the video that they were taken from.
        world: Rotation (3, 3) that turns the calibration's world so that +y is up.
        metres: Of the calibration's unit.

    Returns:
        The camera without distortion, of square pixels; how masks and pictures become its own, None where they are;
        sentences.

    Raises:
        InputError: The masks are not of this camera.

    """
    said = list[str]()
    lens = Calibration.of(known, "") if isinstance(known, Camera) else known
    if isinstance(known, Camera) and (known.width, known.height) == size:
        camera = known
    else:
        stated = lens.size
        lens = _fitting(lens, filmed or size, scaled=filmed is None)
        # a camera's world is upright, and in metres
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
    """Return what is said of pictures of another size than their calibration's."""
    calibration = Calibration.of(known, "") if isinstance(known, Camera) else known
    width, height = calibration.size or size
    change = (
        f"is scaled to {size[0]}x{size[1]}"
        if calibration.padded(size) is None
        else f"holds for {size[0]}x{size[1]}, with rows or columns more or less at the end"
    )
    name = f" {quoted(calibration.name)}" if calibration.name else ""
    return f"the calibration{name} of {width}x{height} {change}"


def _straight(
    world: Array, metres: float, known: Camera | Calibration, view: View
) -> tuple[Camera, View, list[str]]:
    """Return the camera of a view, the view as that camera has it, and what is to be said of it."""
    camera, how, said = straightening(known, view.size, view.filmed, world, metres)
    return camera, view if how is None else how.of(view), said


def same_person(
    known: Sequence[Camera | Calibration],
    first: View,
    size: tuple[int, int],
    persons: Persons,
    filmed: tuple[int, int] | None = None,
) -> int:
    """Return the number of the person in another view who is followed in the first one.

    It is the one whose rays meet those of the first view in a person who keeps one height, in both views and all
    frames: rays of level cameras meet anyhow. `known` are the cameras of both, and `persons` are the people in the
    other's masks, which have a `size` and were taken from a video of the size `filmed`.
    """
    sizes = (first.size, size)
    blank = np.zeros(size[::-1], dtype=bool)
    fitted = [
        camera
        if isinstance(camera, Camera)
        else _fitting(camera, film or pixels, scaled=film is None)
        for camera, pixels, film in zip(
            known, sizes, (first.filmed, filmed), strict=True
        )
    ]
    cameras = [
        camera if isinstance(camera, Camera) else camera.camera(pixels, np.eye(3))
        for camera, pixels in zip(fitted, sizes, strict=True)
    ]
    differences = list[float]()
    for person in persons:
        # by how much rays miss each other, and the heights in both views
        pairs = list[tuple[float, Array]]()
        for k in np.flatnonzero(first.usable).tolist():
            part = part_at(person, k)
            if part is not None and part.detections[k][1] is None:
                paste(part.detections[k][0], mask := blank.copy())
                views = first.silhouette(k), Silhouette.of(mask)
                pairs.append(apparent_size(cameras, [*map(_extent, fitted, views)]))
        heights = np.array([np.maximum(tall, 1e-9) for _, tall in pairs])
        misses = [miss / float(np.median(heights)) for miss, _ in pairs]
        differences.append(
            float(np.median(misses) + np.std(np.log(heights))) if pairs else np.inf
        )
    return 1 + int(np.argmin(differences))


def _extent(known: Camera | Calibration, silhouette: Silhouette) -> tuple[Array, float]:
    """Return the middle (2,) of a silhouette as a pinhole camera has it, and its height in pixels."""
    (middle, tall), (height, width) = extent_of(silhouette), silhouette.mask.shape
    if not isinstance(known, Camera):
        middle = known.straightened(np.array([*middle, 0.0]), (width, height))[:2]
    return middle, tall


def world_of(
    known: Sequence[Camera | Calibration], up: Up | None, unit: Unit | None
) -> tuple[Array, float, dict[str, str]]:
    """Return how the world of calibrations is turned upright, their unit in metres, and what is guessed of both."""
    calibrations = [camera for camera in known if isinstance(camera, Calibration)]
    guesses = (
        {"up": guess} if up is None and (guess := guessed_up(calibrations)) else {}
    )
    for calibration in calibrations:
        if unit not in (None, "m") and calibration.scale == "metres":
            raise InputError(
                f"unit must be left out for {quoted(calibration.name)}, whose file states it, got {quoted(unit)}"
            )
    distances = [
        float(np.linalg.norm(place))
        for calibration in calibrations
        if (place := calibration.translation) is not None
        and calibration.scale != "metres"
    ]
    if unit is None and distances:
        unit = (
            "m"
            if max(distances) <= FAR
            else "cm"
            if max(distances) <= FARTHER
            else "mm"
        )
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
    heights = [
        float(world[1] @ place)
        for calibration in calibrations
        if (place := calibration.in_metres(METRES[unit or "m"]).position) is not None
    ]
    if min(heights, default=0.0) < -BELOW:
        guesses["below"] = (
            f"a camera stands {-min(heights):.1f} m below its world's origin: is its translation its place?"
        )
    return world, METRES[unit or "m"], guesses


def unit_of_heights(ratio: float) -> Unit:
    """Return the unit of calibrations in which the person is so many times as tall as they are in metres."""
    return min(GUESSED_UNITS, key=lambda unit: abs(np.log(ratio * METRES[unit])))


def yaws_of(facings: Array | Sequence[float], camera: Camera, fps: float) -> Array:
    """Return about which way a person faces in each frame (T,), radians about the vertical; NaN where unknown.

    `facings` (T,) are a segmenter's, as `Segmenter.facing`. Each frame gets the mean direction of the second around it,
    so that a few wrong ones do not count.
    """
    values = np.asarray(facings, dtype=np.float64)
    reach = max(round(AROUND * fps), 1)
    towards = np.arctan2(-camera.rotation[2, 0], -camera.rotation[2, 2])
    known = np.isfinite(values)
    directions = np.where(known, np.exp(1j * (np.nan_to_num(values) + towards)), 0.0)
    around = [slice(max(k - reach, 0), k + reach + 1) for k in range(len(values))]
    total, count = (
        np.array([each[rows].sum() for rows in around]) for each in (directions, known)
    )
    return np.where(
        np.abs(total) >= np.maximum(AGREEMENT * count, 1e-9), np.angle(total), np.nan
    )


def _unequal(views: Sequence[View]) -> list[str]:
    lengths = [len(view) for view in views]
    if len(set(lengths)) == 1:
        return []
    came = ", ".join(
        f"{view.name} {length}" for view, length in zip(views, lengths, strict=True)
    )
    return [
        f"the videos differ in length; the first {min(lengths)} frames are used of {came}"
    ]


def _rate(views: Sequence[View], fps: float | None) -> tuple[float, bool]:
    """Return the frame rate of views: `fps`, or else what their files state, or 30; and whether it is stated.

    Raises InputError where views of masks differ in their rates, or in how many frames they have.
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
    """Return about where (3,) the root of a person of so many metres is, whom one camera or several see."""
    shown = [
        (camera, *extent_of(silhouette))
        for camera, silhouette in zip(cameras, silhouettes, strict=True)
        if silhouette.mask.any()
    ]
    if len(shown) > 1:
        return meeting(
            [camera for camera, _, _ in shown], [middle for _, middle, _ in shown]
        )[0]
    camera, middle, tall = shown[0]
    depth = camera.focal[1] * stature / tall
    place = np.array([*((middle - camera.centre) / camera.focal * depth), depth])
    return np.asarray(camera.rotation.T @ (place - camera.translation))


def listed(
    cameras: Sequence[Camera | Calibration | str | Path],
) -> list[Camera | Calibration]:
    """Return cameras, those of files read; a file with several cameras serves for several views, in its order.

    Raises InputError where a file is one of masks.
    """
    known = list[Camera | Calibration]()
    for camera in cameras:
        if isinstance(camera, Camera | Calibration):
            known.append(camera)
        elif (suffix := Path(camera).suffix.lower()) in (*IMAGES, *ARRAYS) or Path(
            camera
        ).is_dir():
            came = (
                "a file of masks"
                if suffix in ARRAYS
                else "an image"
                if suffix in IMAGES
                else "a folder"
            )
            raise InputError(
                f"{camera}: expected a calibration of the camera, got {came}"
            )
        else:
            known += read_calibrations(camera)
    return known


def calibrated(
    cameras: Sequence[Camera | Calibration | str | Path],
    filmed: Sequence[tuple[int, int] | None],
    names: Sequence[str] = (),
) -> list[Camera | Calibration]:
    """Return the cameras of as many views, none for a single view without one; `filmed` are the sizes of videos.

    Cameras have the order of the views, whose `names` are those of their sources; where both have the same names, they
    are paired by these. Raises InputError where cameras and views do not fit each other.
    """
    known = listed(cameras)
    views = len(filmed)
    if not known and views > 1:
        raise InputError(
            f"camera must be given for each of several views, {views}, got none"
        )
    if known and len(known) != views:
        came = ", ".join(
            camera.name for camera in known if isinstance(camera, Calibration)
        )
        chosen = (
            f": {cut(came)}; FILE:NAME is one of a file"
            if len(known) > views and came
            else ""
        )
        raise InputError(
            f"camera must be given for each view, {views}, got {len(known)}{chosen}"
        )
    if views > 1 and any(
        isinstance(camera, Calibration) and camera.rotation is None for camera in known
    ):
        raise InputError(
            "camera must say where each of several cameras stands, got a file without rotation"
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
    """Return which camera took each source: the one with its name, where all have one, else the one at its place.

    What all names share does not count, nor do zeros before a number: walk-a.mp4 and walk-b.mp4 are of the cameras a
    and b, or cam_a and cam_b. Raises InputError where names can be paired in two ways.
    """
    in_order = list(range(len(cameras)))
    if not all(isinstance(camera, Calibration) for camera in cameras):
        return in_order
    wanted = [camera.name for camera in cameras if isinstance(camera, Calibration)]
    orders = set[tuple[int, ...]]()
    for given in (
        [Path(source).stem for source in sources],
        [Path(source).parent.name for source in sources],
        list(sources),
    ):
        for these, those in (
            (list(map(_words, given)), list(map(_words, wanted))),
            (_own_words(given), _own_words(wanted)),
        ):
            if len(set(these)) == len(these) and set(these) == set(those):
                orders.add(tuple(those.index(words) for words in these))
                break
    if not orders:
        orders = _order_by_part(wanted, sources)
    if len(orders) > 1:
        raise InputError(
            f"cameras must have names that only fit one order of the sources, got {cut(', '.join(wanted))} for "
            f"{cut(', '.join(sources))}; give one file a camera, of other names"
        )
    return list(*orders) if orders else in_order


def _order_by_part(
    cameras: Sequence[str], sources: Sequence[str]
) -> set[tuple[int, ...]]:
    """Return the order in which each source has one camera's name in its own, and each camera one source."""
    words = [f" {' '.join(_words(camera))} " for camera in cameras]
    order = []
    for source in sources:
        given = f" {' '.join(_words(Path(source).stem))} "
        found = [
            k for k, camera in enumerate(words) if camera.strip() and camera in given
        ]
        if len(found) != 1:
            return set()
        order += found
    return {tuple(order)} if len(set(order)) == len(cameras) else set()


def _words(name: str) -> tuple[str, ...]:
    """Return the words and the numbers of a name, without regard to capitals and zeros in front."""
    parts = re.findall(r"[0-9]+|[^\W\d_]+", name.casefold())
    return tuple(part.lstrip("0") or "0" if part.isdigit() else part for part in parts)


def _own_words(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the words of each name without those that all begin or end with."""
    every = [_words(name) for name in names]
    shortest = min(map(len, every))
    before = 0
    while before < shortest and len({words[before] for words in every}) == 1:
        before += 1
    after = 0
    while (
        after < shortest - before and len({words[-1 - after] for words in every}) == 1
    ):
        after += 1
    return [words[before : len(words) - after] for words in every]


def _fitting(
    calibration: Calibration, size: tuple[int, int], *, scaled: bool
) -> Calibration:
    """Return the calibration of pictures of a size, or of this shape where they may have been scaled.

    Raises InputError for others, of which it is not known which part of the sensor they show: cameras often film with a
    part of it where the size is another.
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
