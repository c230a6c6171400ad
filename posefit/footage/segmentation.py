"""Segment one person in a video.

| value | what it does |
|---|---|
| `Extraction` | says how a person is segmented: the user's options |
| `PersonSegmenter` | finds the people in one frame |
| `Scanner` | goes once through a video, and tells its people apart: a `Scan` |
| `Segmentation` | follows one of these people: a `Segmented` view |
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.errors import NoPersonError
from posefit.footage.edge import EdgeWatch
from posefit.footage.extraction import Extraction
from posefit.footage.facing import facings_on_the_spot
from posefit.footage.identities import with_identities
from posefit.footage.people import Chooser, planes_of, rows_of
from posefit.footage.quality import Verdict, advice, verdict
from posefit.footage.scanner import Progress, Scan, Scanner
from posefit.footage.video import Video
from posefit.footage.views import Range, View, empty_planes, release

MISSING = 0.02  # share of a file's frames that may be missing without a warning
DAMAGED = (
    "the file says that it has {} frames more than can be read: it seems to be damaged"
)


class _Followed(NamedTuple):
    """The person who is followed."""

    view: View
    several: str  # the message if there are several people
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
                the segmenter of `how` reports.

        Raises:
            InputError: The extraction or the frames do not fit the video.
        """
        self.video = video
        self.how = how
        self._scanner = Scanner(video, how, frames)
        self._all_people = None
        if among is not None:
            self._all_people = Scanner(video, among, frames)

    def read(
        self,
        progress: Progress | None = None,
        choose: Chooser | None = None,
        *,
        refuse_cut: bool = False,
    ) -> Segmented:
        """Segment the video, after the background was learned.

        Args:
            progress: Shows the progress of the pass.
            choose: Returns the number of the person to follow, instead of the
                extraction's `person`.
            refuse_cut: Whether to stop soon if the picture cuts the person in all
                frames.

        Raises:
            NoPersonError: No frame shows a person, or the picture cuts the person in
                all frames and `refuse_cut` is given.
        """
        watch = EdgeWatch(self._scanner).add if refuse_cut else None
        scan = self._scanner.scan(progress, watch=watch)
        if self._all_people is not None:
            scan = with_identities(self._all_people, self._scanner, scan, progress)
        if choose is not None:
            scan = scan._replace(choice=choose)
        followed = self._follow_person(scan)
        rows = followed.rows
        learned = self._scanner.segmenter.learned
        if not any(row["area"] for row in rows):
            raise NoPersonError(self._why_nobody(learned))
        doubt = verdict(followed.apart, self.how.name, learned=learned)
        if doubt is not None:
            doubt = replace(doubt, text=f"{self.video.path}: {doubt.text}")
        view = replace(
            followed.view,
            usable=np.array([row["usable"] for row in rows], dtype=bool),
            landmarks=_known_landmarks(followed.view),
            facings=_known_facings(followed.view, rows, self.video.fps),
            doubt="" if doubt is None else doubt.text,
            warnings=self._warnings(followed, doubt),
        )
        return Segmented(view, rows, doubt)

    def _why_nobody(self, learned: bool) -> str:
        """Return the message if no frame shows a person."""
        reason = f"; {DAMAGED.format(self._missing)}"
        if not self._missing:
            reason = advice(self.how.name, learned=learned)
        return (
            f"{self.video.path}: expected a person who moves in front of a still"
            f" background, got none in any frame{reason}"
        )

    def _warnings(self, followed: _Followed, doubt: Verdict | None) -> list[str]:
        """Return what a user should check before trusting the masks."""
        path = self.video.path
        warnings = [*self.video.warnings]
        if doubt is not None:
            warnings.append(doubt.text)
        if self._missing > MISSING * len(followed.view):
            warnings.append(f"{path}: {DAMAGED.format(self._missing)}")
        if followed.several:
            warnings.append(f"{path}: {followed.several}")
        if followed.view.moves:
            warnings.append(
                f"{path}: the camera seems to move, and silhouettes need a still one; "
                "expect poor masks"
            )
        return warnings

    @property
    def _missing(self) -> int:
        """How many frames the file states, but does not have."""
        return max(0, self.video.claimed - self.video.count())

    def _follow_person(self, scan: Scan) -> _Followed:
        """Return the person who is followed. The pixels of the others are unknown."""
        scale = 1.0 / self.video.scale
        parts, several = scan.people.chosen(
            scan.choice, lambda k: f"frame {self._scanner.start + k}", scale
        )
        if not several:
            return _Followed(scan.view, several, scan.largest, scan.largest)
        others = scan.people.others(parts)
        bits = empty_planes(len(scan.view), scan.view.size)
        known = empty_planes(len(scan.view), scan.view.size)
        for k in range(len(scan.blanks)):
            shown = scan.view.silhouette(k).valid
            mask, valid = planes_of(parts, others, k, shown)
            bits[k] = np.packbits(mask)
            known[k] = np.packbits(valid)
            release(bits, k)
            release(known, k)
        view = replace(scan.view, bits=bits, known=known)
        return _Followed(view, several, *rows_of(parts, scan.blanks))


def _known_landmarks(view: View) -> Array | None:
    """Return the landmarks of a view; None if none has a confidence."""
    landmarks = view.landmarks
    return landmarks if landmarks is not None and landmarks[..., 2].any() else None


def _known_facings(
    view: View, rows: Sequence[Mapping[str, Any]], fps: float
) -> Array | None:
    """Return the facings of a view, NaN for a person who is not on the spot.

    `rows` are those of quality.csv.
    """
    facings = view.facings
    # masks are decoded here, which a segmenter without facings does not need
    if facings is None or not np.isfinite(facings).any():
        return facings
    sides = [row["longer_side"] for row in rows]
    return facings_on_the_spot(facings, _middles(view), sides, fps)


def _middles(view: View) -> list[float]:
    """Return the middle column of each mask, in pixels; NaN if the mask is empty."""
    middles = list[float]()
    for mask in view.masks():
        columns = np.flatnonzero(mask) % view.size[0]
        middles.append(float(columns.mean()) if len(columns) else math.nan)
    return middles
