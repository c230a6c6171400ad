"""The people of a film: who is who from frame to frame, and which of them is followed.

A person goes on from frame to frame as they went, and keeps about their size and colours. Where people meet, a blob
shows several: what lies where one of them alone is expected is theirs, and the rest of it is unknown.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import NoPersonError
from posefit.footage.views import unpacked
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask, padded_box
from posefit.silhouette.pieces import RIVAL_AREA

MAX_STEP = 1.0  # times the height: farther from where they are expected a person is not
MAX_GAP_SECONDS = 1.0  # without a detection, after which a person is another one
MEMORY = 0.8  # of the last step, size and colours that is kept with each frame
# of where a person is expected: a blob that covers so much shows them, too
COVERED = 0.3
SLACK = 0.04  # of the height: so far around where they are expected people may be
AROUND = 0.3  # of the height: so far around where they are a network looks for a person
CLEARER = 2.0  # times as many pixels of a person as of any other show whose a mask is
MIN_DETECTIONS = 8  # frames of a person alone; what shows in fewer may be noise
COLOUR = 0.01  # what a grey level of another colour counts, in heights
AREA = 0.5  # what an area e times as large counts, in heights

Cut = tuple[tuple[slice, slice], NDArray[np.uint8]]  # a box of a mask, and its bits
# a person by their number, 1 the longest visible, or by a point of where they are when they come
Choice = int | tuple[float, float]
Persons = list[list["Tracklet"]]  # the parts of each person
Chooser = Callable[[Persons], int]  # returns the number of one of several


def cut_out(mask: Mask) -> Cut:
    """Return a mask's pixels as bits, no more than their box."""
    box = padded_box(mask, 0)
    return box, np.packbits(mask[box])


def paste(cut: Cut, mask: Mask) -> None:
    """Set the pixels in a mask that have been cut out of another."""
    box, bits = cut
    part = mask[box]
    part |= unpacked(bits, part.shape[::-1])


class _Blob:
    """What may be a person in a picture."""

    def __init__(self, mask: Mask, image: Image | None) -> None:
        self.mask = mask
        moments = cv2.moments(mask.astype(np.uint8), binaryImage=True)
        self.area = float(moments["m00"])
        self.place = np.array([moments["m10"], moments["m01"]]) / max(self.area, 1.0)
        rows = np.flatnonzero(mask.any(axis=1))
        self.height = float(np.ptp(rows)) + 1.0
        # blue, green and red of the upper half, and of the lower
        self.colours = np.zeros(6)
        if image is not None:
            middle = int(self.place[1])
            halves = (mask.copy(), mask.copy())
            halves[0][middle:], halves[1][:middle] = False, False
            self.colours = np.concatenate(
                [cv2.mean(image, half.astype(np.uint8))[:3] for half in halves]
            )


