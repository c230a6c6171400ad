"""Signs of whether masks taken from video are a person's: of each frame, of the whole video, and between cameras.

The true mask is unknown. A frame's mask is compared with its picture, the pictures shortly before, and the background
that was learned, where there is one.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.footage.people import MIN_DETECTIONS, SLACK
from posefit.footage.views import MOST, Observations
from posefit.geometry.camera import Camera
from posefit.silhouette.foreground import SAMPLES, Image, Person
from posefit.silhouette.mask import Mask, Silhouette, box_of, padded_box

# of a frame
AREA_FRAMES = 15  # latest frames that a frame's area is compared with
# a frame whose area differs by more than this share from the latest is not usable
AREA_CHANGE = 0.5
# the area of a person's silhouette over the square of its longer side: 0.08 to 0.47 in 1,296 poses of the library,
# from any side
FILL = (0.07, 0.5)
# pixels of the longer side below which a person cannot be distinguished from noise
MIN_SIDE = 12
LAG = 0.1  # seconds between two pictures that are compared for motion
MOVING_LEVELS = 25  # grey levels by which a pixel that moved has changed
# of the person's longer side: motion is searched as far as that from the mask
MOTION_REACH = 0.5

# of a video
# needs no background: for a person who is always in the picture
PEOPLE_SEGMENTER = "mediapipe"
# more of what moves lies outside the masks, in half of the frames: they are not the
# person
UNEXPLAINED = 0.3
# changes of the longer side and the area from frame to frame that one in ten exceeds
TALLER = 0.15
LARGER = 0.25
GHOSTS = 0.1  # of the frames with masks of an empty place: worth a warning

# between cameras
# of the person's height: rays to the middles of masks that pass each other by more do
# not meet in a person
APART = 0.7
# times their height: what a person may seem, from above, crouching, or with the arms up
SHORT = 0.45
TALL = 1.9


class FrameQuality:
    """Compares the mask of one frame after the other with the pictures; its rows become quality.csv."""

    def __init__(
        self, fps: float, background: Image | None = None, *, still: bool = True
    ) -> None:
        """Where the background need not be `still`, what moves outside a mask does not count."""
        self._still = still
        self._edges = None if background is None else _edges(background)
        self._before: deque[tuple[Image, Mask]] = deque(maxlen=max(1, round(LAG * fps)))
        self._areas: deque[int] = deque(maxlen=AREA_FRAMES)
        self._sides: deque[int] = deque(maxlen=AREA_FRAMES)

    def row(self, image: Image, person: Person, frame: int) -> dict[str, Any]:
        """Return a frame's row: usable where the mask is whole, looks like a person and covers what moves.

        Its area must not be far from that of the frames before either, where they are like a person's.
        """
        side = max(cv2.boundingRect(person.mask.astype(np.uint8))[2:])
        outside = self._outside(image, person, side)
        ghost = self._is_ghost(image, person.mask)
        whole = person.area > 0 and not person.touches_border
        likely = (
            whole
            and side >= MIN_SIDE
            and FILL[0] <= person.area / side**2 <= FILL[1]
            and outside <= MOST
            and not ghost
        )
        typical = float(np.median(self._areas)) if self._areas else float(person.area)
        jitter = abs(person.area / typical - 1.0) if typical else 0.0
        if likely:
            self._areas.append(person.area)
        if whole:
            self._sides.append(side)
        self._before.append((image, person.mask))
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

    def _outside(self, image: Image, person: Person, side: int) -> float:
        """Return which share of the pixels that moved, at the person and around, lies outside the mask."""
        if not self._still or not self._before or not person.area:
            return 0.0
        earlier, mask = self._before[0]
        covered = person.mask | mask
        reach = max(side, *self._sides) if self._sides else side
        changed = changed_pixels(image, earlier) & person.valid
        moved, inside = moved_pixels(changed, covered, covered, reach, SLACK)
        outside = moved - inside
        return outside / moved if moved else 0.0

    def _is_ghost(self, image: Image, mask: Mask) -> bool:
        """Return whether the outline of a mask is an edge of the background rather than of the picture.

        There a person who was learned into the background has gone away.
        """
        if self._edges is None or not mask.any():
            return False
        box = padded_box(mask, 2)  # what is farther away changes no edge at the mask
        inner = (
            cv2.erode(mask[box].astype(np.uint8), np.ones((3, 3), dtype=np.uint8)) > 0
        )
        outline = mask[box] & ~inner
        now = _edges(image[box])[outline]
        before = self._edges[box][outline]
        return bool((before > now).sum() > (now > before).sum())


def changed_pixels(image: Image, earlier: Image) -> Mask:
    """Return which pixels (height, width) changed from one picture to another, but for single ones, which are noise."""
    levels = cv2.split(cv2.absdiff(image, earlier))
    changed = np.asarray(
        cv2.max(cv2.max(levels[0], levels[1]), levels[2]) > MOVING_LEVELS,
        dtype=np.uint8,
    )
    return np.asarray(cv2.medianBlur(changed, 5) > 0)


def moved_pixels(
    changed: Mask, region: Mask, body: Mask, reach: float, slack: float
) -> tuple[int, int]:
    """Return how many pixels changed in a region and around, and how many of them lie at the body.

    Around is as near as half of `reach`, the person's longer side in pixels, and at the body as near as `slack` of it.
    """
    (left, top, right, bottom), far = box_of(region), round(MOTION_REACH * reach)
    window = np.s_[max(0, top - far) : bottom + far, max(0, left - far) : right + far]
    width = 2 * max(1, round(slack * reach)) + 1
    near = (
        cv2.dilate(
            body[window].astype(np.uint8), np.ones((width, width), dtype=np.uint8)
        )
        > 0
    )
    return int(changed[window].sum()), int((changed[window] & near).sum())


def _edges(image: Image) -> NDArray[np.float32]:
    """Return how strong an edge is at each pixel (height, width), or next to it, in grey levels a pixel."""
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float32)
    across, down = (
        cv2.Sobel(grey, cv2.CV_32F, *way, scale=0.125) for way in ((1, 0), (0, 1))
    )
    return np.asarray(
        cv2.dilate(cv2.magnitude(across, down), np.ones((3, 3), dtype=np.uint8)),
        dtype=np.float32,
    )


@dataclass(frozen=True)
class Verdict:
    """What is wrong with the masks of a video, and whether that is too much to go on."""

    text: str
    refused: bool


def verdict(
    rows: Sequence[Mapping[str, Any]], method: str, *, learned: bool
) -> Verdict | None:
    """Return what is wrong with masks, by the rows of `FrameQuality`; None where nothing is.

    `learned`: the segmenter was given no picture of the empty scene. Masks are refused where much moves outside them
    and their size jumps, or where it jumps and few frames are usable or most masks are in pieces. Either alone may be
    another person, or clothes like the background, and is a warning.
    """
    whole = [row for row in rows if row["area"] and not row["touches_border"]]
    usable = sum(row["usable"] for row in whole)
    instead = advice(method, learned=learned)
    none = f"expected masks of a person, got none in any of {len(rows)} frames{instead}"
    cut = sum(bool(row["touches_border"]) for row in rows)
    if cut > MOST * len(rows):
        none = f"expected a person who is whole in the picture, got one at its edge in {cut} of {len(rows)} frames"
    if len(whole) < MIN_DETECTIONS:
        return None if usable else Verdict(none, True)
    outside = float(np.median([row["beside"] for row in whole]))
    pairs = [(a, b) for a, b in pairwise(whole) if b["frame"] == a["frame"] + 1]
    taller, larger = (_change(pairs, name) for name in ("longer_side", "area"))
    unsteady = taller > TALLER or larger > LARGER
    ghosts = float(np.mean([row["ghost"] for row in whole]))
    broken = float(np.mean([row["pieces"] > 1 for row in whole]))
    moves = f"{outside:.0%} of what moves"
    changes = f"change by {larger:.0%} from frame to frame"
    if outside > UNEXPLAINED and unsteady:
        where = (
            "the person seems to stand in the background"
            if learned
            else "the masks do not show the whole person"
        )
        text = f"{where}: {moves} lies outside the masks, and they {changes}"
        refused = True
    elif ghosts > GHOSTS:
        text = f"{ghosts:.0%} of the masks show a place that is empty now: the person was learned into the background"
        refused = ghosts > MOST
    elif not usable:
        return Verdict(none, True)
    elif unsteady:
        pieces = (
            f" and are in pieces in {broken:.0%} of the frames" if broken > MOST else ""
        )
        text = f"the masks {changes}{pieces}: parts of the person seem to be missing"
        refused = usable < MOST * len(whole) or broken > MOST
    elif outside > UNEXPLAINED:
        text = f"{moves} near the person lies outside the masks, which may miss parts of the person"
        refused = False
    else:
        return None
    return Verdict(f"{text}{instead}", refused)


def advice(method: str, *, learned: bool) -> str:
    """Return what to do instead of a segmenter, after a semicolon."""
    if method == PEOPLE_SEGMENTER:
        return "; --roi says where to look"
    empty = "give --background with an empty picture, or " if learned else ""
    return f"; {empty}--extraction {PEOPLE_SEGMENTER}"


def _change(
    pairs: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]], name: str
) -> float:
    """Return by which share a value changes from frame to frame in one frame of ten, or by more."""
    if not pairs:
        return 0.0
    return float(
        np.expm1(np.percentile([abs(np.log(b[name] / a[name])) for a, b in pairs], 90))
    )


def extent_of(silhouette: Silhouette) -> tuple[Array, float]:
    """Return the middle (2,) and the height in pixels of a silhouette's bounding box."""
    left, top, right, bottom = box_of(silhouette.mask)
    return 0.5 * np.array([left + right, top + bottom]), float(bottom - top)


