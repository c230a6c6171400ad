"""From video frames to the mask of one person: a background model, clean edges, the largest piece, no holes.

Frames and backgrounds are (height, width, 3) uint8. Nothing here keeps a frame, so a video may be as long as it likes.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.errors import InputError
from posefit.silhouette.mask import Mask, padded_box, touches_border
from posefit.silhouette.pieces import people_in

Image = NDArray[np.uint8]  # (height, width, 3)

SPREADS = 4.0  # a pixel is foreground this many standard deviations from the background
MIN_DIFFERENCE_LEVELS = 18.0  # and at least so many grey levels
SHADE = (0.45, 0.95)  # a shadow keeps this share of the background's brightness
TINT = 14.0  # and its colour, to within so many grey levels after scaling
NOISE = 3  # pixels to a side, of which the majority decides
SPECK = 0.004  # of the image's height: what an opening takes away
GAP = 0.012  # of the image's height: what a closing joins
# of the person's height: shadow between parts of the person that are no farther apart
# is clothing
BRIDGE = 0.15
BRIGHT = 127  # a pixel of a mask that is brighter belongs to the person
MAX_HOLE_AREA = 0.02  # of the person's area: a hole that is smaller is filled
SAMPLES = 40  # frames that a median looks at, spread over a film
HISTORY = 500  # frames that a mixture remembers
# squared standard deviations from its nearest Gaussian, from which on a pixel is
# foreground
THRESHOLD = 25.0


class Film(Protocol):
    """What a segmenter gets before the first frame: a video at its working size, cut to the roi."""

    def __len__(self) -> int:
        """How many frames the video has."""
        ...

    def frames(
        self, start: int = 0, stop: int | None = None, step: int = 1
    ) -> Iterator[Image]:
        """Yield every `step`th frame of start to stop."""
        ...

    def picture(self, path: str) -> Image:
        """Return a picture of the video's size as the video shows it. Raises InputError where there is none."""
        ...


class Segmenter(Protocol):
    """Separates a person from the rest of a picture. Frames come in their order, each once.

    One that compares each frame with a still background may have that picture as `background` (height, width, 3), and
    is then checked for a person who was learned into it. One with a model of people may have, as `facing`, which way
    the person in the latest picture faces: radians, 0 towards the camera, growing to the picture's right, NaN for none;
    and, as `landmarks` (27, 3), the column, row and confidence, 0 to 1, of their joints, 0 for an unknown joint.
    """

    def segment(self, image: Image) -> tuple[Mask, Mask]:
        """Return where the person is in an image, and where their shadow may be, both (height, width)."""
        ...


# called with a `Film`, and settings as keywords
SegmenterFactory = Callable[..., Segmenter]


@dataclass(frozen=True)
class Still:
    """One mean (or median) colour and one spread for each pixel. VSMM 1.1 and 1.2 are its mean form."""

    middle: NDArray[np.float32] = field(repr=False)  # (height, width, 3)
    spread: NDArray[np.float32] = field(repr=False)  # (height, width)

    @property
    def background(self) -> Image:
        """The picture that frames are held against."""
        return self.middle.round().astype(np.uint8)

    def segment(self, image: Image) -> tuple[Mask, Mask]:
        """Return where an image differs from the background, and where it is only darker."""
        away = cv2.absdiff(image, self.background)
        difference = cv2.max(cv2.max(away[..., 0], away[..., 1]), away[..., 2])
        changed = np.asarray(
            difference > np.maximum(MIN_DIFFERENCE_LEVELS, SPREADS * self.spread)
        )
        # the rest need not be looked at
        before = self.middle[changed]
        now = image[changed].astype(np.float32)
        share = (now.mean(axis=1) + 1.0) / (before.mean(axis=1) + 1.0)
        tint = np.abs(now - before * share[:, None]).max(axis=1)
        shadow = np.zeros_like(changed)
        shadow[changed] = (share > SHADE[0]) & (share < SHADE[1]) & (tint < TINT)
        return changed & ~shadow, shadow


def mean_background(images: Iterable[Image]) -> Still:
    """Return the background that is the mean of images without a person. Raises InputError where there is none."""
    count = 0
    total = np.zeros(())
    squares = np.zeros(())
    for image in images:
        values = image.astype(np.float64)
        count = count + 1
        total = total + values
        squares = squares + values**2
    if not count:
        raise InputError("background must hold at least one frame, got none")
    middle = total / count
    variance = np.maximum(squares / count - middle**2, 0.0).max(axis=-1)
    return Still(middle.astype(np.float32), np.sqrt(variance).astype(np.float32))


