"""Remove lens distortion from views, and make their pixels square."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.views import View, empty_planes
from posefit.geometry.calibration import Calibration
from posefit.geometry.camera import Camera
from posefit.reading import quoted
from posefit.silhouette.foreground import Image

SAME_SHAPE = 0.01  # share by which aspect ratios of masks and calibration may differ


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


def undistorted(
    view: View,
    calibration: Calibration,
    maps: tuple[Any, Any],
    straight: Camera | None = None,
) -> View:
    """Return a view without lens distortion, as a pinhole camera sees it.

    Its landmarks are straightened, too. Pixels that the lens did not cover are unknown.

    Args:
        view: What the calibrated camera saw.
        calibration: The calibration of that camera.
        maps: The calibration's pixel maps from the view's size to `straight`.
        straight: The pinhole camera. By default the calibration's, at the view's size.

    Returns:
        A view with the size of `maps`.
    """
    size = (maps[0].shape[1], maps[0].shape[0])
    bits = empty_planes(len(view), size)
    known = empty_planes(len(view), size)
    for k in range(len(view)):
        silhouette = view.silhouette(k)
        levels = 255 * silhouette.mask.astype(np.uint8)
        valid = silhouette.valid.astype(np.uint8)
        share = cv2.remap(levels, *maps, cv2.INTER_LINEAR)
        covered = cv2.remap(valid, *maps, cv2.INTER_NEAREST)
        # after interpolation, the outline is where the person has half of a pixel
        bits[k] = np.packbits(share > 127)
        known[k] = np.packbits(covered != 0)
    landmarks = view.landmarks
    if landmarks is not None:
        landmarks = calibration.straightened(landmarks, view.size, straight)
    return replace(view, size=size, bits=bits, known=known, landmarks=landmarks)


def straightening(
    given: Camera | Calibration,
    size: tuple[int, int],
    filmed: tuple[int, int] | None = None,
    world: Array | None = None,
    metres: float = 1.0,
) -> tuple[Camera, Straightening | None, list[str]]:
    """Return a camera without distortion, and how to turn masks into what it sees.

    This is the only place that removes distortion and makes pixels square.

    Args:
        given: The camera, or its calibration.
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
    notes = list[str]()
    calibration = Calibration.of(given, "") if isinstance(given, Camera) else given
    lens = calibration
    if isinstance(given, Camera) and (given.width, given.height) == size:
        camera = given
    else:
        lens = calibration_for(calibration, filmed or size, scaled=filmed is None)
        # the world of a `Camera` is upright already
        if world is None or isinstance(given, Camera):
            world = np.eye(3)
        camera = lens.in_metres(metres).camera(size, world)
        if calibration.size not in (None, filmed or size):
            notes.append(_resized(calibration, filmed or size))
    square = camera.squared()
    if square is not camera:
        ratio = camera.focal[0] / camera.focal[1]
        notes.append(
            f"pixels are not square, fx is {ratio:.3g} fy: {size[0]}x{size[1]} becomes "
            f"{square.width}x{square.height}"
        )
    if square is camera and not lens.distorted:
        return camera, None, notes
    return square, Straightening(square, lens, lens.maps(size, square)), notes


def _resized(calibration: Calibration, size: tuple[int, int]) -> str:
    """Return the sentence about pictures that differ in size from their calibration."""
    width, height = calibration.size or size
    came = f"{size[0]}x{size[1]}"
    change = f"is scaled to {came}"
    if calibration.padded(size) is not None:
        change = f"is used for {came}, with more or fewer rows or columns at the end"
    name = f" {quoted(calibration.name)}" if calibration.name else ""
    return f"the calibration{name} of {width}x{height} {change}"


def calibration_for(
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
            f"camera{name} must be calibrated for {size[0]}x{size[1]}, the size of the "
            f"pictures, got a centre of {middle}: calibrate again at this size"
        )
    width, height = calibration.size
    if scaled and abs(size[0] * height / (size[1] * width) - 1.0) <= SAME_SHAPE:
        return calibration
    raise InputError(
        f"camera{name} must be calibrated for {size[0]}x{size[1]}, the size of the "
        f"pictures, got {width}x{height}: calibrate again at this size"
    )
