"""The scene of real cameras: their masks or videos, with their calibrations."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.cleaning import cleaned
from posefit.footage.extract import segmented
from posefit.footage.facing import yaws_of
from posefit.footage.masks import FPS, PackedMasks, Range, Views, undistorted
from posefit.footage.readers import read_masks
from posefit.footage.scene import Placing, Scene, observed
from posefit.footage.segmentation import Segmentation
from posefit.footage.video import Video
from posefit.geometry.body import Body
from posefit.geometry.calibration import Calibration, Up, read_calibrations, upright
from posefit.geometry.camera import Camera
from posefit.progress import Progress
from posefit.silhouette.foreground import Image

SAME_SHAPE = 0.01  # by how much the aspect ratios of masks and calibration may differ


@dataclass(frozen=True, eq=False)
class CameraView:
    """The masks of one camera."""

    masks: PackedMasks
    name: str  # of the source
    filmed: tuple[int, int] | None = None  # size of the video, where the masks were taken from one
    pictures: Callable[[], Iterator[Image]] | None = field(default=None, repr=False)
    warnings: Sequence[str] = ()
    facings: Array | Sequence[float] = ()  # of each frame, as `Segmenter.facing`; NaN where unknown


def masks_of(path: Path, frames: Range, label: int | None, holes: float | None) -> CameraView:
    """Return what a folder or an .npz of masks shows of one person.

    `label` is the person's value, and `holes` the largest that is filled. Raises InputError where no frame shows one.
    """
    masks, warnings = cleaned(read_masks(path, frames, label), path, holes)
    return CameraView(masks, str(path), warnings=warnings)


def video_of(video: Video, segmentation: Segmentation, progress: Progress) -> CameraView:
    """Return what a video shows. Raises InputError where its masks cannot be those of a person."""
    masks = segmented(segmentation, progress.steps)
    if segmentation.verdict and segmentation.verdict.refused:
        raise InputError(segmentation.verdict.text)
    pictures = partial(video.frames, segmentation.start, segmentation.stop, segmentation.size)
    return CameraView(masks, str(video.path), video.size, pictures, segmentation.warnings, segmentation.facings)


def _rate(views: Sequence[CameraView], fps: float | None) -> float:
    """Return the frame rate of views: `fps`, or else what their files state, or 30.

    Raises InputError where views of masks differ in their rates, or in how many frames they have.
    """
    first = views[0]
    for view in views[1:]:
        if view.filmed is None and len(view.masks) != len(first.masks):
            came = f"{len(first.masks)} of {first.name} and {len(view.masks)} of {view.name}"
            raise InputError(f"views must have the same frames, got {came}")
    if fps is not None:
        return fps
    stated = [view for view in views if view.masks.fps is not None]
    for view in stated[1:]:
        if view.filmed is None and view.masks.fps != stated[0].masks.fps:
            came = " and ".join(f"{one.masks.fps:g} of {one.name}" for one in (stated[0], view))
            raise InputError(f"views must have one frame rate, frames a second, got {came}")
    return (stated[0].masks.fps if stated else None) or FPS


def combined(
    views: Sequence[CameraView],
    name: str,
    body: Body,
    cameras: Sequence[Camera | str | Path],
    view_degrees: float | None,
    up: Up | None,
    fps: float | None = None,
) -> Scene:
    """Return the scene of what cameras saw at the same times.

    A file with several cameras serves for several views, in its order. One view without a camera gets a guess: level,
    40 degrees across. Raises InputError where cameras and views do not fit each other.
    """
    rate, size = _rate(views, fps), views[0].masks.size
    known = calibrated(cameras, [view.filmed for view in views]) or [Camera.around(np.zeros(3), 0.0, 0.0, size)]
    world = upright([camera for camera in known if isinstance(camera, Calibration)], up)
    masks: list[PackedMasks] = []
    placed: list[Camera] = []
    pictures = views[0].pictures
    for k, (view, calibration) in enumerate(zip(views, known, strict=True)):
        if isinstance(calibration, Camera):
            masks.append(view.masks)
            placed.append(calibration)
            continue
        size = view.masks.size
        if view.filmed is None:
            calibration = calibration.padded(size) or calibration
            _check_shape(calibration, size)
        placed.append(calibration.camera(size, world))
        maps = calibration.maps(size) if calibration.distorted else None
        masks.append(view.masks if maps is None else undistorted(view.masks, maps))
        if k == 0 and pictures is not None and maps is not None:
            pictures = partial(_straightened, pictures, maps)
    placing: Placing = "given" if cameras else "guessed"
    warnings = [warning for view in views for warning in view.warnings]
    # several cameras distinguish front and back themselves
    yaws = yaws_of(views[0].facings if len(views) == 1 else (), placed[0], rate)
    return observed(Views(masks, yaws), body, placed, name, rate, view_degrees, pictures, placing, warnings)


def _straightened(pictures: Callable[[], Iterator[Image]], maps: tuple[Any, Any]) -> Iterator[Image]:
    for image in pictures():
        yield np.asarray(cv2.remap(image, *maps, cv2.INTER_LINEAR), dtype=np.uint8)


def calibrated(
    cameras: Sequence[Camera | str | Path], filmed: Sequence[tuple[int, int] | None]
) -> list[Camera | Calibration]:
    """Return the cameras of as many views, none for a single view without one; `filmed` are the sizes of videos.

    Raises InputError where cameras and views do not fit each other.
    """
    known: list[Camera | Calibration] = []
    for camera in cameras:
        if isinstance(camera, Camera):
            known.append(camera)
        else:
            known += read_calibrations(camera)
    views = len(filmed)
    if not known and views > 1:
        raise InputError(f"camera must be given for each of several views, {views}, got none")
    if known and len(known) != views:
        raise InputError(f"camera must be given for each view, {views}, got {len(known)}")
    if views > 1 and any(isinstance(one, Calibration) and one.rotation is None for one in known):
        raise InputError("camera must say where each of several cameras stands, got a file without rotation")
    for k, (one, size) in enumerate(zip(known, filmed, strict=False)):
        if isinstance(one, Calibration) and size is not None:
            fitting = one.padded(size)
            if fitting is None:
                raise _other_size(one, size)
            known[k] = fitting
    return known


def _check_shape(calibration: Calibration, size: tuple[int, int]) -> None:
    """Check that masks, which may be scaled, have the shape that a calibration is for."""
    width, height = calibration.size
    if abs(size[0] * height / (size[1] * width) - 1.0) > SAME_SHAPE:
        raise _other_size(calibration, size)


def _other_size(calibration: Calibration, size: tuple[int, int]) -> InputError:
    width, height = calibration.size
    return InputError(f"camera {calibration.name!r} must be calibrated for {size[0]}x{size[1]}, got {width}x{height}")
