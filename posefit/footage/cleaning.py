"""Clean masks from other tools: invert them, fill holes, and follow one person."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.choice import Choice
from posefit.footage.people import Chooser, People, Tracklet, planes_of
from posefit.footage.views import (
    MOST,
    Planes,
    View,
    border_of,
    empty_planes,
    full_planes,
    release,
    unpacked,
)
from posefit.motion.clips import FPS
from posefit.silhouette.foreground import MAX_HOLE_AREA, without_holes
from posefit.silhouette.mask import Mask, Silhouette, touches_border
from posefit.silhouette.pieces import people_in

BORDER_FRAMES = 500  # frames whose borders are looked at together
# share of the person's area: the largest hole that is filled if there is one mask only.
# A hole between an arm and the trunk shows where the arm is, and there is no other
# frame that does
MAX_HOLE_ALONE = 0.0005


def cleaned(
    view: View, holes: float | None = None, choice: Choice | Chooser | None = None
) -> View:
    """Return the view of one person, from masks that another tool made.

    Frames become unusable if they show no person against a background, or if the
    picture's edge cuts off most of the person. Other people's pixels become unknown.

    Args:
        view: The masks as read.
        holes: Share of the person's area up to which holes are filled. The default
            depends on whether there are several frames.
        choice: Which of several people is followed, see `People.chosen`.

    Raises:
        InputError: No frame shows a person.
    """
    count = len(view)
    warnings = list(view.warnings)
    inverted = _is_inverted(view)
    if inverted:
        warnings.append(
            f"{view.name}: the masks cover most of the picture's border, so they seem "
            "to be inverted, and are inverted back"
        )
    if holes is None:
        holes = MAX_HOLE_AREA if count > 1 else MAX_HOLE_ALONE
    usable = view.usable & view.shows
    if not usable.any():
        raise _no_person(view)
    people = People(view.fps or FPS)
    clean = _CleanMasks(view)
    for k in range(count):
        silhouette = _silhouette(view, k, inverted)
        masks = _people(silhouette) if usable[k] else []
        people.add(masks)
        mask = without_holes(masks[0], holes) if masks else silhouette.mask
        clean.store(k, mask & silhouette.valid)

    # only a look at all frames shows that there are several people
    parts, several = people.chosen(choice, lambda frame: f"frame {view.numbers[frame]}")
    known = view.known
    if several:
        warnings.append(f"{view.name}: {several}")
        others = people.others(parts)
        frames = np.flatnonzero(usable).tolist()
        known = _replaced(clean, view, parts, others, frames, holes)

    usable = usable & (clean.areas > 0)
    return replace(
        view,
        bits=clean.bits,
        known=known,
        usable=usable & _shows_enough(usable, clean.areas, clean.cut),
        warnings=warnings,
    )


class _CleanMasks:
    """The cleaned masks of a view."""

    def __init__(self, view: View) -> None:
        self.bits = empty_planes(len(view), view.size)
        self.areas = np.zeros(len(view))  # (T,) pixels of the person
        # (T,) whether the picture's edge cuts the person
        self.cut = np.zeros(len(view), dtype=bool)

    def store(self, k: int, mask: Mask) -> None:
        """Store the mask of frame k, also in place of an earlier one."""
        self.bits[k] = np.packbits(mask)
        release(self.bits, k)
        self.areas[k] = mask.sum()
        self.cut[k] = touches_border(mask)


def _replaced(
    clean: _CleanMasks,
    view: View,
    parts: Sequence[Tracklet],
    others: Sequence[Tracklet],
    frames: Sequence[int],
    holes: float,
) -> Planes:
    """Replace the masks of frames by those of one person; return what is known then.

    Args:
        clean: The masks.
        view: The view that they are from.
        parts: The parts of the person.
        others: The parts of all other people, whose pixels become unknown.
        frames: The frames, counted from 0.
        holes: As for `cleaned`.
    """
    before = view.known
    if before is None:
        before = full_planes(len(view), view.size)
    known = empty_planes(len(view), view.size)
    known[:] = before
    for k in frames:
        mask, valid = planes_of(parts, others, k, unpacked(before[k], view.size))
        clean.store(k, without_holes(mask, holes) & valid)
        known[k] = np.packbits(valid)
        release(known, k)
    return known


def _no_person(view: View) -> InputError:
    """Return the error for a view in which no usable mask shows a person."""
    count = len(view)
    came = "one without background" if view.bits[0].any() else "an empty one"
    rest = f" first, and none with both in {count} frames" if count > 1 else ""
    return InputError(
        f"{view.name}: expected a mask with a person and a background, got {came}{rest}"
    )


def _silhouette(view: View, k: int, inverted: bool) -> Silhouette:
    """Return the silhouette of a frame; `inverted` masks are inverted again."""
    silhouette = view.silhouette(k)
    if inverted:
        return Silhouette.of(~silhouette.mask, silhouette.valid)
    return silhouette


def _people(silhouette: Silhouette) -> list[Mask]:
    """Return the masks of the people in a silhouette."""
    people = people_in(silhouette.mask, silhouette.valid)
    # a single person is the whole mask, with all of its small pieces
    if len(people) == 1:
        return [silhouette.mask]
    return [person.mask for person in people]


def _shows_enough(
    usable: NDArray[np.bool_], areas: Array, cut: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return whether each frame (T,) shows most of the person.

    A frame in which the picture's edge cuts the person is compared with the nearest
    frame in which it does not.

    Args:
        usable: (T,) which frames show a person.
        areas: (T,) of the person, in pixels.
        cut: (T,) in which frames the person touches the edge.
    """
    enough = np.ones(len(areas), dtype=bool)
    whole = np.flatnonzero(usable & ~cut)
    if not len(whole):
        return enough
    frames = np.flatnonzero(usable & cut)
    later = np.searchsorted(whole, frames).clip(1, len(whole) - 1)
    # of two equally near frames, the earlier one counts
    is_earlier = frames - whole[later - 1] <= whole[later] - frames
    nearest = whole[np.where(is_earlier, later - 1, later)]
    enough[frames] = areas[frames] >= MOST * areas[nearest]
    return enough


def _is_inverted(view: View) -> bool:
    """Return whether most masks cover most of the border, as people never do."""
    shows = view.shows
    if not shows.any():
        return False
    covered = np.empty(len(view), dtype=bool)
    # a piece at a time, because the borders of a long film need much memory
    for first in range(0, len(view), BORDER_FRAMES):
        piece = slice(first, first + BORDER_FRAMES)
        marked = border_of(view.bits[piece], view.size)
        release(view.bits, first, BORDER_FRAMES)
        known = np.ones_like(marked)
        if view.known is not None:
            known = border_of(view.known[piece], view.size)
            release(view.known, first, BORDER_FRAMES)
        covered[piece] = (marked & known).sum(axis=1) > MOST * known.sum(axis=1)
    return bool(np.mean(covered[shows]) > MOST)
