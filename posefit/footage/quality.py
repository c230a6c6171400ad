"""Judge whether segmented masks show a person: per frame, and per video.

The true mask is unknown. So a frame's mask is compared with its picture, with earlier
pictures, and with the learned background if the segmenter has one.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.footage.people import MIN_DETECTIONS, OUTLINE_SLACK
from posefit.footage.views import MOST
from posefit.silhouette.foreground import Image, Person
from posefit.silhouette.mask import Mask, box_of, padded_box

# per frame
AREA_FRAMES = 15  # number of earlier frames that a frame's area is compared with
# share by which a usable frame's area may differ from the earlier ones
AREA_CHANGE = 0.5
# area of a silhouette over the square of its longer side. In 1,296 poses of the
# library, seen from all sides, it is 0.08 to 0.47
FILL_RANGE = (0.07, 0.5)
# pixels: a silhouette with a shorter longer side could be noise
MIN_SIDE = 12
LAG_SECONDS = 0.1  # seconds between two pictures that are compared for motion
MOVING_LEVELS = 25  # grey levels by which a pixel changes if something moved
# share of the person's longer side: how far from the mask motion is searched
MOTION_REACH = 0.5

# per video
# the segmenter that needs no background, for a person who is always in the picture
PEOPLE_SEGMENTER = "mediapipe"
# share of the moving pixels outside the masks, as a median over frames: above it, the
# masks do not show the person
UNEXPLAINED_SHARE = 0.3
# shares by which the longer side and the area change from frame to frame: the masks are
# unsteady if more than one frame in ten changes more
UNSTEADY_SIDE = 0.15
UNSTEADY_AREA = 0.25
CHANGE_PERCENTILE = 90
# share of the frames whose masks show an empty place: with more, the user is warned
GHOST_SHARE = 0.1


class Changes:
    """Which pixels changed between two frames, found once for all people in them."""

    def __init__(self) -> None:
        self._frames: tuple[int, int] | None = None  # the latest pair
        self._changed: Mask | None = None

    def between(self, earlier: tuple[int, Image], now: tuple[int, Image]) -> Mask:
        """Return `changed_pixels` of two frames, given by their numbers and pictures.

        A number must always have the same picture.
        """
        frames = earlier[0], now[0]
        if self._changed is None or frames != self._frames:
            self._changed = changed_pixels(now[1], earlier[1])
            self._frames = frames
        return self._changed


class FrameQuality:
    """Compares masks with their pictures. Its rows become quality.csv."""

    def __init__(
        self, fps: float, background: Image | None = None, *, still: bool = True
    ) -> None:
        """Start with the first frame.

        Args:
            fps: Frames per second.
            background: The learned picture of the empty scene, if there is one.
            still: Whether the background must be still. If not, motion outside a mask
                is not counted.
        """
        self._still = still
        self._edges = None if background is None else _edges(background)
        self._changes = Changes()
        lag = max(1, round(LAG_SECONDS * fps))
        self._before: deque[tuple[int, Image, Mask]] = deque(maxlen=lag)
        self._areas: deque[int] = deque(maxlen=AREA_FRAMES)
        self._sides: deque[int] = deque(maxlen=AREA_FRAMES)

    def duplicate(self) -> Self:
        """Return the same comparison, to continue with another person's masks."""
        other = copy(self)
        other._before = self._before.copy()
        other._areas = self._areas.copy()
        other._sides = self._sides.copy()
        return other

    def row(self, image: Image, person: Person, frame: int) -> dict[str, Any]:
        """Return the row of quality.csv for the next frame.

        The frame is usable if its mask is whole, has the shape of a person, covers what
        moves, and has about the area of earlier masks that may be a person.
        """
        side = max(cv2.boundingRect(person.mask.astype(np.uint8))[2:])
        outside = self._outside(frame, image, person, side)
        ghost = self._is_ghost(image, person.mask)
        whole = person.area > 0 and not person.touches_border
        likely = (
            whole
            and side >= MIN_SIDE
            and FILL_RANGE[0] <= person.area / side**2 <= FILL_RANGE[1]
            and outside <= MOST
            and not ghost
        )
        typical = float(np.median(self._areas)) if self._areas else float(person.area)
        jitter = abs(person.area / typical - 1.0) if typical else 0.0
        # other masks would shift the area that the next ones are compared with
        if likely:
            self._areas.append(person.area)
        if whole:
            self._sides.append(side)
        self._before.append((frame, image, person.mask))
        return {
            "frame": frame,
            "area": person.area,
            "longer_side": side,
            "jitter": round(jitter, 4),
            "pieces": person.pieces,
            "rival": round(person.rival, 4),
            "touches_border": int(person.touches_border),
            "beside": round(outside, 4),
            "ghost": int(ghost),
            "usable": int(likely and jitter <= AREA_CHANGE),
        }

    def _outside(self, frame: int, image: Image, person: Person, side: int) -> float:
        """Return the share of the moving pixels near the person outside the mask."""
        if not self._still or not self._before or not person.area:
            return 0.0
        number, before, mask = self._before[0]
        covered = person.mask | mask
        reach = max(side, *self._sides) if self._sides else side
        changed = self._changes.between((number, before), (frame, image))
        changed = changed & person.valid
        moved, inside = moved_pixels(changed, covered, covered, reach, OUTLINE_SLACK)
        outside = moved - inside
        return outside / moved if moved else 0.0

    def _is_ghost(self, image: Image, mask: Mask) -> bool:
        """Return whether a mask's outline is an edge in the background only.

        Such a mask shows an empty place: the background was learned while the person
        stood there.
        """
        if self._edges is None or not mask.any():
            return False
        # edges at the mask depend on no pixel farther away
        box = padded_box(mask, 2)
        kernel = np.ones((3, 3), dtype=np.uint8)
        inner = cv2.erode(mask[box].astype(np.uint8), kernel) > 0
        outline = mask[box] & ~inner
        now = _edges(image[box])[outline]
        before = self._edges[box][outline]
        return bool((before > now).sum() > (now > before).sum())