class Tracklet:
    """One person of a film, from where they are visible first until they are lost."""

    def __init__(self, blob: _Blob, frame: int) -> None:
        # by frame: their mask, and what is unknown of a blob
        self.detections: dict[int, tuple[Cut, Cut | None]] = {}
        self.rows: dict[int, dict[str, Any]] = {}  # by frame, of `FrameQuality`
        self.quality: Any = None
        # where they are visible first: frame, across and down
        self.first = (frame, *blob.place.tolist())
        # the latest blob that shows them alone, and its frame
        self.latest = blob
        self.last = frame
        self.alone = 0  # frames that show them alone
        # smoothed over these
        self.height = blob.height
        self.area = blob.area
        self.colours = blob.colours
        self._step = np.zeros(2)  # pixels a frame
        self._usable = 0

    def expected(self, frame: int) -> Array:
        """Return where (2,) their middle is expected."""
        return np.asarray(self.latest.place + (frame - self.last) * self._step)

    def distance(self, blob: _Blob, frame: int) -> float:
        """Return how far a blob is from what is expected, in heights; infinite where it is too far away."""
        away = float(np.linalg.norm(blob.place - self.expected(frame))) / self.height
        colour = float(np.abs(blob.colours - self.colours).mean())
        if away > MAX_STEP:
            return np.inf
        size = float(abs(np.log(blob.area / self.area)))
        return away + COLOUR * colour + AREA * size

    def outline(self, frame: int) -> Mask:
        """Return where they are expected, and a little around."""
        (across, down), width = (
            self.expected(frame) - self.latest.place,
            2 * round(SLACK * self.height) + 1,
        )
        shift = np.array([[1.0, 0.0, across], [0.0, 1.0, down]])
        mask = self.latest.mask.astype(np.uint8)
        moved = cv2.warpAffine(mask, shift, mask.shape[::-1], flags=cv2.INTER_NEAREST)
        return cv2.dilate(moved, np.ones((width, width), dtype=np.uint8)) > 0

    def update(self, blob: _Blob, frame: int) -> None:
        """Take a blob that shows them alone."""
        if frame > self.last:
            step = (blob.place - self.latest.place) / (frame - self.last)
            share = MEMORY if self.alone > 1 else 0.0
            self._step = share * self._step + (1.0 - share) * step
            for name in ("area", "colours", "height"):
                setattr(
                    self,
                    name,
                    MEMORY * getattr(self, name) + (1.0 - MEMORY) * getattr(blob, name),
                )
        self.alone = self.alone + 1
        self.last = frame
        self.latest = blob
        self.detections[frame] = cut_out(blob.mask), None

    def confirmed(self, least: float = MIN_DETECTIONS) -> bool:
        """Return whether they are visible so often, and as a person, that they are no noise."""
        frames = self._usable if self.rows else self.alone
        return frames >= min(MIN_DETECTIONS, least)

    def add_row(self, frame: int, row: dict[str, Any]) -> None:
        """Take the row of `FrameQuality` of a frame."""
        self.rows[frame], self._usable = row, self._usable + row["usable"]

    @property
    def score(self) -> float:
        """How long and steadily they are visible, times their height: 0 where they are never usable."""
        return (self._usable if self.rows else self.alone) * self.height


class People:
    """Who is who in the frames of a film, which come one after the other."""

    def __init__(self, fps: float) -> None:
        self.tracklets: list[Tracklet] = []
        self.active: list[Tracklet] = []  # those who may be in the next frame
        self._frame = -1
        self._patience = MAX_GAP_SECONDS * fps

    def add(self, masks: Sequence[Mask], image: Image | None = None) -> list[Tracklet]:
        """Return who is in the next frame, of which the blobs (height, width) are the largest first."""
        self._frame += 1
        frame = self._frame
        blobs = [_Blob(mask, image) for mask in masks]
        active = []
        for tracklet in self.active:
            if frame - max(tracklet.detections) <= self._patience:
                active.append(tracklet)
            else:
                # only the next frame would need them, and memory would grow with noise
                tracklet.latest.mask = np.empty((0, 0), dtype=bool)
                tracklet.quality = None
        owners = _owners(active, blobs, frame)
        confirmed = [
            tracklet
            for tracklet in active
            if tracklet.confirmed() and tracklet not in owners.values()
        ]
        outlines = [tracklet.outline(frame) for tracklet in confirmed] if blobs else []
        present = []
        for k, blob in enumerate(blobs):
            hidden = [
                tracklet
                for tracklet, outline in zip(confirmed, outlines, strict=True)
                if tracklet.area >= RIVAL_AREA * blob.area
                and (outline & blob.mask).sum() > COVERED * outline.sum()
            ]
            owner = owners.get(k)
            if owner is None and not hidden:
                owner = Tracklet(blob, frame)
                self.tracklets.append(owner)
                active.append(owner)
            if owner is not None and not hidden:
                owner.update(blob, frame)
                present.append(owner)
            else:
                group = hidden if owner is None else [*hidden, owner]
                _share(blob, group, frame)
                present += group
        self.active = active
        return present

    def persons(self) -> Persons:
        """Return the people, the longest and steadiest first: those parts of each that follow each other in time."""
        persons = Persons()
        least = 0.5 * (self._frame + 1)
        for tracklet in sorted(
            self.tracklets, key=lambda tracklet: tracklet.score, reverse=True
        ):
            apart = [
                person
                for person in persons
                if not any(
                    tracklet.detections.keys() & part.detections.keys()
                    for part in person
                )
            ]
            if apart and tracklet.confirmed(least):
                min(
                    apart,
                    key=lambda person: min(
                        _distance(tracklet, part) for part in person
                    ),
                ).append(tracklet)
            else:
                persons.append([tracklet])
        scores = [sum(part.score for part in person) for person in persons]
        confirmed = [
            k
            for k, person in enumerate(persons)
            if any(part.confirmed(least) for part in person)
        ]
        if not confirmed:  # whatever there is
            return [[part for person in persons for part in person]] if persons else []
        return [persons[k] for k in sorted(confirmed, key=lambda k: -scores[k])]

    def others(self, parts: Sequence[Tracklet]) -> list[Tracklet]:
        """Return the parts of all people but those of one."""
        return [
            part for person in self.persons() for part in person if part not in parts
        ]

    def chosen(
        self,
        choice: Choice | Chooser | None,
        name: Callable[[int], str],
        scale: float = 1.0,
    ) -> tuple[list[Tracklet], str]:
        """Return the parts of the person who is followed, and what there is to say where there are several.

        `name` names a frame; places in `choice` and in words are `scale` times as large as in masks. Raises
        NoPersonError where nobody has the number.
        """
        persons = self.persons()
        if not persons:
            return [], ""
        # of the part that shows them best: the others may be noise
        where = [person[0].first for person in persons]
        number = 1
        other = "--person N another"
        if callable(choice):
            number = choice(persons)
            other = "as by the first camera"
        elif isinstance(choice, int):
            number = choice
        elif choice is not None:
            away = [
                np.hypot(scale * across - choice[0], scale * down - choice[1])
                for _, across, down in where
            ]
            number = 1 + int(np.argmin(away))
        if not 1 <= number <= len(persons):
            raise NoPersonError(
                f"person must be 1 to {len(persons)}, as many people as there are, got {number}"
            )
        if len(persons) == 1:
            return persons[0], ""
        spots = [
            f"{scale * across:.0f},{scale * down:.0f} in {name(frame)}"
            for frame, across, down in where
        ]
        listed = "; ".join(f"{k} at {spot}" for k, spot in enumerate(spots, 1))
        words = f"{len(persons)} people: {listed}; person {number} is followed, {other}"
        return persons[number - 1], words


