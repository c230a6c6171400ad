"""Charts below the stills of a track: a figure over the frames; how sure joints are, with marks of doubtful frames."""

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS
from posefit.silhouette.foreground import Image
from posefit.tracking.drawing.colours import BACKGROUND, BOTH, LINES, MISSED, OTHER, RIGHT, TEXT, width_of, write
from posefit.tracking.evaluation import LOST
from posefit.uncertainty.calibration import LEVELS

LEFT_MARGIN, RIGHT_MARGIN = 56, 16  # pixels
HEAD, FOOT = 46, 50  # pixels of what is written above, and of the two rows of marks below
STRIP = 12  # pixels high, of a row of marks
STEPS = (5, 10, 20, 50, 100, 200, 500, 1000)  # millimetres between two lines
STRENGTHS = (0.85, 0.5, 0.25)  # of the bands' colour, the narrowest first
ROOT = JOINTS.index("root")  # which every interval is relative to


def curve(values: Sequence[float], name: str, width: int, height: int) -> Image:
    """Return a plot (height, width, 3) of values, one a frame, from 0 up."""
    image = np.full((height, width, 3), BACKGROUND, dtype=np.uint8)
    top = max(max(values), 1e-9) * 1.15
    x, _ = _places(len(values), width)
    y = height - 24 - np.array(values) / top * (height - 48)
    for level in (0.0, float(np.mean(values)), max(values)):
        row = int(height - 24 - level / top * (height - 48))
        cv2.line(image, (LEFT_MARGIN, row), (width - RIGHT_MARGIN, row), LINES, 1)
        write(image, f"{level:.2f}", (8, row + 4), scale=0.4)
    points = np.rint(np.column_stack([x, y]) * 16).astype(np.int32)
    cv2.polylines(image, [points], False, BOTH, 2, cv2.LINE_AA, 4)
    write(image, f"{name}, frame by frame: 0, mean and maximum", (60, 16), scale=0.45)
    return image


def says_doubts(rows: Sequence[Mapping[str, float]], radii: Array | None) -> bool:
    """Return whether there is anything to show in a chart of doubts."""
    return radii is not None or bool(np.isfinite([[row["unknown_sides"], row["lost"]] for row in rows]).any())


def doubts(rows: Sequence[Mapping[str, float]], radii: Array | None, title: str, width: int, height: int) -> Image:
    """Return a chart (height, width, 3) of how far joints may be off, frame by frame, and of which frames are doubtful.

    Bands are the radii (T, levels, 27) of intervals, the mean over joints; where the truth is known, a line is how far
    joints really are off. Rows of marks are frames whose sides are unknown, and lost ones. `title` is written above.
    """
    image = np.full((height, width, 3), BACKGROUND, dtype=np.uint8)
    count, bottom = len(rows), height - FOOT
    x, half = _places(count, width)
    bands = None if radii is None else 1e3 * np.delete(radii, ROOT, axis=2).mean(axis=2)
    off = np.array([row.get("mpjpe_mm", np.nan) for row in rows])
    shown = np.append(off, [] if bands is None else bands.ravel())
    top = 1.05 * max(float(np.nanmax(shown)) if np.isfinite(shown).any() else 0.0, STEPS[0])
    step = next((one for one in STEPS if top / one <= 4.0), STEPS[-1])

    def height_of(value: Any) -> Any:
        return bottom - np.asarray(value) / top * (bottom - HEAD)

    for k in reversed(range(len(LEVELS) if bands is not None else 0)):
        assert bands is not None
        colour = tuple(STRENGTHS[k] * c + (1.0 - STRENGTHS[k]) * b for c, b in zip(RIGHT, BACKGROUND, strict=True))
        for run in _runs(np.isfinite(bands[:, k])):
            ends = np.concatenate([[x[run[0]] - half], x[run], [x[run[-1]] + half]]).clip(x[0], width - RIGHT_MARGIN)
            values = height_of(bands[[run[0], *run, run[-1]], k])
            edge = [*zip(ends, values, strict=True), (ends[-1], bottom), (ends[0], bottom)]
            cv2.fillPoly(image, [np.rint(np.array(edge) * 16).astype(np.int32)], colour, cv2.LINE_AA, 4)
    for level in range(0, int(top) + 1, step):
        cv2.line(image, (LEFT_MARGIN, int(height_of(level))), (width - RIGHT_MARGIN, int(height_of(level))), LINES, 1)
        write(image, f"{level}", (8, int(height_of(level)) + 4), scale=0.4)
    if np.isfinite(off).all():
        points = np.rint(np.column_stack([x, height_of(off)]) * 16).astype(np.int32)
        cv2.polylines(image, [points], False, BOTH, 2, cv2.LINE_AA, 4)
    marks = (("unknown_sides", 1.0, OTHER), ("lost", LOST, MISSED))
    for k, (name, least, colour) in enumerate(marks):
        row = bottom + 8 + k * (STRIP + 6)
        cv2.rectangle(image, (LEFT_MARGIN, row), (width - RIGHT_MARGIN, row + STRIP), LINES, 1)
        for at in x[np.array([one[name] >= least for one in rows])]:
            ends = np.rint(np.clip([at - half, at + half], LEFT_MARGIN, width - RIGHT_MARGIN)).astype(int).tolist()
            cv2.rectangle(image, (ends[0], row), (ends[1], row + STRIP), colour, -1)
        write(image, ("sides", "lost")[k], (8, row + STRIP - 2), colour, 0.4)
    write(image, title or "nothing is said to be unknown or lost", (60, 16), scale=0.45)
    _legend(image, bands is not None, bool(np.isfinite(off).all()))
    return image


def _legend(image: Image, banded: bool, known: bool) -> None:
    """Write which colour of a chart of doubts is what."""
    levels = ", ".join(f"{100 * level:.0f}" for level in LEVELS)
    words = [("mm, the mean over joints:", TEXT)] if banded or known else []
    words += [(f"intervals of {levels} %", RIGHT)] if banded else []
    words += [("true error", BOTH)] if known else []
    words += [("left and right unknown", OTHER), ("lost", MISSED)]
    at = 60
    for word, colour in words:
        write(image, word, (at, 34), colour, 0.45)
        at += width_of(word, 0.45) + 18


def _places(count: int, width: int) -> tuple[Array, float]:
    """Return where frames stand from left to right (count,), and half of what is between two."""
    x = np.linspace(LEFT_MARGIN, width - RIGHT_MARGIN, max(count, 2))[:count]
    return x, 0.5 * (width - RIGHT_MARGIN - LEFT_MARGIN) / max(count - 1, 1)


def _runs(known: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Return the numbers of frames that follow each other and are known."""
    frames = np.flatnonzero(known)
    return [run for run in np.split(frames, np.flatnonzero(np.diff(frames) > 1) + 1) if len(run)]
