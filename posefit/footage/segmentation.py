"""The person in a video, separated from the background frame by frame."""

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
BACKGROUND_SEGMENTER = "mean"  # where a background is given
WIDTH = 640  # pixels; larger videos are scaled down to it
OFTEN = 0.2  # the share of frames from which on something is worth a warning
MISSING = 0.02  # the share of a file's frames that may be missing without a warning
# of the longer side: a person who goes as far across the picture within `STAYING` is
# not on the spot
CROSSING = 0.35
STAYING = 2.0  # seconds before and after a frame

# whether the camera moved
PERIOD = 5  # frames between two that are compared with the first
SMALL = 160  # pixels: the width of the pictures that are compared
TILES = 4  # to a side
FINE = 1.0  # pixels: smaller structures are filtered out
# pixels: larger structures are filtered out, and a tile is searched so far to either
# side
REACH = 4
# grey levels a pixel: a tile that changes less along some axis does not show where it
# went
TEXTURE = 0.7
FREE = 0.25  # the share of these tiles that a person leaves free at least
# of the width: a shift since the first frame that counts as a moving camera
MOVED = 0.008


@dataclass(frozen=True)
class Extraction:
    """How the person is separated from the rest of a video.

    `method` is a segmenter's name: by default a "mixture" of Gaussians learned from the whole video, or the "mean" of
    `background` where that is given: frames without a person, as A:B, or an image. Where "mediapipe" is installed, a
    track by default takes the better of both, see `ways`. `settings` are the segmenter's own.
    `roi` x, y, width, height in the video's own pixels is where the person is searched; `ignore` is an image whose
    bright pixels are never known, such as a tree in front. Of several people `person` is followed, see `People.chosen`,
    a place being in the video's own pixels. Videos wider than `width` are scaled down to it.
    """

    method: str | None = None
    background: str | None = None
    roi: Box | None = None
    ignore: str | Path | None = None
    width: int = WIDTH
    person: Choice | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 36 <= self.width <= 8192:
            raise InputError(f"width must lie in 36 to 8192 pixels, got {self.width}")
        offer = registry().offer("segmenter", self.name)
        if self.background is not None:
            offers = registry().offers["segmenter"].values()
            takers = [
                other.name
                for other in offers
                if "background" in [setting.name for setting in other.settings]
            ]
            if self.name not in takers:
                came = f"{quoted(self.background)} with {self.name}"
                raise InputError(
                    f"background must be given for the method {' or '.join(takers)} only, got {came}"
                )
            object.__setattr__(
                self, "settings", {**self.settings, "background": self.background}
            )
        object.__setattr__(
            self, "settings", check(self.name, offer.factory, self.settings)
        )
        for setting in offer.settings:
            if setting.default is Parameter.empty and setting.name not in self.settings:
                given = (
                    "frames A:B or an image"
                    if setting.name == "background"
                    else "given"
                )
                raise InputError(
                    f"{setting.name} must be {given} for the method {self.name}, got none"
                )

    @property
    def name(self) -> str:
        """The segmenter's name."""
        return segmenter_name(self.method, self.background)

    def ways(self, cameras: int) -> "list[Extraction]":
        """Return this extraction, and for the default of a track, where "mediapipe" is installed, that beside it.

        A track takes the first whose masks are not doubted. With one camera that is first "mediapipe", whose landmarks
        show which leg is the left one.
        """
        other = registry().offers["segmenter"].get(PEOPLE_SEGMENTER)
        if (
            self.method
            or self.background
            or self.settings
            or other is None
            or other.missing
        ):
            return [self]
        both = [self, replace(self, method=PEOPLE_SEGMENTER)]
        return both[::-1] if cameras == 1 else both

    def segmenter(self, film: Film) -> Segmenter:
        """Return the segmenter, trained on a film. Raises InputError where a setting does not fit it."""
        offer = registry().offer("segmenter", self.name)
        with plugin_errors(offer.label, "it", passed=(ValueError, ImportError)):
            return cast(Segmenter, offer.factory(film, **self.settings))


def segmenter_name(method: str | None, background: str | None) -> str:
    """Return the name of the segmenter: by default one that learns the background, or uses the given one."""
    return method or (DEFAULT_SEGMENTER if background is None else BACKGROUND_SEGMENTER)


