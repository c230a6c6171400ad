"""Segment the person in a video, frame by frame."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from inspect import Parameter
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError, NoPersonError
from posefit.fitting.validation import BrokenRuleError, plugin_errors
from posefit.footage.images import read_image
from posefit.footage.people import (
    Choice,
    Chooser,
    People,
    Tracklet,
    excluded_mask,
    person_indices,
    planes_of,
    replace_detection,
    rows_of,
)
from posefit.footage.quality import (
    PEOPLE_SEGMENTER,
    FrameQuality,
    Verdict,
    advice,
    verdict,
)
from posefit.footage.video import Video, scaled
from posefit.footage.views import (
    MOST,
    Range,
    View,
    empty_planes,
    span,
    times_of,
    unpacked,
)
from posefit.geometry.skeleton import JOINTS
from posefit.reading import quoted
from posefit.registry import registry
from posefit.settings import check
from posefit.silhouette.foreground import BRIGHT, Film, Image, Person, Segmenter, people
from posefit.silhouette.mask import Mask, touches_border

T = TypeVar("T", bound=np.generic)
Box = tuple[int, int, int, int]  # x, y, width, height
Progress = Callable[[Iterator[Any], int], Iterator[Any]]

DEFAULT_SEGMENTER = "mixture"
BACKGROUND_SEGMENTER = "mean"  # the default if a background is given
WIDTH = 640  # pixels: wider videos are scaled down to this width
WIDTHS = (36, 8192)  # pixels: the widths that a user may set
OFTEN = 0.2  # share of the frames above which the camera counts as moving
MISSING = 0.02  # share of a file's frames that may be missing without a warning
# share of the longer side: a person who moves farther across the picture within
# `STAYING` is not on the spot
CROSSING = 0.35
STAYING = 2.0  # seconds before and after a frame

# whether the camera moves
PERIOD = 5  # every PERIODth frame is compared with the first one
SMALL = 160  # pixels: width of the pictures that are compared
TILES = 4  # tiles per side of a picture
FINE = 1.0  # pixels: smaller structures are filtered out as noise
# pixels: larger structures are filtered out, and tiles are searched this far around
REACH = 4
# grey levels per pixel: a tile that changes less along some axis shows no shift
TEXTURE = 0.7
FREE = 0.25  # least share of these tiles that a person leaves free
# share of the width: a larger shift since the first frame means that the camera moved
MOVED = 0.008


@dataclass(frozen=True)
class Extraction:
    """How the person is segmented in a video.

    Args:
        method: Name of a segmenter. By default a "mixture" of Gaussians is learned from
            the whole video, or the "mean" of `background` if that is given. If
            "mediapipe" is installed, a track by default uses the better of both, see
            `ways`.
        background: Frames without a person, as A:B, or an image.
        roi: x, y, width and height of the region to search, in the video's pixels.
        ignore: An image whose bright pixels are never known, such as a tree in front.
        width: Videos that are wider are scaled down to this width.
        person: Which of several people is followed, see `People.chosen`. A point is in
            the video's pixels.
        settings: The segmenter's own settings.

    Raises:
        InputError: A setting is missing, unknown or out of range.

    """

    method: str | None = None
    background: str | None = None
    roi: Box | None = None
    ignore: str | Path | None = None
    width: int = WIDTH
    person: Choice | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        least, most = WIDTHS
        if not least <= self.width <= most:
            raise InputError(
                f"width must lie in {least} to {most} pixels, got {self.width}"
            )
        offer = registry().offer("segmenter", self.name)
        settings = dict(self.settings)
        if self.background is not None:
            self._check_takes_background()
            settings["background"] = self.background
        settings = dict(check(self.name, offer.factory, settings))
        object.__setattr__(self, "settings", settings)
        for setting in offer.settings:
            if setting.default is Parameter.empty and setting.name not in settings:
                given = "given"
                if setting.name == "background":
                    given = "frames A:B or an image"
                raise InputError(
                    f"{setting.name} must be {given} for the method {self.name}, "
                    "got none"
                )

    def _check_takes_background(self) -> None:
        """Raise InputError if the segmenter does not take a background."""
        takers = list[str]()
        for offer in registry().offers["segmenter"].values():
            if any(setting.name == "background" for setting in offer.settings):
                takers.append(offer.name)
        if self.name not in takers:
            raise InputError(
                f"background must be given for the method {' or '.join(takers)} only, "
                f"got {quoted(self.background)} with {self.name}"
            )

    @property
    def name(self) -> str:
        """The segmenter's name."""
        return segmenter_name(self.method, self.background)

    def ways(self, cameras: int) -> "list[Extraction]":
        """Return the extractions that a track tries, in their order.

        A track uses the first one without doubtful masks. If the user chose nothing,
        "mediapipe" is tried, too, if it is installed. With one camera it comes first,
        because its landmarks show which leg is the left one.
        """
        if self.method or self.background or self.settings:
            return [self]
        other = registry().offers["segmenter"].get(PEOPLE_SEGMENTER)
        if other is None or other.missing:
            return [self]
        both = [self, replace(self, method=PEOPLE_SEGMENTER)]
        return both[::-1] if cameras == 1 else both

    def segmenter(self, film: Film) -> Segmenter:
        """Return the segmenter, trained on a film.

        Raises InputError if a setting does not fit the film.
        """
        offer = registry().offer("segmenter", self.name)
        with plugin_errors(offer.label, "it", passed=(ValueError, ImportError)):
            return cast(Segmenter, offer.factory(film, **self.settings))


