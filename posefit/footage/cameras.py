"""What real cameras saw: masks or videos, with their calibrations, as one scene."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.footage.extract import store
from posefit.footage.given.settled import settled
from posefit.footage.masks import FPS, FolderMasks, Masks, Range, Straight, Views
from posefit.footage.scene import Placing, Scene, observed
from posefit.footage.segmentation import Segmentation
from posefit.footage.segmenting.facing import yaws_of
from posefit.footage.stacks import StackMasks
from posefit.footage.video import Video
from posefit.geometry.body import Body
from posefit.geometry.calibration import Calibration, Up, read_calibrations, upright
from posefit.geometry.camera import Camera
from posefit.listening import Listener
from posefit.silhouette.foreground import Image

SAME_SHAPE = 0.01  # by how much the aspect ratios of masks and calibration may differ


@dataclass(frozen=True, eq=False)
class CameraView:
    """The masks of one camera."""

    masks: Masks
    size: tuple[int, int]  # of the masks
    filmed: tuple[int, int] | None  # of the video, where the masks were taken from one
    fps: float
    pictures: Callable[[], Iterator[Image]] | None = field(default=None, repr=False)
    warnings: Sequence[str] = ()
    facings: Array | Sequence[float] = ()  # of each frame, as `Segmenter.facing`; nan where nobody knows


def masks_of(path: Path, fps: float | None, frames: Range, label: int | None, holes: float | None) -> CameraView:
    """Return what a folder or an .npz of masks shows of one person, at `fps`, or else at the file's own rate, or 30.

    `label` is the value that he has, and `holes` the largest that is filled. Raises ValueError where nobody is seen.
    """
    masks = FolderMasks.of(path, frames, label) if path.is_dir() else StackMasks.of(path, frames, label)
    one = settled(masks, path, holes)
    return CameraView(one, Views([one]).sizes[0], None, fps or masks.fps or FPS, warnings=one.warnings)


def video_of(video: Video, found: Segmentation, folder: Path, listener: Listener) -> CameraView:
    """Return what a video shows; its masks are written to a new folder, so that none has to stay in memory.

    Raises ValueError where they cannot be those of a person.
    """
    folder.mkdir()
    masks = store(folder, found, listener.progress)
    if found.verdict and found.verdict.refused:
        raise ValueError(found.verdict.text)
    pictures = partial(video.frames, found.start, found.stop, found.size)
    return CameraView(masks, found.size, video.size, video.fps, pictures, found.warnings, found.facings)


def combined(
    seen: Sequence[CameraView],
    name: str,
    body: Body,
    cameras: Sequence[Camera | str | Path],
    view_degrees: float | None,
    up: Up | None,
) -> Scene:
    """Return the scene of what cameras saw at the same times.

    A file with several cameras serves for several views, in its order. One view without a camera gets a guess: level,
    40 degrees across. Raises ValueError where cameras and views do not fit each other.
    """
    known = calibrated(cameras, [one.filmed for one in seen]) or [Camera.around(np.zeros(3), 0.0, 0.0, seen[0].size)]
    world = upright([one for one in known if isinstance(one, Calibration)], up)
    masks: list[Masks] = []
    placed: list[Camera] = []
    maps: list[tuple[Any, Any] | None] = []
    for one, calibration in zip(seen, known, strict=True):
        if isinstance(calibration, Camera):
            masks.append(one.masks)
            placed.append(calibration)
            maps.append(None)
            continue
        if one.filmed is None:
            calibration = calibration.padded(one.size) or calibration
            _check_shape(calibration, one.size)
        placed.append(calibration.camera(one.size, world))
        bent = calibration.maps(one.size) if calibration.distorted else None
        maps.append(bent)
        masks.append(one.masks if bent is None else Straight(one.masks, bent))
    pictures = seen[0].pictures
    if pictures is not None and (first := maps[0]) is not None:
        pictures = partial(_straightened, pictures, first)
    placing: Placing = "given" if cameras else "guessed"
    warnings = [warning for one in seen for warning in one.warnings]
    # several cameras tell front from back themselves
    yaws = yaws_of(seen[0].facings if len(seen) == 1 else (), placed[0], seen[0].fps)
    return observed(Views(masks, yaws), body, placed, name, seen[0].fps, view_degrees, pictures, placing, warnings)


def _straightened(pictures: Callable[[], Iterator[Image]], maps: tuple[Any, Any]) -> Iterator[Image]:
    for image in pictures():
        yield np.asarray(cv2.remap(image, *maps, cv2.INTER_LINEAR), dtype=np.uint8)


def calibrated(
    cameras: Sequence[Camera | str | Path], filmed: Sequence[tuple[int, int] | None]
) -> list[Camera | Calibration]:
    """Return the cameras of as many views, none for a single view without one; `filmed` are the sizes of videos.

    Raises ValueError where cameras and views do not fit each other.
    """
    known: list[Camera | Calibration] = []
    for camera in cameras:
        if isinstance(camera, Camera):
            known.append(camera)
        else:
            known += read_calibrations(camera)
    views = len(filmed)
    if not known and views > 1:
        raise ValueError(f"camera must be given for each of several views, {views}, got none")
    if known and len(known) != views:
        raise ValueError(f"camera must be given for each view, {views}, got {len(known)}")
    if views > 1 and any(isinstance(one, Calibration) and one.rotation is None for one in known):
        raise ValueError("camera must say where each of several cameras stands, got a file without rotation")
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


def _other_size(calibration: Calibration, size: tuple[int, int]) -> ValueError:
    width, height = calibration.size
    return ValueError(f"camera {calibration.name!r} must be calibrated for {size[0]}x{size[1]}, got {width}x{height}")