@dataclass(frozen=True)
class VideoFootage:
    """A video as a segmenter gets it: scaled to `size` and cut to `part`, x, y, width and height in scaled pixels."""

    video: Video
    size: tuple[int, int]
    part: Box

    def __len__(self) -> int:
        return self.video.count()

    def frames(
        self, start: int = 0, stop: int | None = None, step: int = 1
    ) -> Iterator[Image]:
        """Yield every `step`th frame of start to stop."""
        return map(self.cut, self.video.frames(start, stop, self.size, step))

    def picture(self, path: str) -> Image:
        """Return a picture of the video's size as the video shows it. Raises InputError where there is none."""
        image = read_image(path, grey=False)
        if image is None:
            raise InputError(
                f"background must be frames A:B or an image, got {quoted(path)}"
            )
        (tall, wide), (width, height) = image.shape[:2], self.video.size
        if (wide, tall) != (width, height):
            raise InputError(
                f"{path}: background must have the video's size {width}x{height}, got {wide}x{tall}"
            )
        return self.cut(scaled(image, self.size))

    def cut(self, image: NDArray[T]) -> NDArray[T]:
        """Return the part of a scaled frame or mask (height, width, ...) that a segmenter gets."""
        x, y, wide, tall = self.part
        return np.ascontiguousarray(image[y : y + tall, x : x + wide])


class SegmentedFrame(NamedTuple):
    """The people in a frame of the working size, the largest first, and what a segmenter knows besides."""

    people: list[Person]
    facing: float  # as `Segmenter.facing`; NaN where unknown
    # (27, 3) as `Segmenter.landmarks`, at their place in the frame; 0 for none
    landmarks: Array


class PersonSegmenter:
    """Takes the person out of the frames of a video, one after the other; it learns the background before the first."""

    def __init__(self, video: Video, how: Extraction) -> None:
        """Check that the extraction fits the video. Raises InputError where it does not."""
        scale = min(1.0, how.width / video.size[0])
        self.size = (
            max(1, round(video.size[0] * scale)),
            max(1, round(video.size[1] * scale)),
        )
        self.scale = scale
        self.learned = "background" not in how.settings
        self._roi, self._ignored = (
            _scaled_roi(how.roi, video, scale),
            _ignored(how.ignore, self.size),
        )
        self._film = VideoFootage(video, self.size, self._roi or (0, 0, *self.size))
        self._how = how
        if not self.learned:  # a background is checked now
            _ = self._segmenter

    @cached_property
    def _segmenter(self) -> Segmenter:
        """The segmenter, trained on the video."""
        return self._how.segmenter(self._film)

    def frame(self, image: Image) -> SegmentedFrame:
        """Return who is in the next frame, which is of the working size."""
        result = people(*self._segmented(image), self._roi, self._ignored)
        return SegmentedFrame(
            result,
            float(getattr(self._segmenter, "facing", math.nan)),
            self._landmarks(),
        )

    def without(self, image: Image, mask: Mask) -> Image:
        """Return a frame of the working size with the background where a mask is."""
        (x, y, wide, tall), result = self._film.part, image.copy()
        part = result[y : y + tall, x : x + wide]
        covered = self._film.cut(mask)
        part[covered] = getattr(self._segmenter, "background", part)[covered]
        return result

    def quality(self) -> FrameQuality:
        """Return what compares the masks of a person with the pictures, from the first frame on."""
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
        """Return the segmenter's two masks of the part that it gets, at its place in the whole frame."""
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
                f"segmenter {self._how.name!r}: segment must return two boolean masks of shape {tall, wide}, got {came}"
            )
        whole = np.zeros((2, *image.shape[:2]), dtype=bool)
        whole[:, y : y + tall, x : x + wide] = planes
        return whole[0], whole[1]

    def _landmarks(self) -> Array:
        landmarks = getattr(self._segmenter, "landmarks", None)
        given = np.array(
            np.zeros((len(JOINTS), 3)) if landmarks is None else landmarks,
            dtype=np.float64,
        )
        if (
            given.shape != (len(JOINTS), 3)
            or not np.isfinite(given).all()
            or given[:, 2].min() < 0.0
        ):
            raise BrokenRuleError(
                f"segmenter {self._how.name!r}: landmarks must be finite numbers of shape {len(JOINTS), 3}, their "
                f"confidence 0 or more, got shape {given.shape}"
            )
        given[:, :2] += self._film.part[:2]
        return given