def _owners(
    tracklets: Sequence[Tracklet], blobs: Sequence[_Blob], frame: int
) -> dict[int, Tracklet]:
    """Return whose each blob is, by its number, so that all are as near as possible to where they are expected."""
    if not tracklets or not blobs:
        return {}
    distances = np.array(
        [[tracklet.distance(blob, frame) for blob in blobs] for tracklet in tracklets]
    )
    if 1 in distances.shape:
        pairs = [divmod(int(distances.argmin()), len(blobs))]
    else:
        # takes a third of a second to import
        from scipy.optimize import linear_sum_assignment

        rows, columns = linear_sum_assignment(np.minimum(distances, 1e6))
        pairs = list(zip(rows.tolist(), columns.tolist(), strict=True))
    return {
        column: tracklets[row]
        for row, column in pairs
        if np.isfinite(distances[row, column])
    }


def _distance(tracklet: Tracklet, other: Tracklet) -> float:
    """Return how far two parts of a film are from being one person's, in heights."""
    first, second = sorted((tracklet, other), key=lambda part: min(part.detections))
    start = min(second.detections)
    _, *place = second.first
    colour = float(np.abs(first.colours - second.colours).mean())
    away = float(np.linalg.norm(np.array(place) - first.latest.place)) / first.height
    size = float(abs(np.log(second.area / first.area)))
    return (
        COLOUR * colour + AREA * size + away / (1.0 + max(0, start - first.last) / 30.0)
    )


def _share(blob: _Blob, group: Sequence[Tracklet], frame: int) -> None:
    """Give each of a group in a blob what lies where they alone are expected; the rest of it is unknown."""
    outlines = [tracklet.outline(frame) for tracklet in group]
    count = np.sum(outlines, axis=0)
    for tracklet, outline in zip(group, outlines, strict=True):
        clear = blob.mask & outline & (count == 1)
        tracklet.detections[frame] = cut_out(clear), cut_out(blob.mask & ~clear)


def part_at(parts: Sequence[Tracklet], frame: int) -> Tracklet | None:
    """Return the part of a person that a frame shows; of several, which are noise, that of the largest box."""
    shown = [part for part in parts if frame in part.detections]
    return max(shown, key=lambda part: part.detections[frame][0][1].size, default=None)


