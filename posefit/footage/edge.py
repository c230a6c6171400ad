"""Refuse a film early if the picture's border cuts the person in all of its frames.

`quality.verdict` refuses such a film, too, but only after all of its frames.
"""

from collections.abc import Sequence

import cv2
import numpy as np

from posefit.errors import NoPersonError
from posefit.footage.people import MIN_DETECTIONS, SEARCH_REACH
from posefit.footage.quality import at_edge, changed_pixels
from posefit.footage.scanner import Scanner
from posefit.footage.segmenter import PersonSegmenter
from posefit.footage.views import MOST
from posefit.registry import registry
from posefit.silhouette.foreground import Image, Person
from posefit.silhouette.pieces import RIVAL_AREA

# a person who is cut in all frames for this long may be cut in the others, too
CUT_SECONDS = 2.0
# step between the frames that are looked at: if a person is whole in fewer successive
# frames, a track is too short to be useful
LOOK_STEP = MIN_DETECTIONS


class EdgeWatch:
    """Watches a pass through a film, frame after frame.

    Once everybody in the picture has been cut for two seconds, it looks ahead, at every
    eighth frame up to the end, to see whether that changes.
    """

    def __init__(self, scanner: Scanner) -> None:
        self._scanner = scanner
        self._watching = True
        self._cut = 0  # frames with cut people

    def add(self, k: int, blobs: Sequence[Person]) -> None:
        """Add the people of frame k, counted from 0.

        Raises:
            NoPersonError: The picture cuts the person in all frames that were looked
                at, and nobody else moves.
        """
        if not self._watching:
            return
        self._watching = not _is_whole(blobs)
        self._cut += blobs[0].touches_border
        fps = self._scanner.video.fps
        if self._watching and self._cut >= CUT_SECONDS * fps:
            self._watching = False
            self._look(k + 1)

    def _look(self, start: int) -> None:
        """Look at some of the frames from `start` on, counted from 0."""
        scanner = self._scanner
        segmenter = scanner.segmenter
        if not registry().offer("segmenter", scanner.how.name).still_background:
            # a network follows people from frame to frame, so the pass's own network
            # must not be given frames out of order
            segmenter = PersonSegmenter(scanner.video, scanner.how)
        cut = self._cut
        looked = start  # frames before `start`, and later ones looked at
        before: tuple[Image, Person] | None = None
        frames = scanner.video.frames(scanner.start + start, scanner.stop, LOOK_STEP)
        for image in frames:
            blobs = segmenter.frame(image).people
            if _is_whole(blobs) or (before and _others_move(image, blobs[0], *before)):
                return
            before = image, blobs[0]
            cut += blobs[0].touches_border
            looked += 1
        if cut > MOST * looked:
            count = scanner.stop - scanner.start
            raise NoPersonError(
                f"{scanner.video.path}: {at_edge(cut, looked)} looked at, of {count}"
            )


def _is_whole(blobs: Sequence[Person]) -> bool:
    """Return whether a frame shows somebody whom the picture's border does not cut."""
    return any(blob.area and not blob.touches_border for blob in blobs)


def _others_move(image: Image, person: Person, then: Image, earlier: Person) -> bool:
    """Return whether so much moves far from the person that it may be another one.

    A network may report the person who is cut while another is whole.
    """
    mask = person.mask | earlier.mask
    reach = round(SEARCH_REACH * max(cv2.boundingRect(mask.astype(np.uint8))[2:]))
    kernel = np.ones((2 * reach + 1, 2 * reach + 1), dtype=np.uint8)
    near = cv2.dilate(mask.astype(np.uint8), kernel) > 0
    moved = (changed_pixels(image, then) & ~near).sum()
    return bool(moved > RIVAL_AREA * max(person.area, earlier.area))
