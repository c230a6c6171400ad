"""What all frames of a video say together: whether their masks can be those of one person, in plain words if not."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

BETTER = "mediapipe"  # the segmenter that a person who is always in the picture asks for
FEW = 8  # frames with a whole mask below which nothing is said
UNEXPLAINED = 0.3  # more of what moves lies outside the masks, in half of the frames: they are not the person
TALLER, LARGER = 0.15, 0.25  # changes of the longer side and the area from frame to frame that one in ten exceeds
GHOSTS = 0.1  # the share of frames with masks of an empty place that is worth a word,
EMPTY = 0.5  # and that from which on nothing else is to be expected
BROKEN = 0.3  # of the frames: masks that are in pieces more often, and unsteady, are parts of a person at best
MOST = 0.5  # where fewer of the frames are usable and the masks are unsteady, there is nothing to follow


@dataclass(frozen=True)
class Verdict:
    """What is wrong with the masks of a video, and whether that is too much to go on."""

    text: str
    refused: bool


def verdict(rows: Sequence[Mapping[str, Any]], method: str, *, learned: bool) -> Verdict | None:
    """Return what is wrong with masks, by the rows of `Watch`; None where nothing is.

    `learned` says that the segmenter was given no picture of the empty scene. What moves outside the masks while their
    size jumps refuses them, and so does a size that jumps where few frames are usable or most masks are in pieces;
    either alone may be another person or clothes like the background, and is a warning.
    """
    whole = [row for row in rows if row["area"] and not row["touches_border"]]
    usable = sum(row["usable"] for row in whole)
    instead = advice(method, learned=learned)
    nobody = f"expected masks of a person, got none in any of {len(rows)} frames{instead}"
    if len(whole) < FEW:
        return None if usable else Verdict(nobody, True)
    beside = float(np.median([row["beside"] for row in whole]))
    pairs = [(a, b) for a, b in pairwise(whole) if b["frame"] == a["frame"] + 1]
    taller, larger = (_change(pairs, name) for name in ("longer_side", "area"))
    unsteady = taller > TALLER or larger > LARGER
    ghosts = float(np.mean([row["ghost"] for row in whole]))
    if beside > UNEXPLAINED and unsteady:
        moves = (
            f"{beside:.0%} of what moves lies outside the masks, and they change by {larger:.0%} from frame to frame"
        )
        where = "the person seems to stand in the background" if learned else "the masks do not show the whole person"
        return Verdict(f"{where}: {moves}{instead}", True)
    if ghosts > GHOSTS:
        said = f"{ghosts:.0%} of the masks show a place that is empty now: the person was learned into the background"
        return Verdict(f"{said}{instead}", ghosts > EMPTY)
    if not usable:
        return Verdict(nobody, True)
    if unsteady:
        broken = float(np.mean([row["pieces"] > 1 for row in whole]))
        pieces = f" and are in pieces in {broken:.0%} of the frames" if broken > BROKEN else ""
        said = f"the masks change by {larger:.0%} from frame to frame{pieces}: parts of the person seem to be missing"
        return Verdict(f"{said}{instead}", usable < MOST * len(whole) or broken > BROKEN)
    if beside > UNEXPLAINED:
        said = f"{beside:.0%} of what moves near the person lies outside the masks, which may miss parts of the person"
        return Verdict(f"{said}{instead}", False)
    return None


def advice(method: str, *, learned: bool) -> str:
    """Return what to do instead of a segmenter, after a semicolon."""
    if method == BETTER:
        return "; --roi says where to look"
    empty = "give --background with an empty picture, or " if learned else ""
    return f"; {empty}--extraction {BETTER}"


def _change(pairs: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]], name: str) -> float:
    """Return by which share a value changes from frame to frame in one frame of ten, or by more."""
    if not pairs:
        return 0.0
    return float(np.expm1(np.percentile([abs(np.log(b[name] / a[name])) for a, b in pairs], 90)))