def changed_pixels(image: Image, earlier: Image) -> Mask:
    """Return which pixels (height, width) changed between two pictures, denoised."""
    blue, green, red = cv2.split(cv2.absdiff(image, earlier))
    largest = cv2.max(cv2.max(blue, green), red)
    changed = np.asarray(largest > MOVING_LEVELS, dtype=np.uint8)
    # single pixels are noise
    return np.asarray(cv2.medianBlur(changed, 5) > 0)


def moved_pixels(
    changed: Mask, region: Mask, body: Mask, reach: float, slack: float
) -> tuple[int, int]:
    """Return how many pixels changed near a region, and how many of them at the body.

    Args:
        changed: Which pixels changed.
        region: Where the person is or was.
        body: The pixels of the body.
        reach: The person's longer side in pixels. Pixels up to `MOTION_REACH` of it
            around the region are counted.
        slack: Share of `reach` up to which a pixel is at the body.
    """
    left, top, right, bottom = box_of(region)
    far = round(MOTION_REACH * reach)
    window = np.s_[max(0, top - far) : bottom + far, max(0, left - far) : right + far]
    width = 2 * max(1, round(slack * reach)) + 1
    kernel = np.ones((width, width), dtype=np.uint8)
    near = cv2.dilate(body[window].astype(np.uint8), kernel) > 0
    return int(changed[window].sum()), int((changed[window] & near).sum())


# the weights of a 3 x 3 Sobel filter add up to 8 grey levels per pixel
SOBEL_SCALE = 1.0 / 8.0


def _edges(image: Image) -> NDArray[np.float32]:
    """Return the strongest edge within one pixel of each (height, width).

    It is in grey levels per pixel.
    """
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float32)
    across = cv2.Sobel(grey, cv2.CV_32F, 1, 0, scale=SOBEL_SCALE)
    down = cv2.Sobel(grey, cv2.CV_32F, 0, 1, scale=SOBEL_SCALE)
    kernel = np.ones((3, 3), dtype=np.uint8)
    strongest = cv2.dilate(cv2.magnitude(across, down), kernel)
    return np.asarray(strongest, dtype=np.float32)


@dataclass(frozen=True)
class Verdict:
    """What is wrong with the masks of a video."""

    text: str
    refused: bool  # whether tracking them makes no sense


