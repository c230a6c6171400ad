"""Tell the people in a film apart from frame to frame, and choose one to follow.

A blob is a region of one frame. A tracklet is a person in successive frames, until they
are lost. A person who is found again has several tracklets, their parts.

A person is expected to keep their velocity, and about their size and colours. If people
meet, one blob shows several of them. Pixels where only one person is expected belong to
that person, and the rest of the blob is unknown.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import NoPersonError
from posefit.footage.choice import Choice
from posefit.footage.views import unpacked
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask, padded_box
from posefit.silhouette.pieces import RIVAL_AREA

# times the height: a person is at most this far from where they are expected
MAX_STEP = 1.0
MAX_GAP_SECONDS = 1.0  # a person who is hidden for longer counts as another one
# share of the last step, size and colours that is kept with each frame
MEMORY_SHARE = 0.8
# share of a person's expected outline: a blob that covers more of it shows the person
COVERED_SHARE = 0.3
# share of the height by which a person may be off their expected outline
OUTLINE_SLACK = 0.04
# share of the height around a person in which a network looks for them
SEARCH_REACH = 0.3
# a mask is a person's if it has this many times as many pixels of them as of any other
CLEAR_FACTOR = 2.0
MIN_DETECTIONS = 8  # frames that show a person alone; fewer may be noise
# heights: the distance that one grey level of different colour adds
COLOUR_DISTANCE = 0.01
AREA_DISTANCE = 0.5  # heights: the distance added by an area larger by the factor e
HALVING_SECONDS = 1.0  # a gap of this many seconds halves the weight of a distance
UNREACHABLE = 1e6  # heights: replaces infinity, which the assignment does not accept


class Patch(NamedTuple):
    """The pixels of a mask: its box, and the bits in it."""

    box: tuple[slice, slice]
    bits: NDArray[np.uint8]


class Detection(NamedTuple):
    """What a frame shows of a person."""

    shown: Patch  # the person's mask
    hidden: (
        Patch | None
    )  # unknown pixels, where others are too; None for a person alone


# the parts of each person: a person who was lost and found again has several tracklets
Persons = list[list["Tracklet"]]
Chooser = Callable[[Persons], int]  # returns the number of one of several people


def patch_of(mask: Mask) -> Patch:
    """Return the patch of a mask: the bits in its bounding box."""
    box = padded_box(mask, 0)
    return Patch(box, np.packbits(mask[box]))


def paste(patch: Patch, mask: Mask) -> None:
    """Set the pixels of a patch in a mask, in place."""
    inside = mask[patch.box]
    inside |= unpacked(patch.bits, inside.shape[::-1])


class _Blob:
    """A region of a picture that may be a person."""

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
            upper = mask.copy()
            upper[middle:] = False
            lower = mask.copy()
            lower[:middle] = False
            halves = [
                cv2.mean(image, half.astype(np.uint8))[:3] for half in (upper, lower)
            ]
            self.colours = np.concatenate(halves)


class Tracklet:
    """A person in successive frames, from when they appear until they are lost."""

    def __init__(self, blob: _Blob, frame: int) -> None:
        self.detections: dict[int, Detection] = {}  # by frame
        self.rows: dict[int, dict[str, Any]] = {}  # by frame, of `FrameQuality`
        # where they appear: frame, column and row
        self.first = (frame, *blob.place.tolist())
        # the latest blob that shows them alone, and its frame
        self.latest = blob
        self.last = frame
        self.alone = 0  # number of frames that show them alone
        # these are smoothed over the frames that show them alone
        self.height = blob.height
        self.area = blob.area
        self.colours = blob.colours
        self._step = np.zeros(2)  # pixels per frame
        self._usable = 0  # number of usable rows

    def expected(self, frame: int) -> Array:
        """Return where (2,) the middle of the person is expected."""
        return np.asarray(self.latest.place + (frame - self.last) * self._step)

    def distance(self, blob: _Blob, frame: int) -> float:
        """Return how unlike the person a blob is, in heights; infinite if too far."""
        away = float(np.linalg.norm(blob.place - self.expected(frame))) / self.height
        colour = float(np.abs(blob.colours - self.colours).mean())
        if away > MAX_STEP:
            return np.inf
        size = float(abs(np.log(blob.area / self.area)))
        return away + COLOUR_DISTANCE * colour + AREA_DISTANCE * size

    def outline(self, frame: int) -> Mask:
        """Return the mask where the person is expected, widened by `OUTLINE_SLACK`."""
        across, down = self.expected(frame) - self.latest.place
        shift = np.array([[1.0, 0.0, across], [0.0, 1.0, down]])
        mask = self.latest.mask.astype(np.uint8)
        moved = cv2.warpAffine(mask, shift, mask.shape[::-1], flags=cv2.INTER_NEAREST)
        return _widened(moved, self.height)

    def update(self, blob: _Blob, frame: int) -> None:
        """Add a blob that shows the person alone."""
        if frame > self.last:
            step = (blob.place - self.latest.place) / (frame - self.last)
            # the first step has no earlier one to be smoothed with
            share = MEMORY_SHARE if self.alone > 1 else 0.0
            self._step = share * self._step + (1.0 - share) * step
            self.area = MEMORY_SHARE * self.area + (1.0 - MEMORY_SHARE) * blob.area
            self.colours = (
                MEMORY_SHARE * self.colours + (1.0 - MEMORY_SHARE) * blob.colours
            )
            self.height = (
                MEMORY_SHARE * self.height + (1.0 - MEMORY_SHARE) * blob.height
            )
        self.alone += 1
        self.last = frame
        self.latest = blob
        self.detections[frame] = Detection(patch_of(blob.mask), None)

    def end(self) -> None:
        """Free what only later frames need, or memory would grow with noise."""
        self.latest.mask = np.empty((0, 0), dtype=bool)

    def confirmed(self, least: float = MIN_DETECTIONS) -> bool:
        """Return whether the person is visible in enough frames not to be noise."""
        return self._frames >= min(MIN_DETECTIONS, least)

    def add_row(self, frame: int, row: dict[str, Any]) -> None:
        """Add the row of `FrameQuality` of a frame."""
        self.rows[frame] = row
        self._usable += row["usable"]

    @property
    def _frames(self) -> int:
        """How many frames show the person; if judged, only usable ones count."""
        return self._usable if self.rows else self.alone

    @property
    def score(self) -> float:
        """How many frames show the person, times their height."""
        return self._frames * self.height


class People:
    """Tells the people in a film apart, frame after frame."""

    def __init__(self, fps: float) -> None:
        self.tracklets: list[Tracklet] = []
        self.active: list[Tracklet] = []  # people who may be in the next frame
        self._frame = -1
        self._fps = fps

    def add(self, masks: Sequence[Mask], image: Image | None = None) -> list[Tracklet]:
        """Return who is in the next frame.

        Args:
            masks: (height, width) of each blob in the frame, the largest first.
            image: The picture, whose colours tell people apart.
        """
        self._frame += 1
        frame = self._frame
        blobs = [_Blob(mask, image) for mask in masks]
        self._end_lost(frame)
        owners = _owners(self.active, blobs, frame)
        outlines = self._hidden_outlines(owners, frame) if blobs else []
        present = []
        for k, blob in enumerate(blobs):
            # people without a blob who are probably in this one
            hidden = list[Tracklet]()
            for tracklet, outline in outlines:
                is_large = tracklet.area >= RIVAL_AREA * blob.area
                covered = (outline & blob.mask).sum()
                if is_large and covered > COVERED_SHARE * outline.sum():
                    hidden.append(tracklet)
            owner = owners.get(k)
            if owner is None and not hidden:
                owner = Tracklet(blob, frame)
                self.tracklets.append(owner)
                self.active.append(owner)
            if owner is not None and not hidden:
                owner.update(blob, frame)
                present.append(owner)
            else:
                group = hidden if owner is None else [*hidden, owner]
                _share(blob, group, frame)
                present += group
        return present

    def _end_lost(self, frame: int) -> None:
        """Stop expecting people who are hidden for more than `MAX_GAP_SECONDS`."""
        active = list[Tracklet]()
        for tracklet in self.active:
            if frame - max(tracklet.detections) <= MAX_GAP_SECONDS * self._fps:
                active.append(tracklet)
            else:
                tracklet.end()
        self.active = active

    def _hidden_outlines(
        self, owners: Mapping[int, Tracklet], frame: int
    ) -> list[tuple[Tracklet, Mask]]:
        """Return the people without a blob, and the mask where each is expected."""
        hidden = list[tuple[Tracklet, Mask]]()
        for tracklet in self.active:
            if tracklet.confirmed() and tracklet not in owners.values():
                hidden.append((tracklet, tracklet.outline(frame)))
        return hidden

    def persons(self) -> Persons:
        """Return the people, the longest visible first.

        A person who was lost and found again has several parts, which are never in one
        frame.
        """
        persons = Persons()
        # in a short film fewer frames are enough
        least = 0.5 * (self._frame + 1)
        by_score = sorted(self.tracklets, key=lambda part: part.score, reverse=True)
        for tracklet in by_score:
            apart = [person for person in persons if _are_apart(tracklet, person)]
            if apart and tracklet.confirmed(least):
                distances = [
                    min(_distance(tracklet, part, self._fps) for part in person)
                    for person in apart
                ]
                apart[distances.index(min(distances))].append(tracklet)
            else:
                persons.append([tracklet])
        confirmed = Persons()
        for person in persons:
            if any(part.confirmed(least) for part in person):
                confirmed.append(person)
        if not confirmed:
            # all of them may be noise, so they count as one person
            return [[part for person in persons for part in person]] if persons else []
        return sorted(confirmed, key=_score, reverse=True)

    def others(self, parts: Sequence[Tracklet]) -> list[Tracklet]:
        """Return the parts of all people except one, whose `parts` are given."""
        others = list[Tracklet]()
        for person in self.persons():
            others += [part for part in person if part not in parts]
        return others

    def chosen(
        self,
        choice: Choice | Chooser | None,
        name: Callable[[int], str],
        scale: float = 1.0,
    ) -> tuple[list[Tracklet], str]:
        """Return the parts of the person to follow, and a sentence.

        The sentence says who is followed. It is empty if there are not several people.

        Args:
            choice: The person's number, a point at which they appear, or a function
                that returns the number. By default the first one is followed.
            name: Returns the name of a frame, for the sentence.
            scale: Pixels of `choice` and of the sentence per pixel of the masks.

        Raises:
            NoPersonError: There are fewer people than the number.
        """
        persons = self.persons()
        if not persons:
            return [], ""
        # the first part shows the person best, and the others may be noise
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
                f"person must be 1 to {len(persons)}, the number of people, "
                f"got {number}"
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
    """Return the person of each blob by the blob's index.

    The total distance is least. Blobs that are too far from everyone are missing.
    """
    if not tracklets or not blobs:
        return {}
    distances = np.array(
        [[tracklet.distance(blob, frame) for blob in blobs] for tracklet in tracklets]
    )
    if 1 in distances.shape:
        # one person or one blob: the nearest pair is the assignment
        pairs = [divmod(int(distances.argmin()), len(blobs))]
    else:
        # takes a third of a second to import
        from scipy.optimize import linear_sum_assignment

        rows, columns = linear_sum_assignment(np.minimum(distances, UNREACHABLE))
        pairs = list(zip(rows.tolist(), columns.tolist(), strict=True))
    owners = dict[int, Tracklet]()
    for row, column in pairs:
        if np.isfinite(distances[row, column]):
            owners[column] = tracklets[row]
    return owners


def _score(person: Sequence[Tracklet]) -> float:
    return sum(part.score for part in person)


def _are_apart(tracklet: Tracklet, person: Sequence[Tracklet]) -> bool:
    """Return whether no frame shows both a tracklet and a part of a person."""
    frames = tracklet.detections.keys()
    return all(frames.isdisjoint(part.detections) for part in person)


def _distance(tracklet: Tracklet, other: Tracklet, fps: float) -> float:
    """Return how unlikely it is that two tracklets show one person, in heights."""
    first, second = sorted((tracklet, other), key=lambda part: min(part.detections))
    start = min(second.detections)
    _, *place = second.first
    colour = float(np.abs(first.colours - second.colours).mean())
    away = float(np.linalg.norm(np.array(place) - first.latest.place)) / first.height
    size = float(abs(np.log(second.area / first.area)))
    # the longer a person was hidden, the farther they may have walked
    gap = max(0, start - first.last) / fps
    return (
        COLOUR_DISTANCE * colour
        + AREA_DISTANCE * size
        + away / (1.0 + gap / HALVING_SECONDS)
    )


def _widened(mask: NDArray[Any], height: float) -> Mask:
    """Return a mask widened by `OUTLINE_SLACK` of a person's height."""
    width = 2 * round(OUTLINE_SLACK * height) + 1
    return cv2.dilate(mask, np.ones((width, width), dtype=np.uint8)) > 0


