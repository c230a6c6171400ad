"""Find the people in a video, frame by frame."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.validation import BrokenRuleError, plugin_errors
from posefit.footage.extraction import Box, Extraction
from posefit.footage.images import read_image
from posefit.footage.quality import FrameQuality
from posefit.footage.video import Video, scaled
from posefit.geometry.skeleton import JOINTS
from posefit.reading import existing, quoted
from posefit.registry import registry
from posefit.silhouette.foreground import BRIGHT, Image, Person, Segmenter, people
from posefit.silhouette.mask import Mask

T = TypeVar("T", bound=np.generic)


@dataclass(frozen=True)
class PartOfVideo:
    """A video as a segmenter gets it: cut to `part`."""

    video: Video
    part: Box

    def __len__(self) -> int:
        return self.video.count()

    def frames(
        self, start: int = 0, stop: int | None = None, step: int = 1
    ) -> Iterator[Image]:
        """Yield every `step`th frame from start to stop."""
        return map(self.crop, self.video.frames(start, stop, step))

    def picture(self, path: str) -> Image:
        """Return a picture of the video's size, scaled and cut as the video.

        Raises InputError if the file is missing, is not a picture, or has another size.
        """
        if Path(path).suffix:
            existing(Path(path))
        image = read_image(path, grey=False)
        if image is None:
            raise InputError(
                f"background must be frames A:B or an image, got {quoted(path)}"
            )
        tall, wide = image.shape[:2]
        width, height = self.video.filmed
        if (wide, tall) != (width, height):
            raise InputError(
                f"{path}: background must have the video's size {width}x{height}, "
                f"got {wide}x{tall}"
            )
        return self.crop(scaled(image, self.video.size))

    def crop(self, image: NDArray[T]) -> NDArray[T]:
        """Return the segmenter's part of an image (height, width, ...)."""
        x, y, wide, tall = self.part
        return np.ascontiguousarray(image[y : y + tall, x : x + wide])


class SegmentedFrame(NamedTuple):
    """What a segmenter finds in a frame, in pixels of the working size."""

    people: list[Person]  # the largest first
    facing: float  # as `Segmenter.facing`; NaN if unknown
    # (27, 3) as `Segmenter.landmarks`; 0 if the segmenter reports none
    landmarks: Array


class PersonSegmenter:
    """Segments the person in a video, frame after frame.

    It learns the background from the whole video before the first frame.
    """

    def __init__(self, video: Video, how: Extraction) -> None:
        """Prepare a video. Raises InputError if the extraction does not fit it."""
        self.learned = "background" not in how.settings
        self._roi = _scaled_roi(how.roi, video)
        self._ignored = _ignored(how.ignore, video.size)
        self._film = PartOfVideo(video, self._roi or (0, 0, *video.size))
        self._how = how
        # the user's background is read now, so that a mistake in it shows at once
        if not self.learned:
            _ = self._segmenter

    @cached_property
    def _segmenter(self) -> Segmenter:
        """The segmenter, trained on the video."""
        return self._how.segmenter(self._film)

    def frame(self, image: Image) -> SegmentedFrame:
        """Return who is in the next frame, which has the working size."""
        result = people(*self._segmented(image), self._roi, self._ignored)
        facing = float(getattr(self._segmenter, "facing", math.nan))
        return SegmentedFrame(result, facing, self._landmarks())

    def without(self, image: Image, mask: Mask) -> Image:
        """Return a frame of the working size with background pasted over a mask."""
        x, y, wide, tall = self._film.part
        result = image.copy()
        part = result[y : y + tall, x : x + wide]
        covered = self._film.crop(mask)
        part[covered] = getattr(self._segmenter, "background", part)[covered]
        return result

    def quality(self) -> FrameQuality:
        """Return a new comparison of a person's masks with the pictures."""
        background = getattr(self._segmenter, "background", None)
        still = registry().offer("segmenter", self._how.name).still_background
        return FrameQuality(self._film.video.fps, background, still=still)

    def row(
        self, quality: FrameQuality, image: Image, person: Person, number: int
    ) -> dict[str, Any]:
        """Return the row of quality.csv for a person in the next frame."""
        part = replace(
            person,
            mask=self._film.crop(person.mask),
            valid=self._film.crop(person.valid),
        )
        return quality.row(self._film.crop(image), part, number)

    def _segmented(self, image: Image) -> tuple[Mask, Mask]:
        """Return the segmenter's two masks of its part, pasted into the whole frame."""
        x, y, wide, tall = self._film.part
        with plugin_errors(f"segmenter {self._how.name!r}", "segment"):
            planes = [
                np.asarray(plane)
                for plane in self._segmenter.segment(self._film.crop(image))
            ]
        if len(planes) != 2 or any(
            plane.shape != (tall, wide) or plane.dtype != np.bool_ for plane in planes
        ):
            came = ", ".join(f"{plane.shape} {plane.dtype}" for plane in planes)
            raise BrokenRuleError(
                f"segmenter {self._how.name!r}: segment must return two boolean masks "
                f"of shape {tall, wide}, got {came}"
            )
        whole = np.zeros((2, *image.shape[:2]), dtype=bool)
        whole[:, y : y + tall, x : x + wide] = planes
        return whole[0], whole[1]

    def _landmarks(self) -> Array:
        """Return the segmenter's landmarks (27, 3), placed in the whole frame."""
        shape = (len(JOINTS), 3)
        landmarks = getattr(self._segmenter, "landmarks", None)
        if landmarks is None:
            landmarks = np.zeros(shape)
        points = np.array(landmarks, dtype=np.float64)
        if (
            points.shape != shape
            or not np.isfinite(points).all()
            or points[:, 2].min() < 0.0
        ):
            raise BrokenRuleError(
                f"segmenter {self._how.name!r}: landmarks must be finite numbers of "
                f"shape {shape}, their confidence 0 or more, got shape {points.shape}"
            )
        points[:, :2] += self._film.part[:2]
        return points


def _scaled_roi(roi: Box | None, video: Video) -> Box | None:
    """Return a region in scaled pixels. Raises InputError if it leaves the video."""
    if roi is None:
        return None
    x, y, wide, tall = roi
    scale = video.scale
    width, height = video.filmed
    if min(x, y) < 0 or min(wide, tall) < 1 or x + wide > width or y + tall > height:
        raise InputError(
            f"roi must lie within the video's {width}x{height} pixels, got {roi}"
        )
    left = round(x * scale)
    top = round(y * scale)
    right = round((x + wide) * scale)
    bottom = round((y + tall) * scale)
    return left, top, max(1, right - left), max(1, bottom - top)


def _ignored(path: str | Path | None, size: tuple[int, int]) -> Mask | None:
    """Return the bright pixels of an image, scaled. Raises InputError if unreadable."""
    if path is None:
        return None
    image = read_image(path, grey=True)
    if image is None:
        raise InputError(
            f"{path}: expected an image of what to ignore, got a damaged or another "
            "file"
        )
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_NEAREST) > BRIGHT)