def rows_of(
    parts: Sequence[Tracklet], blanks: Sequence[dict[str, Any]]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the rows of a person in all frames, and in those that do not show others before or behind them.

    `blanks` are the rows of frames that do not show the person.
    """
    rows = list[dict[str, Any]]()
    apart = list[dict[str, Any]]()
    for k, blank in enumerate(blanks):
        part = part_at(parts, k)
        rows.append(blank if part is None else part.rows[k])
        if part is None or part.detections[k][1] is None:
            apart.append(rows[-1])
    return rows, apart


def person_indices(persons: Persons, masks: Iterable[Mask]) -> list[int | None]:
    """Return the index of the person in the mask of each frame; for a mask beside everyone, that of the mask before.

    None where a mask is empty, covers more than half as much of another, or is beside everyone while the person before
    is elsewhere; and everywhere if all masks are, or if most cover several people, who are parts of one then.
    """
    beside = -1
    result = list[int | None]()
    several = list[bool]()
    for k, mask in enumerate(masks):
        present = [part_at(parts, k) for parts in persons]
        pixels = [
            (0, 0) if part is None else _common(part.detections[k][0], mask)
            for part in present
        ]
        areas, shares = np.array(pixels).T
        *_, second, most = sorted(shares)
        clear = mask.any() and most >= CLEARER * second
        result.append((int(shares.argmax()) if most else beside) if clear else None)
        if mask.any() and (areas > 0).sum() > 1:
            several.append((2 * shares > areas).sum() > 1)
    latest = next((index for index in result if index not in (None, beside)), None)
    if latest is None or (several and np.mean(several) > 0.5):
        return [None] * len(result)
    for k, index in enumerate(result):
        if index == beside:
            result[k] = None if part_at(persons[latest], k) else latest
        elif index is not None:
            latest = index
    return result


def _common(cut: Cut, mask: Mask) -> tuple[int, int]:
    """Return how many pixels a mask has that has been cut out, and how many of them are another's, too."""
    box, bits = cut
    part = mask[box]
    own = unpacked(bits, part.shape[::-1])
    return int(own.sum()), int((part & own).sum())


def replace_detection(
    parts: Sequence[Tracklet], frame: int, mask: Mask, row: dict[str, Any]
) -> None:
    """Give a person another mask, and its row of `FrameQuality`, in a frame."""
    part = part_at(parts, frame) or parts[0]
    _, hidden = part.detections.get(frame, (None, None))
    part.detections[frame], part.rows[frame] = (cut_out(mask), hidden), row


def excluded_mask(
    parts: Sequence[Tracklet],
    others: Sequence[Tracklet],
    frame: int,
    size: tuple[int, int],
) -> Mask:
    """Return where one of several people surely is not in a frame of a size: where the others are, and far away."""
    mask, own = (np.zeros(size[::-1], dtype=bool) for _ in range(2))
    for other in others:
        if frame in other.detections:
            paste(other.detections[frame][0], mask)
    width = 2 * round(SLACK * max((other.height for other in others), default=0.0)) + 1
    mask = (
        cv2.dilate(mask.astype(np.uint8), np.ones((width, width), dtype=np.uint8)) > 0
    )
    if (part := part_at(parts, frame)) is not None:
        for cut in part.detections[frame]:
            if cut is not None:
                paste(cut, own)
        mask &= ~own
        near = np.zeros_like(mask)
        near[padded_box(own, round(AROUND * part.height))] = True
        mask |= ~near
    return mask


def planes_of(
    parts: Sequence[Tracklet], others: Sequence[Tracklet], frame: int, known: Mask
) -> tuple[Mask, Mask]:
    """Return the mask of a person in a frame, and which pixels are known: none of the others', or of those before them.

    `known` are those that the picture shows.
    """
    mask = np.zeros_like(known)
    unknown = np.zeros_like(known)
    if (part := part_at(parts, frame)) is not None:
        shown, hidden = part.detections[frame]
        paste(shown, mask)
        if hidden is not None:
            paste(hidden, unknown)
    for other in others:
        if frame in other.detections:
            paste(other.detections[frame][0], unknown)
    return mask, (known | mask) & ~(unknown & ~mask)