def verdict(
    rows: Sequence[Mapping[str, Any]], method: str, *, learned: bool
) -> Verdict | None:
    """Return what is wrong with the masks of a video; None if nothing is.

    Masks are refused if their size jumps and, in addition, much moves outside them, few
    frames are usable, or most masks are in pieces. Motion outside the masks alone may
    be another person, and a jumping size alone may be clothes that look like the
    background, so that either is only a warning.

    Args:
        rows: The rows of `FrameQuality`.
        method: Name of the segmenter.
        learned: Whether the segmenter learned the background from the video itself, and
            not from a picture of the empty scene.
    """
    instead = advice(method, learned=learned)

    def poor(text: str, refused: bool) -> Verdict:
        return Verdict(f"{text}{instead}", refused)

    whole = [row for row in rows if row["area"] and not row["touches_border"]]
    usable = sum(row["usable"] for row in whole)
    nobody = poor(
        f"expected masks of a person, got none in any of {len(rows)} frames", True
    )
    cut = sum(bool(row["touches_border"]) for row in rows)
    if cut > MOST * len(rows):
        nobody = Verdict(at_edge(cut, len(rows)), True)
    if len(whole) < MIN_DETECTIONS:
        return None if usable else nobody

    signs = _Signs.of(whole)
    changes = f"change by {signs.area_change:.0%} from frame to frame"
    moves = f"{signs.outside:.0%} of what moves"
    if signs.is_unexplained and signs.is_unsteady:
        where = "the masks do not show the whole person"
        if learned:
            where = "the person seems to stand in the background"
        return poor(
            f"{where}: {moves} lies outside the masks, and they {changes}", True
        )
    if signs.ghosts > GHOST_SHARE:
        empty = f"{signs.ghosts:.0%} of the masks show a place that is empty now"
        return poor(
            f"{empty}: the person was learned into the background", signs.ghosts > MOST
        )
    if not usable:
        return nobody
    if signs.is_unsteady:
        pieces = ""
        if signs.broken > MOST:
            pieces = f" and are in pieces in {signs.broken:.0%} of the frames"
        return poor(
            f"the masks {changes}{pieces}: parts of the person seem to be missing",
            usable < MOST * len(whole) or signs.broken > MOST,
        )
    if signs.is_unexplained:
        return poor(
            f"{moves} near the person lies outside the masks, which may miss parts of "
            "the person",
            False,
        )
    return None


class _Signs(NamedTuple):
    """What counts against the masks of a video. All are shares."""

    outside: float  # of the moving pixels, outside the masks; the median over frames
    side_change: float  # see `_change`
    area_change: float
    ghosts: float  # of the frames, with a mask that shows an empty place
    broken: float  # of the frames, with a mask in pieces

    @classmethod
    def of(cls, rows: Sequence[Mapping[str, Any]]) -> Self:
        """Return the signs of the rows of `FrameQuality` of whole people."""
        pairs = [(a, b) for a, b in pairwise(rows) if b["frame"] == a["frame"] + 1]
        return cls(
            outside=float(np.median([row["beside"] for row in rows])),
            side_change=_change(pairs, "longer_side"),
            area_change=_change(pairs, "area"),
            ghosts=float(np.mean([row["ghost"] for row in rows])),
            broken=float(np.mean([row["pieces"] > 1 for row in rows])),
        )

    @property
    def is_unexplained(self) -> bool:
        """Whether much moves outside the masks."""
        return self.outside > UNEXPLAINED_SHARE

    @property
    def is_unsteady(self) -> bool:
        """Whether the size of the masks jumps."""
        return self.side_change > UNSTEADY_SIDE or self.area_change > UNSTEADY_AREA


def at_edge(cut: int, count: int) -> str:
    """Return the message that a film's border cuts the person in `cut` frames.

    `count` frames were looked at.
    """
    return (
        "expected a person who is whole in the picture, got one cut by the edge in "
        f"{cut} of {count} frames"
    )


def advice(method: str, *, learned: bool) -> str:
    """Return what a user may try instead of a segmenter, starting with a semicolon."""
    if method == PEOPLE_SEGMENTER:
        return "; --roi says where to look"
    empty = "give --background with an empty picture, or " if learned else ""
    return f"; {empty}--extraction {PEOPLE_SEGMENTER}"


def _change(
    pairs: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]], name: str
) -> float:
    """Return the share by which a value changes from frame to frame.

    One frame in ten changes by this share or more.
    """
    if not pairs:
        return 0.0
    ratios = [abs(np.log(after[name] / before[name])) for before, after in pairs]
    return float(np.expm1(np.percentile(ratios, CHANGE_PERCENTILE)))