class _Pass(NamedTuple):
    """A pass through a video, before a person is chosen."""

    view: View  # of the largest blob in each frame
    people: People
    # rows of quality.csv for the largest blobs: the person, where there is one only
    largest: list[dict[str, Any]]
    blanks: list[dict[str, Any]]  # rows for empty masks
    choice: Choice | Chooser | None  # who is followed, as `People.chosen`


class Segmentation:
    """A pass through a video. Raises InputError where the extraction or the frames do not fit it."""

    def __init__(
        self,
        video: Video,
        how: Extraction,
        frames: Range,
        among: Extraction | None = None,
    ) -> None:
        """Where the segmenter of `how` reports one person only, that of `among` identifies which of several it is."""
        self.start, self.stop = span(frames, video.count())
        self.video, self.how, self._segmenter = video, how, PersonSegmenter(video, how)
        self.size = self._segmenter.size
        self._among = None if among is None else Segmentation(video, among, frames)

    def read(
        self, progress: Progress | None = None, choose: Chooser | None = None
    ) -> tuple[View, list[dict[str, Any]], Verdict | None]:
        """Return the view of the video, which is decoded once, after the background was learned.

        With it come the rows of quality.csv, and what is wrong with the masks, if anything. Of several people `choose`
        returns the number of the one who is followed, where the extraction names none. Raises NoPersonError where no
        frame shows a person.
        """
        video = self.video
        scan = self._scan(progress)
        if self._among is not None:
            scan = self._among.with_identities(self, scan, progress)
        learned = self._segmenter.learned
        view, several, rows, apart = self._follow_person(
            scan if choose is None else scan._replace(choice=choose)
        )
        missing = max(0, video.claimed - video.count())
        damage = ""
        if missing:
            damage = f"the file says that it has {missing} frames more than can be read: it seems to be damaged"
        if not any(row["area"] for row in rows):
            none = "expected a person who moves before a still background, got none in any frame"
            reason = f"; {damage}" if damage else advice(self.how.name, learned=learned)
            raise NoPersonError(f"{video.path}: {none}{reason}")
        doubt = verdict(apart, self.how.name, learned=learned)
        if doubt is not None:
            doubt = replace(doubt, text=f"{video.path}: {doubt.text}")
        moves = "the camera seems to move, and silhouettes need a still one; expect poor masks"
        warnings = [
            damage if missing > MISSING * len(view) else "",
            several,
            moves if view.moves else "",
        ]
        landmarks = view.landmarks
        facings = view.facings
        # nothing is decoded for a segmenter that reports none
        if facings is not None and np.isfinite(facings).any():
            sides = [row["longer_side"] for row in rows]
            facings = facings_on_the_spot(facings, _middles(view), sides, video.fps)
        view = replace(
            view,
            usable=np.array([row["usable"] for row in rows], dtype=bool),
            landmarks=landmarks
            if landmarks is not None and landmarks[..., 2].any()
            else None,
            facings=facings,
            doubt="" if doubt is None else doubt.text,
            warnings=[
                *video.warnings,
                *([] if doubt is None else [doubt.text]),
                *(f"{video.path}: {text}" for text in warnings if text),
            ],
        )
        return view, rows, doubt

    def _scan(
        self,
        progress: Progress | None,
        changed: Callable[[int, Image], Image] | None = None,
    ) -> _Pass:
        """Return what each frame shows: the largest blob, and the people with the quality of their masks.

        The segmenter gets the pictures as `changed` returns them.
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
        masks, valid = (empty_planes(room, self.size) for _ in range(2))
        images = self.video.frames(self.start, self.stop, self.size)
        for k, image in enumerate(progress(images, room) if progress else images):
            camera.add(k, image)
            blobs, facing, points = segmenter.frame(
                image if changed is None else changed(k, image)
            )
            facings.append(facing)
            landmarks.append(points)
            known = blobs[0].valid
            masks[k], valid[k] = np.packbits(blobs[0].mask), np.packbits(known)
            present = people.add([blob.mask for blob in blobs if blob.area], image)
            empty = Person(np.zeros_like(known), known, 0, 0, 0.0, False)
            for tracklet in people.active:
                tracklet.quality = tracklet.quality or deepcopy(blank_quality)
                person = (
                    _alone(tracklet, present, blobs, k)
                    if tracklet in present
                    else empty
                )
                tracklet.add_row(k, self._row(tracklet.quality, image, person, k))
            blanks.append(self._row(blank_quality, image, empty, k))
            largest.append(self._row(largest_quality, image, blobs[0], k))
        count = len(blanks)  # the file may break off
        numbers = np.arange(self.start, self.start + count)
        view = View(
            str(self.video.path),
            numbers,
            times_of(numbers, self.video.fps),
            masks[:count],
            valid[:count],
            np.array([row["usable"] for row in largest], dtype=bool),
            self.size,
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
        """Return the scan of a segmenter that reports one person only, with the people of this still background.

        Nothing changes where this one has one person only, or poor masks of all. For the person who is followed
        `single` runs again, with the background in place of the others; where its mask is still that of another, this
        one's is used. Without a choice that is the first, or, if `single` does not find them, its most frequent one.
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
        indices = person_indices(
            persons, (unpacked(plane, self.size) for plane in scan.view.bits)
        )
        if not any(index is not None for index in indices):
            return scan
        most = max(range(len(persons)), key=indices.count)
        chosen = self.how.person
        for choice in dict.fromkeys((1, 1 + most)) if chosen is None else [chosen]:
            parts, _ = own.people.chosen(choice, str, 1.0 / self._segmenter.scale)
            scan = self._without_others(
                single, parts, own.people.others(parts), progress
            )
            indices = person_indices(
                persons, (unpacked(plane, self.size) for plane in scan.view.bits)
            )
            frames = [
                k
                for k, index in enumerate(indices)
                if index is not None and persons[index] == parts
            ]
            if len(frames) >= MOST * len(
                {frame for part in parts for frame in part.detections}
            ):
                break
        for k in frames:
            mask = unpacked(scan.view.bits[k], self.size)
            replace_detection(parts, k, mask, scan.largest[k])
        used = np.zeros(len(indices), dtype=bool)
        used[frames] = True
        one = scan.view
        # a pass states all of these
        assert one.known is not None
        assert own.view.known is not None
        assert one.landmarks is not None
        assert one.facings is not None
        view = replace(
            own.view,
            known=np.where(used[:, None], one.known, own.view.known),
            landmarks=np.where(used[:, None, None], one.landmarks, 0.0),
            facings=np.where(used, one.facings, np.nan),
        )
        return own._replace(view=view, choice=choice)

    def _without_others(
        self,
        single: "Segmentation",
        parts: Sequence[Tracklet],
        others: Sequence[Tracklet],
        progress: Progress | None,
    ) -> _Pass:
        """Return another pass of a segmentation, through pictures with the background where a person is not."""

        def changed(k: int, image: Image) -> Image:
            return self._segmenter.without(
                image, excluded_mask(parts, others, k, self.size)
            )

        return Segmentation(
            single.video, single.how, (single.start, single.stop)
        )._scan(progress, changed)

    def _follow_person(
        self, scan: _Pass
    ) -> tuple[View, str, list[dict[str, Any]], list[dict[str, Any]]]:
        """Return the view of the person who is followed, what there is to say of several, and the rows as `rows_of`.

        The pixels of the others are unknown.
        """
        scale = 1.0 / self._segmenter.scale
        parts, several = scan.people.chosen(
            scan.choice, lambda k: f"frame {self.start + k}", scale
        )
        if not several:
            return scan.view, several, scan.largest, scan.largest
        others = scan.people.others(parts)
        bits = np.empty_like(scan.view.bits)
        known = np.empty_like(scan.view.bits)
        for k in range(len(scan.blanks)):
            shown = scan.view.silhouette(k).valid
            mask, valid = planes_of(parts, others, k, shown)
            bits[k] = np.packbits(mask)
            known[k] = np.packbits(valid)
        view = replace(scan.view, bits=bits, known=known)
        return view, several, *rows_of(parts, scan.blanks)

    def _row(
        self, quality: FrameQuality, image: Image, person: Person, k: int
    ) -> dict[str, Any]:
        row = self._segmenter.row(quality, image, person, self.start + k)
        return row | {
            "usable": int(row["usable"] and self.video.is_filmed(self.start + k))
        }