def meeting(cameras: Sequence[Camera], middles: Sequence[Array]) -> tuple[Array, Array]:
    """Return where (3,) the rays of cameras through pixels (2,) meet best, and how far (n,) it is from each."""
    rays = [
        camera.rotation.T @ np.array([*((middle - camera.centre) / camera.focal), 1.0])
        for camera, middle in zip(cameras, middles, strict=True)
    ]
    across = [np.eye(3) - np.outer(ray, ray) / (ray @ ray) for ray in rays]
    positions = [camera.position for camera in cameras]
    place = np.linalg.lstsq(
        np.sum(across, axis=0),
        np.sum([a @ p for a, p in zip(across, positions, strict=True)], axis=0),
    )[0]
    return place, np.array(
        [
            np.linalg.norm(a @ (place - p))
            for a, p in zip(across, positions, strict=True)
        ]
    )


def apparent_sizes(
    observations: Observations, cameras: Sequence[Camera]
) -> tuple[float, Array] | None:
    """Return by how much the rays of cameras to the person miss each other, and how tall the person is in each view.

    Both are medians over frames, in the cameras' unit; None where no frame is usable in all views.
    """
    count = len(observations)
    each = [view.usable[:count] for view in observations.views]
    usable = np.flatnonzero(np.all(each, axis=0)).tolist()
    if not usable:
        return None
    misses = []
    heights = []
    for k in np.unique(np.linspace(0, len(usable) - 1, SAMPLES).astype(int)):
        silhouettes = observations[usable[k]].silhouettes
        extents = [extent_of(silhouette) for silhouette in silhouettes]
        miss, tall = apparent_size(cameras, extents)
        misses.append(miss)
        heights.append(tall)
    return float(np.median(misses)), np.asarray(np.median(heights, axis=0))


