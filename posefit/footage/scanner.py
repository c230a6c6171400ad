"""A pass through some frames of a video, which finds the people in each of them."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.footage.camera_motion import CameraMotion
from posefit.footage.choice import Choice
from posefit.footage.extraction import Extraction
from posefit.footage.people import (
    Chooser,
    People,
    Tracklet,
    planes_of,
)
from posefit.footage.quality import FrameQuality
from posefit.footage.segmenter import PersonSegmenter, SegmentedFrame
from posefit.footage.video import Video, ahead
from posefit.footage.views import Range, View, empty_planes, release, span, times_of
from posefit.silhouette.foreground import Image, Person
from posefit.silhouette.mask import touches_border

Progress = Callable[[Iterator[Any], int], Iterator[Any]]


class Scan(NamedTuple):
    """What a pass through a video found, before a person is chosen."""

    view: View  # the masks of the largest blob in each frame
    people: People
    # rows of quality.csv of the largest blobs: of the person, if there is only one
    largest: list[dict[str, Any]]
    blanks: list[dict[str, Any]]  # rows of empty masks
    choice: Choice | Chooser | None  # who is followed, as `People.chosen`


class Scanner:
    """Goes once through some frames of a video, and finds the people in each."""

    def __init__(
        self,
        video: Video,
        how: Extraction,
        frames: Range,
    ) -> None:
        """Prepare a pass.

        Args:
            video: The video.
            how: How to segment the people.
            frames: Which frames to read.

        Raises:
            InputError: The extraction or the frames do not fit the video.
        """
        self.start, self.stop = span(frames, video.count())
        self.how = how
        self.video = video
        video.keep(self.start, self.stop)
        self.segmenter = PersonSegmenter(video, how)

    def again(self) -> "Scanner":
        """Return another pass through the same frames, with a new segmenter."""
        return Scanner(self.video, self.how, (self.start, self.stop))

    def scan(
        self,
        progress: Progress | None,
        changed: Callable[[int, Image], Image] | None = None,
        watch: Callable[[int, Sequence[Person]], None] | None = None,
    ) -> Scan:
        """Return what each frame shows: the largest blob, and the people.

        Args:
            progress: Shows the progress of the pass.
            changed: Returns the picture that the segmenter gets for a frame, given the
                frame's index and its picture.
            watch: Gets each frame's index and its people; it may end the pass.
        """
        video = self.video
        size = video.size
        count = self.stop - self.start
        people = People(video.fps)
        camera = CameraMotion(size)
        rows = _Rows(self)
        facings = list[float]()
        landmarks = list[Array]()
        bits = empty_planes(count, size)
        known = empty_planes(count, size)
        # a second core segments the next frames while people are told apart in this one
        frames = ahead(self._segmented(changed, watch))
        for k, frame in enumerate(progress(frames, count) if progress else frames):
            image, (blobs, facing, points) = frame
            camera.add(k, image)
            facings.append(facing)
            landmarks.append(points)
            bits[k] = np.packbits(blobs[0].mask)
            known[k] = np.packbits(blobs[0].valid)
            release(bits, k)
            release(known, k)
            present = people.add([blob.mask for blob in blobs if blob.area], image)
            rows.add(k, image, blobs, people, present)
        read = len(rows.blanks)  # the file may end early
        numbers = np.arange(self.start, self.start + read)
        view = View(
            name=str(video.path),
            numbers=numbers,
            times=times_of(numbers, video.fps),
            bits=bits[:read],
            known=known[:read],
            usable=np.array([row["usable"] for row in rows.largest], dtype=bool),
            size=size,
            fps=video.fps,
            filmed=video.filmed,
            landmarks=np.array(landmarks),
            facings=np.array(facings),
            moves=camera.moves,
            guesses=video.guesses,
            pictures=partial(video.frames, self.start, self.stop),
        )
        return Scan(view, people, rows.largest, rows.blanks, self.how.person)

    def _segmented(
        self,
        changed: Callable[[int, Image], Image] | None,
        watch: Callable[[int, Sequence[Person]], None] | None,
    ) -> Iterator[tuple[Image, SegmentedFrame]]:
        """Yield each frame's picture, and what the segmenter finds in it.

        `changed` and `watch` are as for `scan`.
        """
        for k, image in enumerate(self.video.frames(self.start, self.stop)):
            given = image if changed is None else changed(k, image)
            segmented = self.segmenter.frame(given)
            if watch is not None:
                # here, because it may use the segmenter, too
                watch(k, segmented.people)
            yield image, segmented


class _Rows:
    """The rows of quality.csv of all frames.

    Each frame has a row for every person who is expected in it, one for its largest
    blob, and one for an empty mask.
    """

    def __init__(self, scanner: Scanner) -> None:
        self.blanks = list[dict[str, Any]]()
        self.largest = list[dict[str, Any]]()
        self._scanner = scanner
        self._of_blanks = scanner.segmenter.quality()
        self._of_largest = self._of_blanks.duplicate()
        # of the people who may be in the next frame
        self._of_people = dict[Tracklet, FrameQuality]()

    def add(
        self,
        k: int,
        image: Image,
        blobs: Sequence[Person],
        people: People,
        present: Sequence[Tracklet],
    ) -> None:
        """Judge the masks of a frame.

        Args:
            k: The frame, counted from 0.
            image: Its picture.
            blobs: What the segmenter found in it, the largest first.
            people: The people of the frames up to this one. They get their rows.
            present: The people in this one.
        """
        known = blobs[0].valid
        empty = Person(np.zeros_like(known), known, 0, 0, 0.0, False)
        qualities = dict[Tracklet, FrameQuality]()
        for tracklet in people.active:
            # a new person was in none of the earlier frames
            quality = self._of_people.get(tracklet) or self._of_blanks.duplicate()
            qualities[tracklet] = quality
            person = empty
            if tracklet in present:
                person = _alone(tracklet, present, blobs, k)
            tracklet.add_row(k, self._row(quality, image, person, k))
        # comparisons of people who are lost are freed, or memory would grow with noise
        self._of_people = qualities
        self.blanks.append(self._row(self._of_blanks, image, empty, k))
        self.largest.append(self._row(self._of_largest, image, blobs[0], k))

    def _row(
        self, quality: FrameQuality, image: Image, person: Person, k: int
    ) -> dict[str, Any]:
        """Return the row of a person in frame k, counted from 0."""
        number = self._scanner.start + k
        row = self._scanner.segmenter.row(quality, image, person, number)
        # a repeated frame does not show where the person is at its time
        usable = row["usable"] and self._scanner.video.is_filmed(number)
        return row | {"usable": int(usable)}


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