def median_background(images: Iterable[Image]) -> Still:
    """Return the background that is the median of some images, before which a person may walk.

    All are in memory together. Raises InputError where there is none.
    """
    stack = np.stack(list(images)) if not isinstance(images, np.ndarray) else images
    if not len(stack):
        raise InputError("background must hold at least one frame, got none")
    middle = np.median(stack, axis=0).astype(np.float32)
    away = np.median(np.abs(stack.astype(np.float32) - middle), axis=0).max(axis=-1)
    return Still(middle, (1.4826 * away).astype(np.float32))


class Mixture:
    """OpenCV's adaptive mixture of Gaussians, learned from all frames first, as in the SAPSO paper."""

    def __init__(
        self,
        images: Iterable[Image],
        history: int = HISTORY,
        threshold: float = THRESHOLD,
    ) -> None:
        self._model: Any = cv2.createBackgroundSubtractorMOG2(history, threshold, True)
        count = 0
        for image in images:
            self._model.apply(image)
            count += 1
        if not count:
            raise InputError("background must hold at least one frame, got none")

    @property
    def background(self) -> Image:
        """The likeliest colour of each pixel."""
        return np.asarray(self._model.getBackgroundImage(), dtype=np.uint8)

    def segment(self, image: Image) -> tuple[Mask, Mask]:
        """Return what the mixture calls foreground, and what it calls shadow."""
        label = self._model.apply(image, learningRate=0.0)
        return np.asarray(label == 255), np.asarray(label == 127)


class GivenMasks:
    """A segmenter of frames that are masks themselves: bright is the person."""

    def segment(self, image: Image) -> tuple[Mask, Mask]:
        """Return which pixels are bright, and that nothing is a shadow."""
        bright = np.asarray(image.max(axis=2) > BRIGHT)
        return bright, np.zeros_like(bright)


@dataclass(frozen=True)
class Person:
    """One frame's mask, and how good it is."""

    mask: Mask = field(repr=False)
    # False where nothing is known: shadow, and what is ignored
    valid: Mask = field(repr=False)
    area: int  # pixels
    # how many the foreground had that are large enough to be a part of a person
    pieces: int
    # the area of the largest piece that is not this person's, as a share of the
    # person's
    rival: float
    touches_border: bool


def people(
    foreground: Mask,
    shadow: Mask,
    roi: tuple[int, int, int, int] | None,
    ignore: Mask | None,
) -> list[Person]:
    """Return the people (height, width) of a foreground, the largest first, within `roi` x, y, width, height.

    There is always a first one, which is empty where no person is; others are at least a quarter as large.

    Noise and specks go, gaps close, pieces near the largest one join it and small holes are filled. What looks like a
    shadow but lies between parts of the person is dark clothing and belongs to it; any other shadow is unknown.
    """
    height = foreground.shape[0]
    inside = np.ones(foreground.shape, dtype=bool)
    if roi is not None:
        x, y, wide, tall = roi
        inside[:] = False
        inside[y : y + tall, x : x + wide] = True
    if ignore is not None:
        inside &= ~ignore
    known = ~shadow if ignore is None else ~shadow & ~ignore
    changed = (
        np.asarray(cv2.medianBlur(foreground.astype(np.uint8), NOISE) > 0) & inside
    )
    largest = people_in(_cleaned(changed, height) & inside)
    if not largest:
        return [Person(np.zeros_like(changed), known, 0, 0, 0.0, False)]
    size = int(np.ptp(np.flatnonzero(largest[0].mask.any(axis=1)))) + 1
    dark = (
        _morphed(foreground & inside, cv2.MORPH_CLOSE, BRIDGE * size) & shadow & inside
    )
    result = list[Person]()
    for part in people_in(_cleaned(changed | dark, height) & inside):
        mask = without_holes(part.mask)
        border = touches_border(mask)
        area = int(mask.sum())
        result.append(Person(mask, known | mask, area, part.pieces, part.rival, border))
    return result


def _cleaned(mask: Mask, height: int) -> Mask:
    return _morphed(
        _morphed(mask, cv2.MORPH_CLOSE, GAP * height), cv2.MORPH_OPEN, SPECK * height
    )


def _morphed(mask: Mask, operation: int, size: float) -> Mask:
    side = 2 * max(1, round(0.5 * size)) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    box = padded_box(mask, side)
    morphed = np.zeros_like(mask)
    morphed[box] = cv2.morphologyEx(mask[box].astype(np.uint8), operation, kernel) > 0
    return morphed


def without_holes(mask: Mask, most: float = MAX_HOLE_AREA) -> Mask:
    """Return a mask whose holes are filled that have at most this share of its area."""
    box = padded_box(mask, 1)
    filled = mask.copy()
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        (~mask[box]).astype(np.uint8), connectivity=4
    )
    height, width = labels.shape
    lefts, tops, widths, heights, areas = stats[:count].T
    enclosed = (
        (lefts > 0) & (tops > 0) & (lefts + widths < width) & (tops + heights < height)
    )
    fills = enclosed & (areas <= most * mask.sum())
    fills[0] = False  # the person
    filled[box] |= fills[labels]
    return filled