def apparent_size(
    cameras: Sequence[Camera], extents: Sequence[tuple[Array, float]]
) -> tuple[float, Array]:
    """Return by how much the rays of cameras to a person miss each other, and how tall the person is in each view.

    `extents` are the middle (2,) and the height of the person in each picture. What lies behind a camera has a height
    below 0.
    """
    place, away = meeting(cameras, [middle for middle, _ in extents])
    per_view = zip(cameras, extents, strict=True)
    heights = [
        tall * (camera.rotation @ place + camera.translation)[2] / camera.focal[1]
        for camera, (_, tall) in per_view
    ]
    return 2.0 * float(away.max()), np.array(heights)


def disagreement(miss: float, tall: Array, stature: float) -> str | None:
    """Return what is wrong between `apparent_sizes` and a person of a height, all in metres, if anything."""
    reasons = (
        "the masks show only parts of the person, or another one, "
        "or the calibrations are in another order or unit"
    )
    if miss > APART * stature:
        return f"expected cameras that see one person, got views that pass each other by {miss:.1f} m: {reasons}"
    wrong = np.flatnonzero((tall < SHORT * stature) | (tall > TALL * stature))
    if len(wrong):
        k = int(wrong[0])
        return f"expected a person of {stature:.2f} m, got masks {tall[k]:.2f} m tall in view {k + 1}: {reasons}"
    return None