def _alone(
    tracklet: Tracklet, present: Sequence[Tracklet], blobs: Sequence[Person], k: int
) -> Person:
    """Return what frame k shows of a tracklet, without the others that are present."""
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
    """Return the middle column of each mask, in pixels; NaN where it is empty."""
    columns = [
        np.flatnonzero(unpacked(bits, view.size)) % view.size[0] for bits in view.bits
    ]
    return [float(each.mean()) if len(each) else math.nan for each in columns]


def facings_on_the_spot(
    facings: Array | Sequence[float],
    middles: Sequence[float],
    sides: Sequence[float],
    fps: float,
) -> Array:
    """Return which way a person faces in each frame (T,), NaN where they go across the picture or it is unknown.

    `middles` and `sides` are those of the mask, in pixels. For a person who goes along, the frames themselves show
    front and back, and a network is no surer.
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
    """Compares every `PERIOD`th picture with the first one, to estimate whether the camera moved."""

    def __init__(self, size: tuple[int, int]) -> None:
        self._size = SMALL, max(16 * TILES, round(SMALL * size[1] / size[0]))
        # the tiles of the first picture; None for one without texture
        self._first: list[Any] | None = None
        self._shifts = list[float]()

    @property
    def moves(self) -> bool:
        """Whether the camera seems to move."""
        return sum(shift > MOVED * SMALL for shift in self._shifts) > OFTEN * len(
            self._shifts
        )

    def add(self, k: int, image: Image) -> None:
        """Take picture k."""
        if k % PERIOD == 0:
            self._shifts.append(self._shift(image))

    def _shift(self, image: Image) -> float:
        """Return by how many pixels of a picture `SMALL` wide an image is shifted against the first.

        Tiles that a person covers match anywhere, but a camera that moves takes along every tile: what all but a
        few of those with texture are shifted by at least is the camera's part. Where few have any, it is 0.
        """
        small = cv2.cvtColor(
            cv2.resize(image, self._size, interpolation=cv2.INTER_AREA),
            cv2.COLOR_BGR2GRAY,
        )
        # noise is no texture, and light that changes is none
        grey: Any = cv2.GaussianBlur(small.astype(np.float32), (0, 0), FINE)
        grey -= cv2.GaussianBlur(grey, (0, 0), REACH)
        wide, tall = (side // TILES for side in self._size)
        corners = [(y * tall, x * wide) for y in range(TILES) for x in range(TILES)]
        tiles = [
            np.ascontiguousarray(grey[y : y + tall, x : x + wide]) for y, x in corners
        ]
        if self._first is None:
            self._first = [
                tile[REACH:-REACH, REACH:-REACH] if _textured(tile) else None
                for tile in tiles
            ]
        shifts = []
        for before, now in zip(self._first, tiles, strict=True):
            if before is not None:
                best = cv2.minMaxLoc(
                    cv2.matchTemplate(now, before, cv2.TM_CCOEFF_NORMED)
                )[3]
                shifts.append(float(np.hypot(*np.subtract(best, REACH))))
        return (
            float(np.quantile(shifts, FREE)) if len(shifts) > MOST * TILES**2 else 0.0
        )


def _textured(tile: Any) -> bool:
    """Return whether a tile changes along both axes, so that it shows a shift."""
    down, across = np.gradient(tile)
    tensor = [
        [np.mean(across * across), np.mean(across * down)],
        [np.mean(across * down), np.mean(down * down)],
    ]
    return bool(np.linalg.eigvalsh(tensor)[0] > TEXTURE**2)


def _scaled_roi(roi: Box | None, video: Video, scale: float) -> Box | None:
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
            f"roi must lie within the video's {video.size[0]}x{video.size[1]} pixels, got {roi}"
        )
    left = round(x * scale)
    top = round(y * scale)
    return (
        left,
        top,
        max(1, round((x + wide) * scale) - left),
        max(1, round((y + tall) * scale) - top),
    )


def _ignored(path: str | Path | None, size: tuple[int, int]) -> Mask | None:
    if path is None:
        return None
    image = read_image(path, grey=True)
    if image is None:
        raise InputError(
            f"{path}: expected an image of what to ignore, got a file that is none"
        )
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_NEAREST) > BRIGHT)