def segmenter_name(method: str | None, background: str | None) -> str:
    """Return the name of the segmenter; the default depends on the background."""
    return method or (DEFAULT_SEGMENTER if background is None else BACKGROUND_SEGMENTER)


@dataclass(frozen=True)
class VideoFootage:
    """A video as a segmenter gets it: scaled to `size`, then cut to `part`."""

    video: Video
    size: tuple[int, int]
    part: Box

    def __len__(self) -> int:
        return self.video.count()

    def frames(
        self, start: int = 0, stop: int | None = None, step: int = 1
    ) -> Iterator[Image]:
        """Yield every `step`th frame from start to stop."""
        return map(self.cut, self.video.frames(start, stop, self.size, step))

    def picture(self, path: str) -> Image:
        """Return a picture of the video's size, scaled and cut as the video.

        Raises InputError if the file is not a picture, or has another size.
        """
        image = read_image(path, grey=False)
        if image is None:
            raise InputError(
                f"background must be frames A:B or an image, got {quoted(path)}"
            )
        tall, wide = image.shape[:2]
        width, height = self.video.size
        if (wide, tall) != (width, height):
            raise InputError(
                f"{path}: background must have the video's size {width}x{height}, "
                f"got {wide}x{tall}"
            )
        return self.cut(scaled(image, self.size))

    def cut(self, image: NDArray[T]) -> NDArray[T]:
        """Return the segmenter's part of a scaled image (height, width, ...)."""
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
        scale = min(1.0, how.width / video.size[0])
        self.size = (
            max(1, round(video.size[0] * scale)),
            max(1, round(video.size[1] * scale)),
        )
        self.scale = scale
        self.learned = "background" not in how.settings
        self._roi = _scaled_roi(how.roi, video, scale)
        self._ignored = _ignored(how.ignore, self.size)
        self._film = VideoFootage(video, self.size, self._roi or (0, 0, *self.size))
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
        covered = self._film.cut(mask)
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
            person, mask=self._film.cut(person.mask), valid=self._film.cut(person.valid)
        )
        return quality.row(self._film.cut(image), part, number)

    def _segmented(self, image: Image) -> tuple[Mask, Mask]:
        """Return the segmenter's two masks of its part, pasted into the whole frame."""
        x, y, wide, tall = self._film.part
        with plugin_errors(f"segmenter {self._how.name!r}", "segment"):
            planes = [
                np.asarray(plane)
                for plane in self._segmenter.segment(self._film.cut(image))
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


class _Pass(NamedTuple):
    """What a pass through a video found, before a person is chosen."""

    view: View  # the masks of the largest blob in each frame
    people: People
    # rows of quality.csv of the largest blobs: of the person, if there is only one
    largest: list[dict[str, Any]]
    blanks: list[dict[str, Any]]  # rows of empty masks
    choice: Choice | Chooser | None  # who is followed, as `People.chosen`


class _Followed(NamedTuple):
    """The person who is followed."""

    view: View
    several: str  # what to say if there are several people
    rows: list[dict[str, Any]]  # of quality.csv, for each frame
    apart: list[dict[str, Any]]  # the rows of frames in which others do not overlap


class Segmented(NamedTuple):
    """What a pass through a video found of one person."""

    view: View
    rows: list[dict[str, Any]]  # of quality.csv, for each frame
    doubt: Verdict | None  # what is wrong with the masks; None if nothing


class Segmentation:
    """A pass through a video that follows one person."""

    def __init__(
        self,
        video: Video,
        how: Extraction,
        frames: Range,
        among: Extraction | None = None,
    ) -> None:
        """Prepare a pass.

        Args:
            video: The video.
            how: How to segment the person.
            frames: Which frames to read.
            among: A second extraction, which finds all people. It tells which of them
                it is that the segmenter of `how` reports.

        Raises:
            InputError: The extraction or the frames do not fit the video.

        """
        self.start, self.stop = span(frames, video.count())
        self.video = video
        self.how = how
        self._segmenter = PersonSegmenter(video, how)
        self.size = self._segmenter.size
        self._among = None if among is None else Segmentation(video, among, frames)

    def read(
        self, progress: Progress | None = None, choose: Chooser | None = None
    ) -> Segmented:
        """Segment the video, after the background was learned.

        Args:
            progress: Shows how far the pass is.
            choose: Returns the number of the person to follow, instead of the
                extraction's `person`.

        Raises:
            NoPersonError: No frame shows a person.

        """
        video = self.video
        scan = self._scan(progress)
        if self._among is not None:
            scan = self._among.with_identities(self, scan, progress)
        if choose is not None:
            scan = scan._replace(choice=choose)
        learned = self._segmenter.learned
        view, several, rows, apart = self._follow_person(scan)
        missing = max(0, video.claimed - video.count())
        damage = ""
        if missing:
            damage = (
                f"the file says that it has {missing} frames more than can be read: it "
                "seems to be damaged"
            )
        if not any(row["area"] for row in rows):
            none = (
                "expected a person who moves before a still background, got none in "
                "any frame"
            )
            reason = f"; {damage}" if damage else advice(self.how.name, learned=learned)
            raise NoPersonError(f"{video.path}: {none}{reason}")
        warnings = [*video.warnings]
        doubt = verdict(apart, self.how.name, learned=learned)
        if doubt is not None:
            doubt = replace(doubt, text=f"{video.path}: {doubt.text}")
            warnings.append(doubt.text)
        if missing > MISSING * len(view):
            warnings.append(f"{video.path}: {damage}")
        if several:
            warnings.append(f"{video.path}: {several}")
        if view.moves:
            warnings.append(
                f"{video.path}: the camera seems to move, and silhouettes need a still "
                "one; expect poor masks"
            )
        landmarks = view.landmarks
        if landmarks is not None and not landmarks[..., 2].any():
            landmarks = None
        facings = view.facings
        # masks are decoded here, which a segmenter without facings does not need
        if facings is not None and np.isfinite(facings).any():
            sides = [row["longer_side"] for row in rows]
            facings = facings_on_the_spot(facings, _middles(view), sides, video.fps)
        view = replace(
            view,
            usable=np.array([row["usable"] for row in rows], dtype=bool),
            landmarks=landmarks,
            facings=facings,
            doubt="" if doubt is None else doubt.text,
            warnings=warnings,
        )
        return Segmented(view, rows, doubt)

    def _scan(
        self,
        progress: Progress | None,
        changed: Callable[[int, Image], Image] | None = None,
    ) -> _Pass:
        """Return what each frame shows: the largest blob, and the people.

        Args:
            progress: Shows how far the pass is.
            changed: Returns the picture of a frame that the segmenter gets, given the
                frame's index and its picture.

        """
        segmenter = self._segmenter
        room = self.stop - self.start
        people = People(self.video.fps)
        camera = CameraMotion(self.size)
        facings = list[float]()
        landmarks = list[Array]()
        blank_quality = segmenter.quality()
        largest_quality = segmenter.quality()
        blanks = list[dict[str, Any]]()
        largest = list[dict[str, Any]]()
        masks = empty_planes(room, self.size)
        valid = empty_planes(room, self.size)
        images = self.video.frames(self.start, self.stop, self.size)
        for k, image in enumerate(progress(images, room) if progress else images):
            camera.add(k, image)
            given = image if changed is None else changed(k, image)
            blobs, facing, points = segmenter.frame(given)
            facings.append(facing)
            landmarks.append(points)
            known = blobs[0].valid
            masks[k] = np.packbits(blobs[0].mask)
            valid[k] = np.packbits(known)
            present = people.add([blob.mask for blob in blobs if blob.area], image)
            empty = Person(np.zeros_like(known), known, 0, 0, 0.0, False)
            for tracklet in people.active:
                # a new person was in none of the earlier frames
                tracklet.quality = tracklet.quality or deepcopy(blank_quality)
                person = empty
                if tracklet in present:
                    person = _alone(tracklet, present, blobs, k)
                tracklet.add_row(k, self._row(tracklet.quality, image, person, k))
            blanks.append(self._row(blank_quality, image, empty, k))
            largest.append(self._row(largest_quality, image, blobs[0], k))
        count = len(blanks)  # the file may break off
        numbers = np.arange(self.start, self.start + count)
        view = View(
            name=str(self.video.path),
            numbers=numbers,
            times=times_of(numbers, self.video.fps),
            bits=masks[:count],
            known=valid[:count],
            usable=np.array([row["usable"] for row in largest], dtype=bool),
            size=self.size,
            fps=self.video.fps,
            filmed=self.video.size,
            landmarks=np.array(landmarks),
            facings=np.array(facings),
            moves=camera.moves,
            guesses=self.video.guesses,
            pictures=partial(self.video.frames, self.start, self.stop, self.size),
        )
        return _Pass(view, people, largest, blanks, self.how.person)

    def with_identities(
        self, single: "Segmentation", scan: _Pass, progress: Progress | None
    ) -> _Pass:
        """Return the scan of a segmenter that reports one person only, with identities.

        This segmentation finds the people, from the still background. Then `single`
        runs again with the background pasted over everyone except the person who is
        followed. In frames where it still shows another person, this segmentation's
        mask is used.

        Nothing changes if this segmentation finds one person only, or if its masks of
        everyone are poor.

        Args:
            single: The segmentation that reports one person only.
            scan: Its pass.
            progress: Shows how far further passes are.

        Returns:
            A scan that follows the person whom the user chose. By default this is the
            first person, or the one whom `single` shows most often if it does not find
            the first.

        """
        own = self._scan(progress)
        persons = own.people.persons()
        learned = self._segmenter.learned
        doubts = [
            verdict(rows_of(person, own.blanks)[1], self.how.name, learned=learned)
            for person in persons
        ]
        if len(persons) < 2 or own.view.moves or all(doubts):
            return scan
        indices = person_indices(persons, _masks(scan.view))
        if not any(index is not None for index in indices):
            return scan
        choices = [self.how.person]
        if self.how.person is None:
            most = max(range(len(persons)), key=indices.count)
            choices = [1] if most == 0 else [1, 1 + most]
        for choice in choices:
            parts, _ = own.people.chosen(choice, str, 1.0 / self._segmenter.scale)
            others = own.people.others(parts)
            scan = self._without_others(single, parts, others, progress)
            frames = list[int]()
            for k, index in enumerate(person_indices(persons, _masks(scan.view))):
                if index is not None and persons[index] == parts:
                    frames.append(k)
            detected = {frame for part in parts for frame in part.detections}
            if len(frames) >= MOST * len(detected):
                break
        for k in frames:
            mask = unpacked(scan.view.bits[k], self.size)
            replace_detection(parts, k, mask, scan.largest[k])
        return own._replace(view=_merged(own.view, scan.view, frames), choice=choice)

    def _without_others(
        self,
        single: "Segmentation",
        parts: Sequence[Tracklet],
        others: Sequence[Tracklet],
        progress: Progress | None,
    ) -> _Pass:
        """Return another pass of `single`, with the background pasted over the others.

        Args:
            single: The segmentation that reports one person only.
            parts: The parts of the person who is followed.
            others: The parts of all other people.
            progress: Shows how far the pass is.

        """

        def changed(k: int, image: Image) -> Image:
            excluded = excluded_mask(parts, others, k, self.size)
            return self._segmenter.without(image, excluded)

        frames = (single.start, single.stop)
        return Segmentation(single.video, single.how, frames)._scan(progress, changed)

    def _follow_person(self, scan: _Pass) -> _Followed:
        """Return the person who is followed. The pixels of the others are unknown."""
        scale = 1.0 / self._segmenter.scale
        parts, several = scan.people.chosen(
            scan.choice, lambda k: f"frame {self.start + k}", scale
        )
        if not several:
            return _Followed(scan.view, several, scan.largest, scan.largest)
        others = scan.people.others(parts)
        bits = np.empty_like(scan.view.bits)
        known = np.empty_like(scan.view.bits)
        for k in range(len(scan.blanks)):
            shown = scan.view.silhouette(k).valid
            mask, valid = planes_of(parts, others, k, shown)
            bits[k] = np.packbits(mask)
            known[k] = np.packbits(valid)
        view = replace(scan.view, bits=bits, known=known)
        return _Followed(view, several, *rows_of(parts, scan.blanks))

    def _row(
        self, quality: FrameQuality, image: Image, person: Person, k: int
    ) -> dict[str, Any]:
        """Return the row of quality.csv for a person in frame k, counted from 0."""
        number = self.start + k
        row = self._segmenter.row(quality, image, person, number)
        # a repeated frame does not show where the person is at its time
        usable = row["usable"] and self.video.is_filmed(number)
        return row | {"usable": int(usable)}


def _masks(view: View) -> Iterator[Mask]:
    """Yield the mask of each frame."""
    for bits in view.bits:
        yield unpacked(bits, view.size)


def _merged(own: View, single: View, frames: Sequence[int]) -> View:
    """Return a view that takes what is known in some frames from another pass.

    In all other frames it has neither landmarks nor facings.
    """
    # every pass states all of these
    assert single.known is not None
    assert own.known is not None
    assert single.landmarks is not None
    assert single.facings is not None
    used = np.zeros(len(single), dtype=bool)
    used[frames] = True
    return replace(
        own,
        known=np.where(used[:, None], single.known, own.known),
        landmarks=np.where(used[:, None, None], single.landmarks, 0.0),
        facings=np.where(used, single.facings, np.nan),
    )


def _alone(
    tracklet: Tracklet, present: Sequence[Tracklet], blobs: Sequence[Person], k: int
) -> Person:
    """Return a tracklet's person in frame k, without other people in the same blob."""
    known = blobs[0].valid
    others = [other for other in present if other is not tracklet and other.confirmed()]
    mask, valid = planes_of([tracklet], others, k, known)
    whole = next(
        (blob for blob in blobs if blob.mask is tracklet.latest.mask), blobs[0]
    )
    pieces = max(min(1, whole.pieces), whole.pieces - len(others))
    return Person(
        mask, valid, int(mask.sum()), pieces, whole.rival, touches_border(mask)
    )


def _middles(view: View) -> list[float]:
    """Return the middle column of each mask, in pixels; NaN if the mask is empty."""
    middles = list[float]()
    for mask in _masks(view):
        columns = np.flatnonzero(mask) % view.size[0]
        middles.append(float(columns.mean()) if len(columns) else math.nan)
    return middles


def facings_on_the_spot(
    facings: Array | Sequence[float],
    middles: Sequence[float],
    sides: Sequence[float],
    fps: float,
) -> Array:
    """Return which way a person faces in each frame (T,), if they are on the spot.

    A person who walks across the picture shows front and back by their motion, which is
    no less reliable than a network. Their facing becomes NaN.

    Args:
        facings: (T,) as `Segmenter.facing`, NaN if unknown.
        middles: (T,) the middle column of each mask, in pixels; NaN if it is empty.
        sides: (T,) the longer side of each mask, in pixels.
        fps: Frames per second.

    """
    result = np.array(facings, dtype=np.float64)
    reach = max(round(STAYING * fps), 1)
    for k in range(len(result)):
        rows = slice(max(k - reach, 0), k + reach + 1)
        known = np.isfinite(middles[rows])
        across = np.asarray(middles[rows])[known]
        side = np.asarray(sides[rows])[known]
        if known.any() and np.ptp(across) > CROSSING * np.median(side):
            result[k] = np.nan
    return result


class CameraMotion:
    """Estimates whether the camera moves, by comparing pictures with the first one."""

    def __init__(self, size: tuple[int, int]) -> None:
        # tiles of fewer than 16 rows would be too low to search
        self._size = SMALL, max(16 * TILES, round(SMALL * size[1] / size[0]))
        # the tiles of the first picture; None for a tile without texture
        self._first: list[Any] | None = None
        self._shifts = list[float]()

    @property
    def moves(self) -> bool:
        """Whether the camera seems to move."""
        moved = sum(shift > MOVED * SMALL for shift in self._shifts)
        return moved > OFTEN * len(self._shifts)

    def add(self, k: int, image: Image) -> None:
        """Compare picture k with the first one, if it is its turn."""
        if k % PERIOD == 0:
            self._shifts.append(self._shift(image))

    def _shift(self, image: Image) -> float:
        """Return the shift against the first picture, in pixels of a `SMALL` picture.

        A moving camera shifts every tile. A tile that a person covers may match
        anywhere. So the camera's shift is one that all textured tiles reach, except for
        a few. If most tiles have no texture, it is 0.
        """
        tiles = self._tiles(image)
        if self._first is None:
            self._first = [
                tile[REACH:-REACH, REACH:-REACH] if _textured(tile) else None
                for tile in tiles
            ]
        shifts = list[float]()
        for before, now in zip(self._first, tiles, strict=True):
            if before is None:
                continue
            likeness = cv2.matchTemplate(now, before, cv2.TM_CCOEFF_NORMED)
            _, _, _, best = cv2.minMaxLoc(likeness)
            shifts.append(float(np.hypot(*np.subtract(best, REACH))))
        if len(shifts) <= MOST * TILES**2:
            return 0.0
        return float(np.quantile(shifts, FREE))

    def _tiles(self, image: Image) -> list[Any]:
        """Return the tiles of a picture, filtered to medium-sized structures."""
        resized = cv2.resize(image, self._size, interpolation=cv2.INTER_AREA)
        small = cv2.cvtColor(resized, cv2.COLOR_BGR2GRAY).astype(np.float32)
        # neither noise nor changing light may count as texture
        grey: Any = cv2.GaussianBlur(small, (0, 0), FINE)
        grey -= cv2.GaussianBlur(grey, (0, 0), REACH)
        wide, tall = (side // TILES for side in self._size)
        tiles = list[Any]()
        for top in range(0, TILES * tall, tall):
            for left in range(0, TILES * wide, wide):
                tile = grey[top : top + tall, left : left + wide]
                tiles.append(np.ascontiguousarray(tile))
        return tiles


def _textured(tile: Any) -> bool:
    """Return whether a tile changes along every axis, so that it shows any shift."""
    down, across = np.gradient(tile)
    tensor = [
        [np.mean(across * across), np.mean(across * down)],
        [np.mean(across * down), np.mean(down * down)],
    ]
    return bool(np.linalg.eigvalsh(tensor)[0] > TEXTURE**2)


def _scaled_roi(roi: Box | None, video: Video, scale: float) -> Box | None:
    """Return a region in scaled pixels. Raises InputError if it leaves the video."""
    if roi is None:
        return None
    x, y, wide, tall = roi
    if (
        min(x, y) < 0
        or min(wide, tall) < 1
        or x + wide > video.size[0]
        or y + tall > video.size[1]
    ):
        raise InputError(
            f"roi must lie within the video's {video.size[0]}x{video.size[1]} pixels, "
            f"got {roi}"
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
            f"{path}: expected an image of what to ignore, got another or a damaged "
            "file"
        )
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_NEAREST) > BRIGHT)