def _share(blob: _Blob, group: Sequence[Tracklet], frame: int) -> None:
    """Divide a blob among the people in it.

    Each gets the pixels where nobody else is expected. The rest of the blob is unknown.
    """
    outlines = [tracklet.outline(frame) for tracklet in group]
    count = np.sum(outlines, axis=0)
    for tracklet, outline in zip(group, outlines, strict=True):
        clear = blob.mask & outline & (count == 1)
        hidden = blob.mask & ~clear
        tracklet.detections[frame] = Detection(patch_of(clear), patch_of(hidden))


def part_at(parts: Sequence[Tracklet], frame: int) -> Tracklet | None:
    """Return the part of a person that a frame shows, or None.

    Only parts that are noise can be in one frame. The one with the largest box is
    returned then.
    """
    present = [part for part in parts if frame in part.detections]

    def size(part: Tracklet) -> int:
        return part.detections[frame].shown.bits.size

    return max(present, key=size, default=None)


def rows_of(
    parts: Sequence[Tracklet], blanks: Sequence[dict[str, Any]]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the rows of a person in all frames, and in frames without an overlap.

    Args:
        parts: The parts of the person.
        blanks: For each frame, the row to use if it does not show the person.
    """
    rows = list[dict[str, Any]]()
    apart = list[dict[str, Any]]()
    for k, blank in enumerate(blanks):
        part = part_at(parts, k)
        rows.append(blank if part is None else part.rows[k])
        if part is None or part.detections[k].hidden is None:
            apart.append(rows[-1])
    return rows, apart


def person_indices(persons: Persons, masks: Iterable[Mask]) -> list[int | None]:
    """Return the index of the person whom the mask of each frame shows, or None.

    A mask that shows nobody gets the previous frame's person, unless this person is
    elsewhere. The result is None for an empty mask, and for one that covers several
    people about equally. It is None for all frames if every mask shows nobody, or if
    most masks cover several people: they are probably parts of one person.

    Args:
        persons: The people.
        masks: The mask (height, width) of each frame, from another segmenter.
    """
    nobody = -1  # for a mask that shows nobody, until it gets a person
    result = list[int | None]()
    # whether the mask covers several people, for each frame that shows several
    several = list[bool]()
    for k, mask in enumerate(masks):
        present = [part_at(parts, k) for parts in persons]
        pixels = [
            (0, 0) if part is None else _common(part.detections[k].shown, mask)
            for part in present
        ]
        areas, shares = np.array(pixels).T  # (people,) pixels of each, and in the mask
        *_, second, most = sorted(shares)
        if not mask.any() or most < CLEAR_FACTOR * second:
            result.append(None)
        else:
            result.append(int(shares.argmax()) if most else nobody)
        if mask.any() and (areas > 0).sum() > 1:
            several.append((2 * shares > areas).sum() > 1)
    latest = next((index for index in result if index not in (None, nobody)), None)
    if latest is None or (several and np.mean(several) > 0.5):
        return [None] * len(result)
    for k, index in enumerate(result):
        if index == nobody:
            result[k] = None if part_at(persons[latest], k) else latest
        elif index is not None:
            latest = index
    return result


def _common(patch: Patch, mask: Mask) -> tuple[int, int]:
    """Return how many pixels a patch has, and how many of them a mask has, too."""
    inside = mask[patch.box]
    own = unpacked(patch.bits, inside.shape[::-1])
    return int(own.sum()), int((inside & own).sum())


def replace_detection(
    parts: Sequence[Tracklet], frame: int, mask: Mask, row: dict[str, Any]
) -> None:
    """Replace a person's mask in a frame, and its row of `FrameQuality`."""
    part = part_at(parts, frame) or parts[0]
    before = part.detections.get(frame)
    hidden = None if before is None else before.hidden
    part.detections[frame] = Detection(patch_of(mask), hidden)
    part.rows[frame] = row


def excluded_mask(
    parts: Sequence[Tracklet],
    others: Sequence[Tracklet],
    frame: int,
    size: tuple[int, int],
) -> Mask:
    """Return where a person cannot be in a frame: at the others, and far away.

    Args:
        parts: The parts of the person.
        others: The parts of all other people.
        frame: The frame.
        size: Its width and height.
    """
    mask = np.zeros(size[::-1], dtype=bool)
    for other in others:
        if frame in other.detections:
            paste(other.detections[frame].shown, mask)
    tallest = max((other.height for other in others), default=0.0)
    mask = _widened(mask.astype(np.uint8), tallest)
    part = part_at(parts, frame)
    if part is None:
        return mask
    own = np.zeros_like(mask)
    for patch in part.detections[frame]:
        if patch is not None:
            paste(patch, own)
    mask &= ~own
    near = np.zeros_like(mask)
    near[padded_box(own, round(SEARCH_REACH * part.height))] = True
    mask |= ~near
    return mask


def planes_of(
    parts: Sequence[Tracklet], others: Sequence[Tracklet], frame: int, known: Mask
) -> tuple[Mask, Mask]:
    """Return the mask of a person in a frame, and which pixels are known.

    Pixels of other people are unknown, because the person may be behind them.

    Args:
        parts: The parts of the person.
        others: The parts of all other people.
        frame: The frame.
        known: (height, width) the pixels that the picture shows.
    """
    mask = np.zeros_like(known)
    unknown = np.zeros_like(known)
    part = part_at(parts, frame)
    if part is not None:
        shown, hidden = part.detections[frame]
        paste(shown, mask)
        if hidden is not None:
            paste(hidden, unknown)
    for other in others:
        if frame in other.detections:
            paste(other.detections[frame].shown, unknown)
    return mask, (known | mask) & ~(unknown & ~mask)
